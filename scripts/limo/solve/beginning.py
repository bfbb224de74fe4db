"""Where a case begins: flat, or at the state at rest that the same device has on a coarser mesh."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from limo.cases.case import Case
from limo.errors import ResultError
from limo.measure.frames import open_case
from limo.mechanics.model import Model
from limo.mechanics.transfer import carried
from limo.store.files import read_json
from limo.store.results import CaseFiles

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Beginning:
    """The state at rest of a model, displacements (n, 3) in mm, or none; and what the status says of it."""

    model: Model | None
    displacements: np.ndarray | None
    summary: dict[str, Any]

    def on(self, model: Model) -> np.ndarray | None:
        """The same state on another model; None where there is none, or that model is of another part of the device."""
        if self.model is None or self.model.mesh.symmetry != model.mesh.symmetry:
            return None
        try:
            return carried(self.model, self.displacements, model)
        except ResultError as error:
            log.warning("begun flat: %s", error)
            return None


def beginning(case: Case, files: Sequence[Path]) -> Beginning:
    """Where ``case`` begins, by the mesh, ``case.json`` and ``frames.nc`` of ``case.fit``; flat without these or without rest."""
    if not files:
        return Beginning(None, None, {})
    mesh_file, described, _ = files
    status = read_json(CaseFiles(described.parent).status)
    seconds = status.get("solver_cpu_seconds", 0.0) + status.get("fit_cpu_seconds", 0.0)
    summary = {"begun_at": case.fit.case_id, "fit_cpu_seconds": round(seconds, 2)}
    try:
        model, frames = open_case(case.fit, mesh_file, described.parent)
    except ResultError as error:
        log.warning("begun flat: %s", error)
        return Beginning(None, None, summary | {"not_begun_at": str(error)})
    return Beginning(model, frames.displacement[0].astype(float), summary)
