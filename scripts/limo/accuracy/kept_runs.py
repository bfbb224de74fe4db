"""Runs of a reference that are kept in the repository: written, read, and completed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import xarray as xr

from limo.accuracy.kept_names import kept_file, kept_name, lacking, names_in, unusable, without_device
from limo.accuracy.packing import filled, packed, padded, stacked
from limo.accuracy.roles import is_kept, studies_of
from limo.accuracy.runs import Run, naming, read_results
from limo.accuracy.surfaces import SECTION, Surface
from limo.cases.case import Case
from limo.cases.grid import study_cases
from limo.config.project import Project
from limo.datasets.gather import attributes
from limo.datasets.study import gather_study
from limo.errors import ResultError
from limo.store.files import UNREADABLE, write_netcdf
from limo.store.machine import processor
from limo.store.results import Results


def runs_of(project: Project, subject: str, results: Path, kept: Path, sources: Mapping[str, Sequence[str]]) -> list[Run]:
    """The runs of a subject: those of ``KEPT_ROLES`` that are kept in the folder ``kept``, the others as they were gathered.

    Cases that are not solved are left out. ``sources``: by study the ids of the cases that serve it, in the order of its grid.
    """
    folder, runs = Results(results), []
    for name in studies_of(project, subject).values():
        if name not in sources:
            continue
        if is_kept(project.studies[name]):
            runs += read_runs(project, name, kept_file(kept, name))
        elif any(folder.case(source).status.exists() for source in sources[name]):
            dataset = gather_study(project, name, folder.cases, sources[name])
            runs += read_results(project, name, dataset, folder, sources[name])
    return runs


# --------------------------------------------------------------------------------------------------------------------
# runs that are kept

#: what is kept of a run's values in its study's dataset; texts, and numbers as they are
_TEXTS = ("case_id", "case_status", "case_reason", "solver_build", "machine")


_NUMBERS = (
    "ventricle_volume",
    "actuation_volume_change",
    "stroke_volume",
    "pressure_90ml",
    "efficiency_90ml",
    "von_mises_peak",
    "fatigue_cycles_min",
    "dissipated_fraction",
    "solver_time",
    "iterations",
    "solver_memory",
)


#: what a kept file holds besides: units, meaning
_KEPT = {
    "solved_degrees_of_freedom": ("1", "displacements of the written-out bricks of the part that was solved"),
    "degrees_of_freedom": ("1", "displacements of the written-out bricks, full device"),
    "picture_pressure": ("kPa", "actuation pressure of a picture, P_a"),
    "picture_height": ("1", "largest w / L in a picture"),
    "points": ("mm", "nodes of the middle surface of the part that was solved, at P_a,max"),
    "quads": ("1", "points of an element, corners first; -1 behind the last element"),
    "mesh": ("1", "which of the meshes a run has"),
    "sections": ("mm", f"x and z of cuts through the part that was solved at y/L = {SECTION:g}"),
}


def keep_runs(project: Project, name: str, results: Path, folder: Path, sources: Sequence[str]) -> list[str]:
    """Add the runs of a study that are solved to those that are kept of it; runs that it no longer has are dropped.

    A run that is kept is not replaced: whoever wants it anew deletes the file. ``sources`` as in ``runs_of``. Returns the names
    of those that are kept now. Raises ``ResultError`` where nothing is solved.
    """
    file, solved = kept_file(folder, name), Results(results)
    runs = {kept_name(run.case): run for run in read_runs(project, name, file)}
    if any(lacking(project, name, folder)):
        machine = xr.DataArray(processor(), attrs=attributes("processor of the machine that solved the case"))
        dataset = gather_study(project, name, solved.cases, sources).assign(machine=machine)
        runs = {kept_name(run.case): run for run in read_results(project, name, dataset, solved, sources)} | runs
    if not runs:
        target = solved.kept_names(name)
        raise ResultError(f"{results}: no case of {name} is solved; snakemake --cores 2 {target} does that")
    names = [key for key in map(kept_name, study_cases(project, name).values()) if key in runs]
    if names != names_in(file):
        write_runs([runs[key] for key in names], file)
    return names


def write_runs(runs: Sequence[Run], file: Path) -> None:
    """Write runs: curves and values of their study, coordinates of shapes in steps of ``STEP``."""
    texts = {n: ("run", np.array([str(r.values[n].values) for r in runs])) for n in _TEXTS}
    parts = [r.values[[n for n in _NUMBERS if n in r.values]].reset_coords(drop=True) for r in runs]
    equations = np.array([run.equations for run in runs], float).reshape(-1, 2)
    counts = {"solved_degrees_of_freedom": ("run", equations[:, 0]), "degrees_of_freedom": ("run", equations[:, 1])}
    names = {"kept_name": ("run", [kept_name(run.case) for run in runs])}
    dataset = xr.concat(parts, "run").assign(names | texts | counts | _shapes([run.surface for run in runs]))
    for name, (units, long_name) in _KEPT.items():
        dataset[name].attrs = attributes(long_name, units)
    for name in _TEXTS:
        dataset[name].attrs = runs[0].values[name].attrs
    dataset["kept_name"].attrs = attributes("name of the case, whichever build solved it")
    title = f"{runs[0].role}: runs that are kept because they take hours"
    write_netcdf(dataset.assign_attrs(title=title), file, packed(dataset), checked=False)


def _shapes(surfaces: Sequence[Surface | None]) -> dict[str, tuple]:
    """The surfaces of runs as variables; meshes that several have are kept once."""
    pressures = padded([np.empty(0) if s is None else s.pressure for s in surfaces])
    every = filled([np.empty((0, 8), int) if s is None else s.quads for s in surfaces], -1)
    quads, mesh = np.unique(every, axis=0, return_inverse=True)
    cuts = stacked([() if s is None else s.sections for s in surfaces], pressures.shape[1])
    return {
        "picture_pressure": (("run", "picture"), pressures),
        "picture_height": (("run", "picture"), padded([np.empty(0) if s is None else s.height for s in surfaces])),
        "points": (("run", "point", "axis"), filled([np.empty((0, 3)) if s is None else s.points for s in surfaces], np.nan)),
        "quads": (("mesh_number", "quad", "corner"), quads),
        "mesh": ("run", mesh),
        "sections": (("run", "picture", "segment", "end", "plane"), cuts),
    }


def read_runs(project: Project, name: str, file: Path) -> list[Run]:
    """The kept runs of a study that it still has, in the order of its grid; none without a file. Raises ``ResultError``."""
    if not file.exists():
        return []
    try:
        dataset = xr.load_dataset(file)
        rows = {without_device(str(key)): row for row, key in enumerate(dataset.kept_name.values)}
        return [
            _kept_run(naming(project, name, point.variant), point.branch, case, dataset.isel(run=rows[kept_name(case)]))
            for point, case in study_cases(project, name).items()
            if kept_name(case) in rows
        ]
    except UNREADABLE as error:
        raise unusable(file, error) from None


def _kept_run(named: tuple[str, str, str], branch: int, case: Case, row: xr.Dataset) -> Run:
    known = np.isfinite(row.picture_pressure.values)
    cuts = [cut[np.isfinite(cut).all(axis=(1, 2))] for cut in row.sections.values[known]]
    points, quads = row.points.values, row.quads.values[int(row.mesh)]
    surface = Surface(
        row.picture_pressure.values[known],
        row.picture_height.values[known],
        points[np.isfinite(points).all(axis=1)].astype(float),
        quads[quads[:, 0] >= 0],
        case.mesh.symmetry,
        tuple(cuts),
    )
    equations = float(row.solved_degrees_of_freedom), float(row.degrees_of_freedom)
    return Run(
        *named,
        branch,
        case,
        row.drop_vars(["kept_name", *_KEPT]),
        surface if known.any() else None,
        equations,
        (float(row.solver_time),),
    )
