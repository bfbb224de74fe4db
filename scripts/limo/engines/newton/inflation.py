"""A model without a ramp, brought to rest at levels of its pressure in turn by the engine newton."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from limo.engines.load_path import LoadPath
from limo.engines.newton import iteration
from limo.mechanics.model import Model
from limo.schema.solver import Solver


def inflate(model: Model, levels: Sequence[float], solver: Solver) -> LoadPath:
    """The equilibria at ``levels`` times P_v: the first one found from the flat state, each other from the one before.

    It ends at the first level that is not reached.
    """
    paths: list[LoadPath] = []
    kept: list[np.ndarray] = []
    for level in levels:
        pressed = replace(model.loading, ventricular_pressure=level * model.loading.ventricular_pressure)
        path = iteration.solve(replace(model, loading=pressed), solver, start=kept[-1] if kept else None)
        paths.append(path)
        kept += [path.displacements(k) for k in range(len(path.stage))]
        if path.status != "converged":
            break
    return replace(
        paths[-1],
        stage=np.zeros(len(kept), int),
        pressure=np.zeros(len(kept)),
        clock=np.arange(1, len(kept) + 1, dtype=float),
        displacements=kept.__getitem__,
        iterations={stage: sum(path.iterations[stage] for path in paths) for stage in paths[-1].iterations},
        rejected=sum(path.rejected for path in paths),
        cpu_seconds=sum(path.cpu_seconds for path in paths),
        wall_seconds=sum(path.wall_seconds for path in paths),
    )
