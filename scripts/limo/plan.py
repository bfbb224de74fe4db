"""Which case stands for which: what is solved already, what has to be solved, and nothing twice.

The ramp of a case does not know where it will stop, so a case that goes to a higher P_a,max passes through every state of
one that stops earlier: one solve serves both. A study says how far this may go (``reuse``).
"""

from __future__ import annotations

import logging
import re
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from limo.case import SOLVE_CODE, Case, Wanted, cross_checks, solve_code, study_cases, wanted_cases
from limo.config import Loaded
from limo.errors import ResultError
from limo.files import read_json

log = logging.getLogger(__name__)
CROSS_CHECK = "cross_check"
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
        return float("inf") if self.status.get("status") == "converged" else self.status.get("actuation_pressure_reached") or 0.0


def solved_cases(results: Path) -> dict[str, Solved]:
    """The cases below ``results/cases`` by id; a folder whose files are absent or damaged is not one."""
    found = {}
    folder = results / "cases"
    for name in sorted(p.name for p in folder.iterdir()) if folder.is_dir() else ():
        try:
            described, status = read_json(folder / name / "case.json"), read_json(folder / name / "status.json")
        except ResultError as error:
            log.debug("%s", error)
            continue
        found[name] = Solved(name, described, status)
    return found


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
    ``solved``, all cases on disk.
    """

    cases: dict[str, Case]
    to_solve: frozenset[str]
    served: dict[str, dict[tuple, str]]
    wanted: dict[str, Wanted]
    solved: dict[str, Solved]

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
    solved = solved_cases(results)
    on_disk: dict[str, list[Solved]] = {}
    for one in solved.values():
        if (label := _LABEL.match(one.case_id)) and one.current:
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
    return Plan(cases, frozenset(frames), served, wanted_cases(loaded, served=served), solved)


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
