"""The table of measured errors: one row a run, gathered, described, written and read."""

from __future__ import annotations

import json
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import xarray as xr

from limo.accuracy.errors import (
    CURVES,
    ERRORS,
    changes_of,
    decades_of,
    efficiency_of,
    errors_of,
    mean_of,
    preset_of,
    pressure_of,
    scatter_of,
    stress_of,
    stroke_of,
)
from limo.accuracy.kept_runs import runs_of
from limo.accuracy.packing import packed, padded, stacked
from limo.accuracy.roles import subjects
from limo.accuracy.runs import Run
from limo.accuracy.sizes import COLUMNS as SIZES
from limo.accuracy.sizes import read_scaling
from limo.accuracy.surfaces import SECTION
from limo.config.project import Project
from limo.errors import ResultError
from limo.schema.config import Preset
from limo.schema.study import ROLES
from limo.store.files import UNREADABLE, write_netcdf
from limo.store.machine import processor
from limo.store.results import Results

#: what a preset may say without being another one
_UNSAID = {"description": ""}

# --------------------------------------------------------------------------------------------------------------------
# the kept dataset

#: texts in a row: meaning
TEXT = {
    "device": "device that was measured, such as np4",
    "part": "what a run is for: accuracy, shells, reference, referee or scatter",
    "kind": "run, or of an ensemble scatter among its members or mean of them",
    "setting": "variant of the study, or the part where that has none",
    "description": "the variant in words",
    "varied": "what of the default a run changes: level, symmetry, element, contact, numerics, fabric",
    "change": "to what",
    "preset": "preset that has these settings",
    "engine": "calculix or newton",
    "build": "build of the solver",
    "level": "mesh level",
    "symmetry": "full, front_back (mirror in z = 0) or quarter (and in x = 0)",
    "element": "element of the fabric",
    "status": "how the solve ended",
    "reason": "why",
    "machine": "processor of the machine that solved it",
}


class RowKey(NamedTuple):
    """What tells a row from others: subject, role of its study, kind, setting and branch, as the dataset calls them."""

    device: str
    part: str
    kind: str
    setting: str
    branch: float


#: numbers in a row besides errors: units, meaning
NUMBERS = {
    "branch": ("1", "0 for the flat state as it is, else the seed of a tiny perturbation of it"),
    "members": ("1", "runs that a row is made of"),
    "grading": ("1", "size of elements on seams and edges over that away from them"),
    "degrees_of_freedom": ("1", "displacements of the written-out bricks, full device"),
    "solved_degrees_of_freedom": ("1", "displacements of the written-out bricks of the part that was solved"),
    "stroke": ("ml", "stroke at P_a,max"),
    "pressure_90ml": ("kPa", "actuation pressure at a stroke of 90 ml"),
    "efficiency_90ml": ("1", "mechanical efficiency at a stroke of 90 ml, eta"),
    "stress": ("MPa", "von Mises stress at P_a,max, area average of the top 5 %"),
    "cycles_decades": ("1", "decadic logarithm of the fewest cycles near seams"),
    "height": ("1", "largest w / L at P_a,max"),
    "dissipated_fraction": ("1", "share of the actuation work over the ramp that damping took"),
    "cpu_seconds": ("s", "CPU time of the solver, one thread, median where it was timed several times"),
    "timed": ("1", "how often it was timed"),
    "iterations": ("1", "Newton iterations, rejected attempts included"),
    "memory_mib": ("MiB", "peak resident memory of the solver"),
}


def gather_errors(project: Project, results: Path, folder: Path, sources: Mapping[str, Sequence[str]]) -> xr.Dataset:
    """One row a run of every device: its setting, errors and cost, curves, heights at its frames.

    Of kind ``run``; rows of kind ``scatter`` have what the members of an ensemble differ among themselves, of kind ``mean``
    the errors of its mean. Sections are kept where the mesh level alone is changed and the engine is newton. ``folder``: where
    the runs of ``KEPT_ROLES`` are. Raises ``ResultError`` where no device has two converged runs of its reference.
    """
    rows, runs = [], []
    for subject in subjects(project):
        for row, run in _rows(project, subject, runs_of(project, subject, results, folder, sources)):
            rows.append(row)
            runs.append(run)
    if not rows:
        raise ResultError(
            f"{results}: no device with two converged runs of its reference; snakemake --cores 2 accuracy makes them"
        )
    data = {n: ("run", np.array([row[n] for row in rows], str if n in TEXT else float)) for n in rows[0]}
    pressure = max((run.values.actuation_pressure.values for run in runs), key=len)
    data |= _curves(runs, pressure) | _heights(runs, rows)
    dataset = xr.Dataset(data | read_scaling(Results(results).scalings), coords={"actuation_pressure": pressure})
    return _described(dataset).assign_attrs(
        title="errors of the settings of the device",
        machine=processor(),
        presets=json.dumps({name: preset.model_dump(mode="json") for name, preset in project.config.presets.items()}),
    )


def _rows(project: Project, subject: str, runs: Sequence[Run]) -> Iterator[tuple[dict, Run]]:
    """The rows of a subject, ensembles first, and the run or the mean of each; none without a reference of two runs."""
    reference = [run for run in runs if run.role == "reference" and run.converged]
    if len(reference) < 2:
        return
    for members in _ensembles(runs):
        if len(members) > 1:
            mean = mean_of(members)
            kinds = {"scatter": scatter_of(members), "mean": errors_of(mean, reference)}
            for kind, errors in kinds.items():
                yield _row(project, subject, mean, kind, errors, members), mean
    for run in runs:
        others = [r for r in reference if r is not run]
        yield _row(project, subject, run, "run", errors_of(run, others), [run]), run


def _curves(runs: Sequence[Run], pressure: np.ndarray) -> dict[str, tuple]:
    """The curves of runs at pressures (n,) in kPa, NaN beyond what a run reached."""
    curves = {}
    for name in CURVES:
        each = np.full((len(runs), len(pressure)), np.nan)
        for k, run in enumerate(runs):
            each[k] = np.interp(pressure, run.values.actuation_pressure.values, run.values[name].values, right=np.nan)
        curves[name] = (("run", "actuation_pressure"), each)
    return curves


def _heights(runs: Sequence[Run], rows: Sequence[dict]) -> dict[str, tuple]:
    """Heights of runs at their frames, and the sections of those that are shown."""
    surfaces = [run.surface for run in runs]
    heights = padded([np.empty(0) if s is None else s.height for s in surfaces])
    shown = [k for k, row in enumerate(rows) if surfaces[k] and _is_shown(row)]
    cuts = stacked([surfaces[k].sections for k in shown], heights.shape[1])
    return {
        "frame_pressure": (("run", "frame"), padded([np.empty(0) if s is None else s.pressure for s in surfaces])),
        "frame_height": (("run", "frame"), heights),
        "section_run": ("section", np.array(shown, float)),
        "sections": (("section", "frame", "segment", "end", "plane"), cuts),
    }


def joined(dataset: xr.Dataset, earlier: xr.Dataset) -> xr.Dataset:
    """The rows of a dataset, and of an earlier one those that it lacks; sizes of the earlier one where there are none now."""
    later = {*keys_of(dataset)}
    stay = [k for k, key in enumerate(keys_of(earlier)) if key not in later]
    parts = [_pieces(earlier, stay), _pieces(dataset, range(dataset.sizes["run"]))]
    frames = max(part.sizes["frame"] for part in parts)
    rows = xr.concat(
        [part.pad(frame=(0, frames - part.sizes["frame"])) for part in parts],
        "run", data_vars="all", coords="minimal", compat="override", join="outer", combine_attrs="drop",
    )  # fmt: skip
    keys = keys_of(rows)
    devices = list(dict.fromkeys(key.device for key in keys))
    ranks = [(devices.index(key.device), key.kind == "run", ROLES.index(key.part)) for key in keys]
    rows = rows.isel(run=sorted(range(len(keys)), key=lambda k: ranks[k]))
    cuts = _cuts(earlier, stay) | _cuts(dataset, range(dataset.sizes["run"]))
    shown = {k: cuts[key] for k, key in enumerate(keys_of(rows)) if key in cuts}
    sizes = dataset if dataset.size_engine.size else earlier
    rows = rows.assign(
        section_run=("section", np.array([*shown], float)),
        sections=(("section", "frame", "segment", "end", "plane"), stacked([*shown.values()], frames)),
        **{name: sizes[name] for name in sizes.data_vars if name.startswith("size_")},
    )
    return _described(rows).assign_attrs(dataset.attrs)


def keys_of(dataset: xr.Dataset) -> list[RowKey]:
    """What tells each row from others."""
    return [RowKey(*key) for key in zip(*(dataset[name].values.tolist() for name in RowKey._fields), strict=True)]


def _pieces(dataset: xr.Dataset, rows: Sequence[int]) -> xr.Dataset:
    """Rows of a dataset, with all that belongs to one row alone."""
    return dataset[[n for n, v in dataset.data_vars.items() if "run" in v.dims]].isel(run=list(rows))


def _cuts(dataset: xr.Dataset, rows: Collection[int]) -> dict[RowKey, tuple[np.ndarray, ...]]:
    """The sections of rows by what tells them from others, frame by frame without what pads them."""
    keys = keys_of(dataset)
    return {
        keys[k]: tuple(frame[np.isfinite(frame).all(axis=(1, 2))] for frame in cut)
        for k, cut in zip(dataset.section_run.values.astype(int), dataset.sections.values, strict=True)
        if k in rows
    }


def _ensembles(runs: Sequence[Run]) -> list[list[Run]]:
    """The converged runs of each mesh of the reference and of the scatter."""
    ensembles: dict[tuple[str, str], list[Run]] = {}
    for run in runs:
        if run.role in ("reference", "scatter") and run.converged:
            ensembles.setdefault((run.role, run.variant), []).append(run)
    return [*ensembles.values()]


#: what runs have in common whose sections are kept: those that the sections of the reference are compared with
_SHOWN = {"kind": "run", "engine": "newton", "branch": 0}


def _is_shown(row: dict) -> bool:
    """Whether the sections of a run are kept."""
    same = all(row[key] == value for key, value in _SHOWN.items())
    return same and row["part"] != "scatter" and row["varied"] in ("", "level")


def _described(dataset: xr.Dataset) -> xr.Dataset:
    words = NUMBERS | {f"error_{name}": ("1", f"error: {text}") for name, text in ERRORS.items()}
    words |= {f"size_{name}": (units, text) for name, (units, text) in SIZES.items() if units}
    words |= {
        "ventricle_volume": ("ml", "ventricle volume, V_v"),
        "actuation_volume_change": ("ml", "pouch volume since P_a = 0, Delta V_a"),
        "frame_pressure": ("kPa", "actuation pressure of a frame, P_a"),
        "frame_height": ("1", "largest w / L in a frame"),
        "sections": ("mm", f"x and z of cuts through the part that was solved at y/L = {SECTION:g}"),
        "section_run": ("1", "row of a section"),
    }
    for name, (units, long_name) in words.items():
        dataset[name].attrs = {"units": units, "long_name": long_name}
    texts = TEXT | {f"size_{name}": text for name, (units, text) in SIZES.items() if not units}
    for name, long_name in texts.items():
        dataset[name].attrs = {"long_name": long_name}
    dataset.actuation_pressure.attrs = {"units": "kPa", "long_name": "actuation pressure, P_a"}
    return dataset


def _row(project: Project, subject: str, run: Run, kind: str, errors: dict[str, float], members: Sequence[Run]) -> dict:
    """A row of the dataset; ``members`` are the runs that its cost is the mean of."""
    values, surface = run.values, run.surface
    changes = changes_of(project, subject, run.case)
    return {
        "device": subject,
        "part": run.role,
        "kind": kind,
        "setting": run.variant or run.role,
        "description": run.description,
        "varied": ", ".join(dict.fromkeys(changes.values())),
        "change": ", ".join(changes),
        "preset": preset_of(project, run) if kind == "run" and not run.branch else "",
        "engine": run.case.engine,
        "build": str(values.solver_build.values),
        "level": run.case.mesh.level,
        "symmetry": run.case.mesh.symmetry,
        "element": run.case.mesh.element,
        "status": str(values.case_status.values),
        "reason": str(values.case_reason.values),
        "machine": str(values.machine.values) if "machine" in values else processor(),
        "branch": run.branch,
        "members": len(members),
        "grading": run.case.mesh_level.grading,
        "degrees_of_freedom": run.equations[1],
        "solved_degrees_of_freedom": run.equations[0],
        "stroke": stroke_of(run),
        "pressure_90ml": pressure_of(run),
        "efficiency_90ml": efficiency_of(run),
        "stress": stress_of(run),
        "cycles_decades": decades_of(run),
        "height": float(surface.height[np.argmax(surface.pressure)]) if surface else np.nan,
        "dissipated_fraction": float(values.dissipated_fraction),
        "cpu_seconds": float(np.mean([np.median(m.times) for m in members])),
        "timed": float(np.mean([len(m.times) for m in members])),
        "iterations": float(np.mean([m.values.iterations for m in members])),
        "memory_mib": float(np.mean([m.values.solver_memory for m in members])),
        **{f"error_{name}": value for name, value in errors.items()},
    }


def add_errors(project: Project, results: Path, file: Path, sources: Mapping[str, Sequence[str]]) -> xr.Dataset:
    """The rows of the runs that are solved in ``results`` and, of those that are not, the ones that ``file`` has."""
    dataset = gather_errors(project, results, file.parent, sources)
    return joined(dataset, read_errors(file)) if file.exists() else dataset


def write_errors(dataset: xr.Dataset, file: Path) -> None:
    """Write the kept dataset, compressed."""
    write_netcdf(dataset, file, packed(dataset), checked=False)


def read_errors(file: Path) -> xr.Dataset:
    """What ``write_errors`` wrote. Raises ``ResultError``."""
    try:
        dataset = xr.load_dataset(file)
    except UNREADABLE as error:
        raise ResultError(f"{file}: not the dataset of measured errors ({error})") from None
    wanted = (*TEXT, *NUMBERS, *(f"error_{e}" for e in ERRORS), *(f"size_{n}" for n in SIZES))
    if missing := [n for n in wanted if n not in dataset]:
        raise ResultError(f"{file}: no variables {', '.join(missing)}")
    return dataset


def under_presets(dataset: xr.Dataset, presets: Mapping[str, Preset]) -> xr.Dataset:
    """Measured errors under the names that presets have now: a run of a preset that says something else today is of none.

    A dataset that does not say what its presets were stays as it is.
    """
    if "presets" not in dataset.attrs:
        return dataset
    today = {json.dumps(preset.model_dump(mode="json") | _UNSAID): name for name, preset in presets.items()}
    then = json.loads(dataset.attrs["presets"])
    names = {name: today.get(json.dumps(preset | _UNSAID), "") for name, preset in then.items()}
    return dataset.assign(preset=("run", np.array([names.get(name, "") for name in dataset.preset.values.tolist()], str)))
