"""Which designs to solve by the finer preset: the ends of the front, where it turns, what is robust, and what fills it.

A robust design is good within the tolerances it is made with. Each goal is the mean over inputs that scatter about the design,
plus one standard deviation, by the surrogates; its constraints must hold with a probability of a half or more on the average.
"""

from __future__ import annotations

import numpy as np

from limo.explore.front import dominated_volume, knee
from limo.explore.learn import Learned

#: designs about one, for its robustness
ABOUT = 128


def recommended(learned: Learned, count: int) -> dict[str, int]:
    """Numbers of at most ``count`` designs by why they are chosen; none where no design is feasible."""
    front = learned.front
    if not len(front):
        return {}
    goals, picked = learned.goals[front], {}
    for k, (name, way) in enumerate(learned.exploration.goals.items()):
        picked[f"{way} {name}"] = int(front[np.argmin(goals[:, k])])
    picked["where the front turns"] = int(front[knee(goals)])
    if learned.exploration.tolerance and (sturdy := robust(learned)) is not None:
        picked["robust"] = sturdy
    chosen: dict[str, int] = {}
    for why, number in picked.items():
        if number in chosen.values():
            before = next(reason for reason, known in chosen.items() if known == number)
            chosen = {(f"{reason}, {why}" if reason == before else reason): known for reason, known in chosen.items()}
        elif len(chosen) < count:
            chosen[why] = number
    left = [int(number) for number in front if number not in chosen.values()]
    while left and len(chosen) < count:
        gains = [dominated_volume(learned.goals[[*chosen.values(), number]], learned.reference) for number in left]
        best = left.pop(int(np.argmax(gains)))
        chosen[f"fills the front, {len(chosen)}"] = best
    return chosen


def robust(learned: Learned) -> int | None:
    """The feasible design that is best within tolerances, by the sum of goals over their ranges; None without surrogates."""
    knowledge = learned.knowledge()
    numbers = np.flatnonzero(learned.feasible)
    if knowledge is None or not len(numbers):
        return None
    spread = spread_of(learned)
    random = np.random.default_rng(learned.seed).standard_normal((ABOUT, len(spread)))
    rated, likely = [], []
    for number in numbers:
        about = np.clip(learned.places[number] + random * spread, 0, 1 - 1e-9)
        about[:, spread == 0] = learned.places[number, spread == 0]
        about = learned.space.snapped(about)
        means = [goal.predict(about)[0] for goal in knowledge.goals]
        rated.append([mean.mean() + mean.std() for mean in means])
        likely.append(float(knowledge.feasible(about).mean()))
    rated, likely = np.array(rated), np.array(likely)
    scaled = (rated - rated.min(axis=0)) / np.maximum(np.ptp(rated, axis=0), 1e-12)
    scaled[likely < 0.5] += 10.0
    return int(numbers[np.argmin(scaled.sum(axis=1))])


def spread_of(learned: Learned) -> np.ndarray:
    """Standard deviations (d,) of inputs as they are made, in the unit cube; 0 of those without a tolerance."""
    tolerance = learned.exploration.tolerance
    return np.array([tolerance.get(i.name, 0.0) / (i.high - i.low) if not i.values else 0.0 for i in learned.space.inputs])
