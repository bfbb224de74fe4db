"""What an engine is to the rest of the project. ``limo.engines.<name>.engine`` is the module of one, found by ``find``.

Nobody outside of this room asks what an engine is called: what differs between engines is asked here.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Protocol, runtime_checkable

from limo.schema.solver import Solver

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy as np

    from limo.engines.load_path import LoadPath
    from limo.mechanics.model import Model
    from limo.schema.element import Element
    from limo.schema.numerics import Numerics


@dataclass(frozen=True)
class Build:
    """A build of an engine: ``id`` is a part of what determines a result, ``command`` the executable of one that has its own."""

    id: str
    command: Path | None = None


@dataclass(frozen=True)
class EngineSettings:
    """How an engine is run: threads and limits of time of ``solver``, and the executable of one that has its own."""

    solver: Solver = field(default_factory=Solver)
    command: Path | None = None


@dataclass(frozen=True)
class Place:
    """How far a run has come: its stage, P_a reached (kPa), shares of the stages that are done, and counts.

    ``written``: when its files were written last, s since 1970.
    """

    stage: str
    actuation_pressure: float
    shares: tuple[float, float, float]
    increments: int
    cutbacks: int
    iterations: int
    written: float


@dataclass(frozen=True)
class Sample:
    """What some iterations on a model took: CPU time in s without what precedes them, peak memory in MiB.

    ``reason`` says why there are none, where there are none.
    """

    build: str
    iterations: int
    cpu_seconds: float
    memory: float
    reason: str


@runtime_checkable
class Engine(Protocol):
    """A module that turns models into load paths.

    Importing one is cheap and needs none of its libraries; calling it may.
    """

    NAME: str
    #: patterns of files in its folder that are needed only until its path is closed
    LARGE_FILES: tuple[str, ...]
    #: whether layers may touch in what it solves
    CONTACT: bool
    #: whether it solves devices that only rest, without a ramp
    WITHOUT_RAMP: bool
    #: whether it drives a device by V_a, with P_a as an outcome
    SYRINGE: bool
    #: modules that it imports when it solves
    LATE: tuple[str, ...]

    def takes(self, element: Element) -> bool:
        """Whether it solves models of an element."""

    def build(self, solver: Solver, config_file: str) -> Build:
        """The build that would solve. Raises ``ConfigError`` or ``SolverNotFoundError`` where there is none."""

    def builds(self) -> dict[str, Build]:
        """The builds of this machine by name, where an engine may have several; else none."""

    def solve(
        self,
        model: Model,
        folder: Path,
        settings: EngineSettings,
        after: LoadPath | None = None,
        start: np.ndarray | None = None,
    ) -> LoadPath:
        """The load path of a model, in an empty folder. Never raises for a model that does not converge.

        ``after``: path of the same model with other limits, which an engine that can carries on. ``start`` (n, 3) in mm: a state
        with the valve fitted and P_v on, from which one that can begins instead of the flat one.
        """

    def inflate(self, model: Model, levels: Sequence[float], folder: Path, settings: EngineSettings) -> LoadPath:
        """The load path of a model without a ramp, in an empty folder.

        P_v goes to ``levels`` of it in turn and rests at the last. All of it counts as the first stage. Never raises for a
        model that does not converge.
        """

    def sample(self, model: Model, folder: Path, settings: EngineSettings) -> Sample:
        """A few iterations from the flat state, in an empty folder."""

    def progress(self, folder: Path, numerics: Numerics, actuation_pressure_max: float) -> Place | None:
        """How far the last run in the folder of a case came, by its files; None while there are none. P_a in kPa."""

    def share_done(
        self, numerics: Numerics, actuation_pressure_max: float, clock: np.ndarray, actuation_pressure: np.ndarray
    ) -> float:
        """Share (0 to 1) of a run that its increments (k,) got through: their clock in s, P_a in kPa."""
