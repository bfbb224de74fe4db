"""Which case stands for which: what is solved already, what has to be solved, and nothing twice.

The ramp of a case does not know where it will stop, so a case that goes to a higher P_a,max passes through every state of
one that stops earlier: one solve serves both. A study says how far this may go (``reuse``).
"""

from __future__ import annotations

import json
import logging
import os
import re
import shutil
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from limo.case import OWN_MESH, SOLVE_CODE, Case, Wanted, cross_checks, describe, digest, solve_code, study_cases, wanted_cases
from limo.config import ENGINES, Loaded
from limo.errors import ResultError
from limo.files import is_whole, read_json
from limo.judge import USABLE

log = logging.getLogger(__name__)
CROSS_CHECK = "cross_check"
RESULT_FILES = ("case.json", "status.json", "volumes.nc", "frames.nc")
KEPT = ".kept"  # in the folder of a case
_CLOSE = 1e-6  # kPa, pressures closer than this are the same
_LABEL = re.compile(r"^\w+?_np\d+_pv[\d.]+_ar[\d.]+_eh[\d.]+(?=_)")


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
        return engine in SOLVE_CODE and self.described.get("code") == solve_code(engine)

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


@dataclass
class _Group:
    """One case as some studies want it: with their ``reuse``, and the frames (kPa) that they keep and need."""

    case: Case
    case_id: str
    reuse: str
    whole_ramp: bool  # whether something is wanted that only the study's own P_a,max gives: fatigue is a maximum over the ramp
    kept: set[float] = field(default_factory=set)
    needed: set[float] = field(default_factory=set)

    @cached_property
    def path(self) -> str:
        return self.case.path()

    @cached_property
    def loose_path(self) -> str:
        return self.case.path(any_level=True)

    def served_by(self, other: Case) -> bool:
        """Whether another case passes through all states of this one, or through those of this one on a better mesh."""
        beyond = other.actuation_pressure_max - self.case.actuation_pressure_max
        if beyond < -_CLOSE or (self.whole_ramp and beyond > _CLOSE):
            return False
        if other.path() == self.path:
            return True
        finer = other.mesh_level.degrees_of_freedom > self.case.mesh_level.degrees_of_freedom
        return self.reuse == "better" and finer and other.path(any_level=True) == self.loose_path


@dataclass(frozen=True)
class Plan:
    """The cases that serve a configuration.

    ``cases`` by id, with the frames they keep; ``to_solve``, the ids among them that are not on disk as they are wanted;
    ``served``, by study and grid point the id of the case that stands for it (after them, behind ``cross_check``, those of
    the other engine); ``wanted``, what is measured of each;
    ``solved``, all cases on disk; ``damaged``, those whose files are, and since when; ``ladders``, digests of the recovery
    ladders by engine.
    """

    cases: dict[str, Case]
    to_solve: frozenset[str]
    served: dict[str, dict[tuple, str]]
    wanted: dict[str, Wanted]
    solved: dict[str, Solved]
    damaged: dict[str, str]
    ladders: dict[str, str]

    def recovery_of(self, case_id: str) -> str:
        """What a solve of a case is called: the same as long as what is on disk stays, another where it has to be solved again.

        So a case whose solver was killed or whose files were damaged, and one that failed with another ladder, are solved
        again; a change of the ladder does not touch the others.
        """
        ladder = self.ladders[self.cases[case_id].engine]
        if case_id in self.damaged:
            return f"{ladder}-{self.damaged[case_id]}"
        return self.solved[case_id].next_recovery(ladder) if case_id in self.solved else f"{ladder}-0"

    def with_cases(self, cases: Iterable[Case]) -> Plan:
        """The same plan and cases that no study asks for, each served by itself."""
        added = {case.case_id: case for case in cases}
        to_solve = {
            name
            for name, case in added.items()
            if (one := self.solved.get(name)) is None
            or not (one.current and one.settled(self.ladders[case.engine]) and holds(one.frames, set(case.frames)))
        }
        return replace(
            self,
            cases=self.cases | {n: c for n, c in added.items() if n not in self.cases},
            to_solve=self.to_solve | (to_solve - self.cases.keys()),
        )

    def of_study(self, name: str) -> list[str]:
        """Ids of the cases that serve a study, each once, in the order of its grid."""
        return list(dict.fromkeys(i for key, i in self.served[name].items() if key[0] != CROSS_CHECK))

    def checks_of_study(self, name: str) -> list[str]:
        """Ids of the cases of the other engine that a study is compared with."""
        return list(dict.fromkeys(i for key, i in self.served[name].items() if key[0] == CROSS_CHECK))


def make_plan(loaded: Loaded, results: Path = Path("results")) -> Plan:
    """Decide for every case of every study which case serves it, from the configuration and what is on disk.

    In this order: the study's own case where it is solved; another solved case that covers it; of the cases that must be
    solved anyway the one that goes furthest; its own, to be solved.
    """
    groups, members = _groups(loaded)
    solved, damaged = solved_cases(results)
    ladders = {engine: digest([rung.model_dump() for rung in getattr(loaded.config.recovery, engine)]) for engine in ENGINES}
    on_disk: dict[str, list[Solved]] = {}
    for one in solved.values():
        if (label := _LABEL.match(one.case_id)) and one.current and one.settled(ladders[one.described["case"]["engine"]]):
            on_disk.setdefault(label.group(), []).append(one)
    own = {group.case_id for group in groups}
    used: dict[str, Case] = {}
    frames: dict[str, set[float]] = {}
    to_solve: dict[str, list[tuple[str, Case]]] = {}
    chosen: dict[int, str] = {}
    # whatever may serve others comes before them: cases that nothing else can serve, then the furthest
    order = sorted(groups, key=lambda g: (g.reuse != "exact" and not g.whole_ramp, -g.case.actuation_pressure_max, g.case_id))
    for group in order:
        label = group.case.label
        if (found := _best_on_disk(group, on_disk.get(label, []), own)) is not None:
            used[found.case_id] = replace(group.case if found.case_id == group.case_id else found.case, frames=found.frames)
            chosen[id(group)] = found.case_id
            continue
        planned = [] if group.reuse == "exact" else [(n, c) for n, c in to_solve.get(label, []) if group.served_by(c)]
        planned = [(n, c) for n, c in planned if c.mesh_level == group.case.mesh_level]
        own_planned = [(n, c) for n, c in to_solve.get(label, []) if n == group.case_id]
        if own_planned:
            serving = group.case_id
        elif planned:
            serving = max(planned, key=lambda item: (item[1].actuation_pressure_max, item[0]))[0]
        else:
            serving = group.case_id
            to_solve.setdefault(label, []).append((serving, group.case))
            used[serving] = group.case
            frames[serving] = set(solved[serving].frames) if serving in solved and solved[serving].current else set()
        frames[serving] |= group.kept if serving == group.case_id else group.needed
        chosen[id(group)] = serving
    cases = {n: replace(c, frames=tuple(sorted(frames[n]))) if n in frames else c for n, c in used.items()}
    served = {name: {key: chosen[id(group)] for key, group in of.items()} for name, of in members.items()}
    return Plan(cases, frozenset(frames), served, wanted_cases(loaded, served=served), solved, damaged, ladders)


def _groups(loaded: Loaded) -> tuple[list[_Group], dict[str, dict[tuple, _Group]]]:
    """The distinct cases of all studies by what may stand for them, and which of them each study's grid points to."""
    groups: dict[tuple, _Group] = {}
    members: dict[str, dict[tuple, _Group]] = {}
    for name, study in loaded.studies.items():
        members[name] = {}
        whole_ramp = "fatigue" in study.measures
        twins = {(CROSS_CHECK, *key): case for key, case in cross_checks(loaded, name).items()}
        for key, case in (study_cases(loaded, name) | twins).items():
            case_id = case.case_id
            group = groups.setdefault((case_id, study.reuse, whole_ramp), _Group(case, case_id, study.reuse, whole_ramp))
            group.kept.update(case.frames)
            group.needed.update(study.needed_frames(case.ventricular_pressure))
            members[name][key] = group
    return list(groups.values()), members


def _best_on_disk(group: _Group, solved: list[Solved], own: set[str]) -> Solved | None:
    """The solved case to use for ``group``: its own first, then the one least beyond it; None where none will do.

    A case that failed before the pressures of the group serves only where it fails for a study too that asks for it
    itself: the shorter one would fail at the same increment.
    """
    usable = []
    for one in solved:
        is_own = one.case_id == group.case_id
        if not is_own and (group.reuse == "exact" or one.case is None or not group.served_by(one.case)):
            continue
        if not holds(one.frames, group.kept if is_own else group.needed):
            continue
        arrived = one.reached >= group.case.actuation_pressure_max - _CLOSE
        same_mesh = is_own or one.case.mesh_level == group.case.mesh_level
        if arrived or (same_mesh and one.case_id in own):
            size = (0, 0.0) if is_own else (one.case.mesh_level.degrees_of_freedom, one.case.actuation_pressure_max)
            usable.append(((not arrived, not is_own, *size, one.case_id), one))
    return min(usable, key=lambda item: item[0])[1] if usable else None
