"""Buckling events: jumps of the stroke volume along the ramp (paper, *Buckling and folding*)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

MOST_EVENTS = 10  # events that results have room for


@dataclass(frozen=True)
class Event:
    """A jump between two accepted increments: ``before`` and ``after`` are P_a,c- and P_a,c+ in kPa, ``jump`` in ml.

    The jump is the change of stroke volume beyond what the slope on both sides would have given; positive when fluid
    leaves the ventricle.
    """

    before: float
    after: float
    jump: float


def events(
    actuation_pressure: np.ndarray,
    stroke_volume: np.ndarray,
    window: float = 8.0,
    factor: float = 4.0,
    smallest: float = 1.0,
    gap: float = 0.2,
) -> list[Event]:
    """Jumps of a curve of accepted increments: pressures (n,) in kPa, not falling, and stroke volumes (n,) in ml.

    A smooth curve changes by slope times increment, however small the increment; a jump changes by the same volume however
    small the increment. So the slope of every increment is compared with the usual one around it: the median over a fine
    grid of pressure, ``window`` kPa wide, where a jump occupies next to nothing. Neighbouring increments that are steeper than
    ``factor`` times the usual slope, and in the same direction, are one event. Together they must exceed the usual change by
    ``smallest`` ml. Less than ``gap`` kPa of rest does not divide an event.
    """
    p, v = np.asarray(actuation_pressure, float), np.asarray(stroke_volume, float)
    keep = np.isfinite(p) & np.isfinite(v)
    p, v = p[keep], v[keep]
    width = np.diff(p)
    moved = width > 0
    if moved.sum() < 3:
        return []
    start, end, rise = p[:-1][moved], p[1:][moved], np.diff(v)[moved]
    slope = rise / (end - start)
    usual = _usual_slope(start, end, slope, window)
    floor = 0.1 * np.abs(v[-1] - v[0]) / (p[-1] - p[0])
    steep = np.abs(slope - usual) > (factor - 1) * np.maximum(np.abs(usual), floor)
    direction = np.where(steep, np.sign(slope - usual), 0.0)
    merged, k = [], 0
    while k < len(slope):
        if direction[k] == 0:
            k += 1
            continue
        last = k
        for following in range(k + 1, len(slope)):
            if start[following] - end[last] > gap or direction[following] == -direction[k]:
                break
            if direction[following] == direction[k]:
                last = following
        jump = float((rise[k : last + 1] - usual[k : last + 1] * (end - start)[k : last + 1]).sum())
        if abs(jump) >= smallest:
            merged.append(Event(float(start[k]), float(end[last]), jump))
        k = last + 1
    return merged


def largest_events(candidates: list[Event]) -> list[Event]:
    """The ``MOST_EVENTS`` with the largest jumps, in the order in which they happen."""
    return sorted(sorted(candidates, key=lambda e: -abs(e.jump))[:MOST_EVENTS], key=lambda e: e.before)


def _usual_slope(start: np.ndarray, end: np.ndarray, slope: np.ndarray, window: float) -> np.ndarray:
    """Median slope (n,) over pressure, within half a ``window`` of the middle of each increment."""
    grid = np.linspace(start[0], end[-1], max(int((end[-1] - start[0]) / window * 200), 200))
    fine_slope = slope[np.clip(np.searchsorted(end, grid), 0, len(slope) - 1)]
    middle = 0.5 * (start + end)
    half = np.maximum(0.5 * window, end - start)
    return np.array([np.median(fine_slope[np.abs(grid - m) <= h]) for m, h in zip(middle, half, strict=True)])


def displacement_difference(before: np.ndarray, after: np.ndarray, length: float) -> np.ndarray:
    """||u(P_a,c+) - u(P_a,c-)|| / L (n,), from displacements (n, 3) and the device length in mm."""
    return np.linalg.norm(np.asarray(after, float) - np.asarray(before, float), axis=-1) / length
