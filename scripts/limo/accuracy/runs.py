"""The runs from which errors of the device are taken: their values, and what of their shapes counts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr

from limo.accuracy.surfaces import Surface, surface_of
from limo.cases.case import Case, solved_on
from limo.cases.grid import study_grid
from limo.config.project import Project
from limo.datasets.gather import members
from limo.errors import LimoError
from limo.mesh.file import read_mesh
from limo.mesh.layers import degrees_of_freedom_of
from limo.store.files import read_json
from limo.store.results import CaseFiles, Results
from limo.store.statuses import CONVERGED, MISSING


@dataclass(frozen=True)
class Run:
    """One run: its study's role, variant, branch, its values in the study's dataset, and its surface where there is one.

    ``equations``: displacements of the part that was solved, and of the full device; ``times``: CPU seconds of the solver, each
    time the case was solved.
    """

    role: str
    variant: str
    description: str
    branch: int
    case: Case
    values: xr.Dataset
    surface: Surface | None
    equations: tuple[float, float] = (np.nan, np.nan)
    times: tuple[float, ...] = ()

    @property
    def converged(self) -> bool:
        """Whether its solve ended well."""
        return str(self.values.case_status.values) == CONVERGED


def read_results(project: Project, name: str, dataset: xr.Dataset, results: Results, sources: Sequence[str]) -> list[Run]:
    """The runs of a study's dataset that were solved.

    ``sources``: ids of the cases that serve the study, in the order of its grid.
    """
    grid, runs = study_grid(project, name), []
    for member in members(grid.cases, grid.axes, results.cases, sources):
        variant, branch = member.point.variant, member.point.branch
        place = {d: v for d, v in (("variant", variant), ("branch", branch)) if d in dataset.dims}
        values = dataset.sel(place).squeeze(drop=True)
        if str(values.case_status.values) != MISSING:
            timed = results.times(member.source)
            times = read_json(timed)["cpu_seconds"] if timed.exists() else [float(values.solver_time)]
            shape = _shape(results, member.files)
            runs.append(Run(*naming(project, name, variant), branch, member.case, values, *shape, tuple(times)))
    return runs


def naming(project: Project, name: str, variant: str) -> tuple[str, str, str]:
    """The role of a study, a variant of it, and that in words."""
    study = project.studies[name]
    return study.role or "", variant, study.variants[variant].description if variant else ""


def _shape(results: Results, files: CaseFiles) -> tuple[Surface | None, tuple[float, float]]:
    """Surface and numbers of displacements of a solved case; none for shells, which keep no displacements."""
    stored = Case.from_dict(read_json(files.described)["case"])
    file = results.mesh(stored.mesh_id)
    solved, mesh_file = solved_on(stored, file, files.folder)
    mesh = read_mesh(mesh_file, solved.mesh.symmetry)
    part = degrees_of_freedom_of(mesh)
    try:
        return surface_of(stored, file, files.folder), (part, part * mesh.copies)
    except LimoError:
        return None, (part, part * mesh.copies)
