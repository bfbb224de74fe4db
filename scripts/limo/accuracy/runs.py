"""The runs from which errors of the device are taken: where they come from, what of their shapes counts, and which are kept.

A device has these studies: ``accuracy_<device>`` varies one setting at a time, ``reference_<device>`` is an ensemble on the
finest mesh, ``referee_<device>`` what CalculiX itself finds on a fine one, ``scatter_<device>`` an ensemble on the default mesh;
``shells_<device>`` adds elements of which only volumes are known. Runs of ``KEPT_PARTS`` take hours: they are solved once, and
kept.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr

from limo.accuracy.surfaces import Surface, surface_of
from limo.cases.case import Case, solved_on
from limo.cases.grid import study_cases
from limo.config.project import Loaded
from limo.errors import LimoError
from limo.mesh.file import read_mesh
from limo.mesh.layers import degrees_of_freedom_of
from limo.store.files import read_json

PARTS = ("accuracy", "reference", "referee", "scatter", "shells")
KEPT_PARTS = ("reference", "referee")
#: parts of which short runs are timed several times
TIMED_PARTS = ("accuracy", "shells")


# --------------------------------------------------------------------------------------------------------------------
# the runs of a device


@dataclass(frozen=True)
class Run:
    """One run: study's part, variant, branch, its values in the study's dataset, and its surface where there is one.

    ``equations``: displacements of the part that was solved, and of the full device; ``times``: CPU seconds of the solver, each
    time the case was solved.
    """

    part: str
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
        return str(self.values.case_status.values) == "converged"


def devices(loaded: Loaded) -> list[str]:
    """Names of the devices for which there is a reference, as in ``reference_<device>``."""
    return [name.partition("_")[2] for name in loaded.studies if name.startswith("reference_")]


def error_studies(loaded: Loaded) -> list[str]:
    """Studies of all devices from which errors are gathered."""
    names = (f"{part}_{device}" for device in devices(loaded) for part in PARTS)
    return [name for name in names if name in loaded.studies]


def _runs_in(loaded: Loaded, name: str, dataset: xr.Dataset, results: Path, sources: Sequence[str]) -> list[Run]:
    """The runs of a study's dataset that were solved."""
    runs = []
    for (key, case), source in zip(study_cases(loaded, name).items(), sources, strict=True):
        variant, branch = key[-2:]
        at = {d: v for d, v in (("variant", variant), ("branch", branch)) if d in dataset.dims}
        values = dataset.sel(at).squeeze(drop=True)
        if str(values.case_status.values) != "missing":
            timed = results / "times" / f"{source}.json"
            times = read_json(timed)["cpu_seconds"] if timed.exists() else [float(values.solver_time)]
            runs.append(Run(*_named(loaded, name, variant), branch, case, values, *_shape(results, source), tuple(times)))
    return runs


def _named(loaded: Loaded, name: str, variant: str) -> tuple[str, str, str]:
    """What a study is for, a variant of it, and that in words."""
    return name.partition("_")[0], variant, loaded.studies[name].variants[variant].description if variant else ""


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
