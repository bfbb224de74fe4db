"""How wrong each setting of the device is: its runs against an ensemble on the finest mesh (paper, *LIMO inflation convergence*).

A device has three studies: ``accuracy_<device>`` varies one setting at a time, ``reference_<device>`` is the ensemble on the
finest mesh, ``scatter_<device>`` one on the default mesh; ``shells_<device>`` adds elements of which only volumes are known.
Errors are taken against the mean of the reference. What the members of an ensemble differ among themselves is the scatter of
paths: a smaller error says nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr
from scipy.spatial import cKDTree

from limo.case import Case, study_cases
from limo.config import Loaded
from limo.elements import gauss, quad8_shape
from limo.errors import LimoError, ResultError
from limo.figures.surface import mirrors
from limo.files import read_json
from limo.measures import open_case
from limo.plan import Plan

PARTS = ("accuracy", "reference", "scatter", "shells")
#: points of a cloud on the surface of the full device, and steps of the stored coordinates in mm
CLOUD, STEP = 6000, 0.01
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
    """What is kept of a run's shapes: w / L (f,) at pressures (f,) in kPa, and the cloud (n, 3) in mm of its last frame."""

    pressure: np.ndarray
    height: np.ndarray
    cloud: np.ndarray


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
    cloud = np.vstack([part * sign for sign in mirrors(case.mesh.symmetry)])
    return Surface(frames.pressure, height, np.round(cloud / STEP) * STEP)


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


def chamfer(first: np.ndarray, second: np.ndarray) -> float:
    """d_c of two clouds (n, 3) and (m, 3), in their unit (paper, *LIMO inflation convergence*)."""
    there, back = cKDTree(second).query(first)[0], cKDTree(first).query(second)[0]
    return float(0.5 * there.mean() + 0.5 * back.mean())


# --------------------------------------------------------------------------------------------------------------------
# the runs of a device


@dataclass(frozen=True)
class Run:
    """One run: study's part, variant, branch, its values in the study's dataset, and its surface where there is one."""

    part: str
    variant: str
    description: str
    branch: int
    case: Case
    values: xr.Dataset
    surface: Surface | None

    @property
    def converged(self) -> bool:
        return str(self.values.case_status.values) == "converged"


def devices(loaded: Loaded) -> list[str]:
    """Names of the devices for which there is a reference, as in ``reference_<device>``."""
    return [name.partition("_")[2] for name in loaded.studies if name.startswith("reference_")]


def runs_of(loaded: Loaded, plan: Plan, device: str, results: Path) -> list[Run]:
    """The runs of a device that are gathered; cases that are not solved are left out."""
    runs = []
    for part in PARTS:
        name = f"{part}_{device}"
        file = results / "studies" / name / "study.nc"
        if name not in loaded.studies or not file.exists():
            continue
        dataset = xr.load_dataset(file)
        for key, case in study_cases(loaded, name).items():
            variant, branch = key[-2:]
            at = {d: v for d, v in (("variant", variant), ("branch", branch)) if d in dataset.dims}
            values = dataset.sel(at).squeeze(drop=True)
            if str(values.case_status.values) != "missing":
                described = loaded.studies[name].variants[variant].description if variant else ""
                runs.append(Run(part, variant, described, branch, case, values, _surface(plan, name, key, results)))
    return runs


def _surface(plan: Plan, name: str, key: tuple, results: Path) -> Surface | None:
    folder = results / "cases" / plan.served[name][key]
    try:
        stored = Case.from_dict(read_json(folder / "case.json")["case"])
        return surface_of(stored, results / "meshes" / f"{stored.mesh_id}.vtu", folder)
    except LimoError:
        return None


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


def gather_errors(loaded: Loaded, plan: Plan, results: Path) -> xr.Dataset:
    """One row a run of every device: its setting, errors, what it dissipated, and its cost; and the scatter of both ensembles.

    Surfaces are kept for the reference and for the last frame of each run, in steps of ``STEP``.
    """
    rows, clouds = [], []
    for device in devices(loaded):
        runs = runs_of(loaded, plan, device, results)
        reference = [run for run in runs if run.part == "reference" and run.converged]
        if len(reference) < 2:
            continue
        for part in ("reference", "scatter"):
            members = [run for run in runs if run.part == part and run.converged]
            if len(members) > 1:
                rows.append(_row(device, members[0], scatter_of(members)) | {"kind": "scatter", "branch": len(members)})
                clouds.append(None)
        for run in runs:
            others = [r for r in reference if r is not run]
            rows.append(_row(device, run, errors_of(run, others)) | {"kind": "run"})
            clouds.append(run.surface if run.part == "reference" else None)
    if not rows:
        raise ResultError(f"{results}: no device with two runs of its reference or more; snakemake --cores 2 accuracy makes them")
    names = list(rows[0])
    data = {n: ("run", np.array([row[n] for row in rows])) for n in names}
    kept = [k for k, cloud in enumerate(clouds) if cloud is not None]
    points = np.full((len(kept), CLOUD, 3), -32768, np.int16)
    for k, at in enumerate(kept):
        points[k, : len(clouds[at].cloud)] = np.round(clouds[at].cloud / STEP)
    data["cloud"] = (("member", "point", "axis"), points, {"units": "mm", "scale_factor": STEP, "_FillValue": -32768})
    data["cloud_run"] = ("member", np.array(kept), {"long_name": "run of a cloud"})
    dataset = xr.Dataset(data, attrs={"title": "errors of the settings of the device"})
    for name, text in ERRORS.items():
        dataset[f"error_{name}"].attrs = {"units": "1", "long_name": f"error: {text}"}
    return dataset


def _row(device: str, run: Run, errors: dict[str, float]) -> dict:
    values = run.values
    return {
        "device": device,
        "part": run.part,
        "setting": run.variant or run.part,
        "description": run.description,
        "branch": run.branch,
        "engine": run.case.engine,
        "level": run.case.mesh.level,
        "symmetry": run.case.mesh.symmetry,
        "element": run.case.mesh.element,
        "status": str(values.case_status.values),
        **{f"error_{name}": value for name, value in errors.items()},
        "dissipated_fraction": float(values.dissipated_fraction),
        "cpu_seconds": float(values.solver_time),
        "iterations": float(values.iterations),
        "memory_mib": float(values.solver_memory),
    }
