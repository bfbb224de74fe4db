"""Where to solve next: designs by the hypervolume that they are expected to add, eight at a time.

Of a design the surrogates give each goal as a normal value, and the probability that its constraints are met. What it is expected
to add to the front,

    EHVI(x) = P(feasible | x) E[HV(front + g(x)) - HV(front)],

is exact for one and two goals: with two, the plane below the front is cut into strips, on which normal values have closed forms
(Yang, Emmerich, Deutz, Back 2019). A batch is chosen one after the other, each as if those before had come out as expected (the
kriging believer of Ginsbourger, Le Riche, Carraro 2010). Candidates are Sobol points and neighbours of the best designs.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.stats import norm

from limo.explore.front import dominated_volume, on_front
from limo.explore.sampling import sample
from limo.explore.space import Design, Space

#: candidates: points of the whole space, and neighbours of each design of the front with their spread in the unit cube
EVERYWHERE, NEARBY, SPREAD = 2048, 24, 0.06


class Surrogate(Protocol):
    """What gives a mean and a standard deviation (m,) at places (m, d)."""

    def predict(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]: ...

    def with_values(self, places: np.ndarray, values: np.ndarray) -> Surrogate: ...


@dataclass(frozen=True)
class Knowledge:
    """What is known when designs are proposed.

    ``goals``: a surrogate of each, to be minimised; ``feasible`` gives (m,) the probability that constraints are met at places
    (m, d); ``front`` (k, g): goals of designs that are solved and meet them; ``reference`` (g,): goals that are worse than what
    counts; ``solved`` (n, d): places of all designs that were solved or tried.
    """

    goals: Sequence[Surrogate]
    feasible: Callable[[np.ndarray], np.ndarray]
    front: np.ndarray
    reference: np.ndarray
    solved: np.ndarray


@dataclass(frozen=True)
class Proposal:
    """Places (b, d) to solve next, and what share of the hypervolume each is expected to add to that of those before."""

    places: np.ndarray
    expected: np.ndarray


def propose(
    space: Space, known: Knowledge, count: int, seed: int, allowed: Callable[[Design], bool] = lambda _: True
) -> Proposal:
    """The next ``count`` designs; never one that is solved already."""
    candidates = _candidates(space, known, seed, allowed)
    goals, front = list(known.goals), known.front.reshape(-1, len(known.reference))
    feasible = known.feasible(candidates)
    whole = max(dominated_volume(front, known.reference), 1e-300)
    chosen, expected = [], []
    free = np.ones(len(candidates), bool)
    for _ in range(min(count, len(candidates))):
        moments = [goal.predict(candidates) for goal in goals]
        mean, deviation = (np.stack(each, axis=1) for each in zip(*moments, strict=True))
        gain = np.where(free, feasible * improvement(mean, deviation, front, known.reference), -1.0)
        best = int(np.argmax(gain))
        if gain[best] <= 0:  # nothing is expected anywhere: where least is known
            best = int(np.argmax(np.where(free, (deviation / (np.ptp(mean, axis=0) + 1e-300)).sum(axis=1), -1.0)))
        free[best] = False
        chosen.append(best)
        expected.append(max(float(gain[best]), 0.0) / whole)
        place = candidates[best : best + 1]
        goals = [goal.with_values(place, mean[best : best + 1, k]) for k, goal in enumerate(goals)]
        front = np.vstack([front, mean[best : best + 1]])
    return Proposal(candidates[chosen], np.array(expected))


def _candidates(space: Space, known: Knowledge, seed: int, allowed: Callable[[Design], bool]) -> np.ndarray:
    """Places (m, d) to choose from: allowed, each once, none of them solved."""
    random = np.random.default_rng(seed)
    parts = [sample(space, EVERYWHERE, seed, allowed)]
    if len(known.solved):
        moments = np.stack([goal.predict(known.solved)[0] for goal in known.goals], axis=1)
        best = known.solved[on_front(moments)]
        near = np.repeat(best, NEARBY, axis=0) + random.normal(0, SPREAD, (NEARBY * len(best), best.shape[1]))
        moved = random.random(near.shape) < 0.1  # now and then another category
        near = space.snapped(np.clip(np.where(moved, random.random(near.shape), near), 0, 1 - 1e-9))
        parts.append(near[[allowed(design) for design in space.from_unit(near)]])
    places = np.unique(np.vstack(parts).round(9), axis=0)
    if len(known.solved):
        places = places[np.abs(places[:, None] - known.solved[None]).max(axis=2).min(axis=1) > 1e-6]
    return places


def improvement(mean: np.ndarray, deviation: np.ndarray, front: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """E[HV(front + g) - HV(front)] (m,) of normal goals with mean and standard deviation (m, g), one or two of them."""
    if len(reference) == 1:
        best = min(float(front.min(initial=np.inf)), float(reference[0]))
        return _below(mean[:, 0], deviation[:, 0], best)
    if len(reference) != 2:
        raise ValueError("one or two goals")
    inside = front[(front < reference).all(axis=1)]
    inside = inside[on_front(inside)]
    inside = inside[np.argsort(inside[:, 0])]
    # strips along the first goal; in each, what is below the front ends at a height of the second one
    edges = np.concatenate([[-np.inf], inside[:, 0], [reference[0]]])
    heights = np.concatenate([[reference[1]], inside[:, 1]])
    total = np.zeros(len(mean))
    for left, right, height in zip(edges[:-1], edges[1:], heights, strict=True):
        # int over the strip of P(g_1 <= a) da, times int below the height of P(g_2 <= b) db
        across = _below(mean[:, 0], deviation[:, 0], right)
        if np.isfinite(left):
            across = across - _below(mean[:, 0], deviation[:, 0], left)
        total += across * _below(mean[:, 1], deviation[:, 1], height)
    return total


def _below(mean: np.ndarray, deviation: np.ndarray, limit: float) -> np.ndarray:
    """E[max(limit - g, 0)] (m,) of normal values."""
    deviation = np.maximum(deviation, 1e-12)
    z = (limit - mean) / deviation
    return deviation * (z * norm.cdf(z) + norm.pdf(z))
