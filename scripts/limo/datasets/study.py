"""The datasets: names, dimensions, units and attributes of every stored variable, and how a study is gathered."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import xarray as xr

from limo.cases.case import Case
from limo.cases.grid import cross_checks, study_axes, study_cases
from limo.config.project import Loaded
from limo.datasets.curves import curves, efficiency_reason
from limo.datasets.measures import gather_measures
from limo.datasets.provenance import _attributes
from limo.datasets.variables import CASE_DIMS, CHECKS, CURVE_DIMS, TEXTS, VARIABLES, describe_axes, on_axes
from limo.errors import ResultError
from limo.store.files import UNREADABLE, read_json
from limo.store.statuses import USABLE


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
    return on_axes(describe_axes(dataset), study)


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
