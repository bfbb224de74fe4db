"""Pareto fronts, and the part of the space of goals that they dominate (``moocore``). All goals are minimised here."""

from __future__ import annotations

import moocore
import numpy as np


def on_front(goals: np.ndarray) -> np.ndarray:
    """Which of goals (n, m) no other one betters in all; of equal ones each."""
    goals = np.asarray(goals, float)
    return moocore.is_nondominated(goals, keep_weakly=True) if len(goals) else np.empty(0, bool)


def dominated_volume(goals: np.ndarray, reference: np.ndarray) -> float:
    """The hypervolume between goals (n, m) and a reference (m,) that is worse than what counts; 0 without any."""
    goals = np.asarray(goals, float).reshape(-1, len(reference))
    inside = goals[(goals < reference).all(axis=1)]
    return float(moocore.hypervolume(inside, ref=reference)) if len(inside) else 0.0


def knee(goals: np.ndarray) -> int:
    """The place on a front (n, m) farthest below the plane through its ends, goals scaled by their ranges: where they turn."""
    goals = np.asarray(goals, float)
    scaled = (goals - goals.min(axis=0)) / np.where(np.ptp(goals, axis=0) > 0, np.ptp(goals, axis=0), 1.0)
    return int(np.argmin(scaled.sum(axis=1)))
