"""Where the cases of a sweep are, read from their files: while it runs, when it is done, and when it was killed.

A case is ``waiting``; ``queued`` on a cluster; ``running``, which a lock or the cluster tells; ``stale`` when it was begun, has
no result and nobody solves it; or it has ended as ``converged``, ``degraded``, ``diverged``, ``timed_out`` or
``crashed``. Files that another process is just writing count as far as they can be read.
"""

from __future__ import annotations

import re
import time
from collections import Counter
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from limo.cases.case import Case
from limo.cases.cost import predict, schedule, seconds_left, share_done
from limo.cases.plan import Plan, make_plan
from limo.cases.solved import Solved, holds, is_sound
from limo.cluster import slurm
from limo.cluster.handed import was_handed
from limo.config.builds import open_project
from limo.config.project import Project
from limo.engines.engine import Place
from limo.engines.find import find_engine
from limo.errors import ClusterError, ResultError
from limo.schema.section import STAGES
from limo.store.files import read_json
from limo.store.progress import solving_since
from limo.store.results import CaseFiles, Results
from limo.store.statuses import CRASHED, ENDED, QUEUED, RUNNING, STALE, USABLE, WAITING, SolveStatus

FAILED = (*(word for word in ENDED if word not in USABLE), STALE)
STATUSES = (RUNNING, QUEUED, WAITING, STALE, *ENDED)
ASK_EVERY = 5.0  # s between two questions to a cluster, which all its users ask
RECENT = 120.0  # s within which files must have grown for a case to run where the file system knows no locks
#: what a name begins with before its numbers
DEVICE = re.compile(r"^\w+?_(?=np\d+_pv)")


@dataclass(frozen=True)
class CaseStatus:
    """Where a case is. Pressures in kPa; times in s, of the wall clock; None for what is not known or does not apply.

    ``variant``: variant and branch of the study that wants it, which its name has as a hash only.
    """

    case: str
    status: str
    reason: str = ""
    stage: str = ""
    actuation_pressure: float | None = None
    actuation_pressure_max: float | None = None
    increments: int | None = None
    cutbacks: int | None = None
    iterations: int | None = None
    iterations_per_second: float | None = None
    seconds: float | None = None
    seconds_left: float | None = None
    variant: str = ""


class Sweep:
    """The cases that some studies of a configuration want, and where they are at the moment of each ``look``."""

    def __init__(self, loaded: Project, plan: Plan, studies: Sequence[str], results: Path, cores: int):
        self.loaded, self.plan, self.results = loaded, plan, Results(results)
        self.workers = max(cores // loaded.config.solver.threads, 1)
        wanted = dict.fromkeys(n for study in studies for n in (*plan.of_study(study), *plan.checks_of_study(study)))
        self.named = list(wanted)
        self.variants = _variants(plan, studies)
        others = [n for n in plan.cases if n not in wanted]
        self.others = [] if set(studies) == set(loaded.studies) else others
        every = list(plan.cases)
        self.cluster = ""  # why a cluster that is here does not answer
        self._asked, self._known = -ASK_EVERY, {}
        # a moment ago, so the first look need not read all files again
        self._read = {name: solved for name, solved in plan.solved.items() if solved.status.status in ENDED}
        self.predicted = dict(zip(every, predict(plan.cases.values(), plan.solved.values()), strict=True))

    def look(self) -> list[CaseStatus]:
        """The cases of the studies in their order, then those of other studies that someone is solving."""
        jobs, logs = self._jobs(), slurm.logs_of(self.results.slurm_logs)
        begun = [n for n in self.others if n in jobs or solving_since(self.results.case(n).folder) is not None]
        read, self._read = self._read, {}
        return [self._case(name, jobs.get(name), logs.get(name), read.get(name)) for name in (*self.named, *begun)]

    def _jobs(self) -> dict[str, slurm.Job]:
        """The jobs of cases on a cluster by case; none where there is no cluster, or it does not answer."""
        folder = self.results.root.absolute().parent
        if slurm.is_here() and was_handed(folder) and time.monotonic() > self._asked + ASK_EVERY:
            try:
                self._known = {job.case: job for job in slurm.jobs_of(folder) if job.case}
                self.cluster = ""
            except ClusterError as error:
                self._known, self.cluster = {}, str(error)
            self._asked = time.monotonic()
        return self._known

    def _case(self, name: str, job: slurm.Job | None, log: Path | None, read: Solved | None) -> CaseStatus:
        status = case_status(self.plan.cases[name], self.results.case(name).folder, self.predicted[name], job, log, read)
        return replace(status, variant=self.variants.get(name, ""))

    def totals(self, statuses: Sequence[CaseStatus]) -> dict[str, Any]:
        """How many cases are in each status, and the wall time (s) that is left."""
        counts = {s: sum(c.status == s for c in statuses) for s in STATUSES}
        left = [c.seconds_left for c in statuses if c.seconds_left]
        workers = max(self.workers, counts[RUNNING])
        return {"cases": len(statuses), **counts, "seconds_left": round(schedule(left, workers), 1)}


def _variants(plan: Plan, studies: Sequence[str]) -> dict[str, str]:
    """What studies call the cases that they tell apart by variant or branch, by case id."""
    names: dict[str, dict[str, None]] = {}
    for study in studies:
        served = [("", point, case_id) for point, case_id in plan.served[study].items()]
        checks = [("cross check", point, case_id) for point, case_id in plan.checks[study].items()]
        for kind, point, case_id in served + checks:
            if words := [word for word in (kind, point.variant, f"branch {point.branch}" * bool(point.branch)) if word]:
                names.setdefault(case_id, {})[", ".join(words)] = None
    return {case_id: " = ".join(each) for case_id, each in names.items()}


def open_sweep(config_file: str, studies: Sequence[str], results: Path, cores: int) -> Sweep:
    """The sweep of some studies (none: those that the configuration runs). Raises ``ConfigError`` for one that is not there."""
    loaded = open_project(config_file, studies, "limo status pressure_volume")
    return Sweep(loaded, make_plan(loaded, results), studies or loaded.config.studies, results, cores)


def case_status(
    case: Case,
    folder: Path,
    predicted: float | None = None,
    job: slurm.Job | None = None,
    log: Path | None = None,
    read: Solved | None = None,
) -> CaseStatus:
    """Where one case is.

    ``predicted``: the time (s) that a solve of it should take; ``job``: its job on a cluster, ``log`` of its last one there;
    ``read``: what was just read of it, if it was sound.
    """
    name, maximum, files = case.case_id, case.actuation_pressure_max, CaseFiles(folder)
    since, ended = solving_since(folder), read or read_ended(folder)
    damaged = read is None and ended is not None and not is_sound(files, ended.described, ended.status)
    if since is None and ended is not None and not damaged and fits(ended, case):
        return ended_status(name, ended.status, maximum)
    if job is not None and job.is_queued:
        return CaseStatus(name, QUEUED, _why_queued(job), seconds_left=predicted, actuation_pressure_max=maximum)
    place = _place(case, folder) or _place(case, files.seen.folder)
    if since is None and job is not None:  # on another node, whose lock is not seen here everywhere
        since = _locked(files) or time.time()
    if since is None and not files.lock.exists() and place is not None and time.time() - place.written < RECENT:
        since = _began(folder)
    if since is not None and place is not None and place.written < since:
        place = None  # of an earlier run
    if since is None and ended is not None:
        reason = "files are damaged" if damaged else "solved by other code or without frames that are wanted"
        return CaseStatus(
            name, WAITING, reason, seconds_left=predicted,
            actuation_pressure_max=maximum,
        )  # fmt: skip
    where = _where(place, maximum)
    if since is None:
        return _begun_status(case, folder, predicted, log, where)
    elapsed = max(time.time() - since, 0.0)
    iterating = place.written - since if place else 0.0
    rate = round(place.iterations / iterating, 2) if iterating > 1.0 else None
    left = None
    if predicted is not None and not (place and place.stage == STAGES[-1]):  # how many legs are gone no engine says
        left = round(seconds_left(predicted, elapsed, share_done(case.engine, *(place.shares if place else (0, 0, 0)))), 1)
    return CaseStatus(
        name, RUNNING, iterations_per_second=rate, seconds=round(elapsed, 1), seconds_left=left, **where
    )  # fmt: skip


def _begun_status(case: Case, folder: Path, predicted: float | None, log: Path | None, where: dict[str, Any]) -> CaseStatus:
    """Where a case is that nobody solves and that has no result."""
    files = CaseFiles(folder)
    reason, begun = (slurm.how_it_ended(log) if log else "") or _error(folder), files.lock.exists() or any_file(files.run)
    status = CRASHED if reason else STALE if begun else WAITING
    if status == STALE:
        reason = "begun, but no process is solving it: run snakemake again"
    return CaseStatus(case.case_id, status, reason, seconds_left=None if status == CRASHED else predicted, **where)


def _why_queued(job: slurm.Job) -> str:
    """Why a job waits, where it waits for more than its turn."""
    return f"job {job.number} waits: {job.reason}" if job.reason not in ("", "Priority", "Resources") else ""


def _locked(files: CaseFiles) -> float | None:
    """When a case was begun, by its lock whoever holds it; None before."""
    try:
        return files.lock.stat().st_mtime
    except OSError:
        return None


def _where(place: Place | None, maximum: float) -> dict[str, Any]:
    if place is None:
        return {"actuation_pressure_max": maximum}
    return {
        "stage": place.stage,
        "actuation_pressure": round(place.actuation_pressure, 3),
        "actuation_pressure_max": maximum,
        "increments": place.increments,
        "cutbacks": place.cutbacks,
        "iterations": place.iterations,
    }


# --------------------------------------------------------------------------------------------------------------------
# cases that have ended


def read_ended(folder: Path) -> Solved | None:
    """The case of a folder as far as it has ended with a status; None otherwise."""
    files = CaseFiles(folder)
    try:
        status = SolveStatus.from_json(read_json(files.status), files.status)
    except ResultError:
        return None
    if status.status not in ENDED:
        return None
    try:
        described = read_json(files.described)
    except ResultError:
        described = {}
    return Solved(folder.name, described, status)


def fits(solved: Solved, case: Case) -> bool:
    """Whether what is on disk was solved by today's code and kept the frames of ``case``."""
    try:
        return solved.current and holds(solved.frames, set(case.frames))
    except (AttributeError, TypeError):  # a damaged case.json
        return False


def ended_status(name: str, status: SolveStatus, maximum: float | None) -> CaseStatus:
    """The same of a case that has ended, from its ``status.json``."""
    iterations, seconds = status.iterations, status.solver_wall_seconds
    counted = [s for s in STAGES if status.iterations_by_stage.get(s)]
    return CaseStatus(
        name,
        status.status,
        "; ".join(filter(None, [status.reason, *(remark.partition(": ")[0] for remark in status.remarks)])),
        counted[-1] if counted else "",
        status.actuation_pressure_reached,
        maximum,
        status.increments,
        status.rejected_attempts,
        iterations,
        round(iterations / seconds, 2) if iterations is not None and seconds else None,
        seconds,
    )


# --------------------------------------------------------------------------------------------------------------------
# cases that were begun


def _place(case: Case, folder: Path) -> Place | None:
    """How far the last run of a case came, by the files of its engine; None while there are none."""
    with suppress(OSError, ValueError, OverflowError):
        return find_engine(case.engine).progress(folder, case.numerics, case.actuation_pressure_max)
    return None


def _began(folder: Path) -> float | None:
    """When the first file of the run was written."""
    with suppress(OSError, ValueError):
        return min(file.stat().st_mtime for file in CaseFiles(folder).run.iterdir())
    return None


def any_file(folder: Path) -> bool:
    """Whether a folder is there and not empty."""
    try:
        return any(folder.iterdir())
    except OSError:
        return False


def _error(folder: Path) -> str:
    """The last error in the log of the script that solved the case; "" where it was killed or never ran."""
    log = Results(folder.parents[1]).log("solve_case", folder.name)
    try:
        lines = log.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return ""
    errors = [line.split(" ERROR ", 1)[1] for line in lines if " ERROR " in line]
    return f"{errors[-1]} (see {log})" if errors else ""


# --------------------------------------------------------------------------------------------------------------------
# for machines and for people


def to_plain(sweep: Sweep, statuses: Sequence[CaseStatus]) -> dict[str, Any]:
    """Totals and cases as plain data, for JSON."""
    return {"totals": sweep.totals(statuses), "cases": [asdict(status) for status in statuses]}


def short_names(names: Iterable[str]) -> dict[str, str]:
    """The shortest beginnings of names that tell each from all others: without the device, the four numbers and so on."""
    names = list(names)
    parts = [DEVICE.sub("", name).split("_") for name in names]
    short: dict[str, str] = {}
    for length in (4, 5, 6, None):  # numbers; with the mesh level; with the numerics; with the hash
        forms = ["_".join(each[:length]) for each in parts]
        counts = Counter(forms)
        short |= {name: form for name, form in zip(names, forms, strict=True) if name not in short and counts[form] == 1}
    return {name: short.get(name, name) for name in names}
