"""How wrong each setting of the device is: its runs against an ensemble on the finest mesh (paper, *LIMO inflation convergence*).

A device has these studies: ``accuracy_<device>`` varies one setting at a time, ``reference_<device>`` is the ensemble on the
finest mesh, ``scatter_<device>`` one on the default mesh; ``shells_<device>`` adds elements of which only volumes are known.
Errors are taken against the mean of the reference. What the members of an ensemble differ among themselves is the scatter of
paths: a smaller error says nothing.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr
from scipy.spatial import cKDTree

from limo.case import Case, solved_on, study_cases
from limo.config import Loaded, Numerics
from limo.elements import gauss, quad8_shape
from limo.errors import LimoError, ResultError
from limo.figures.surface import grid, mirrors
from limo.files import UNREADABLE, read_json, write_netcdf
from limo.measures import open_case
from limo.mesh import degrees_of_freedom_of, read_mesh
from limo.overhead import processor

PARTS = ("accuracy", "reference", "scatter", "shells")
#: points of a cloud on the surface of the full device, and steps of the stored coordinates in mm
CLOUD, STEP = 6000, 0.01
#: where the device is cut, y / L
SECTION = 0.5
#: linear quadrilaterals along a side of an element that is cut
_DIVISIONS = 2
#: curves that are compared, and values
CURVES = ("ventricle_volume", "actuation_volume_change")
_VALUES = ("stroke_volume", "pressure_90ml", "efficiency_90ml", "von_mises_peak", "fatigue_cycles_min")
_DECADES = ("fatigue_cycles_min",)
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


@dataclass(frozen=True)
class Surface:
    """What is kept of a run's shapes: w / L (f,) at pressures (f,) in kPa, and the cloud (n, 3) in mm of its last frame.

    ``sections``: for each frame the segments (k, 2, 2), x and z in mm of both ends, in which the plane y / L = ``SECTION`` cuts
    the part that was solved.
    """

    pressure: np.ndarray
    height: np.ndarray
    cloud: np.ndarray
    sections: tuple[np.ndarray, ...] = ()


def surface_of(case: Case, mesh_file: Path, folder: Path) -> Surface:
    """Heights at all frames and the cloud at the last of the full device. Raises ``LimoError`` where there are none."""
    model, frames = open_case(case, mesh_file, folder)
    if not len(frames.pressure):
        raise ResultError(f"{frames.file}: no frames")
    middle = [model.expansion.midsurface(u.astype(float)) for u in frames.displacement]
    length = case.device.pattern.length
    height = np.array([np.abs(u[:, 2]).max() for u in middle]) / length
    last = int(np.argmax(frames.pressure))
    part = sampled(model.mesh.nodes, model.mesh.quads, middle[last], CLOUD // model.mesh.copies)
    cloud = np.vstack([part * sign for sign in mirrors(model.mesh.symmetry)])
    sections = tuple(section(model.mesh.nodes, model.mesh.quads, u, SECTION * length) for u in middle)
    return Surface(frames.pressure, height, np.round(cloud / STEP) * STEP, sections)


def sampled(nodes: np.ndarray, quads: np.ndarray, displacement: np.ndarray, count: int) -> np.ndarray:
    """Points (count, 3) spread over deformed quadrilaterals in proportion to their area, the same for the same surface.

    ``nodes`` and ``displacement`` (n, 3) in mm, ``quads`` (m, 8). Along the order of the elements the points lie at equal steps
    of area; within an element at points of a low-discrepancy sequence.
    """
    place = (nodes + displacement)[quads]
    local, weights = gauss(2, 2)
    _, slopes = quad8_shape(local)
    tangents = np.einsum("gnd,mnk->mgdk", slopes, place)
    areas = np.linalg.norm(np.cross(tangents[:, :, 0], tangents[:, :, 1]), axis=-1) @ weights
    steps = (np.arange(count) + 0.5) / count * areas.sum()
    element = np.searchsorted(np.cumsum(areas), steps).clip(max=len(quads) - 1)
    # additive recurrence with the plastic number: even in two dimensions for every count
    inside = np.mod(0.5 + np.arange(1, count + 1)[:, None] * np.array([0.7548776662466927, 0.5698402909980532]), 1.0)
    values, _ = quad8_shape(2.0 * inside - 1.0)
    return np.einsum("pn,pnk->pk", values, place[element])


def section(nodes: np.ndarray, quads: np.ndarray, displacement: np.ndarray, y: float) -> np.ndarray:
    """Segments (k, 2, 2), x and z in mm of both ends, in which the plane at ``y`` (mm) cuts deformed quadrilaterals.

    ``nodes`` and ``displacement`` (n, 3) in mm, ``quads`` (m, 8). Elements are divided and cut as flat triangles.
    """
    values, _, cells = grid(_DIVISIONS)
    points = np.einsum("gn,mnk->mgk", values, (nodes + displacement)[quads])
    triangles = points[:, cells][:, :, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3, 3)
    above = triangles[:, :, 1] > y
    crossed = above.any(axis=1) & ~above.all(axis=1)
    triangles, above = triangles[crossed], above[crossed]
    single = np.argmax(above == (above.sum(axis=1) == 1)[:, None], axis=1)  # the corner that has its side to itself
    place = np.arange(len(triangles))[:, None]
    tip, others = triangles[place, single[:, None]], triangles[place, (single[:, None] + [1, 2]) % 3]
    share = (y - tip[..., 1]) / (others[..., 1] - tip[..., 1])
    return (tip + share[..., None] * (others - tip))[..., [0, 2]]


def chamfer(first: np.ndarray, second: np.ndarray) -> float:
    """d_c of two clouds (n, 3) and (m, 3), in their unit (paper, *LIMO inflation convergence*)."""
    there, back = cKDTree(second).query(first)[0], cKDTree(first).query(second)[0]
    return float(0.5 * there.mean() + 0.5 * back.mean())


# --------------------------------------------------------------------------------------------------------------------
# the runs of a device


@dataclass(frozen=True)
class Run:
    """One run: study's part, variant, branch, its values in the study's dataset, and its surface where there is one.

    ``equations``: displacements of the part that was solved, and of the full device.
    """

    part: str
    variant: str
    description: str
    branch: int
    case: Case
    values: xr.Dataset
    surface: Surface | None
    equations: tuple[float, float] = (np.nan, np.nan)

    @property
    def converged(self) -> bool:
        return str(self.values.case_status.values) == "converged"


def devices(loaded: Loaded) -> list[str]:
    """Names of the devices for which there is a reference, as in ``reference_<device>``."""
    return [name.partition("_")[2] for name in loaded.studies if name.startswith("reference_")]


def error_studies(loaded: Loaded) -> list[str]:
    """Studies of all devices from which errors are gathered."""
    names = (f"{part}_{device}" for device in devices(loaded) for part in PARTS)
    return [name for name in names if name in loaded.studies]


def runs_of(loaded: Loaded, device: str, results: Path, sources: Mapping[str, Sequence[str]]) -> list[Run]:
    """The runs of a device that are gathered; cases that are not solved are left out.

    ``sources``: by study the ids of the cases that serve it, in the order of its grid.
    """
    runs = []
    for part in PARTS:
        name = f"{part}_{device}"
        file = results / "studies" / name / "study.nc"
        if name not in sources or not file.exists():
            continue
        try:
            dataset = xr.load_dataset(file)
        except UNREADABLE as error:
            raise ResultError(f"{file}: not the dataset of a study ({error})") from None
        for (key, case), source in zip(study_cases(loaded, name).items(), sources[name], strict=True):
            variant, branch = key[-2:]
            at = {d: v for d, v in (("variant", variant), ("branch", branch)) if d in dataset.dims}
            values = dataset.sel(at).squeeze(drop=True)
            if str(values.case_status.values) != "missing":
                described = loaded.studies[name].variants[variant].description if variant else ""
                shape, equations = _shape(results, source)
                runs.append(Run(part, variant, described, branch, case, values, shape, equations))
    return runs


def _shape(results: Path, case_id: str) -> tuple[Surface | None, tuple[float, float]]:
    """Surface and numbers of displacements of a solved case; none for shells, which keep no displacements."""
    folder = results / "cases" / case_id
    stored = Case.from_dict(read_json(folder / "case.json")["case"])
    file = results / "meshes" / f"{stored.mesh_id}.vtu"
    solved, own = solved_on(stored, file, folder)
    mesh = read_mesh(own, solved.mesh.symmetry)
    part = degrees_of_freedom_of(mesh)
    try:
        return surface_of(stored, file, folder), (part, part * mesh.copies)
    except LimoError:
        return None, (part, part * mesh.copies)


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
        found["chamfer"] = float(np.mean([chamfer(run.surface.cloud, s.cloud) for s in surfaces])) / length
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
    "part": "what a run is for: accuracy, shells, reference or scatter",
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
}
#: numbers in a row besides errors: units, meaning
NUMBERS = {
    "branch": ("1", "0 for the flat state as it is, else the seed of a tiny perturbation of it"),
    "members": ("1", "runs that a row is made of"),
    "degrees_of_freedom": ("1", "displacements of the written-out bricks, full device"),
    "solved_degrees_of_freedom": ("1", "displacements of the written-out bricks of the part that was solved"),
    "stroke": ("ml", "stroke at P_a,max"),
    "pressure_90ml": ("kPa", "actuation pressure at a stroke of 90 ml"),
    "efficiency_90ml": ("1", "mechanical efficiency at a stroke of 90 ml, eta"),
    "stress": ("MPa", "von Mises stress at P_a,max, area average of the top 5 %"),
    "cycles_decades": ("1", "decadic logarithm of the fewest cycles near seams"),
    "height": ("1", "largest w / L at P_a,max"),
    "dissipated_fraction": ("1", "share of the actuation work over the ramp that damping took"),
    "cpu_seconds": ("s", "CPU time of the solver, one thread"),
    "iterations": ("1", "Newton iterations, rejected attempts included"),
    "memory_mib": ("MiB", "peak resident memory of the solver"),
}


def gather_errors(loaded: Loaded, results: Path, sources: Mapping[str, Sequence[str]]) -> xr.Dataset:
    """One row a run of every device: its setting, errors and cost, curves, heights at its frames.

    Of kind ``run``; rows of kind ``scatter`` have what the members of an ensemble differ among themselves, of kind ``mean``
    the errors of its mean. Clouds on the surface at P_a,max are kept of the reference, sections where the mesh level alone is
    changed and the engine is newton. Raises ``ResultError`` where no device has two converged runs of its reference.
    """
    rows, kept = [], []
    for device in devices(loaded):
        runs = runs_of(loaded, device, results, sources)
        reference = [run for run in runs if run.part == "reference" and run.converged]
        if len(reference) < 2:
            continue
        for part in ("reference", "scatter"):
            members = [run for run in runs if run.part == part and run.converged]
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
    data["frame_pressure"] = (("run", "frame"), _padded([_of(s, "pressure") for s in surfaces]))
    data["frame_height"] = (("run", "frame"), _padded([_of(s, "height") for s in surfaces]))
    clouds = [k for k, row in enumerate(rows) if row["part"] == "reference" and row["kind"] == "run" and surfaces[k]]
    data["cloud_run"] = ("member", np.array(clouds, float))
    data["cloud"] = (("member", "point", "axis"), np.array([surfaces[k].cloud for k in clouds]).reshape(-1, CLOUD, 3))
    shown = [k for k, row in enumerate(rows) if surfaces[k] and _is_shown(row)]
    data["section_run"] = ("section", np.array(shown, float))
    cuts = _stacked([surfaces[k].sections for k in shown], data["frame_height"][1].shape[1])
    data["sections"] = (("section", "frame", "segment", "end", "plane"), cuts)
    dataset = xr.Dataset(data, coords={"actuation_pressure": pressure})
    return _described(dataset).assign_attrs(
        title="errors of the settings of the device",
        machine=processor(),
        presets=json.dumps({name: preset.model_dump(mode="json") for name, preset in loaded.config.presets.items()}),
    )


def _is_shown(row: dict) -> bool:
    """Whether the sections of a run are kept."""
    return (
        row["kind"] == "run"
        and row["part"] != "scatter"
        and row["engine"] == "newton"
        and row["branch"] == 0
        and row["varied"] in ("", "level")
    )


def _of(surface: Surface | None, name: str) -> np.ndarray:
    return np.empty(0) if surface is None else getattr(surface, name)


def _padded(arrays: Sequence[np.ndarray]) -> np.ndarray:
    """Arrays (n,) of different lengths as rows, NaN behind their ends."""
    table = np.full((len(arrays), max([len(a) for a in arrays], default=0)), np.nan)
    for row, array in zip(table, arrays, strict=True):
        row[: len(array)] = array
    return table


def _stacked(sections: Sequence[tuple[np.ndarray, ...]], frames: int) -> np.ndarray:
    """Segments (s, frames, k, 2, 2) of runs, NaN behind the last of each frame."""
    longest = max([len(part) for parts in sections for part in parts], default=0)
    table = np.full((len(sections), frames, longest, 2, 2), np.nan)
    for row, parts in zip(table, sections, strict=True):
        for place, part in zip(row, parts, strict=False):
            place[: len(part)] = part
    return table


def _described(dataset: xr.Dataset) -> xr.Dataset:
    words = NUMBERS | {f"error_{name}": ("1", f"error: {text}") for name, text in ERRORS.items()}
    words |= {
        "ventricle_volume": ("ml", "ventricle volume, V_v"),
        "actuation_volume_change": ("ml", "pouch volume since P_a = 0, Delta V_a"),
        "frame_pressure": ("kPa", "actuation pressure of a frame, P_a"),
        "frame_height": ("1", "largest w / L in a frame"),
        "cloud": ("mm", "points on the surface of the full device at P_a,max"),
        "cloud_run": ("1", "row of a cloud"),
        "sections": ("mm", f"x and z of cuts through the part that was solved at y/L = {SECTION:g}"),
        "section_run": ("1", "row of a section"),
    }
    for name, (units, long_name) in words.items():
        dataset[name].attrs = {"units": units, "long_name": long_name}
    for name, long_name in TEXT.items():
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
        "branch": run.branch,
        "members": len(members),
        "degrees_of_freedom": run.equations[1],
        "solved_degrees_of_freedom": run.equations[0],
        "stroke": _stroke(run),
        "pressure_90ml": _pressure(run),
        "efficiency_90ml": _efficiency(run),
        "stress": _stress(run),
        "cycles_decades": _decades(run),
        "height": float(surface.height[np.argmax(surface.pressure)]) if surface else np.nan,
        "dissipated_fraction": float(values.dissipated_fraction),
        "cpu_seconds": float(np.mean([m.values.solver_time for m in members])),
        "iterations": float(np.mean([m.values.iterations for m in members])),
        "memory_mib": float(np.mean([m.values.solver_memory for m in members])),
        **{f"error_{name}": value for name, value in errors.items()},
    }


def write_errors(dataset: xr.Dataset, file: Path) -> None:
    """Write the kept dataset: compressed, numbers in single precision, coordinates of surfaces in steps of ``STEP``."""
    packed = {}
    for name, variable in dataset.variables.items():
        if name in ("cloud", "sections"):
            packed[name] = {"dtype": "int16", "scale_factor": STEP, "_FillValue": -32768, "zlib": True, "complevel": 9}
        elif variable.dtype.kind == "f":
            squeezed = {"zlib": True, "complevel": 9} if variable.size > 1000 else {}
            packed[name] = {"dtype": "float32", "_FillValue": np.float32(np.nan)} | squeezed
    write_netcdf(dataset, file, packed, checked=False)


def read_errors(file: Path) -> xr.Dataset:
    """What ``write_errors`` wrote. Raises ``ResultError``."""
    try:
        dataset = xr.load_dataset(file)
    except UNREADABLE as error:
        raise ResultError(f"{file}: not the dataset of measured errors ({error})") from None
    if missing := [n for n in (*TEXT, *NUMBERS, *(f"error_{e}" for e in ERRORS)) if n not in dataset]:
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


def scatter_row(rows: pd.DataFrame, part: str) -> pd.Series | None:
    """What paths alone make of the errors on the finest (``reference``) or the default mesh (``scatter``) of one device."""
    found = rows[(rows.kind == "scatter") & (rows.part == part)]
    return found.iloc[0] if len(found) else None


def scaling_of(rows: pd.DataFrame) -> pd.DataFrame:
    """Converged runs that differ in mesh level and symmetry alone, with ``seconds_per_iteration``."""
    plain = rows.varied.isin(["", "level", "symmetry", "level, symmetry"])
    found = rows[(rows.kind == "run") & (rows.status == "converged") & plain]
    return found.assign(seconds_per_iteration=found.cpu_seconds / found.iterations)
