"""Which case stands for which: what is solved already, what has to be solved, and nothing twice.

The ramp of a case does not know where it will stop, so a case that goes to a higher P_a,max passes through every state of
one that stops earlier: one solve serves both. A study says how far this may go (``reuse``).
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

from limo.cases.case import Case
from limo.cases.grid import cross_checks, study_cases
from limo.cases.solved import _CLOSE, Solved, holds, solved_cases
from limo.cases.wanted import Wanted, wanted_cases
from limo.config.project import Loaded
from limo.schema.section import ENGINES
from limo.store.digest import digest

CROSS_CHECK = "cross_check"
_LABEL = re.compile(r"^\w+?_np\d+_pv[\d.]+_ar[\d.]+_eh[\d.]+(?=_)")


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
