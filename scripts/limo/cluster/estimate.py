"""What a sweep asks a cluster for, before anything is submitted: jobs, core hours, memory and time of the largest."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

from limo.cases.cost import plan_costs
from limo.cases.plan import Plan
from limo.cluster.profile import Profile
from limo.cluster.resources import core_hours, script_memory, script_minutes, solve_memory, solve_minutes
from limo.cluster.start import Asked
from limo.config.project import Project
from limo.schema.figures import items_of


@dataclass(frozen=True)
class Estimate:
    """Jobs that a sweep submits; core hours that are predicted and that jobs ask for at most; MiB and minutes of the largest."""

    jobs: int
    predicted: float
    asked: float
    memory: int
    minutes: int


def estimate(project: Project, plan: Plan, studies: Collection[str]) -> Estimate:
    """What the cases of some studies ask for that are still to be solved, each with its measures as one job.

    Their datasets and figures are jobs, too, and one job looks at a node first.
    """
    costs, threads = plan_costs(plan), project.config.solver.threads
    left = sorted({c for s in studies for c in (*plan.of_study(s), *plan.checks_of_study(s))} & plan.to_solve)
    minutes = [solve_minutes(costs[c]) + (script_minutes("measure_case") if c in plan.wanted else 0) for c in left]
    memory = [solve_memory(plan.cases[c]) for c in left]
    memory += [script_memory("measure_case", case=plan.cases[c]) for c in left if c in plan.wanted]
    figures = [project.studies[name].figures for name in studies]
    gathered = sum(1 + len(drawn) + bool(items_of(drawn)) for drawn in figures)
    return Estimate(
        jobs=len(left) + gathered + bool(left),
        predicted=sum(costs[c] for c in left) / 3600,
        asked=sum(core_hours(m, threads) for m in minutes),
        memory=max(memory, default=0),
        minutes=max(minutes, default=0),
    )


def longest(plan: Plan, studies: Collection[str], partition: str) -> list[Asked]:
    """What the longest case that is still to be solved asks a partition for; nothing where none is."""
    costs = plan_costs(plan)
    left = {c for s in studies for c in (*plan.of_study(s), *plan.checks_of_study(s))} & plan.to_solve
    worst = sorted(left, key=lambda c: (-costs[c], c))[:1]
    return [
        Asked("solve_case", c, solve_minutes(costs[c]), solve_memory(plan.cases[c]), costs[c], partition=partition) for c in worst
    ]


def estimate_text(found: Estimate, profile: Profile) -> str:
    """The lines that ``limo check --on`` adds."""
    where = f"  on {profile.folder.name}: {found.jobs} jobs, at most {profile.jobs} at once"
    hours = f"{found.predicted:.3g} core hours are predicted, jobs ask for {found.asked:.3g}"
    return f"{where}; {hours}\n  the largest job asks for {found.minutes} min and {found.memory} MiB"
