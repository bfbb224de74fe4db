"""Solved cases on disk: read, checked, kept aside and put back."""

from __future__ import annotations

import json
import logging
import os
import shutil
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from limo.cases.case import Case, describe, solve_code
from limo.errors import ResultError
from limo.schema.pressures import same_pressure
from limo.schema.section import ENGINES
from limo.store.files import is_whole, read_json
from limo.store.results import STATUS, CaseFiles, Results
from limo.store.statuses import USABLE, SolveStatus

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Solved:
    """A case on disk: ``described`` is its ``case.json``, ``status`` its ``status.json``."""

    case_id: str
    described: dict[str, Any]
    status: SolveStatus

    @cached_property
    def case(self) -> Case | None:
        """The case, None when it was described by another version of the project or its folder bears another name."""
        try:
            case = Case.from_dict(self.described["case"])
            return case if case.case_id == self.case_id else None
        except (KeyError, TypeError, ValueError, AttributeError):
            return None

    @cached_property
    def frames(self) -> tuple[float, ...]:
        """Pressures (kPa) whose frames the case was to keep."""
        return tuple(self.described.get("case", {}).get("frames") or ())

    @property
    def engine(self) -> str:
        """What solved it."""
        return self.described.get("case", {}).get("engine", "")

    @property
    def current(self) -> bool:
        """Whether today's code would solve it the same way."""
        return self.engine in ENGINES and self.described.get("code") == solve_code(self.engine)

    def settled(self, recovery: str) -> bool:
        """Whether solving it again could not help: nothing outside broke it off, and another ladder was not needed.

        ``recovery``: digest of the ladder of its engine. A case that succeeded at the first attempt never saw a ladder.
        """
        status = self.status
        if status.interrupted:
            return False
        return status.first_status in USABLE or not status.recovery or status.recovery.split("-")[0] == recovery

    def next_recovery(self, recovery: str) -> str:
        """Label of the next solve: the ladder's digest and a running number."""
        before = self.status.recovery
        if self.settled(recovery) and before:
            return before
        count = (before or "-0").rpartition("-")[2]
        return f"{recovery}-{int(count) + 1}" if count.isdigit() else f"{recovery}-0"


def solved_cases(results: Path) -> tuple[dict[str, Solved], dict[str, str]]:
    """Solved cases by id; for cases with damaged files, the time of the damage."""
    sound, damaged = {}, {}
    folder = Results(results)
    for case_id in folder.case_ids():
        files = folder.case(case_id)
        try:
            sound[case_id] = read_solved(files)
        except ResultError as error:
            log.debug("%s", error)
            if files.status.exists():
                damaged[case_id] = str(max(file.stat().st_mtime_ns for file in files.solved if file.exists()))
    return sound, damaged


def read_solved(files: CaseFiles) -> Solved:
    """A solved case. Raises ``ResultError`` where its files are not there or not those of the solve."""
    described = read_json(files.described)
    status = SolveStatus.from_json(read_json(files.status), files.status)
    if not is_sound(files, described, status):
        raise ResultError(f"{files.folder}: files are damaged")
    return Solved(files.folder.name, described, status)


def is_sound(files: CaseFiles, described: dict[str, Any], status: SolveStatus) -> bool:
    """Whether ``described`` says what ``case.json`` should, and the files of the solve are those of which ``status`` tells."""
    case = described.get("case")
    if not isinstance(case, dict) or not isinstance(case.get("engine"), str):
        return False
    frames = case.get("frames") or []
    if not isinstance(frames, list) or not all(isinstance(p, int | float) for p in frames):
        return False
    names = {file.name for file in (*files.solved, files.own_mesh)}
    written = files.status.stat().st_mtime
    return all(name in names and is_whole(files.folder / name, stamp, written) for name, stamp in status.files.items())


def keep(folder: Path) -> None:
    """Give the results of a case, solved just now, second names in its folder, which Snakemake does not know.

    Before it starts a broken-off job again, it removes its results. It does so even if the job had written all of them and was
    only not yet reported. Links take no room; where the file system knows none, such a case is solved again.
    """
    files = CaseFiles(folder)
    aside = files.kept.folder
    shutil.rmtree(aside, ignore_errors=True)
    aside.mkdir()
    try:
        for file in (*files.solved, files.own_mesh):
            if file.exists():
                os.link(file, aside / file.name)
    except OSError as error:
        log.debug("%s: %s", aside, error)
        shutil.rmtree(aside, ignore_errors=True)


def restore(case: Case, folder: Path, recovery: str) -> dict[str, Any] | None:
    """Put back what ``keep`` kept, where it is what solving ``case`` now would give; returns its status, None otherwise.

    ``recovery``: what this solve is called (``Plan.recovery_of``); another one wants it solved again.
    """
    kept = CaseFiles(folder).kept
    try:
        one = read_solved(kept)
    except ResultError:
        return None
    same = {k: one.described.get(k) for k in ("case", "code")} == json.loads(json.dumps(describe(case)))
    if not (same and one.status.recovery == recovery and not one.status.interrupted):
        return None
    # the status last: it says that all is there
    for file in sorted((*kept.solved, kept.own_mesh), key=lambda file: file.name == STATUS):
        if file.exists() and not (folder / file.name).exists():
            os.link(file, folder / file.name)
    log.info("taken as it is: an earlier run solved this case, by the same code and settings")
    return one.status.to_json()


def holds(kept: tuple[float, ...], needed: set[float]) -> bool:
    """Whether each needed pressure (kPa) is among those kept."""
    return all(any(same_pressure(k, n) for k in kept) for n in needed)
