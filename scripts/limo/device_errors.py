"""How wrong each setting of the device is: its runs against an ensemble on the finest mesh (paper, *LIMO inflation convergence*).

Errors are taken against the mean of the reference. What the members of an ensemble differ among themselves is the scatter of
paths: a smaller error says nothing.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

from limo.case import Case
from limo.config import Loaded, Numerics
from limo.device_runs import PARTS, SECTION, Run, Surface, devices, packed, padded, runs_of, stacked
from limo.errors import ResultError
from limo.files import UNREADABLE, write_netcdf
from limo.overhead import processor
from limo.scaling import COLUMNS as SIZES
from limo.scaling import MEASURED, read_scaling

#: curves that are compared, and values
CURVES = ("ventricle_volume", "actuation_volume_change")
_VALUES = ("stroke_volume", "pressure_90ml", "efficiency_90ml", "von_mises_peak", "fatigue_cycles_min")
_DECADES = ("fatigue_cycles_min",)
#: what the paper says of its mesh: how far the largest w and the surface (d_c / L) are from those of the finest one
PAPER_HEIGHT, PAPER_CHAMFER = 0.02, 5e-3
#: errors of a run and what they are about; all over the reference's value except the distances, which are over L
ERRORS = {
    "ventricle_volume": "relative L2 of V_v over the ramp",
    "actuation_volume": "relative L2 of Delta V_a over the ramp",
    "stroke": "stroke at P_a,max",
    "pressure_90ml": "P_a at a stroke of 90 ml",
    "efficiency_90ml": "efficiency at a stroke of 90 ml",
    "stress": "top-5 % von Mises stress at P_a,max",
    "cycles": "fewest cycles near seams, in decades",
    "height": "largest w at P_a,max",
    "chamfer": "symmetric Chamfer distance of the surfaces at P_a,max over L",
}


def chamfer(first: Surface, second: Surface) -> float:
    """d_c of two surfaces in mm: mean distance of points on each from the other (paper, *LIMO inflation convergence*).

    The paper takes distances between points of two clouds; the spacing of those is a floor that surfaces do not have.
    """
    return float(0.5 * second.distances(first.cloud).mean() + 0.5 * first.distances(second.cloud).mean())


def changes_of(loaded: Loaded, device: str, case: Case) -> dict[str, str]:
    """What a run has instead of the configuration's default with the same engine, and which part of a setting that is.

    Keys are words such as ``medium`` or ``fit.damping 1e+06``; values ``level``, ``symmetry``, ``element``, ``numerics`` or
    ``fabric``.
    """
    study = loaded.studies.get(f"accuracy_{device}", loaded.studies[f"reference_{device}"])
    plain = dict.fromkeys(("preset", "mesh", "numerics", "engine"))
    default = loaded.settings(study.model_copy(update={"variants": {}, "material": {}, **plain}))[""]
    found = {
        getattr(case.mesh, n): n for n in ("level", "symmetry", "element") if getattr(case.mesh, n) != getattr(default.mesh, n)
    }
    own, usual = _flat(case.numerics), _flat(default.numerics.for_engine(case.engine))
    found |= {f"{key} {_word(value)}": "numerics" for key, value in own.items() if value != usual.get(key)}
    own, usual = (d.material.model_dump() for d in (case.device, default.device))
    return found | {f"{key} {_word(value)}": "fabric" for key, value in own.items() if value != usual[key]}


def _flat(numerics: Numerics) -> dict[str, object]:
    found = {}
    for key, value in numerics.model_dump(exclude={"description"}).items():
        found |= {f"{key}.{k}": v for k, v in value.items()} if isinstance(value, dict) else {key: value}
    return found


def _word(value: object) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def preset_of(loaded: Loaded, run: Run) -> str:
    """Name of the accuracy preset that a run was solved with, or nothing."""
    for name, preset in loaded.config.presets.items():
        numerics = loaded.config.numerics_presets[preset.numerics].for_engine(preset.engine)
        device = loaded.devices[run.case.device_name]
        same = (preset.mesh, preset.engine, numerics) == (run.case.mesh, run.case.engine, run.case.numerics)
        if same and run.case.device == device:
            return name
    return ""


# --------------------------------------------------------------------------------------------------------------------
# errors


def errors_of(run: Run, reference: Sequence[Run]) -> dict[str, float]:
    """``ERRORS`` of a run against the mean of a reference; NaN for what one of them lacks."""
    found = {
        "ventricle_volume": _curve_error(run, reference, "ventricle_volume"),
        "actuation_volume": _curve_error(run, reference, "actuation_volume_change"),
    }
    for name, value in (("stroke", _stroke), ("pressure_90ml", _pressure), ("efficiency_90ml", _efficiency), ("stress", _stress)):
        expected = np.mean([value(r) for r in reference])
        found[name] = abs(value(run) / expected - 1.0)
    found["cycles"] = abs(_decades(run) - np.mean([_decades(r) for r in reference]))
    surfaces = [r.surface for r in reference if r.surface is not None]
    found |= {"height": np.nan, "chamfer": np.nan}
    if run.surface is not None and surfaces:
        expected = np.mean([s.height[np.argmax(s.pressure)] for s in surfaces])
        found["height"] = abs(run.surface.height[np.argmax(run.surface.pressure)] / expected - 1.0)
        length = run.case.device.pattern.length
        found["chamfer"] = float(np.mean([chamfer(run.surface, s) for s in surfaces])) / length
    return {name: float(found[name]) for name in ERRORS}


def scatter_of(members: Sequence[Run]) -> dict[str, float]:
    """Mean error of each member of an ensemble against the mean of the others: what paths alone make of a setting."""
    each = [errors_of(run, [r for r in members if r is not run]) for run in members]
    return {name: float(np.mean([e[name] for e in each])) for name in ERRORS}


def mean_of(members: Sequence[Run]) -> Run:
    """What an ensemble gives on average: its mean curves and values; it has no surface."""
    values = members[0].values.copy()
    for name in (*CURVES, *_VALUES):
        if name in values:
            each = np.array([run.values[name].values for run in members])
            values[name] = (values[name].dims, 10 ** np.log10(each).mean(axis=0) if name in _DECADES else each.mean(axis=0))
    return replace(members[0], values=values, surface=None)


def _curve_error(run: Run, reference: Sequence[Run], name: str) -> float:
    """||c - c_ref|| / ||c_ref|| over the ramp; NaN for a run that ends before the reference."""
    expected = np.mean([r.values[name].values for r in reference], axis=0)
    known = np.isfinite(expected)
    return np.linalg.norm(run.values[name].values[known] - expected[known]) / np.linalg.norm(expected[known])


def _stroke(run: Run) -> float:
    return float(run.values.stroke_volume[-1])


def _pressure(run: Run) -> float:
    return float(run.values.pressure_90ml)


def _efficiency(run: Run) -> float:
    return float(run.values.efficiency_90ml)


def _stress(run: Run) -> float:
    return float(run.values.von_mises_peak.sel(frame="max")) if "von_mises_peak" in run.values else np.nan


def _decades(run: Run) -> float:
    return float(np.log10(run.values.fatigue_cycles_min)) if "fatigue_cycles_min" in run.values else np.nan


# --------------------------------------------------------------------------------------------------------------------
# the kept dataset

#: texts in a row: meaning
TEXT = {
    "device": "device that was measured, such as np4",
    "part": "what a run is for: accuracy, shells, reference, referee or scatter",
    "kind": "run, or of an ensemble scatter among its members or mean of them",
    "setting": "variant of the study, or the part where that has none",
    "description": "the variant in words",
    "varied": "what of the default a run changes: level, symmetry, element, engine, numerics, fabric",
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
#: what tells rows from each other
_KEY = ("device", "part", "kind", "setting", "branch")
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


def gather_errors(loaded: Loaded, results: Path, folder: Path, sources: Mapping[str, Sequence[str]]) -> xr.Dataset:
    """One row a run of every device: its setting, errors and cost, curves, heights at its frames.

    Of kind ``run``; rows of kind ``scatter`` have what the members of an ensemble differ among themselves, of kind ``mean``
    the errors of its mean. Sections are kept where the mesh level alone is changed and the engine is newton. ``folder``: where
    the runs of ``KEPT_PARTS`` are. Raises ``ResultError`` where no device has two converged runs of its reference.
    """
    rows, kept = [], []
    for device in devices(loaded):
        runs = runs_of(loaded, device, results, folder, sources)
        reference = [run for run in runs if run.part == "reference" and run.converged]
        if len(reference) < 2:
            continue
        for members in _ensembles(runs):
            if len(members) > 1:
                mean = mean_of(members)
                kinds = {"scatter": scatter_of(members), "mean": errors_of(mean, reference)}
                rows += [_row(loaded, device, mean, kind, errors, members) for kind, errors in kinds.items()]
                kept += [mean] * len(kinds)
        for run in runs:
            others = [r for r in reference if r is not run]
            rows.append(_row(loaded, device, run, "run", errors_of(run, others), [run]))
            kept.append(run)
    if not rows:
        raise ResultError(
            f"{results}: no device with two converged runs of its reference; snakemake --cores 2 accuracy makes them"
        )
    data = {n: ("run", np.array([row[n] for row in rows], str if n in TEXT else float)) for n in rows[0]}
    pressure = max((run.values.actuation_pressure.values for run in kept), key=len)
    for name in CURVES:
        each = np.full((len(kept), len(pressure)), np.nan)
        for k, run in enumerate(kept):
            each[k] = np.interp(pressure, run.values.actuation_pressure.values, run.values[name].values, right=np.nan)
        data[name] = (("run", "actuation_pressure"), each)
    surfaces = [run.surface for run in kept]
    data["frame_pressure"] = (("run", "frame"), padded([np.empty(0) if s is None else s.pressure for s in surfaces]))
    data["frame_height"] = (("run", "frame"), padded([np.empty(0) if s is None else s.height for s in surfaces]))
    shown = [k for k, row in enumerate(rows) if surfaces[k] and _is_shown(row)]
    data["section_run"] = ("section", np.array(shown, float))
    cuts = stacked([surfaces[k].sections for k in shown], data["frame_height"][1].shape[1])
    data["sections"] = (("section", "frame", "segment", "end", "plane"), cuts)
    dataset = xr.Dataset(data | read_scaling(results / "scaling"), coords={"actuation_pressure": pressure})
    return _described(dataset).assign_attrs(
        title="errors of the settings of the device",
        machine=processor(),
        presets=json.dumps({name: preset.model_dump(mode="json") for name, preset in loaded.config.presets.items()}),
    )


def joined(dataset: xr.Dataset, earlier: xr.Dataset) -> xr.Dataset:
    """The rows of a dataset, and of an earlier one those that it lacks; sizes of the earlier one where there are none now."""
    own = {*_keys(dataset)}
    stay = [k for k, key in enumerate(_keys(earlier)) if key not in own]
    parts = [_pieces(earlier, stay), _pieces(dataset, range(dataset.sizes["run"]))]
    frames = max(part.sizes["frame"] for part in parts)
    rows = xr.concat(
        [part.pad(frame=(0, frames - part.sizes["frame"])) for part in parts],
        "run", data_vars="all", coords="minimal", compat="override", join="outer", combine_attrs="drop",
    )  # fmt: skip
    keys = _keys(rows)
    names = list(dict.fromkeys(key[0] for key in keys))
    order = sorted(range(len(keys)), key=lambda k: (names.index(keys[k][0]), keys[k][2] == "run", PARTS.index(keys[k][1]), k))
    cuts = {key: cut for part, of in ((earlier, stay), (dataset, None)) for key, cut in _cuts(part, of).items()}
    rows = rows.isel(run=order)
    shown = [k for k, key in enumerate(_keys(rows)) if key in cuts]
    found = stacked([cuts[_keys(rows)[k]] for k in shown], frames)
    sizes = dataset if dataset.size_engine.size else earlier
    rows = rows.assign(
        section_run=("section", np.array(shown, float)),
        sections=(("section", "frame", "segment", "end", "plane"), found),
        **{name: sizes[name] for name in sizes.data_vars if name.startswith("size_")},
    )
    return _described(rows).assign_attrs(dataset.attrs)


def _keys(dataset: xr.Dataset) -> list[tuple]:
    """What tells each row from others."""
    return list(zip(*(dataset[name].values.tolist() for name in _KEY), strict=True))


def _pieces(dataset: xr.Dataset, rows: Sequence[int]) -> xr.Dataset:
    """Rows of a dataset, with all that belongs to one row alone."""
    return dataset[[n for n, v in dataset.data_vars.items() if "run" in v.dims]].isel(run=list(rows))


def _cuts(dataset: xr.Dataset, rows: Sequence[int] | None) -> dict[tuple, tuple[np.ndarray, ...]]:
    """The sections of rows (none: of all) by what tells them from others, frame by frame without what pads them."""
    keys = _keys(dataset)
    return {
        keys[k]: tuple(frame[np.isfinite(frame).all(axis=(1, 2))] for frame in cut)
        for k, cut in zip(dataset.section_run.values.astype(int), dataset.sections.values, strict=True)
        if rows is None or k in rows
    }


def _ensembles(runs: Sequence[Run]) -> list[list[Run]]:
    """The converged runs of each mesh of the reference and of the scatter."""
    found: dict[tuple[str, str], list[Run]] = {}
    for run in runs:
        if run.part in ("reference", "scatter") and run.converged:
            found.setdefault((run.part, run.variant), []).append(run)
    return [*found.values()]


def _is_shown(row: dict) -> bool:
    """Whether the sections of a run are kept."""
    return (
        row["kind"] == "run"
        and row["part"] != "scatter"
        and row["engine"] == "newton"
        and row["branch"] == 0
        and row["varied"] in ("", "level")
    )


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


def _row(loaded: Loaded, device: str, run: Run, kind: str, errors: dict[str, float], members: Sequence[Run]) -> dict:
    """A row of the dataset; ``members`` are the runs that its cost is the mean of."""
    values, surface = run.values, run.surface
    changes = changes_of(loaded, device, run.case)
    return {
        "device": device,
        "part": run.part,
        "kind": kind,
        "setting": run.variant or run.part,
        "description": run.description,
        "varied": ", ".join(dict.fromkeys(changes.values())),
        "change": ", ".join(changes),
        "preset": preset_of(loaded, run) if kind == "run" and not run.branch else "",
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
        "stroke": _stroke(run),
        "pressure_90ml": _pressure(run),
        "efficiency_90ml": _efficiency(run),
        "stress": _stress(run),
        "cycles_decades": _decades(run),
        "height": float(surface.height[np.argmax(surface.pressure)]) if surface else np.nan,
        "dissipated_fraction": float(values.dissipated_fraction),
        "cpu_seconds": float(np.mean([np.median(m.times) for m in members])),
        "timed": float(np.mean([len(m.times) for m in members])),
        "iterations": float(np.mean([m.values.iterations for m in members])),
        "memory_mib": float(np.mean([m.values.solver_memory for m in members])),
        **{f"error_{name}": value for name, value in errors.items()},
    }


def add_errors(loaded: Loaded, results: Path, file: Path, sources: Mapping[str, Sequence[str]]) -> xr.Dataset:
    """The rows of the runs that are solved in ``results`` and, of those that are not, the ones that ``file`` has."""
    dataset = gather_errors(loaded, results, file.parent, sources)
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


# --------------------------------------------------------------------------------------------------------------------
# what figures and the report make of it


def rows_of(dataset: xr.Dataset) -> pd.DataFrame:
    """The rows without curves and shapes; ``error_volumes`` is the larger error of both volumes."""
    table = dataset[[n for n in dataset if dataset[n].dims == ("run",)]].to_dataframe()
    table["error_volumes"] = np.maximum(table.error_ventricle_volume, table.error_actuation_volume)
    return table


def settings_of(rows: pd.DataFrame) -> pd.DataFrame:
    """The rows of one device that say what a setting costs and how wrong it is.

    Runs that converged from the flat state as it is and solve the same problem (another fabric is another problem).
    """
    same = ~rows.varied.str.contains("fabric")
    return rows[(rows.kind == "run") & (rows.status == "converged") & (rows.branch == 0) & (rows.part != "scatter") & same]


def pareto(cost: np.ndarray, error: np.ndarray) -> np.ndarray:
    """Indices of the points that no other beats in both cost and error, cheapest first; NaN are left out."""
    cost, error = np.asarray(cost, float), np.asarray(error, float)
    best, found = np.inf, []
    for k in np.lexsort((error, cost)):
        if np.isfinite(cost[k]) and error[k] < best:
            best = error[k]
            found.append(k)
    return np.array(found, int)


def exponent(size: np.ndarray, cost: np.ndarray) -> tuple[float, float]:
    """p and a of cost = a size^p by least squares in logarithms; NaN of fewer than three different sizes."""
    size, cost = np.asarray(size, float), np.asarray(cost, float)
    use = np.isfinite(size) & np.isfinite(cost) & (size > 0) & (cost > 0)
    if len(np.unique(size[use])) < 3:
        return float("nan"), float("nan")
    power, offset = np.polyfit(np.log(size[use]), np.log(cost[use]), 1)
    return float(power), float(np.exp(offset))


def richardson(size: np.ndarray, value: np.ndarray, order: float) -> float:
    """a of value = a + c h^order through the two largest sizes, which come last; h = size^(-1/2) is the edge of an element."""
    (coarse, fine), (before, last) = np.asarray(size, float)[-2:], np.asarray(value, float)[-2:]
    return float(last + (last - before) / ((fine / coarse) ** (0.5 * order) - 1.0))


def scatter_row(rows: pd.DataFrame, part: str) -> pd.Series | None:
    """What paths alone make of one device's errors on the finest mesh (``reference``) or the default one (first ``scatter``)."""
    found = rows[(rows.kind == "scatter") & (rows.part == part)]
    return found.iloc[0] if len(found) else None


def sizes_of(dataset: xr.Dataset) -> pd.DataFrame:
    """The sizes that were measured, columns as in ``limo.scaling`` but ``seconds_per_iteration`` for what all of them took."""
    table = pd.DataFrame({name: dataset[f"size_{name}"].values for name in SIZES})
    table = table[table.status == MEASURED]
    return table.assign(seconds_per_iteration=table.pop("cpu_seconds") / table.iterations)


def scaling_of(rows: pd.DataFrame) -> pd.DataFrame:
    """Converged runs that differ in mesh level and symmetry alone, with ``seconds_per_iteration``."""
    plain = rows.varied.isin(["", "level", "symmetry", "level, symmetry"])
    found = rows[(rows.kind == "run") & (rows.status == "converged") & plain]
    return found.assign(seconds_per_iteration=found.cpu_seconds / found.iterations)


def models_of(runs: pd.DataFrame, sizes: pd.DataFrame) -> pd.DataFrame:
    """What the exponents of an iteration and of memory of one engine are fitted to, with ``displacements``.

    Models of the full device where such were measured (``sizes_of``), else its runs (of ``scaling_of``).
    """
    measured = sizes[sizes.engine.isin(runs.engine)]
    return measured if len(measured) else runs.rename(columns={"solved_degrees_of_freedom": "displacements"})
