"""Stroke, fluidic lever and mechanical efficiency from the volumes of a ramp (paper, *Afterload sensitivity*)."""

from __future__ import annotations

import numpy as np

#: actuation volume change, over its largest, below which a ratio of two near-zero volumes says nothing
SMALLEST_CHANGE = 2.0e-3


def io_ratio(stroke_volume: np.ndarray, actuation_volume_change: np.ndarray) -> np.ndarray:
    """Delta V_v / Delta V_a (n,), both from P_a = 0; NaN while the actuation volume has hardly changed."""
    change = np.asarray(actuation_volume_change, float)
    if not len(change) or not np.isfinite(change).any():
        return np.full(len(change), np.nan)
    usable = change > SMALLEST_CHANGE * np.nanmax(change)
    return np.where(usable, stroke_volume / np.where(usable, change, 1.0), np.nan)


def works(
    actuation_pressure: np.ndarray, ventricular_pressure: float, stroke_volume: np.ndarray, actuation_volume_change: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """W_out = P_v Delta V_v and W_in = int P_a dV_a (n,) in mJ; pressures in kPa, volumes in ml (kPa ml = mJ)."""
    from scipy.integrate import cumulative_trapezoid  # takes 0.5 s

    work_in = cumulative_trapezoid(actuation_pressure, actuation_volume_change, initial=0.0)
    return ventricular_pressure * np.asarray(stroke_volume), work_in


def first_crossing(values: np.ndarray, level: float) -> float | None:
    """Fractional index at which ``values`` (n,) first reaches ``level``; None when it never does."""
    reached = np.flatnonzero(values >= level)
    if not len(reached):
        return None
    k = int(reached[0])
    if k == 0 or values[k] == values[k - 1]:
        return float(k)
    return k - 1 + (level - values[k - 1]) / (values[k] - values[k - 1])


def efficiency_at_stroke(
    actuation_pressure: np.ndarray,
    ventricular_pressure: float,
    stroke_volume: np.ndarray,
    actuation_volume_change: np.ndarray,
    stroke: float = 90.0,
) -> tuple[float, float]:
    """eta = W_out / W_in where the stroke volume first reaches ``stroke`` (ml), and the P_a (kPa) at which it does.

    Both NaN when that stroke is never reached.
    """
    index = first_crossing(np.asarray(stroke_volume), stroke)
    if index is None:
        return float("nan"), float("nan")
    counts = np.arange(len(stroke_volume))
    work_out, work_in = works(actuation_pressure, ventricular_pressure, stroke_volume, actuation_volume_change)
    eta = np.interp(index, counts, work_out) / np.interp(index, counts, work_in)
    return float(eta), float(np.interp(index, counts, actuation_pressure))
