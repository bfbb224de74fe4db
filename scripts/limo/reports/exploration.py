"""What an exploration found: a dataset of designs, surrogates and indices, pictures, cutting patterns, and a page of them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

from limo.config.project import Project
from limo.datasets.shapes import gather_shapes
from limo.explore.designs import pattern_of, studies_of, with_studies
from limo.explore.found import dataset_of
from limo.explore.rounds import count_of, round_designs
from limo.explore.steps import held_out, learn, solved_finely
from limo.figures import exploration as figures
from limo.figures import style
from limo.geometry.cutting import cutting_lines, dxf, svg
from limo.geometry.pattern import flat_pattern
from limo.reports.markdown import markdown_table
from limo.schema.exploration import AS_IT_IS, LEARNED_FROM, Exploration
from limo.store.files import read_json, read_netcdf, write_netcdf, write_whole
from limo.store.results import ExplorationFiles, Results
from limo.store.statuses import USABLE


def write_report(project: Project, name: str, exploration: Exploration, results: Results) -> str:
    """Write dataset, pictures, cutting patterns and page of an exploration whose rounds are all told; returns a line about it."""
    files = results.exploration(name)
    learned = learn(exploration, results, name, len(exploration.rounds))
    fine, why = solved_finely(exploration, results, name)
    tested = held_out(exploration, results, name)
    dataset = dataset_of(learned, tested, fine, why, project.devices[exploration.device])
    write_netcdf(dataset, files.dataset)
    drawn = _draw(dataset, files)
    if shapes := _shapes(project, name, exploration, results):
        picture = figures.devices(shapes)
        style.save(picture, files.figure(figures.PICTURES))
        style.close(picture)
        drawn.append(figures.PICTURES)
    patterns = _patterns(project, exploration, dataset, files.folder)
    text = page(exploration, name, dataset, drawn, patterns)
    write_whole(files.page, lambda path: path.write_text(text, encoding="utf-8"))
    count = int(dataset.on_front.sum())
    return f"{files.page}: {len(learned.told)} designs, {count} on the front, {len(fine.told)} solved by {exploration.fine}"


def _shapes(project: Project, name: str, exploration: Exploration, results: Results) -> dict[str, xr.Dataset]:
    """The surfaces of the designs that the finer preset solved, by their names; none of a design without any."""
    shapes = {}
    for number in range(len(exploration.rounds), count_of(exploration)):
        designs = round_designs(results, name, number)
        sources = read_json(results.exploration(name).told(number)).get("cases", {})
        studies = studies_of(project, exploration, designs, exploration.fine)
        drawn = {n: s.model_copy(update={"figures": ["von_mises"], "fields_at": [0.0, "max"]}) for n, s in studies.items()}
        for design in designs:
            found = gather_shapes(with_studies(project, drawn), design, results.cases, results.meshes, sources.get(design))
            if (found.mesh_number >= 0).any():
                shapes[design] = found
    return shapes


def keep_exploration(name: str, results: Results, gallery: Path) -> list[Path]:
    """Take the dataset of an exploration into the gallery, with its pictures and its page, which are made of it alone.

    Raises ``ResultError`` where there is none.
    """
    dataset = _read(results.exploration(name).dataset)
    kept = ExplorationFiles(gallery / name)
    kept.folder.mkdir(parents=True, exist_ok=True)
    small = {n: {"zlib": True, "complevel": 9} for n, v in dataset.data_vars.items() if v.dtype.kind == "f" and v.dims}
    write_netcdf(dataset, kept.dataset, small)
    drawn = _draw(dataset, kept)
    if (picture := results.exploration(name).figure(figures.PICTURES)).exists():  # the surfaces themselves are not kept
        write_whole(kept.figure(figures.PICTURES), lambda path: path.write_bytes(picture.read_bytes()))
        drawn.append(figures.PICTURES)
    text = kept_page(kept.dataset)
    write_whole(kept.page, lambda path: path.write_text(text, encoding="utf-8"))
    return [kept.dataset, *(kept.figure(figure) for figure in drawn), kept.page]


def kept_page(file: Path) -> str:
    """The page of a kept dataset. Raises ``ResultError``."""
    dataset = _read(file)
    exploration = Exploration.model_validate_json(dataset.attrs["exploration"])
    drawn = figures.names(dataset)
    if ExplorationFiles(file.parent).figure(figures.PICTURES).exists():
        drawn.append(figures.PICTURES)
    return page(exploration, file.parent.name, dataset, drawn, {})


def _read(file: Path) -> xr.Dataset:
    return read_netcdf(file, "exploration, which snakemake NAME makes")


def _draw(dataset: xr.Dataset, files: ExplorationFiles) -> list[str]:
    """Draw all figures of a dataset; returns their names."""
    drawn = figures.every(dataset)
    for figure, made in drawn.items():
        style.save(made, files.figure(figure))
        style.close(made)
    return list(drawn)


def _patterns(project: Project, exploration: Exploration, dataset: xr.Dataset, folder: Path) -> dict[str, list[str]]:
    """Cutting patterns of the recommended designs, to scale, by their names."""
    written: dict[str, list[str]] = {}
    for name in dataset.recommended.values:
        design = dataset.sel(recommended=name)
        values = {each: float(design[f"recommended_{each}"]) for each in dataset.input.values}
        pouches = int(values.get("n_pouches", exploration.space.numbers[0]))
        pattern = pattern_of(project, exploration, values | {"n_pouches": pouches})
        lines = cutting_lines(flat_pattern(pattern, pouches))
        title = f"{name}, N_p = {pouches}, one face, L = {pattern.length:g} mm"
        files = {folder / "cutting" / f"{name}.svg": svg(lines, title), folder / "cutting" / f"{name}.dxf": dxf(lines)}
        for file, text in files.items():
            file.parent.mkdir(parents=True, exist_ok=True)
            write_whole(file, lambda path, text=text: path.write_text(text, encoding="utf-8"))
        written[str(name)] = [f"cutting/{file.name}" for file in files]
    return written


def page(exploration: Exploration, name: str, dataset: xr.Dataset, drawn: list[str], patterns: Mapping[str, list[str]]) -> str:
    """The page of an exploration."""
    parts = [f"# {name}\n\n{exploration.description or 'An exploration'}."]
    status = dataset.status.values.astype(str)
    solved = int(np.isin(status, USABLE).sum())
    tested = dataset.sizes["tested"]
    told = f" {tested} more are held out: they test the surrogates, which never learn from them." if tested else ""
    parts.append(
        f"{len(status)} designs by `{exploration.cheap}`, {solved} of them solved, {int(dataset.feasible.sum())} feasible, "
        f"{int(dataset.on_front.sum())} on the front.{told} {dataset.sizes['recommended']} are solved by `{exploration.fine}`, "
        f"{int(dataset.recommended_on_front.sum())} of them on its front."
    )
    if (spent := len(status) + tested) < exploration.searched:
        parts.append(f"The search ended after {spent} of {exploration.searched} designs: no other was worth it.")
    parts.append(
        f"## Recommended\n\n{markdown_table(_recommended(exploration, dataset, patterns))}\n\n{compared(exploration, dataset)}"
    )
    parts.append(f"## How good the surrogates are\n\n{markdown_table(_qualities(dataset))}")
    if text := _corrections(exploration, dataset):
        parts.append(text)
    parts.append(f"## What explains what\n\n{markdown_table(_explained(dataset))}\n\n{_together(dataset)}")
    if dataset.sizes["claim"]:
        parts.append(f"## The paper's statements in this space\n\n{CLAIMED}\n\n{markdown_table(claimed(dataset))}")
    parts += [f"## {figures.TITLES[figure]}\n\n![{figure}]({figure}.png)\n\n{figures.CAPTIONS[figure]}" for figure in drawn]
    return "\n\n".join(parts) + "\n"


def _recommended(exploration: Exploration, dataset: xr.Dataset, patterns: Mapping[str, list[str]]) -> pd.DataFrame:
    rows = []
    for name in dataset.recommended.values:
        one = dataset.sel(recommended=name)
        front = "yes" if bool(one.recommended_on_front) else ""
        row = {
            "design": figures.short(str(name)),
            "why": str(one.why.values),
            "status": str(one.recommended_status.values),
            "on the front": front,
        }
        row |= {each: f"{float(one[f'recommended_{each}']):.4g}" for each in dataset.input.values}
        for quantity in (*exploration.goals, *exploration.constraints):
            value, scatter = float(one[f"recommended_{quantity}"]), float(one[f"recommended_{quantity}_scatter"])
            mean, deviation = float(one[f"predicted_{quantity}"]), float(one[f"predicted_{quantity}_deviation"])
            row[quantity] = f"{value:.4g} ± {scatter:.2g}" if np.isfinite(value) else ""
            row[f"{quantity} predicted"] = f"{mean:.4g} ± {deviation:.2g}" if np.isfinite(mean) else ""
        if files := patterns.get(str(name)):
            row["cutting pattern"] = ", ".join(f"[{Path(file).suffix[1:]}]({file})" for file in files)
        rows.append(row)
    return pd.DataFrame(rows)


def compared(exploration: Exploration, dataset: xr.Dataset) -> str:
    """How much better the recommended designs are than the device as it is, by the finer preset, goal by goal."""
    own = np.flatnonzero(dataset.why.values.astype(str) == AS_IT_IS)
    if not len(own) or not bool(dataset.recommended_feasible[own[0]]):
        return ""
    lines, feasible = [], dataset.recommended_feasible.values
    goals = list(exploration.goals)
    for k, goal in enumerate(goals):
        sign = -1.0 if exploration.goals[goal] == "maximise" else 1.0
        ok = feasible.copy()
        for other in goals[:k] + goals[k + 1 :]:  # no worse in the other goal
            turn = -1.0 if exploration.goals[other] == "maximise" else 1.0
            values = turn * dataset[f"recommended_{other}"].values
            ok &= values <= values[own[0]] * (1 + 1e-9 * np.sign(values[own[0]]))
        values = dataset[f"recommended_{goal}"].values
        best = int(np.flatnonzero(ok)[np.argmin(sign * values[ok])]) if ok.any() else int(own[0])
        band = np.hypot(*(float(dataset[f"recommended_{goal}_scatter"][j]) for j in (best, own[0])))
        others = f" at no worse {' or '.join(goals[:k] + goals[k + 1 :])}" if len(goals) > 1 else ""
        what = (
            "the device as it is is the best of them"
            if best == own[0]
            else (
                f"{dataset.why.values[best]!s} has {values[best]:.4g} instead of {values[own[0]]:.4g}, a change of "
                f"{values[best] - values[own[0]]:+.3g} ± {band:.2g}"
            )
        )
        lines.append(f"- {goal}{others}: {what}.")
    return "Beside the device as it is:\n\n" + "\n".join(lines)


def _qualities(dataset: xr.Dataset) -> pd.DataFrame:
    rows = []
    for name in dataset.quantity.values:
        one, row = dataset.sel(quantity=name), {"quantity": str(name)}
        for group, kind in (("leaving out", "surrogate"), ("held out", "tested")):
            count, error, inside = (float(one[f"{kind}_{key}"]) for key in ("designs", "error", "coverage"))
            row[f"designs, {group}"] = f"{count:.0f}"
            row[f"error over the range, {group} [%]"] = f"{100 * error:.1f}" if count else ""
            row[f"within their 95 % interval, {group} [%]"] = f"{100 * inside:.0f}" if count else ""
        rows.append(row | {"used": "yes" if bool(one.surrogate_used) else "not to be used"})
    return pd.DataFrame(rows)


def _corrections(exploration: Exploration, dataset: xr.Dataset) -> str:
    """What the finer preset changes, in words."""
    found = [
        f"{name} rho = {float(dataset[f'corrected_{name}_slope']):.2f}, error "
        f"{100 * float(dataset[f'corrected_{name}_error']):.0f} % of the range of its fine values"
        for name in (*exploration.goals, *exploration.constraints)
        if np.isfinite(dataset[f"corrected_{name}_error"])
    ]
    if not found:
        return (
            f"Fewer than {LEARNED_FROM} designs are solved by `{exploration.fine}`, so that the cheap surrogate is not corrected."
        )
    return f"Corrected by `{exploration.fine}`, high = rho low + delta: {'; '.join(found)}."


def _explained(dataset: xr.Dataset) -> pd.DataFrame:
    rows = []
    for name in dataset.quantity.values:
        one, row = dataset.sel(quantity=name), {"quantity": str(name)}
        for k, each in enumerate(dataset.input.values):
            first, total = float(one.index_first[k]), float(one.index_total[k])
            row[str(each)] = f"{first:.2f}, {total:.2f} ± {float(one.index_total_within[k]):.2f}" if np.isfinite(total) else ""
        rows.append(row)
    return pd.DataFrame(rows)


def _together(dataset: xr.Dataset) -> str:
    """The pairs of inputs that act together most, in words."""
    texts = []
    for q, name in enumerate(dataset.quantity.values):
        i, j = dataset.pair.values[q]
        if np.isfinite(share := float(dataset.index_second[q, i, j])):
            texts.append(f"{name}: {dataset.input.values[i]} with {dataset.input.values[j]}, {share:.2f}")
    return f"Each cell has the first-order and the total index. What acts together most: {'; '.join(texts)}." if texts else ""


#: what the table of the paper's statements shows
CLAIMED = (
    "Of designs anywhere in the space all inputs but one stay, and that one takes the paper's values. The table has the share of "
    "designs for which a statement of the paper holds, with what the surrogates do not know. A share near a half is undecided."
)


def claimed(dataset: xr.Dataset) -> pd.DataFrame:
    """The paper's statements with the share of designs for which each holds."""
    return pd.DataFrame(
        {"statement": str(text)}
        | {f"N_p = {number:g}": f"{share:.2f}" for number, share in zip(dataset.claim_n_pouches.values, row, strict=True)}
        for text, row in zip(dataset.claim.values, dataset.claim_share.values, strict=True)
    )
