"""Which case stands for which: what is solved already, what has to be solved, and nothing twice.

The ramp of a case does not know where it will stop. A case that goes to a higher P_a,max passes through every state of one that
stops earlier, so one solve serves both. A study says how far this may go (``reuse``).
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from limo.cases.case import Case
from limo.cases.grid import GridPoint, cross_checks, study_cases
from limo.cases.solved import Solved, holds, solved_cases
from limo.cases.wanted import Wanted, wanted_cases
from limo.config.project import Project
from limo.schema.pressures import is_beyond, reaches
from limo.schema.section import ENGINES
from limo.schema.study import Study
from limo.store.digest import digest

_LABEL = re.compile(r"^\w+?_np\d+_pv[\d.]+_ar[\d.]+_eh[\d.]+(?=_)")
#: by study and grid point the id of the case that stands for it
Serving = Mapping[str, Mapping[GridPoint, str]]


@dataclass(eq=False)
class _Group:
    """One case as some studies want it: with their ``reuse``, and the frames (kPa) that they keep and need."""

    case: Case
    reuse: str
    whole_ramp: bool  # whether something is wanted that only the study's own P_a,max gives: fatigue is a maximum over the ramp
    kept: set[float] = field(default_factory=set)
    needed: set[float] = field(default_factory=set)

    @property
    def case_id(self) -> str:
        return self.case.case_id

    @property
    def order(self) -> tuple:
        """By which those come first that may serve others: cases that nothing else can serve, then the furthest."""
        return self.reuse != "exact" and not self.whole_ramp, -self.case.actuation_pressure_max, self.case_id

    def served_by(self, other: Case) -> bool:
        """Whether another case passes through all states of this one, or through those of this one on a better mesh."""
        first, second = self.case.actuation_pressure_max, other.actuation_pressure_max
        if self.reuse == "exact" or is_beyond(first, second) or (self.whole_ramp and is_beyond(second, first)):
            return False
        if other.path == self.case.path:
            return True
        finer = other.mesh_level.degrees_of_freedom > self.case.mesh_level.degrees_of_freedom
        return self.reuse == "better" and finer and other.path_on_any_level == self.case.path_on_any_level


@dataclass(frozen=True)
class Plan:
    """The cases that serve a configuration.

    ``cases`` by id, with the frames they keep, and those at whose states at rest others begin; ``to_solve``, the ids among
    them that are not on disk as they are wanted; ``served``, by study and grid point the id of the case that stands for it;
    ``checks``, the same of the other engine's cases that a study is compared with; ``wanted``, what is measured of each;
    ``solved``, all cases on disk; ``damaged``, those whose files are, and since when; ``ladders``, digests of the recovery
    ladders by engine.
    """

    cases: dict[str, Case]
    to_solve: frozenset[str]
    served: Serving
    checks: Serving
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
        """The same plan and cases that no study asks for, with those at whose states they begin; each is served by itself."""
        added = {each.case_id: each for case in cases for each in (case, *case.fits)}
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

    def with_fits(self, case_ids: Collection[str]) -> set[str]:
        """Ids of cases, and of those at whose states at rest they begin."""
        return {each.case_id for name in case_ids for each in (self.cases[name], *self.cases[name].fits)}

    def serving(self, name: str) -> list[str]:
        """Ids of the cases that serve a study, one for each point in the order of its grid."""
        return list(self.served[name].values())

    def sources(self, name: str) -> list[str]:
        """The same, and behind them the ids of the cases that it is compared with: what its dataset is gathered from."""
        return [*self.serving(name), *self.checks[name].values()]

    def of_study(self, name: str) -> list[str]:
        """Ids of the cases that serve a study, each once, in the order of its grid."""
        return list(dict.fromkeys(self.serving(name)))

    def checks_of_study(self, name: str) -> list[str]:
        """Ids of the cases of the other engine that a study is compared with."""
        return list(dict.fromkeys(self.checks[name].values()))


def make_plan(project: Project, results: Path = Path("results")) -> Plan:
    """Decide for every case of every study which case serves it, from the configuration and what is on disk.

    In this order: the study's own case where it is solved; another solved case that covers it; of the cases that must be
    solved anyway the one that goes furthest; its own, to be solved.
    """
    solved, damaged = solved_cases(results)
    ladders = {e: digest([rung.model_dump() for rung in getattr(project.config.recovery, e)]) for e in ENGINES}
    groups, members, twins = _Groups(), {}, {}
    for name, study in project.studies.items():
        members[name] = groups.of_cases(study, study_cases(project, name))
        twins[name] = groups.of_cases(study, cross_checks(project, name))
    choice = _Choice(solved, ladders, {group.case_id for group in groups.every})
    for group in sorted(groups.every, key=lambda group: group.order):
        choice.serve(group)
    cases = {n: replace(c, frames=tuple(sorted(choice.frames[n]))) if n in choice.frames else c for n, c in choice.used.items()}
    fits = {fit.case_id: fit for case in cases.values() for fit in case.fits}
    served, checks = choice.serving(members), choice.serving(twins)
    wanted = wanted_cases(project, served=served)
    plan = Plan(cases, frozenset(choice.frames), served, checks, wanted, solved, damaged, ladders)
    return plan.with_cases(fits.values()) if fits else plan


class _Groups:
    """The distinct cases of all studies by what may stand for them."""

    def __init__(self) -> None:
        self._groups: dict[tuple, _Group] = {}

    @property
    def every(self) -> list[_Group]:
        return list(self._groups.values())

    def of_cases(self, study: Study, cases: Mapping[GridPoint, Case]) -> dict[GridPoint, _Group]:
        """The groups that points of a study's grid belong to."""
        whole_ramp, members = "fatigue" in study.measures, {}
        needed = {pressure: study.needed_frames(pressure) for pressure in study.axes.ventricular_pressure}
        for point, case in cases.items():
            group = self._groups.setdefault((case.case_id, study.reuse, whole_ramp), _Group(case, study.reuse, whole_ramp))
            group.kept.update(case.frames)
            group.needed.update(needed[point.ventricular_pressure])
            members[point] = group
        return members


class _Choice:
    """Which case serves each group: ``used`` cases by id, ``frames`` of those that are to be solved, ``chosen`` id by group."""

    def __init__(self, solved: Mapping[str, Solved], ladders: Mapping[str, str], asked: set[str]):
        self.used: dict[str, Case] = {}
        self.frames: dict[str, set[float]] = {}
        self.chosen: dict[_Group, str] = {}
        self._solved, self._asked = solved, asked
        self._on_disk: dict[str, list[Solved]] = {}
        self._to_solve: dict[str, list[Case]] = {}
        for one in solved.values():
            if (label := _LABEL.match(one.case_id)) and one.current and one.settled(ladders[one.engine]):
                self._on_disk.setdefault(label.group(), []).append(one)

    def serve(self, group: _Group) -> None:
        """Choose the case that serves a group."""
        one = self._best_on_disk(group)
        self.chosen[group] = self._planned(group) if one is None else one.case_id
        if one is not None:
            self.used[one.case_id] = replace(group.case if one.case_id == group.case_id else one.case, frames=one.frames)

    def serving(self, groups: Mapping[str, Mapping[GridPoint, _Group]]) -> Serving:
        """The ids of the chosen cases in the places of groups."""
        return {name: {point: self.chosen[group] for point, group in each.items()} for name, each in groups.items()}

    def _best_on_disk(self, group: _Group) -> Solved | None:
        """The solved case to use for ``group``: its own first, then the one least beyond it; None where none will do.

        A case that failed before the pressures of the group serves only where it fails for a study too that asks for it
        itself: the shorter one would fail at the same increment.
        """
        usable = []
        for one in self._on_disk.get(group.case.label, ()):
            is_own = one.case_id == group.case_id
            if not is_own and (group.reuse == "exact" or one.case is None or not group.served_by(one.case)):
                continue
            if not holds(one.frames, group.kept if is_own else group.needed):
                continue
            arrived = reaches(one.status.reached, group.case.actuation_pressure_max)
            same_mesh = is_own or one.case.mesh_level == group.case.mesh_level
            if arrived or (same_mesh and one.case_id in self._asked):
                size = (0, 0.0) if is_own else (one.case.mesh_level.degrees_of_freedom, one.case.actuation_pressure_max)
                usable.append(((not arrived, not is_own, *size, one.case_id), one))
        return min(usable, key=lambda item: item[0])[1] if usable else None

    def _planned(self, group: _Group) -> str:
        """The id of the case that is to be solved for a group: one that is already, or its own."""
        planned = self._to_solve.setdefault(group.case.label, [])
        others = [c for c in planned if c.mesh_level == group.case.mesh_level and group.served_by(c)]
        serving = group.case_id
        if others and all(case.case_id != group.case_id for case in planned):
            serving = max(others, key=lambda case: (case.actuation_pressure_max, case.case_id)).case_id
        if serving not in self.frames:
            planned.append(group.case)
            self.used[serving] = group.case
            known = self._solved.get(serving)
            self.frames[serving] = set(known.frames) if known is not None and known.current else set()
        self.frames[serving] |= group.kept if serving == group.case_id else group.needed
        return serving
