"""How a study is gathered: one dataset from the results of its cases."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import xarray as xr

from limo.bench.compare import with_comparison
from limo.cases.case import Case
from limo.cases.grid import StudyGrid, study_grid
from limo.config.project import Project
from limo.datasets.curves import curves, efficiency_reason
from limo.datasets.cycles import gather_cycles
from limo.datasets.gather import GridArrays, Member, members
from limo.datasets.measures import gather_measures
from limo.datasets.provenance import study_attributes
from limo.datasets.variables import CHECKS, CURVE_DIMS, TEXTS, VARIABLES, Variable, describe_axes, on_axes
from limo.errors import ResultError
from limo.measure.states import REMARKS_APART, state_variables
from limo.schema.pressures import is_beyond
from limo.store.files import UNREADABLE, read_json
from limo.store.results import CaseFiles
from limo.store.statuses import CONVERGED, MISSING, SolveStatus


def gather_study(project: Project, name: str, case_folder: Path, sources: Sequence[str] | None = None) -> xr.Dataset:
    """One dataset of a study from the results of its cases below ``case_folder``.

    ``sources``: ids of the cases that serve the study, in the order of its grid, and of those that it is compared with
    (default: its own cases). A case that failed leaves gaps and its status; one whose files cannot be read counts as
    ``missing``.
    """
    grid = study_grid(project, name)
    sources = sources or [case.case_id for case in (*grid.cases.values(), *grid.cross_checks.values())]
    own_sources, others = list(sources[: len(grid.cases)]), list(sources[len(grid.cases) :])
    pressures = _pressures(grid)
    arrays = GridArrays(grid.axes)
    for variable, definition in VARIABLES.items():
        _add(arrays, variable, definition, len(pressures))
    for text, long_name in TEXTS.items():
        arrays.add(text, "", long_name)
    for member in members(grid.cases, arrays.axes, case_folder, own_sources):
        _fill(arrays, member, pressures)
    dataset = arrays.dataset({"actuation_pressure": pressures}).assign_attrs(study_attributes(project, name))
    dataset = dataset.merge(state_variables(dataset))
    if grid.cross_checks:
        dataset = dataset.merge(_gather_checks(dataset, grid, others, case_folder))
    if grid.study.has_legs:
        dataset = dataset.merge(gather_cycles(grid.cases, grid.axes, case_folder, own_sources, pressures))
    if grid.study.measures:
        measured = gather_measures(project, name, case_folder, own_sources)
        dataset = dataset.merge(measured).assign_attrs(measured.attrs)
    dataset = with_comparison(dataset, project, name)
    return on_axes(describe_axes(dataset), grid.study)


def _pressures(grid: StudyGrid) -> np.ndarray:
    """The pressures (n,) in kPa of a study's curves: equal steps, and where its cases end."""
    ends = sorted({case.actuation_pressure_max for case in grid.cases.values()})
    return np.unique(np.append(np.arange(0.0, ends[-1], grid.study.pressure_step), ends))


def _add(arrays: GridArrays, name: str, variable: Variable, count: int) -> None:
    """A variable of a case, or of a curve of ``count`` pressures."""
    further = {"actuation_pressure": count} if variable.dims == CURVE_DIMS else {}
    arrays.add(name, np.nan, variable.long_name, variable.units, further)


def _fill(arrays: GridArrays, member: Member, pressures: np.ndarray) -> None:
    """Put what one case gave into its place."""
    index, case = member.index, member.case
    status, values = read_case(case, member.files, pressures)
    for variable, value in values.items():
        arrays[variable][index] = value
    beyond = is_beyond(pressures, case.actuation_pressure_max)
    for variable, definition in VARIABLES.items():
        if definition.dims == CURVE_DIMS:
            arrays[variable][index][beyond] = np.nan
    arrays["case_id"][index] = member.source
    arrays["case_status"][index], arrays["case_reason"][index] = status.status, status.reason
    arrays["case_remarks"][index] = REMARKS_APART.join(status.remarks)
    arrays["efficiency_90ml_reason"][index] = efficiency_reason(status.status, arrays["stroke_volume"][index])
    arrays["solver_build"][index] = " ".join(status.solver[k] for k in ("version", "sha256", "build") if k in status.solver)


def _gather_checks(dataset: xr.Dataset, grid: StudyGrid, sources: Sequence[str], case_folder: Path) -> xr.Dataset:
    """The strokes of the other engine at their places in a study, and how far the study's own are from them."""
    pressures = dataset.actuation_pressure.values
    arrays = GridArrays(grid.axes)
    for name, definition in CHECKS.items():
        _add(arrays, name, definition, len(pressures))
    arrays.add("check_status", "", "the other engine and how it ended")
    for member in members(grid.cross_checks, arrays.axes, case_folder, sources):
        index = member.index
        status, values = read_case(member.case, member.files, pressures)
        arrays["check_status"][index] = f"{member.case.engine} {status.status}"
        if values:
            stroke, rest = dataset.stroke_volume.values[index], dataset.ventricle_volume.values[index][0]
            arrays["check_stroke_volume"][index] = values["stroke_volume"]
            differences = _differences(stroke, rest, values)
            arrays["check_stroke_difference"][index], arrays["check_rest_difference"][index] = differences
            own, other = dataset.potential_energy.values[index][0], values["potential_energy"][0]
            arrays["check_energy_difference"][index] = (own - other) / abs(other)
    return arrays.dataset({"actuation_pressure": dataset.actuation_pressure})


def _differences(stroke: np.ndarray, rest: float, other: dict[str, np.ndarray]) -> tuple[float, float]:
    """How far a stroke (ml) and a volume at rest (ml) are from the other engine's, relative to these; NaN without a stroke."""
    expected = other["stroke_volume"]
    both = np.isfinite(stroke) & np.isfinite(expected)
    if not (both.any() and np.linalg.norm(expected[both]) > 0):
        return np.nan, np.nan
    difference = np.linalg.norm((stroke - expected)[both]) / np.linalg.norm(expected[both])
    return difference, rest / other["ventricle_volume"][0] - 1.0


def read_case(case: Case, files: CaseFiles, pressures: np.ndarray) -> tuple[SolveStatus, dict[str, float | np.ndarray]]:
    """Status and values of one case as far as its own P_a,max; an unreadable result is a status, not an error.

    A case that went further and failed there has converged as far as this study is concerned.
    """
    if not files.status.exists():
        return SolveStatus(status=MISSING, reason="not solved"), {}
    try:
        status = SolveStatus.from_json(read_json(files.status), files.status)
        with xr.open_dataset(files.volumes) as history:
            values = curves(history.load(), case.ventricular_pressure, pressures, case.actuation_pressure_max)
    except (ResultError, *UNREADABLE) as error:
        return SolveStatus(status=MISSING, reason=str(error)), {}
    reached = status.actuation_pressure_reached
    if reached is not None and reached > case.actuation_pressure_max:
        reached = case.actuation_pressure_max
        if not status.is_usable:
            status = status.model_copy(update={"status": CONVERGED, "reason": ""})
    values |= {
        "dissipated_fraction": status.dissipated_fraction,
        "rest_change": status.rest_change,
        "actuation_pressure_reached": reached,
        "solver_time": None if status.solver_cpu_seconds is None else status.fit_cpu_seconds + status.solver_cpu_seconds,
        "python_time": status.python_cpu_seconds,
        "iterations": status.iterations,
        "solver_memory": status.solver_memory_mib,
    }
    return status, {k: np.nan if v is None else v for k, v in values.items()}
