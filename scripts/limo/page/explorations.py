"""The section of explorations: what each recommends, its pictures, and its files."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import xarray as xr

from limo.figures.exploration import CAPTIONS, PICTURES, TITLES, short
from limo.page.parts import Figure, figure, links
from limo.store.results import ExplorationFiles, Results


@dataclass
class ExplorationPart:
    """What the page says of an exploration; ``problem`` where its dataset cannot be read."""

    name: str
    description: str = ""
    summary: str = ""
    columns: list[str] = field(default_factory=list)
    rows: list[list[str]] = field(default_factory=list)
    figures: list[Figure] = field(default_factory=list)
    links: list[tuple[str, str]] = field(default_factory=list)
    problem: str = ""


def explorations(results: Path) -> list[ExplorationPart]:
    """All explorations that have been reported below ``results``."""
    return [
        _part(results, ExplorationFiles(file.parent)) for file in sorted(Results(results).explorations.glob("*/exploration.nc"))
    ]


def _part(results: Path, files: ExplorationFiles) -> ExplorationPart:
    part = ExplorationPart(files.folder.name)
    part.links = links(results, [files.page, files.dataset])
    try:
        _fill(part, results, files, xr.load_dataset(files.dataset, engine="netcdf4"))
    except (OSError, ValueError, KeyError, AttributeError) as error:
        part.problem = f"{files.dataset.name}: not the dataset of an exploration ({error})"
    return part


def _fill(part: ExplorationPart, results: Path, files: ExplorationFiles, dataset: xr.Dataset) -> None:
    asked = json.loads(dataset.attrs["exploration"])
    part.description = asked["description"]
    count, front = dataset.sizes["design"] + dataset.sizes["tested"], int(dataset.on_front.sum())
    fine, its_front = dataset.sizes["recommended"], int(dataset.recommended_on_front.sum())
    cheap, finer = dataset.attrs["cheap"], dataset.attrs["fine"]
    part.summary = (
        f"{count} designs by {cheap}, {front} on the front; {fine} by {finer}, {its_front} on its front, which come first"
    )
    inputs, quantities = dataset.input.values.astype(str), [*asked["goals"], *asked["constraints"]]
    part.columns = ["design", "why", "status", *inputs, *quantities]
    for k in np.argsort(~dataset.recommended_on_front.values, kind="stable"):
        one = dataset.isel(recommended=int(k))
        name = str(one.recommended.values)
        row = [short(name), str(one.why.values), str(one.recommended_status.values)]
        row += [f"{float(one[f'recommended_{each}']):.4g}" for each in inputs]
        for quantity in quantities:
            value, scatter = float(one[f"recommended_{quantity}"]), float(one[f"recommended_{quantity}_scatter"])
            row.append(f"{value:.4g} \u00b1 {scatter:.2g}" if np.isfinite(value) else "")
        part.rows.append(row)
        part.links += links(results, [files.folder / "cutting" / f"{name}.{kind}" for kind in ("svg", "dxf")])
    for name in (*(n for n in TITLES if n != PICTURES), PICTURES):
        png = files.figure(name)
        if png.exists():
            part.figures.append(figure(results, png, CAPTIONS[name], [png]))
