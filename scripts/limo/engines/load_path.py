"""What every engine returns of a model: its load path, the accepted increments in order."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from limo.schema.section import STAGES


class PathEndedError(Exception):
    """An engine's path ends here: a status and a reason."""

    def __init__(self, status: str, reason: str):
        super().__init__(reason)
        self.status, self.reason = status, reason


def _nothing() -> None:
    """Close a path that holds nothing open."""


@dataclass(frozen=True)
class LoadPath:
    """How an engine carried a model along its stages: accepted increments in order, and what they cost.

    ``status`` is ``converged``, ``diverged``, ``timed_out`` or ``crashed``, ``reason`` empty when it converged. ``stage``
    (k,) counts ``STAGES``; ``pressure`` (k,) is P_a in kPa; ``clock`` (k,) is the engine's own time in s.
    ``displacements(k)`` gives (n, 3) in mm at all nodes of the model, good to ``precision``. ``is_static``: every increment is
    an equilibrium without motion. ``iterations`` by stage contain those of ``rejected`` attempts. CPU and wall time in s,
    ``memory`` in MiB (peak); ``in_process``: spent by this process, not by one of the engine's own. ``ended_in``: the stage in
    which it ended. ``ventricular`` (k,): P_v in kPa, None where it is that of the model from the end of the fit on. ``leg``
    (k,): 0 up to the ramp's end, then the number of the point of the cycle that the load goes to, from 1; None without a cycle.
    ``interrupted``: ended by something outside of the case, such as a kill or a lack of memory or disk.

    A path may read its displacements from files that it holds open. ``close`` releases them, as the end of a ``with`` block
    does; the rest of the path stays.
    """

    status: str
    reason: str
    stage: np.ndarray
    pressure: np.ndarray
    clock: np.ndarray
    displacements: Callable[[int], np.ndarray]
    precision: str
    is_static: bool
    in_process: bool
    iterations: dict[str, int]
    rejected: int
    build: dict[str, str]
    cpu_seconds: float
    wall_seconds: float
    memory: float
    details: dict = field(default_factory=dict)
    ended_in: str = STAGES[-1]
    interrupted: bool = False
    ventricular: np.ndarray | None = None
    leg: np.ndarray | None = None
    close: Callable[[], None] = _nothing

    def __enter__(self) -> LoadPath:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def count_stages() -> dict[str, int]:
    """A counter at zero for each stage."""
    return dict.fromkeys(STAGES, 0)
