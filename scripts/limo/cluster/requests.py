"""What the rules state as resources: functions of wildcards and attempt, as Snakemake calls them.

They are here and not beside the rules because Snakemake's own parser takes a hundred times as long as Python's.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from limo.cases.case import Case
from limo.cases.plan import Plan
from limo.cluster.resources import script_memory, script_minutes, solve_memory, solve_minutes


class Requests:
    """Memory (MiB) and time (min) of the jobs of a plan.

    ``case_of``: the case that wildcards name; ``costs_of``: predicted CPU times (s) by case, of the plan that holds a case.
    """

    def __init__(self, plan: Plan, case_of: Callable[[Any], Case], costs_of: Callable[[str], Mapping[str, float]]):
        self.plan, self.case_of, self.costs_of = plan, case_of, costs_of

    def memory_of(self, script: str) -> Callable[[Any, int], int]:
        """What a script asks for."""

        def memory(wildcards: Any, attempt: int) -> int:
            case = self.case_of(wildcards) if hasattr(wildcards, "case") else None
            return script_memory(script, attempt, case, self._cases_behind(wildcards))

        return memory

    def minutes_of(self, script: str) -> Callable[[Any, int], int]:
        """The same in minutes."""

        def minutes(wildcards: Any, attempt: int) -> int:
            return script_minutes(script, attempt, self._cases_behind(wildcards))

        return minutes

    def memory_to_solve(self, wildcards: Any, attempt: int) -> int:
        """What solving a case asks for."""
        return solve_memory(self.case_of(wildcards), attempt)

    def minutes_to_solve(self, wildcards: Any, attempt: int) -> int:
        """The same in minutes."""
        return solve_minutes(self.seconds_to_solve(wildcards), attempt)

    def minutes_to_time(self, wildcards: Any, attempt: int) -> int:
        """The same where a case is solved again, a few times at most."""
        return 3 * self.minutes_to_solve(wildcards, attempt)

    def seconds_to_solve(self, wildcards: Any) -> int:
        """CPU time that a case will take."""
        return round(self.costs_of(wildcards.case).get(wildcards.case, 0))

    def _cases_behind(self, wildcards: Any) -> int:
        """How many cases a study has that a path names; 0 for a path without one."""
        return len(self.plan.sources(wildcards.study)) if hasattr(wildcards, "study") else 0
