"""The words for how something ended, and what ``status.json`` says of a solve."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from limo.errors import ResultError

CONVERGED, DEGRADED, DIVERGED, TIMED_OUT, CRASHED = "converged", "degraded", "diverged", "timed_out", "crashed"
#: how a solve may end, and of these the results that a study uses
ENDED = (CONVERGED, DEGRADED, DIVERGED, TIMED_OUT, CRASHED)
USABLE = (CONVERGED, DEGRADED)
#: of a case in a dataset without results that can be read
MISSING = "missing"
#: of a case in a sweep that has not ended: no process is solving a stale one, though it was begun; a cluster has a queued one
RUNNING, WAITING, STALE, QUEUED = "running", "waiting", "stale", "queued"
#: of what is measured of a solved case, or of a size
MEASURED, NOT_MEASURED = "measured", "failed"


Count = Annotated[int, Field(ge=0, le=2**53)]


class _Plain(BaseModel):
    """Plain data of known types; what it does not name is kept."""

    model_config = ConfigDict(frozen=True, strict=True, extra="allow")


class AttemptStatus(_Plain):
    """One attempt of a solve: with which rung of the recovery ladder, how it ended, what it reached (kPa) and took (s)."""

    status: str
    rung: str = ""
    reason: str = ""
    ended_in: str = ""
    elements: Count | None = None
    actuation_pressure_reached: float | None = None
    iterations: Count | None = None
    solver_cpu_seconds: float | None = None
    solver_wall_seconds: float | None = None


class SolveStatus(_Plain):
    """How a solve ended: what ``status.json`` holds.

    ``status`` is one of ``ENDED``; pressures in kPa, times in s, memory in MiB. ``fit_cpu_seconds`` were spent on coarser meshes
    for the state at which it began. ``attempts``: all climbs of the ladder.
    ``remarks``: what is not physical or coarse about a usable result, ``what: details`` each.
    ``recovery``: what the solve is called (``Plan.recovery_of``). ``interrupted``: something outside broke it off.
    ``files``: stamps of what it wrote. None and empty stand for what an older or fabricated status does not say.
    """

    status: str
    reason: str = ""
    remarks: list[str] = []
    case: str = ""
    engine: str = ""
    actuation_pressure_reached: float | None = None
    increments: Count | None = None
    rejected_attempts: Count | None = None
    iterations: Count | None = None
    iterations_by_stage: dict[str, Count] = {}
    degrees_of_freedom: Count | None = None
    elements: Count | None = None
    rest_change: float | None = None
    rested: bool | None = None
    dissipated_fraction: float | None = None
    checks: dict[str, Any] = {}
    limits: dict[str, float] = {}
    solver: dict[str, Any] = {}
    threads: Count | None = None
    solver_cpu_seconds: float | None = None
    fit_cpu_seconds: float = 0.0
    solver_wall_seconds: float | None = None
    solver_memory_mib: float | None = None
    python_cpu_seconds: float | None = None
    attempts: list[AttemptStatus] = []
    recovery: str = ""
    interrupted: bool = False
    files: dict[str, dict[str, Any]] = {}

    @classmethod
    def from_json(cls, data: dict[str, Any], source: object = "status.json") -> SolveStatus:
        """The status that plain data describe. Raises ``ResultError``, which names the ``source``, for data that are none."""
        try:
            return cls.model_validate(data)
        except ValidationError as error:
            first = error.errors()[0]
            key = ".".join(map(str, first["loc"]))
            raise ResultError(f"{source}: {key}: {first['msg']}; no status of a solve") from None

    def to_json(self) -> dict[str, Any]:
        """Plain data from which ``from_json`` makes the same again."""
        return self.model_dump(exclude_unset=True)

    @property
    def is_usable(self) -> bool:
        """Whether studies use the result."""
        return self.status in USABLE

    @property
    def first_status(self) -> str:
        """How the first attempt ended, before any recovery."""
        return self.attempts[0].status if self.attempts else self.status

    @property
    def reached(self) -> float:
        """Highest P_a (kPa) of an accepted increment; without end for a result that studies use."""
        return float("inf") if self.is_usable else self.actuation_pressure_reached or 0.0
