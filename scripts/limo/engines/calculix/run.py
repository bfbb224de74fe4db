"""CalculiX on a deck: run it under watch, judge how the run ended, and read its load path.

CalculiX's exit code alone says little: it is 0 with a missing deck and with nonsense from a singular model, and a
diverged run still writes one last frame. A converged run has exit code 0 and no ``*ERROR`` in its log, and its last
accepted increment (.sta) is at the end of the last step.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import re
import shutil
import signal
import subprocess
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from limo.engines.calculix.build import solver_build
from limo.engines.calculix.deck import StageTime, actuation_pressure_at, history_of, kept_times, write_deck
from limo.engines.calculix.frd import Frame, FrdFile
from limo.engines.calculix.sta import Increment, read_sta
from limo.engines.load_path import LoadPath, count_stages
from limo.errors import ResultError
from limo.mechanics.model import Loading, Model
from limo.schema.section import PLANNED, STAGES
from limo.schema.solver import Solver

JOB = "deck"
_ALL = np.empty(0)
_SAME_TIME = 1e-6  # relative, as .sta rounds
_PR_SET_PDEATHSIG = 1
_POLL = 0.5  # s between looks at a running solver
#: signals that people, terminals and the kernel's memory killer send; a solver that fails by itself ends with others
OUTSIDE = frozenset({signal.SIGKILL, signal.SIGTERM, signal.SIGINT, signal.SIGHUP, signal.SIGQUIT, signal.SIGXCPU})
#: what CalculiX's u_calloc, the loader of its libraries, the Fortran library and PARDISO say
NO_MEMORY = re.compile(r"error allocating memory|failed to map segment|[Cc]annot allocate memory|PARDISO[^\n]*-2\b")
#: a run is stopped when this many consecutive increments advance it by less than this share of its total time: the rest would
#: take millions. In runs that finish, the literal set-up among them, so many increments always advanced it by at least 7e-3
CRAWLING, CRAWLED = 300, 1e-4
_LOOK_AT_STA = 5.0  # s between looks at how far a solver's clock is
_STA_LINE = 70  # bytes
LEAST_DISK = 1 << 20  # bytes free, below which CalculiX's files end anywhere: it does not look at what was written


@dataclass(frozen=True)
class Run:
    """How a run of the solver ended.

    ``status`` is ``converged``, ``diverged``, ``timed_out`` or ``crashed``; ``reason`` is empty when it converged.
    CPU and wall time in s, ``memory`` (peak resident) in MiB. ``interrupted``: what ended it lies outside of the case.
    """

    status: str
    reason: str
    exit_code: int
    increments: tuple[Increment, ...]
    cpu_seconds: float
    wall_seconds: float
    memory: float
    interrupted: bool = False

    @property
    def accepted(self) -> tuple[Increment, ...]:
        return tuple(i for i in self.increments if i.accepted)

    @property
    def iterations(self) -> int:
        """Newton iterations, those of rejected attempts included."""
        return sum(i.iterations for i in self.increments)


def solve(model: Model, folder: Path, solver: Solver, command: Path) -> LoadPath:
    """Run a model in ``folder``; the path reads displacements from the solver's results until it is closed."""
    times = write_deck(model, folder / f"{JOB}.inp")
    with contextlib.ExitStack() as stack:
        outcome = run(folder, command, solver, times[-1].end)
        left = stack.enter_context(results(folder, outcome, kept_times(model, times)))
        clock = np.array([f.time for f in left[2]], float)
        ends, loading = [t.end * (1 + 1e-9) for t in times[:-1]], model.loading
        place = np.searchsorted(ends, clock)
        history = history_of(loading, times)
        cycled = {
            "ventricular": np.interp(clock, history[:, 0], history[:, 2]),
            "leg": np.maximum(place - len(PLANNED) + 1, 0),
        }
        return load_path(
            *left,
            model,
            command,
            stage=np.minimum(place, len(STAGES) - 1),
            pressure=_actuation(loading, times, clock, history),
            **(cycled if loading.cycle else {}),
            ended_in=_stage_at_the_end(left[0], times),
            iterations=_iterations_by_stage(left[0], times),
            close=stack.pop_all().close,
        )


def _actuation(loading: Loading, times: tuple[StageTime, ...], clock: np.ndarray, history: np.ndarray) -> np.ndarray:
    """P_a (k,) in kPa at times of the solver."""
    if loading.cycle:
        return np.interp(clock, history[:, 0], history[:, 3])
    return actuation_pressure_at(times, loading.actuation_pressure_max, clock)


def load_path(outcome: Run, frd: FrdFile | None, usable: list[Frame], model: Model, command: Path, **others) -> LoadPath:
    """The path of what a run left, as ``results`` gives it; ``others``: what depends on the model's stages, and ``close``."""
    return LoadPath(
        status=outcome.status,
        reason=outcome.reason,
        interrupted=outcome.interrupted,
        clock=np.array([f.time for f in usable], float),
        displacements=lambda k: frd.displacements(usable[k], len(model.nodes)),
        precision="float32",
        is_static=False,
        in_process=False,
        rejected=len(outcome.increments) - len(outcome.accepted),
        build=solver_build(command),
        cpu_seconds=outcome.cpu_seconds,
        wall_seconds=outcome.wall_seconds,
        memory=outcome.memory,
        **others,
    )


@contextlib.contextmanager
def results(folder: Path, outcome: Run, kept: np.ndarray = _ALL) -> Iterator[tuple[Run, FrdFile | None, list[Frame]]]:
    """What a run in ``folder`` left, open as long as the block lasts: outcome, file of results, frames in it that count.

    ``kept`` (k,): times in s of the increments that have frames, all of them by default.

    A diverged run writes its last, unconverged state too: only increments that .sta accepted count. It does not notice when
    the disk is full: an accepted increment without a frame has crashed, and so has a file that cannot be read.
    """
    told = [i for i in outcome.accepted if not len(kept) or np.isclose(kept, i.total_time, rtol=_SAME_TIME, atol=0).any()]
    accepted, file = {(i.step, i.increment) for i in told}, folder / f"{JOB}.frd"
    with contextlib.ExitStack() as stack:
        frd, usable, error = None, [], ""
        if accepted and file.exists():
            try:
                frd = stack.enter_context(FrdFile(file))
                usable = [f for f in frd.frames if (f.step, f.increment) in accepted]
            except ResultError as problem:
                error = str(problem)
        if not error and len(usable) < len(accepted):
            error = f"{file.name} has {len(usable)} of {len(accepted)} accepted increments"
        if error:
            unseen = outcome.status == "converged"  # by CalculiX, so it was not its doing
            status, reason = "crashed" if unseen else outcome.status, f"{outcome.reason} {error}".strip()
            outcome = replace(outcome, status=status, reason=reason, interrupted=outcome.interrupted or unseen)
        yield outcome, frd, usable


def _iterations_by_stage(outcome: Run, times: tuple[StageTime, ...]) -> dict[str, int]:
    """Newton iterations of each stage by the time at which an increment started, rejected attempts included."""
    counts = count_stages()
    for increment in outcome.increments:
        counts[_stage_of(increment.total_time - (increment.size if increment.accepted else 0.0), times)] += increment.iterations
    return counts


def _stage_of(started: float, times: tuple[StageTime, ...]) -> str:
    """The stage in which an increment that starts at a solver time lies."""
    return next((t.name for t in times if started < t.end * (1 - 1e-6)), STAGES[-1])


def _stage_at_the_end(outcome: Run, times: tuple[StageTime, ...]) -> str:
    """The stage after the last accepted increment."""
    return _stage_of(outcome.accepted[-1].total_time if outcome.accepted else 0.0, times)


def run(folder: Path, command: Path, solver: Solver, end_time: float) -> Run:
    """Run ``folder/deck.inp`` up to ``end_time`` (solver s) and judge the outcome; the log goes to ``folder/ccx.log``.

    The solver runs in a process group of its own. The group is ended when it exceeds ``time_limit``, makes no Newton iteration
    for ``stall_limit``, crawls, or when this process is interrupted.
    """
    log_path = folder / "ccx.log"
    threads = str(solver.threads)
    environment = dict(os.environ)
    for name in ("OMP_NUM_THREADS", "CCX_NPROC_STIFFNESS", "CCX_NPROC_RESULTS", "CCX_NPROC_EQUATION_SOLVER"):
        environment[name] = threads
    started, stopped = time.monotonic(), ""
    with log_path.open("wb") as log, _interruptible():
        process = subprocess.Popen(
            [command, JOB],
            cwd=folder,
            stdout=log,
            stderr=subprocess.STDOUT,
            stdin=subprocess.DEVNULL,
            env=environment,
            start_new_session=True,
            preexec_fn=_die_with_parent,
        )
        try:
            stopped, exit_code, usage = _watch(process, folder, solver, started, end_time)
        except BaseException:
            _kill(process)
            raise
    wall = time.monotonic() - started
    increments, log_text = read_sta(folder / f"{JOB}.sta"), log_path.read_text(encoding="utf-8", errors="replace")
    status, reason = judge(exit_code, log_text, increments, end_time, stopped)
    outside = "" if stopped or status == "converged" else _outside(exit_code, log_text, folder)
    return Run(
        "crashed" if outside else status,
        outside or reason,
        exit_code,
        increments,
        usage.ru_utime + usage.ru_stime,
        wall,
        usage.ru_maxrss / 1024,
        bool(outside),
    )


def _outside(exit_code: int, log: str, folder: Path) -> str:
    """What ended a run although nothing is wrong with the case, or ""."""
    if -exit_code in OUTSIDE:
        return f"killed from outside by signal {-exit_code}"
    if NO_MEMORY.search(log):
        return "not enough memory"
    return "the disk is full" if shutil.disk_usage(folder).free < LEAST_DISK else ""


def _watch(process: subprocess.Popen, folder: Path, solver: Solver, started: float, end_time: float):
    """Wait for the end; returns why it was stopped (or ""), its exit code and its resource usage."""
    progress, seen_at, looked_at, stopped = -1, started, started, ""
    while True:
        pid, wait_status, usage = os.wait4(process.pid, os.WNOHANG)
        if pid:
            process.returncode = os.waitstatus_to_exitcode(wait_status)
            return stopped, process.returncode, usage
        now = time.monotonic()
        written = sum(_bytes(folder / name) for name in (f"{JOB}.cvg", f"{JOB}.sta", "ccx.log"))
        if written != progress:
            progress, seen_at = written, now
        if not stopped and now - started > 60 * solver.time_limit:
            stopped = f"stopped after the time limit of {solver.time_limit:g} min"
        elif not stopped and now - seen_at > 60 * solver.stall_limit:
            stopped = f"stopped after {solver.stall_limit:g} min without a Newton iteration"
        elif not stopped and now - looked_at > _LOOK_AT_STA:
            looked_at, stopped = now, _crawls(folder / f"{JOB}.sta", end_time)
        if stopped:
            _signal(process, signal.SIGKILL)
        time.sleep(_POLL)


def _bytes(file: Path) -> int:
    """How large a file is, which CalculiX may remove at any moment to write it anew."""
    with contextlib.suppress(FileNotFoundError):
        return file.stat().st_size
    return 0


def _crawls(sta: Path, end_time: float) -> str:
    """Why a run that iterates and gets nowhere is stopped, or "" for one that gets on."""
    accepted = [i for i in read_sta(sta, last=2 * CRAWLING * _STA_LINE) if i.accepted][-CRAWLING:]
    covered = sum(i.size for i in accepted)
    if len(accepted) < CRAWLING or covered > CRAWLED * end_time:
        return ""
    return (
        f"stopped at {accepted[-1].total_time:.4g} s of {end_time:.4g} s: {CRAWLING} increments took it {covered:.1e} s further"
    )


@contextlib.contextmanager
def _interruptible() -> Iterator[None]:
    """Let SIGTERM end the block like Ctrl-C does, so that the solver is ended with it (main thread only)."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def stop(number: int, _frame: object) -> None:
        raise SystemExit(128 + number)

    before = signal.signal(signal.SIGTERM, stop)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def _die_with_parent() -> None:
    """In the child: ask the kernel to end the solver when its watcher ends, however that happens."""
    ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)


def _signal(process: subprocess.Popen, number: int) -> None:
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, number)


def _kill(process: subprocess.Popen) -> None:
    _signal(process, signal.SIGKILL)
    process.wait()


def judge(exit_code: int, log: str, increments: tuple[Increment, ...], end_time: float, stopped: str = "") -> tuple[str, str]:
    """Status and reason of a finished run from its exit code, log and increments (see the module's note)."""
    if stopped:
        return "timed_out", stopped
    errors = re.findall(r"\*ERROR[^\n]*(?:\n[ \t]+\S[^\n]*)?", log)
    message = " ".join(errors[0].split()) if errors else ""
    accepted = [i for i in increments if i.accepted]
    if exit_code < 0:
        return "crashed", f"ended by signal {-exit_code}"
    if not accepted:
        status = "diverged" if increments and exit_code in (0, 201) else "crashed"
        return status, message or f"no increment was accepted (exit code {exit_code})"
    at_end = accepted[-1].total_time >= end_time * (1 - 1e-5)  # .sta has six digits
    if exit_code == 0 and not errors and "Job finished" in log and at_end:
        return "converged", ""
    if not errors and not at_end:
        message = f"ended at {accepted[-1].total_time:g} s of {end_time:g} s (exit code {exit_code})"
    if exit_code in (0, 201) or "divergence" in log or "too many cutbacks" in log:
        return "diverged", message or f"exit code {exit_code}"
    return "crashed", message or f"exit code {exit_code}"
