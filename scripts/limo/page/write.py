"""Gather what is there into ``results/index.html``. Nothing is solved or measured for it, and what cannot be read is said."""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from plotly.offline import get_plotlyjs

from limo.beat.circulations import FOLDER as CIRCULATIONS
from limo.beat.circulations import read_circulations
from limo.datasets.variables import SYMBOLS, place
from limo.errors import ResultError
from limo.figures.style import COLORS
from limo.measure.states import REMARKS_APART
from limo.page import BUDGET, FILE, FOLDER, TEMPLATES, dataset_of
from limo.page.curves import curves
from limo.page.devices import LEFT_OUT, Devices
from limo.page.explorations import explorations
from limo.page.packing import pack_bytes
from limo.page.parts import Figure, caption_of, figure, links
from limo.schema.study import Study
from limo.store.files import read_json, write_whole
from limo.store.results import Results
from limo.store.statuses import CONVERGED, MEASURED

_ROOM = 500  # bytes of a case for its names, and for a reason if it has to be left out
_HASH = re.compile(r"\b([0-9a-f]{8})[0-9a-f]{8,}\b")


@dataclass(frozen=True)
class CaseRow:
    """A case of a study: what it is, how it ended, why, what else is to be said, its files, and its N_p and P_v (kPa)."""

    case_id: str
    label: str
    status: str
    remarks: list[str]
    links: list[tuple[str, str]]
    place: dict[str, float]


@dataclass
class StudyPart:
    """What the page says of a study; ``problem`` where its dataset cannot be read."""

    name: str
    description: str
    gathered: str = ""
    solved_by: str = ""
    statuses: list[tuple[str, int]] = field(default_factory=list)
    cases: list[CaseRow] = field(default_factory=list)
    figures: list[Figure] = field(default_factory=list)
    absent_figures: list[str] = field(default_factory=list)
    links: list[tuple[str, str]] = field(default_factory=list)
    problem: str = ""


def write_page(results: Path, studies: Mapping[str, Study], circulations: Path = CIRCULATIONS) -> str:
    """Write the page of all of ``studies`` that have been gathered below ``results``; returns a line about it.

    Their devices beat in the ``circulations`` of a folder.
    """
    parts, plots, shown, beats = [], {}, {}, {}
    devices = Devices(results, BUDGET)
    for name, study in studies.items():
        file = dataset_of(results, name)
        if not file.exists():
            continue
        part = StudyPart(name, study.description, f"{datetime.fromtimestamp(file.stat().st_mtime):%Y-%m-%d %H:%M}")
        parts.append(part)
        try:
            dataset = xr.load_dataset(file, engine="netcdf4")
            _fill(part, results, study, dataset, devices)
            plots[name] = curves(dataset)
        except (OSError, ValueError, KeyError, AttributeError) as error:
            part.problem = f"{file.name}: not a study's dataset ({error})"
            continue
        shown[name] = [{"case": case.case_id, "label": case.label, **case.place} for case in part.cases]
        if study.actuation:
            from limo.page.beats import beats_of  # compiled loops, for a study that has a use for them

            beats[name] = beats_of(file, read_circulations(circulations))
    context = {
        "studies": parts,
        "explorations": explorations(results),
        "absent": [name for name in studies if name not in {part.name for part in parts}],
        "plots": pack_bytes(json.dumps({"studies": plots, "colors": COLORS}, separators=(",", ":")).encode()),
        "library": pack_bytes(get_plotlyjs().encode()),
    }
    without = _render(context | {"left_out": "", "devices": "", "problems": _problems(parts, devices)})
    notes = devices.fit(BUDGET - len(without.encode()) - len(json.dumps(beats)) - _ROOM * sum(len(part.cases) for part in parts))
    shown = {name: [c for c in cases if c["case"] in devices.cases] for name, cases in shown.items()}
    plain = devices.plain() | {"studies": {name: cases for name, cases in shown.items() if cases}, "beats": beats}
    page = _render(context | {"left_out": notes, "devices": plain, "problems": _problems(parts, devices)})
    write_whole(results / FILE, lambda path: path.write_text(page, encoding="utf-8"))
    size = (results / FILE).stat().st_size / 1e6
    counts = f"{len(parts)} studies, {len(devices.cases)} cases in three dimensions, {size:.1f} MB"
    return f"{results / FILE}: {counts}" + (f" ({notes})" if notes else "")


def _render(context: dict[str, Any]) -> str:
    """The page; every text in ``context`` is escaped."""
    environment = Environment(
        loader=FileSystemLoader(FOLDER), autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    environment.policies["json.dumps_kwargs"] = {"separators": (",", ":")}
    templates = {name.replace(".", "_"): (FOLDER / name).read_text(encoding="utf-8") for name in TEMPLATES[1:]}
    return environment.get_template(TEMPLATES[0]).render(context | templates)


# --------------------------------------------------------------------------------------------------------------------
# one study


def _fill(part: StudyPart, results: Path, study: Study, dataset: xr.Dataset, devices: Devices) -> None:
    dims = list(dataset.case_status.dims)
    varying = [d for d in dims if dataset.sizes[d] > 1] or dims[:2]
    cases = dataset.stack(case=dims)
    engines = set()
    for k in range(cases.sizes["case"]):
        case = cases.isel(case=k)
        case_id = str(case.case_id.values)
        devices.add(case_id)
        engines.add(_engine(results, case_id))
        part.cases.append(
            CaseRow(
                case_id,
                _label(case, varying),
                str(case.case_status.values),
                _remarks(case),
                _case_links(results, case_id),
                {"pouches": int(case.n_pouches), "ventricular": float(case.ventricular_pressure)},
            )
        )
    part.statuses = sorted(Counter(case.status for case in part.cases).items())
    builds = dict.fromkeys(_HASH.sub(r"\1", b) for b in np.unique(dataset.solver_build.values.astype(str)) if b)
    part.solved_by = ", ".join([*sorted(e for e in engines if e), *builds])
    files = Results(results).study(part.name)
    part.links = links(results, [files.table, files.dataset, files.shapes])
    for name in study.figures:
        try:
            png = files.figure(name, "png")
            part.figures.append(figure(results, png, caption_of(png.stem), [png, png.with_suffix(".pdf")]))
        except OSError:
            part.absent_figures.append(name)


def _engine(results: Path, case_id: str) -> str:
    try:
        return str(read_json(Results(results).case(case_id).described)["case"]["engine"])
    except (ResultError, KeyError, TypeError):
        return ""


def _label(case: xr.Dataset, dims: list[str]) -> str:
    parts = []
    for dim in dims:
        units = case[dim].attrs.get("units", "1")
        parts.append(f"{SYMBOLS.get(dim, dim)} = {place(case[dim].item())}{'' if units in ('', '1') else f' {units}'}")
    return ", ".join(parts)


def _remarks(case: xr.Dataset) -> list[str]:
    """Why a case failed, what is not physical about it, and what is less than it should be though it did not."""
    remarks = [str(case.case_reason.values)]
    if "case_remarks" in case:
        remarks += str(case.case_remarks.values).split(REMARKS_APART)
    if "measure_status" in case and str(case.measure_status.values) != MEASURED:
        remarks.append(f"not measured: {case.measure_reason.values}")
    if "check_status" in case and (check := str(case.check_status.values)) and not check.endswith(" converged"):
        remarks.append(f"the other engine: {check}")
    return [remark for remark in remarks if remark]


def _problems(parts: list[StudyPart], devices: Devices) -> list[tuple[str, CaseRow, list[str]]]:
    """Cases that failed or of which something is missing, with the study's name and all reasons.

    How many are left out for the page's size is said where devices are shown.
    """
    rows = []
    for part in parts:
        for case in part.cases:
            reasons = list(case.remarks)
            if (reason := devices.reasons.get(case.case_id, LEFT_OUT)) != LEFT_OUT:
                reasons.append(f"not in the 3D view: {reason}")
            if reasons or case.status != CONVERGED:
                rows.append((part.name, case, reasons))
    return rows


def _case_links(results: Path, case_id: str) -> list[tuple[str, str]]:
    case = Results(results).case(case_id)
    fields = [file for kind in ("deformed", "reference") for file in sorted(case.fields.glob(f"{kind}*"))]
    return links(results, [case.status, case.volumes, case.frames, case.measures, case.fields, *fields])
