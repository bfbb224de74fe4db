"""What Slurm says of its jobs and partitions, by its own commands: it has no library for Python that is installed everywhere.

Jobs of a folder are those that Snakemake submitted from it: their working folder is the folder, their comment begins with a rule.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from limo.errors import ClusterError

TIMEOUT = 60.0  # s; a controller that is busy answers late
#: states of a job that waits, and of one that has begun; all others have ended
QUEUED = ("PENDING", "CONFIGURING", "REQUEUED", "SUSPENDED", "RESV_DEL_HOLD", "REQUEUE_FED", "REQUEUE_HOLD", "SPECIAL_EXIT")
BEGUN = ("RUNNING", "COMPLETING", "STAGE_OUT", "SIGNALING", "STOPPED")
#: what Snakemake's plugin begins the comment of a job with
COMMENT = "rule_"
#: the part of a comment that names a case: of a rule by its wildcard, of a group by the group's name
_CASE = re.compile(r"^rule_(?:[a-z_]+_wildcards_)?([\w.]+_[0-9a-f]{10})(?:_[a-z_]+)?$")
#: what ended a job, in the log that Slurm writes of it
_ENDS = re.compile(r"DUE TO (TIME LIMIT)|(exceeded memory limit|oom[-_]kill)|(CANCELLED AT)", re.IGNORECASE)


class NoAnswer(ClusterError):
    """Slurm's programs are here, and nothing is behind them, or not now."""


@dataclass(frozen=True)
class Job:
    """A job that waits or runs; ``reason``: why it waits, ``case``: the one that it solves or measures, if it is of one."""

    number: str
    state: str
    reason: str
    case: str

    @property
    def is_queued(self) -> bool:
        """Whether it has not begun."""
        return self.state in QUEUED


@dataclass(frozen=True)
class Partition:
    """A partition: the longest time of a job in minutes, infinite without a limit; the largest memory of a node in MiB."""

    name: str
    minutes: float
    memory: float


def is_here() -> bool:
    """Whether this machine can ask a Slurm."""
    return shutil.which("squeue") is not None


def jobs_of(folder: Path) -> list[Job]:
    """The jobs of a folder that wait or run, oldest first. Raises ``NoAnswer``."""
    here, found = os.path.realpath(folder), []
    for line in _ask("squeue", "--me", "--noheader", "--format=%i|%T|%r|%k|%Z").splitlines():
        number, state, reason, comment, where = (*line.split("|", 4), "", "", "", "")[:5]
        alive = state in QUEUED or state in BEGUN
        if alive and comment.startswith(COMMENT) and os.path.realpath(where) == here:
            found.append(Job(number, state, "" if reason == "None" else reason, case_in(comment)))
    return sorted(found, key=lambda job: int(re.match(r"\d*", job.number).group() or 0))


def is_alive(number: str) -> bool:
    """Whether a job waits or runs; one that Slurm has forgotten does neither."""
    done = subprocess.run(
        ["squeue", "--noheader", "--format=%T", f"--jobs={number}"], capture_output=True, text=True, timeout=TIMEOUT, check=False
    )
    return done.stdout.strip() in QUEUED + BEGUN or (done.returncode != 0 and "Invalid job id" not in done.stderr)


def case_in(comment: str) -> str:
    """The case that a job's comment names; "" for a job of another rule."""
    named = _CASE.match(comment)
    return named.group(1) if named and "_pv" in named.group(1) else ""


def cancel(jobs: Iterable[Job]) -> None:
    """Cancel jobs. Raises ``ClusterError`` where Slurm refuses."""
    if numbers := [job.number for job in jobs]:
        _ask("scancel", *numbers)


def wait_for_end(folder: Path, every: float = 5.0, said: Callable[[Sequence[Job]], None] | None = None) -> None:
    """Return when a folder has no jobs any more; ``said`` is called with those that are left, every so many seconds."""
    while left := jobs_of(folder):
        if said:
            said(left)
        time.sleep(every)


def partitions() -> dict[str, Partition]:
    """The partitions by their names; the default one by "", too. Raises ``NoAnswer``."""
    found: dict[str, Partition] = {}
    for line in _ask("sinfo", "--noheader", "--format=%R|%l|%m|%P").splitlines():
        name, limit, memory, starred = (*line.split("|"), "", "", "")[:4]
        most = float(re.match(r"\d*", memory).group() or "inf")
        before = found.get(name)
        found[name] = Partition(name, minutes_of(limit), max(most, before.memory if before else 0.0))
        if starred.endswith("*"):
            found[""] = found[name]
    return found


def minutes_of(text: str) -> float:
    """Minutes of a time as Slurm writes it: ``30:00``, ``2:00:00``, ``1-12:00:00``; infinite for one without a limit."""
    days, _, clock = text.rpartition("-")
    try:
        parts = [int(part) for part in clock.split(":")]
        hours, minutes, seconds = [0] * (3 - len(parts)) + parts
        return 1440 * int(days or 0) + 60 * hours + minutes + seconds / 60
    except ValueError:
        return float("inf")


def logs_of(folder: Path) -> dict[str, Path]:
    """The newest log that Slurm wrote of each case below a folder of logs; those of jobs that ended well are removed."""
    found: dict[str, Path] = {}
    for one in folder.iterdir() if folder.is_dir() else ():
        named = [(case_in(f"{COMMENT}{one.name.removeprefix('group_')}"), one)]
        if one.name.startswith(COMMENT):  # a rule's folder has one of each case
            named = [(case_in(f"{one.name}_wildcards_{below.name}"), below) for below in one.iterdir()]
        for case_id, logs in named:
            newest = max(logs.glob("**/*.log"), key=lambda file: file.stat().st_mtime, default=None) if case_id else None
            if newest and (case_id not in found or newest.stat().st_mtime > found[case_id].stat().st_mtime):
                found[case_id] = newest
    return found


def how_it_ended(log: Path) -> str:
    """Why Slurm ended a job, by the log of it; "" where it did not."""
    ends = list(_ENDS.finditer(log.read_text(encoding="utf-8", errors="replace")))
    words = ("its job ran out of time", "its job ran out of memory", "its job was cancelled")
    return next((f"{word} ({log})" for k, word in enumerate(words, 1) for end in ends if end.group(k)), "")


def _ask(*command: str) -> str:
    """What a command of Slurm prints. Raises ``ClusterError``."""
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=TIMEOUT, check=False)
    except FileNotFoundError:
        raise ClusterError(f"{command[0]}: no such program; a sweep on Slurm starts on a login node of the cluster") from None
    except subprocess.TimeoutExpired:
        raise NoAnswer(f"{command[0]}: Slurm does not answer within {TIMEOUT:g} s; is the cluster up?") from None
    if done.returncode:
        said = (done.stderr.strip().splitlines() or [f"exit code {done.returncode}"])[-1]
        raise NoAnswer(f"{command[0]}: Slurm does not answer: {said}")
    return done.stdout
