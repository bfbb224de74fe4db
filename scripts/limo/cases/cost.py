"""How long a case will take: a prior from measured runs, corrected by the cases that finished.

The solver's CPU time is iterations times the time of one. Iterations grow with the pressure to be reached and fall with the
number of pouches; the time of one grows with the size of the model to a power a little above 1 (sparse factorisation of a
shell). What a prior cannot know, speed of the machine, build, snapping, is learned as a factor from similar finished cases.
No dependency writes a time with as few digits as a prediction deserves, so ``duration`` does.
"""

from __future__ import annotations

import heapq
from collections.abc import Collection, Iterable, Mapping
from typing import Any

import numpy as np

from limo.cases.case import Case
from limo.cases.plan import Plan
from limo.cases.solved import Solved

#: measured on the quarter model of level preview: s an iteration at 21 thousand displacements of four quarters, its growth
SECONDS_PER_ITERATION, SIZE, GROWTH = 0.16, 21000, 1.3
#: CPU time of an engine over that of CalculiX
SHARE = {"calculix": 1.0, "newton": 1 / 12}
#: CPU time of an element over that of bricks, fits on coarser meshes and contact included
ELEMENT_SHARE = {"SHELL8R": 0.21}
#: MiB of the process that solves, by engine: for any model, and for each thousand displacements of the part that is solved
MEMORY = {"calculix": (137.0, 2.5), "newton": (265.0, 10.5)}
#: the second number for elements of fewer unknowns
ELEMENT_MEMORY = {"SHELL8R": 6.7}
#: share of the full device that is solved
PART = {"full": 1.0, "front_back": 0.5, "quarter": 0.25}
#: iterations of fit and hold; iterations a kPa of the ramp with no pouches, what each pouch takes off, and the least
STILL, PER_KPA, PER_POUCH, LEAST_PER_KPA = 300, 45.0, 2.6, 10.0
#: share of a run's time that fit and hold take, by engine, measured on level preview
STILL_SHARE = {"calculix": (0.17, 0.09), "newton": (0.31, 0.0)}
#: weight of the prior among finished cases, and how far (kPa, 1) a case may differ from another and still tell about it
PRIOR_WEIGHT = 0.3
#: ``SIZE_REACH``: by how many doublings of its size a case may differ until the factor of others says little of it
SIZE_REACH = 1.5
REACH = {"n_pouches": 1.5, "ventricular_pressure": 5.0, "actuation_pressure_max": 30.0, "aspect_ratio": 0.7}


def prior_seconds(case: Mapping[str, Any]) -> float:
    """CPU seconds of a case, as ``Case.to_dict`` describes it, on the machine the constants were measured on.

    The engine newton takes a twelfth of CalculiX's time on the same model. The legs of a cycle count as ramps as long, and a ml
    of a syringe as a kPa.
    """
    size = case["mesh_level"]["degrees_of_freedom"] * PART[case["mesh"]["symmetry"]] / (SIZE * PART["quarter"])
    per_kpa = max(PER_KPA - PER_POUCH * case["n_pouches"], LEAST_PER_KPA)
    points = np.array([(case["ventricular_pressure"], case["actuation_pressure_max"]), *case.get("cycle", ())])
    legs = float(np.abs(np.diff(points, axis=0)).max(axis=1, initial=0.0).sum())
    legs += float(np.abs(np.diff([0.0, *(volume or 0.0 for volume in case.get("syringe", ()))])).sum())
    iterations = STILL + per_kpa * (case["actuation_pressure_max"] + legs)
    share = SHARE[case["engine"]] * ELEMENT_SHARE.get(case["mesh"]["element"], 1.0)
    return iterations * SECONDS_PER_ITERATION * size**GROWTH * share


def memory_mib(case: Case) -> float:
    """Peak memory (MiB) of solving a case, as measured of newton and of CalculiX's tuned build; a stock one takes less."""
    fixed, per_thousand = MEMORY[case.engine]
    per_thousand = ELEMENT_MEMORY.get(case.mesh.element, per_thousand)
    return fixed + per_thousand * case.mesh_level.degrees_of_freedom * PART[case.mesh.symmetry] / 1000


def _place(case: Mapping[str, Any]) -> list[float]:
    """Where a case lies among others, in units of what tells them apart; its size comes first."""
    part = case["mesh_level"]["degrees_of_freedom"] * PART[case["mesh"]["symmetry"]]
    return [
        float(np.log2(part)) / SIZE_REACH,
        *(case[name] / reach for name, reach in REACH.items()),
        float(np.log2(case["stiffness_ratio"])),
    ]


def _kind(case: Mapping[str, Any]) -> tuple:
    """Cases of different kinds tell nothing about each other: engine, and numerics (damping sets the increments)."""
    return case["engine"], case["numerics_name"], case["mesh"]["element"]


def predict(cases: Iterable[Case], solved: Iterable[Solved] = ()) -> list[float]:
    """CPU seconds of each case. ``solved``: cases on disk; those that did not converge tell nothing and are left out."""
    known: dict[tuple, list[tuple[list[float], float]]] = {}
    for one in solved:
        seconds = one.status.solver_cpu_seconds or 0.0
        if not (one.status.is_usable and seconds > 0):
            continue
        try:
            case = one.described["case"]
            known.setdefault(_kind(case), []).append((_place(case), float(np.log(seconds / prior_seconds(case)))))
        except (KeyError, TypeError, ValueError, ZeroDivisionError):
            continue  # described by another version
    arrays = {kind: (np.array([p for p, _ in each]), np.array([e for _, e in each])) for kind, each in known.items()}
    return [prior_seconds(case) * _factor(case, arrays.get(_kind(case))) for case in map(Case.to_dict, cases)]


def _factor(case: Mapping[str, Any], known: tuple[np.ndarray, np.ndarray] | None) -> float:
    """By how much the prior is off for a case: the mean over all of its kind and about its size, refined by what is near it.

    ``known``: places (n, 6) of finished cases of the kind, and logarithms (n,) of how far the prior was off. What a small case
    takes beside its iterations would make a large one look many times too dear, so sizes count from the start.
    """
    if known is None:
        return 1.0
    places, errors = known
    away = (places - _place(case)) ** 2
    alike = np.exp(-0.5 * away[:, 0])
    # however many small ones there are, they tell no more of a large one than the largest of them may
    everywhere = alike.max() * len(errors) / (len(errors) + PRIOR_WEIGHT) * (alike * errors).sum() / max(alike.sum(), 1e-300)
    near = np.exp(-0.5 * away.sum(axis=1))
    return float(np.exp(everywhere + (near * (errors - everywhere)).sum() / (near.sum() + PRIOR_WEIGHT)))


def share_done(engine: str, fitted: float, held: float, ramped: float) -> float:
    """Share of a run that is done (0 to 1) from the shares of its stages that are."""
    fit, hold = STILL_SHARE[engine]
    return fit * fitted + hold * held + (1.0 - fit - hold) * ramped


def seconds_left(predicted: float, elapsed: float, share: float) -> float:
    """Time (s) that a run still takes, of which a share is done after ``elapsed`` s.

    Total time blends the prediction (weight 1 - share) with ``elapsed / share`` (weight share).
    """
    return (1.0 - share) * ((1.0 - share) * predicted + elapsed)


def plan_costs(plan: Plan) -> dict[str, float]:
    """Predicted CPU seconds of every case that is to be solved, by its id."""
    names = sorted(plan.to_solve)
    return dict(zip(names, predict((plan.cases[n] for n in names), plan.solved.values()), strict=True))


def ranks(costs: Mapping[str, float], first: Collection[str] = ()) -> dict[str, int]:
    """Priorities from 1 (the shortest) upwards, so that the longest case starts first; those in ``first`` before all others."""
    return {name: k for k, name in enumerate(sorted(costs, key=lambda n: (n in first, costs[n], n)), 1)}


def schedule(costs: Iterable[float], cores: int) -> float:
    """Wall time (s) when ``cores`` cores take the longest case that is left whenever they are free.

    At most 4/3 of the shortest possible.
    """
    free = [0.0] * max(cores, 1)
    for cost in sorted(costs, reverse=True):
        heapq.heapreplace(free, free[0] + cost)
    return max(free)


def duration(seconds: float) -> str:
    """A time for people, with as many digits as a prediction deserves: ``40 s``, ``23 min``, ``5.5 h``."""
    if seconds < 100:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 6000 else f"{seconds / 3600:.1f} h"
