"""The datasets: names, dimensions, units and attributes of every stored variable, and how a study is gathered."""

from __future__ import annotations

import json
import platform
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import numpy as np
import xarray as xr

from limo import __version__
from limo.case import Case, cross_checks, study_axes, study_cases
from limo.config import Loaded, Study
from limo.efficiency import efficiency_at_stroke, io_ratio
from limo.errors import ResultError
from limo.files import CONVENTIONS, UNREADABLE, read_json
from limo.judge import USABLE
from limo.measures import gather_measures
from limo.solution import ramp_of

STROKE_FOR_EFFICIENCY = 90.0  # ml, physiological stroke volume (paper, Afterload sensitivity)
PAPER = "Lauber, Arfaee, Peirlinck: The mechanics of the Less In More Out artificial heart"
STATUSES = ("converged", "degraded", "diverged", "timed_out", "crashed", "missing")
CASE_DIMS = ("n_pouches", "ventricular_pressure", "aspect_ratio", "stiffness_ratio", "width_scale", "variant", "branch")
CURVE_DIMS = (*CASE_DIMS, "actuation_pressure")


@dataclass(frozen=True)
class Variable:
    """What is stored under a name: ``dims`` are those of a case or of a curve."""

    dims: tuple[str, ...]
    units: str
    long_name: str


VARIABLES = {
    "ventricle_volume": Variable(CURVE_DIMS, "ml", "ventricle volume, V_v"),
    "actuation_volume": Variable(CURVE_DIMS, "ml", "total pouch volume, V_a"),
    "actuation_volume_change": Variable(CURVE_DIMS, "ml", "pouch volume since P_a = 0, Delta V_a"),
    "stroke_volume": Variable(CURVE_DIMS, "ml", "fluid that left the ventricle since P_a = 0, Delta V_v"),
    "io_ratio": Variable(CURVE_DIMS, "1", "input-output ratio, Delta V_v / Delta V_a"),
    "efficiency_90ml": Variable(CASE_DIMS, "1", "mechanical efficiency at a stroke of 90 ml, eta"),
    "pressure_90ml": Variable(CASE_DIMS, "kPa", "actuation pressure at a stroke of 90 ml"),
    "dissipated_fraction": Variable(CASE_DIMS, "1", "share of the actuation work over the ramp that damping took"),
    "rest_change": Variable(CASE_DIMS, "1", "relative change of V_v over the last part of the hold"),
    "actuation_pressure_reached": Variable(CASE_DIMS, "kPa", "highest actuation pressure of an accepted increment"),
    "solver_time": Variable(CASE_DIMS, "s", "CPU time of the solver"),
    "python_time": Variable(CASE_DIMS, "s", "CPU time of deck, volumes and files"),
    "iterations": Variable(CASE_DIMS, "1", "Newton iterations, rejected attempts included"),
    "solver_memory": Variable(CASE_DIMS, "MiB", "peak resident memory of the solver"),
}
TEXTS = {
    "case_id": "name of the case that these results are from",
    "case_status": "how the solve ended, as far as the study's P_a,max",
    "case_reason": "why the case did not converge, or what is doubtful about it",
    "efficiency_90ml_reason": "why there is no efficiency at a stroke of 90 ml",
    "solver_build": "which executable or library solved the case",
}
CHECKS = {
    "check_stroke_volume": Variable(CURVE_DIMS, "ml", "stroke volume of the other engine"),
    "check_stroke_difference": Variable(
        CASE_DIMS, "1", "relative L2 difference of the stroke to the other engine's over the ramp"
    ),
    "check_rest_difference": Variable(CASE_DIMS, "1", "relative difference of V_v at P_a = 0 to the other engine's"),
}
COORDINATES = {
    "n_pouches": ("1", "number of pouches, N_p"),
    "ventricular_pressure": ("kPa", "ventricular pressure, P_v"),
    "aspect_ratio": ("1", "aspect ratio of the valve support, AR"),
    "stiffness_ratio": ("1", "endocardial over fabric modulus, E_hat"),
    "width_scale": ("1", "scale of the device's widths"),
    "variant": ("", "variant of everything else, as the study names it"),
    "branch": ("1", "0 for the flat state as it is, else the seed of a tiny perturbation of it"),
    "actuation_pressure": ("kPa", "actuation pressure, P_a"),
}


def curves(
    history: xr.Dataset, ventricular_pressure: float, pressures: np.ndarray, maximum: float = np.inf
) -> dict[str, np.ndarray]:
    """A case's curves at ``pressures`` (n,) in kPa, NaN beyond what it reached, and its values at a stroke of 90 ml.

    What lies beyond ``maximum`` (kPa) does not count: the case may have gone further for another study. Raises nothing for
    a case without a ramp: everything is NaN then.
    """
    ramp = ramp_of(history)
    result = {n: np.full(len(pressures), np.nan) for n, v in VARIABLES.items() if v.dims == CURVE_DIMS}
    result |= {"efficiency_90ml": np.nan, "pressure_90ml": np.nan}
    if not ramp.sizes["increment"]:
        return result
    pressure = ramp.actuation_pressure.values
    ventricle, actuation = ramp.ventricle_volume.values, ramp.actuation_volume.values
    if pressure[-1] > maximum:
        ends = np.append(pressure[pressure < maximum], maximum)
        ventricle, actuation = (np.interp(ends, pressure, values) for values in (ventricle, actuation))
        pressure = ends
    stroke, change = ventricle[0] - ventricle, actuation - actuation[0]
    at = {
        "ventricle_volume": ventricle,
        "actuation_volume": actuation,
        "stroke_volume": stroke,
        "actuation_volume_change": change,
    }
    # the solver's clock is rounded: an end a hair short of a wanted pressure is that pressure
    pressures = np.where(np.isclose(pressures, pressure[-1], rtol=1e-6, atol=1e-6), pressure[-1], pressures)
    for name, values in at.items():
        result[name] = np.interp(pressures, pressure, values, right=np.nan)
    result["io_ratio"] = io_ratio(result["stroke_volume"], result["actuation_volume_change"])
    eta, reached = efficiency_at_stroke(pressure, ventricular_pressure, stroke, change, STROKE_FOR_EFFICIENCY)
    return result | {"efficiency_90ml": eta, "pressure_90ml": reached}


def efficiency_reason(case_status: str, stroke: np.ndarray) -> str:
    """Why there is no efficiency at 90 ml, or ""."""
    if not np.isfinite(stroke).any():
        return f"no ramp ({case_status})"
    if np.nanmax(stroke) < STROKE_FOR_EFFICIENCY:
        return f"largest stroke {np.nanmax(stroke):.1f} ml"
    return ""


def gather_study(loaded: Loaded, name: str, case_folder: Path, sources: Sequence[str] | None = None) -> xr.Dataset:
    """One dataset of a study from the results of its cases below ``case_folder``.

    ``sources``: ids of the cases that serve the study, in the order of its grid, and of those that it is compared with
    (default: its own cases). A case that failed leaves gaps and its status; one whose files cannot be read counts as
    ``missing``.
    """
    study, cases, twins = loaded.studies[name], study_cases(loaded, name), cross_checks(loaded, name)
    sources = sources or [case.case_id for case in (*cases.values(), *twins.values())]
    source = dict(zip(cases, sources[: len(cases)], strict=True))
    twin_source = dict(zip(twins, sources[len(cases) :], strict=True))
    highest = max(case.actuation_pressure_max for case in cases.values())
    pressures = np.unique(
        np.append(np.arange(0.0, highest, study.pressure_step), sorted({c.actuation_pressure_max for c in cases.values()}))
    )
    coords = study_axes(loaded, name)
    shape = tuple(len(v) for v in coords.values())
    data = {n: np.full(shape + ((len(pressures),) if v.dims == CURVE_DIMS else ()), np.nan) for n, v in VARIABLES.items()}
    text = {n: np.full(shape, "", dtype=object) for n in TEXTS}
    for key, case in cases.items():
        index = tuple(coords[d].index(k) for d, k in zip(CASE_DIMS, key, strict=True))
        status, values = _read_case(case, case_folder / source[key], pressures)
        for variable, value in values.items():
            data[variable][index] = value
        beyond = pressures > case.actuation_pressure_max + 1e-9
        for variable, definition in VARIABLES.items():
            if definition.dims == CURVE_DIMS:
                data[variable][index][beyond] = np.nan
        text["case_id"][index] = source[key]
        text["case_status"][index] = status["status"]
        text["case_reason"][index] = status["reason"]
        text["efficiency_90ml_reason"][index] = efficiency_reason(status["status"], data["stroke_volume"][index])
        build = status.get("solver", {})
        text["solver_build"][index] = " ".join(build[k] for k in ("version", "sha256", "build") if k in build)
    dataset = xr.Dataset(
        {
            n: (VARIABLES[n].dims, values, {"units": VARIABLES[n].units, "long_name": VARIABLES[n].long_name})
            for n, values in data.items()
        }
        | {n: (CASE_DIMS, values.astype(str), {"long_name": TEXTS[n]}) for n, values in text.items()},
        coords=coords | {"actuation_pressure": pressures},
        attrs=_attributes(loaded, name),
    )
    if twins:
        dataset = dataset.merge(_gather_checks(dataset, twins, twin_source, case_folder))
    if study.measures:
        measured = gather_measures(loaded, name, cases, coords, case_folder, source)
        dataset = dataset.merge(measured).assign_attrs(measured.attrs)
    if study.measured is not None:
        from limo.bench.compare import with_comparison  # it knows datasets itself

        dataset = with_comparison(dataset, loaded, name)
    return on_axes(describe_axes(dataset), study)


def at_end(curve: xr.DataArray) -> xr.DataArray:
    """The last value that each case has of a curve (..., actuation_pressure), its dimension dropped; NaN where there is none."""
    last = curve.notnull().cumsum("actuation_pressure").argmax("actuation_pressure")
    return curve.isel(actuation_pressure=last)


def absent(dataset: xr.Dataset) -> xr.DataArray:
    """Which cases of a study's dataset are not solved, or not measured where the study wants that."""
    solved = dataset.case_status != "missing"
    return ~solved if "measure_status" not in dataset else ~solved | (dataset.measure_status == "missing")


def completed(dataset: xr.Dataset, earlier: xr.Dataset) -> xr.Dataset:
    """A study's dataset in which the cases that are absent are those of an earlier one, where it has them.

    Raises ``ValueError`` where that has another configuration: its cases are others then.
    """
    if dataset.attrs["config"] != earlier.attrs["config"]:
        raise ValueError("gathered with another configuration")
    taken = absent(dataset) & ~absent(earlier)
    filled = {
        name: earlier[name].where(taken, values).assign_attrs(values.attrs)
        for name, values in dataset.data_vars.items()
        if name in earlier and set(taken.dims) <= set(values.dims)
    }
    return dataset.assign(filled)


def describe_axes(dataset: xr.Dataset) -> xr.Dataset:
    """The same with units and names on the axes of a grid of cases and of curves."""
    for coordinate in (c for c in COORDINATES if c in dataset.coords):
        units, long_name = COORDINATES[coordinate]
        dataset[coordinate].attrs = {"long_name": long_name} | ({"units": units} if units else {})
    return dataset


def on_axes(dataset: xr.Dataset, study: Study) -> xr.Dataset:
    """The same without the dimensions ``width_scale``, ``variant`` and ``branch`` where the study does not vary them."""
    fixed = {"width_scale": study.axes.width_scale is None, "variant": not study.variants, "branch": dataset.sizes["branch"] == 1}
    dataset = dataset.isel({dim: 0 for dim, one in fixed.items() if one})
    return dataset if study.variants else dataset.drop_vars("variant")


def _gather_checks(dataset: xr.Dataset, twins: dict[tuple, Case], source: dict[tuple, str], case_folder: Path) -> xr.Dataset:
    """The strokes of the other engine at their places in a study, and how far the study's own are from them."""
    shape = dataset.case_status.shape
    pressures = dataset.actuation_pressure.values
    data = {n: np.full(shape + ((len(pressures),) if v.dims == CURVE_DIMS else ()), np.nan) for n, v in CHECKS.items()}
    status = np.full(shape, "", object)
    for key, twin in twins.items():
        index = tuple(list(dataset[d].values).index(k) for d, k in zip(CASE_DIMS, key, strict=True))
        state, values = _read_case(twin, case_folder / source[key], pressures)
        status[index] = f"{twin.engine} {state['status']}"
        if not values:
            continue
        own, other = dataset.stroke_volume.values[index], values["stroke_volume"]
        both = np.isfinite(own) & np.isfinite(other)
        data["check_stroke_volume"][index] = other
        if both.any() and np.linalg.norm(other[both]) > 0:
            data["check_stroke_difference"][index] = np.linalg.norm((own - other)[both]) / np.linalg.norm(other[both])
            data["check_rest_difference"][index] = dataset.ventricle_volume.values[index][0] / values["ventricle_volume"][0] - 1.0
    variables = {n: (v.dims, data[n], {"units": v.units, "long_name": v.long_name}) for n, v in CHECKS.items()}
    variables["check_status"] = (CASE_DIMS, status.astype(str), {"long_name": "the other engine and how it ended"})
    return xr.Dataset(variables, coords=dataset.coords)


def _read_case(case: Case, folder: Path, pressures: np.ndarray) -> tuple[dict, dict]:
    """Status and values of one case as far as its own P_a,max; an unreadable result is a status, not an error.

    A case that went further and failed there has converged as far as this study is concerned.
    """
    if not (folder / "status.json").exists():
        return {"status": "missing", "reason": "not solved"}, {}
    try:
        status = read_json(folder / "status.json")
        with xr.open_dataset(folder / "volumes.nc") as history:
            values = curves(history.load(), case.ventricular_pressure, pressures, case.actuation_pressure_max)
    except (ResultError, *UNREADABLE) as error:
        return {"status": "missing", "reason": str(error)}, {}
    missing, reached = float("nan"), status.get("actuation_pressure_reached")
    if reached is not None and reached > case.actuation_pressure_max:
        reached = case.actuation_pressure_max
        if status["status"] not in USABLE:
            status = status | {"status": "converged", "reason": ""}
    values |= {
        "dissipated_fraction": status.get("dissipated_fraction"),
        "rest_change": status.get("rest_change"),
        "actuation_pressure_reached": reached,
        "solver_time": status.get("solver_cpu_seconds"),
        "python_time": status.get("python_cpu_seconds"),
        "iterations": status.get("iterations"),
        "solver_memory": status.get("solver_memory_mib"),
    }
    return status, {k: missing if v is None else v for k, v in values.items()}


def _attributes(loaded: Loaded, name: str) -> dict[str, str]:
    study = loaded.studies[name]
    return {
        "title": f"{name}: {study.description}" if study.description else name,
        "Conventions": CONVENTIONS,
        "references": PAPER,
        "source": f"displacements of a Less In More Out device by the engine {' and '.join(loaded.engines_of(study))}",
        "study": name,
        "config": json.dumps(loaded.content(name), sort_keys=True),
        "versions": json.dumps(_versions(), sort_keys=True),
        "git_commit": git_commit(),
    }


def _versions() -> dict[str, str]:
    found = {"limo": __version__, "python": platform.python_version()}
    for package in ("gmsh", "meshio", "netCDF4", "numpy", "scipy", "snakemake", "xarray"):
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = "absent"
    return found


def git_commit() -> str:
    """The commit of the project, with ``+`` when files differ from it; ``unknown`` outside a checkout."""
    root = Path(__file__).parents[2]
    try:
        commit = subprocess.run(
            ["git", "-C", root, "rev-parse", "HEAD"], capture_output=True, text=True, check=True
        ).stdout.strip()
        changed = subprocess.run(["git", "-C", root, "status", "--porcelain"], capture_output=True, text=True, check=True).stdout
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
    return commit + ("+" if changed.strip() else "")
