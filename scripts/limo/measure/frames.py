"""A solved case as it lies on disk: mesh, model and displacement frames."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import xarray as xr

from limo.cases.case import Case, solved_on
from limo.errors import ResultError
from limo.measure.buckling import Event
from limo.mechanics.build import build_model
from limo.mechanics.model import Model
from limo.mesh.file import read_mesh
from limo.schema.pressures import same_pressure
from limo.store.files import UNREADABLE
from limo.store.results import CaseFiles

# --------------------------------------------------------------------------------------------------------------------
# one case


@dataclass(frozen=True)
class CaseFrames:
    """The stored displacements of a case: ``requested`` and ``pressure`` (f,) in kPa, ``displacement`` (f, n, 3) in mm.

    ``motion`` (f, 2, n, 3): velocity and acceleration in mm/s and mm/s^2 on the solver's clock. ``event_pressure`` (e, 2) in
    kPa and ``event_displacement`` (e, 2, n, 3) in mm: before and after each buckling event. Frames may come without these.
    ``damping`` (1/s) on the solver's clock is that of the attempt that made them. States along the legs of a cycle, in order:
    ``cycle_leg`` (c,), ``cycle_displacement`` (c, n, 3) in mm, ``cycle_pressures`` (c, 2), P_v and P_a in kPa.
    """

    file: Path
    requested: np.ndarray
    pressure: np.ndarray
    displacement: np.ndarray
    motion: np.ndarray | None
    event_pressure: np.ndarray
    event_displacement: np.ndarray
    damping: float = 0.0
    cycle_leg: np.ndarray = field(default_factory=lambda: np.empty(0, int))
    cycle_displacement: np.ndarray | None = None
    cycle_pressures: np.ndarray | None = None

    def find(self, requested: float) -> int | None:
        """Index of the frame kept for a pressure (kPa); None when the case did not get there."""
        return _first(same_pressure(self.requested, requested))

    def find_event(self, event: Event) -> int | None:
        """Index of a buckling event among those whose displacements are kept; None for another one."""
        return _first(same_pressure(self.event_pressure, np.array([event.before, event.after])).all(axis=1))


def _first(chosen: np.ndarray) -> int | None:
    """Index of the first that is chosen (n,); None where none is."""
    hits = np.flatnonzero(chosen)
    return int(hits[0]) if len(hits) else None


def read_frames(file: Path, n_nodes: int) -> CaseFrames:
    """Frames of a case. Raises ``ResultError`` for a file that is missing, damaged, empty or of another mesh."""
    try:
        with xr.open_dataset(file) as data:
            data = data.load()
        frames = CaseFrames(
            file,
            data.requested_pressure.values.astype(float),
            data.actuation_pressure.values.astype(float),
            data.displacement.values,
            data.motion.values if "motion" in data else None,
            data.event_pressure.values if "event_pressure" in data else np.empty((0, 2)),
            data.event_displacement.values if "event_displacement" in data else np.empty((0, 2, n_nodes, 3)),
            float(data.attrs.get("damping", 0.0)),
            *(_of_cycle(data) if "cycle_leg" in data else ()),
        )
    except UNREADABLE as error:
        raise ResultError(f"{file}: not the frames of a case ({error})") from None
    if not len(frames.pressure):
        raise ResultError(f"{file}: no frames (the case did not reach P_a = 0)")
    if frames.displacement.shape[1] != n_nodes:
        raise ResultError(f"{file}: {frames.displacement.shape[1]} nodes, the mesh has {n_nodes}")
    return frames


def _of_cycle(data: xr.Dataset) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Leg, displacements and pressures of the states along a cycle."""
    pressures = np.column_stack([data.cycle_ventricular_pressure.values, data.cycle_actuation_pressure.values])
    return data.cycle_leg.values, data.cycle_displacement.values, pressures


def open_case(case: Case, mesh_file: Path, folder: Path) -> tuple[Model, CaseFrames]:
    """Model and frames of a solved case. Raises ``ResultError`` where one cannot be used."""
    case, mesh_file = solved_on(case, mesh_file, folder)
    model, file = build_model(case, read_mesh(mesh_file, case.mesh.symmetry)), CaseFiles(folder).frames
    if model.element.is_shell:
        raise ResultError(f"{file}: element {model.element.name} keeps no displacements through the thickness")
    return model, read_frames(file, len(model.expansion.nodes))
