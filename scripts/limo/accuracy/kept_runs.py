"""Runs of a reference that are kept in the repository: written, read, and what is lacking of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import xarray as xr

from limo.accuracy.packing import _filled, packed, padded, stacked
from limo.accuracy.runs import KEPT_PARTS, PARTS, Run, _named, _runs_in
from limo.accuracy.surfaces import SECTION, Surface
from limo.cases.case import Case
from limo.cases.grid import study_cases
from limo.config.project import Loaded
from limo.datasets.study import gather_study
from limo.errors import ResultError
from limo.store.files import UNREADABLE, write_netcdf
from limo.store.machine import processor


def runs_of(loaded: Loaded, device: str, results: Path, kept: Path, sources: Mapping[str, Sequence[str]]) -> list[Run]:
    """The runs of a device: those of ``KEPT_PARTS`` that are kept in the folder ``kept``, the others as they were gathered.

    Cases that are not solved are left out. ``sources``: by study the ids of the cases that serve it, in the order of its grid.
    """
    runs = []
    for part in PARTS:
        name = f"{part}_{device}"
        if name not in sources:
            continue
        if part in KEPT_PARTS:
            runs += read_runs(loaded, name, kept_file(kept, name))
        elif any((results / "cases" / source / "status.json").exists() for source in sources[name]):
            dataset = gather_study(loaded, name, results / "cases", sources[name])
            runs += _runs_in(loaded, name, dataset, results, sources[name])
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
_SHAPES = {
    "solved_degrees_of_freedom": ("1", "displacements of the written-out bricks of the part that was solved"),
    "degrees_of_freedom": ("1", "displacements of the written-out bricks, full device"),
    "picture_pressure": ("kPa", "actuation pressure of a picture, P_a"),
    "picture_height": ("1", "largest w / L in a picture"),
    "points": ("mm", "nodes of the middle surface of the part that was solved, at P_a,max"),
    "quads": ("1", "points of an element, corners first; -1 behind the last element"),
    "mesh": ("1", "which of the meshes a run has"),
    "sections": ("mm", f"x and z of cuts through the part that was solved at y/L = {SECTION:g}"),
}


def kept_file(folder: Path, study: str) -> Path:
    """Where the runs of a study are kept."""
    return folder / f"{study}_runs.nc"


def kept_name(case: Case) -> str:
    """The name under which a run is kept: that of its case, whichever build of the engine solved it."""
    return replace(case, build="").case_id


def lacking(loaded: Loaded, name: str, folder: Path) -> list[bool]:
    """Of each case of a study, in the order of its grid, whether its run is not kept in ``folder``.

    Another mesh or other numerics are another case; another build of the engine is not.
    """
    there = set(_names_in(kept_file(folder, name)))
    return [kept_name(case) not in there for case in study_cases(loaded, name).values()]


def _names_in(file: Path) -> list[str]:
    if not file.exists():
        return []
    with _opened(file) as dataset:
        return [*map(str, dataset.kept_name.values)]


def keep_runs(loaded: Loaded, name: str, results: Path, folder: Path, sources: Sequence[str]) -> list[str]:
    """Add the runs of a study that are solved to those that are kept of it; runs that it no longer has are dropped.

    A run that is kept is not replaced: whoever wants it anew deletes the file. ``sources`` as in ``runs_of``. Returns the names
    of those that are kept now. Raises ``ResultError`` where nothing is solved.
    """
    file = kept_file(folder, name)
    runs = {kept_name(run.case): run for run in read_runs(loaded, name, file)}
    if any(lacking(loaded, name, folder)):
        machine = xr.DataArray(processor(), attrs={"long_name": "processor of the machine that solved the case"})
        dataset = gather_study(loaded, name, results / "cases", sources).assign(machine=machine)
        runs = {kept_name(run.case): run for run in _runs_in(loaded, name, dataset, results, sources)} | runs
    if not runs:
        raise ResultError(f"{results}: no case of {name} is solved; snakemake --cores 2 results/kept/{name}.txt does that")
    names = [key for key in map(kept_name, study_cases(loaded, name).values()) if key in runs]
    if names != _names_in(file):
        write_runs([runs[key] for key in names], file)
    return names


def write_runs(runs: Sequence[Run], file: Path) -> None:
    """Write runs: curves and values of their study, coordinates of shapes in steps of ``STEP``."""
    texts = {n: ("run", np.array([str(r.values[n].values) for r in runs])) for n in _TEXTS}
    parts = [r.values[[n for n in _NUMBERS if n in r.values]].reset_coords(drop=True) for r in runs]
    surfaces = [run.surface for run in runs]
    shapes = {
        "solved_degrees_of_freedom": ("run", [run.equations[0] for run in runs]),
        "degrees_of_freedom": ("run", [run.equations[1] for run in runs]),
        "picture_pressure": (("run", "picture"), padded([np.empty(0) if s is None else s.pressure for s in surfaces])),
        "picture_height": (("run", "picture"), padded([np.empty(0) if s is None else s.height for s in surfaces])),
        "points": (("run", "point", "axis"), _filled([np.empty((0, 3)) if s is None else s.points for s in surfaces], np.nan)),
    }
    quads, mesh = np.unique(
        _filled([np.empty((0, 8), int) if s is None else s.quads for s in surfaces], -1), axis=0, return_inverse=True
    )
    shapes |= {"quads": (("mesh_number", "quad", "corner"), quads), "mesh": ("run", mesh)}
    pictures = shapes["picture_pressure"][1].shape[1]
    cuts = stacked([() if s is None else s.sections for s in surfaces], pictures)
    shapes["sections"] = (("run", "picture", "segment", "end", "plane"), cuts)
    names = {"kept_name": ("run", [kept_name(run.case) for run in runs])}
    dataset = xr.concat(parts, "run").assign(names | texts | shapes)
    for name, (units, long_name) in _SHAPES.items():
        dataset[name].attrs = {"units": units, "long_name": long_name}
    for name in _TEXTS:
        dataset[name].attrs = runs[0].values[name].attrs
    dataset["kept_name"].attrs = {"long_name": "name of the case, whichever build solved it"}
    title = f"{runs[0].part}: runs that are kept because they take hours"
    write_netcdf(dataset.assign_attrs(title=title), file, packed(dataset), checked=False)


def read_runs(loaded: Loaded, name: str, file: Path) -> list[Run]:
    """The kept runs of a study that it still has, in the order of its grid; none without a file. Raises ``ResultError``."""
    if not file.exists():
        return []
    with _opened(file) as opened:
        dataset = opened.load()
    try:
        rows = {str(key): row for row, key in enumerate(dataset.kept_name.values)}
        return [
            _kept_run(_named(loaded, name, key[-2]), key[-1], case, dataset.isel(run=rows[kept_name(case)]))
            for key, case in study_cases(loaded, name).items()
            if kept_name(case) in rows
        ]
    except UNREADABLE as error:
        raise ResultError(f"{file}: not the runs of a study ({error}); without the file they are solved anew") from None


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
        row.drop_vars(["kept_name", *_SHAPES]),
        surface if known.any() else None,
        equations,
        (float(row.solver_time),),
    )


def _opened(file: Path) -> xr.Dataset:
    try:
        return xr.open_dataset(file)
    except UNREADABLE as error:
        raise ResultError(f"{file}: not the runs of a study ({error}); without the file they are solved anew") from None
