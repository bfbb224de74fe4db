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

from limo.cases.case import OWN_MESH, Case, describe, solve_code
from limo.errors import ResultError
from limo.schema.section import ENGINES
from limo.store.files import is_whole, read_json
from limo.store.statuses import USABLE

log = logging.getLogger(__name__)


RESULT_FILES = ("case.json", "status.json", "volumes.nc", "frames.nc")


KEPT = ".kept"  # in the folder of a case


_CLOSE = 1e-6  # kPa, pressures closer than this are the same


@dataclass(frozen=True)
class Solved:
    """A case on disk: ``described`` is its ``case.json``, ``status`` its ``status.json``."""

    case_id: str
    described: dict[str, Any]
    status: dict[str, Any]

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
        return tuple(self.described.get("case", {}).get("frames", ()))

    @property
    def current(self) -> bool:
        """Whether today's code would solve it the same way."""
        engine = self.described.get("case", {}).get("engine", "")
        return engine in ENGINES and self.described.get("code") == solve_code(engine)

    @property
    def reached(self) -> float:
        """Highest P_a (kPa) of an accepted increment; without end for a case that converged."""
        return float("inf") if self.status.get("status") in USABLE else self.status.get("actuation_pressure_reached") or 0.0

    def settled(self, recovery: str) -> bool:
        """Whether solving it again could not help: nothing outside broke it off, and another ladder was not needed.

        ``recovery``: digest of the ladder of its engine. A case that succeeded at the first attempt never saw a ladder.
        """
        if self.status.get("interrupted"):
            return False
        attempts = self.status.get("attempts") or [self.status]
        solved_with = self.status.get("recovery")
        return attempts[0].get("status") in USABLE or not solved_with or solved_with.split("-")[0] == recovery

    def next_recovery(self, recovery: str) -> str:
        """Label of the next solve: the ladder's digest and a running number."""
        if self.settled(recovery) and (before := self.status.get("recovery")):
            return before
        count = str(self.status.get("recovery") or "-0").rpartition("-")[2]
        return f"{recovery}-{int(count) + 1}" if count.isdigit() else f"{recovery}-0"


def solved_cases(results: Path) -> tuple[dict[str, Solved], dict[str, str]]:
    """Solved cases by id; for cases with damaged files, the time of the damage."""
    found, damaged = {}, {}
    folder = results / "cases"
    for name in sorted(p.name for p in folder.iterdir()) if folder.is_dir() else ():
        try:
            described, status = read_json(folder / name / "case.json"), read_json(folder / name / "status.json")
        except ResultError as error:
            log.debug("%s", error)
            described = status = {}
        if described and status and is_sound(folder / name, described, status):
            found[name] = Solved(name, described, status)
        elif (folder / name / "status.json").exists():
            files = [file for file in (folder / name / n for n in RESULT_FILES) if file.exists()]
            damaged[name] = str(max(file.stat().st_mtime_ns for file in files))
    return found, damaged


def is_sound(folder: Path, described: dict[str, Any], status: dict[str, Any]) -> bool:
    """Whether ``case.json`` and ``status.json`` hold what they should, and the files beside them are those of the solve."""
    case = described.get("case")
    if not isinstance(case, dict) or not isinstance(case.get("engine"), str) or not isinstance(status.get("status"), str):
        return False
    frames, attempts, files = case.get("frames") or [], status.get("attempts") or [], status.get("files") or {}
    if not isinstance(frames, list) or not all(isinstance(p, int | float) for p in frames):
        return False
    if not isinstance(attempts, list) or not all(isinstance(a, dict) and isinstance(a.get("status"), str) for a in attempts):
        return False
    if not isinstance(status.get("recovery") or "", str) or not isinstance(
        status.get("actuation_pressure_reached") or 0.0, int | float
    ):
        return False
    written = (folder / "status.json").stat().st_mtime
    known = isinstance(files, dict) and all(name in (*RESULT_FILES, OWN_MESH) for name in files)
    return known and all(is_whole(folder / name, stamp, written) for name, stamp in files.items())


def keep(folder: Path) -> None:
    """Give the results of a case, solved just now, second names in its folder, which Snakemake does not know.

    It removes the results of a job that was broken off before it starts it again, also of one that had written all of them and
    was only not yet reported. Links take no room; where the file system knows none, such a case is solved again.
    """
    aside = folder / KEPT
    shutil.rmtree(aside, ignore_errors=True)
    aside.mkdir()
    try:
        for name in (*RESULT_FILES, OWN_MESH):
            if (folder / name).exists():
                os.link(folder / name, aside / name)
    except OSError as error:
        log.debug("%s: %s", aside, error)
        shutil.rmtree(aside, ignore_errors=True)


def restore(case: Case, folder: Path, recovery: str) -> dict[str, Any] | None:
    """Put back what ``keep`` kept, where it is what solving ``case`` now would give; returns its status, None otherwise.

    ``recovery``: what this solve is called (``Plan.recovery_of``); another one wants it solved again.
    """
    aside = folder / KEPT
    try:
        described, status = read_json(aside / "case.json"), read_json(aside / "status.json")
    except ResultError:
        return None
    same = {k: described.get(k) for k in ("case", "code")} == json.loads(json.dumps(describe(case)))
    if not (same and status.get("recovery") == recovery and not status.get("interrupted") and is_sound(aside, described, status)):
        return None
    for name in (*RESULT_FILES, OWN_MESH):
        if name != "status.json" and (aside / name).exists():
            _put_back(aside / name, folder / name)
    _put_back(aside / "status.json", folder / "status.json")
    return status


def _put_back(kept: Path, file: Path) -> None:
    if not file.exists():
        os.link(kept, file)


def holds(kept: tuple[float, ...], needed: set[float]) -> bool:
    """Whether each needed pressure (kPa) is among those kept."""
    return all(any(abs(k - n) < _CLOSE for k in kept) for n in needed)
