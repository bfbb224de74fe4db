"""Stroke, fluidic lever and mechanical efficiency from the volumes of a ramp (paper, *Afterload sensitivity*)."""

from __future__ import annotations

import numpy as np

#: pouch volume, over its largest, up to which the ratio says nothing, and the same of its change since P_a = 0
SMALLEST_VOLUME, SMALLEST_CHANGE = 1.0e-2, 2.0e-3


def io_ratio(stroke_volume: np.ndarray, actuation_volume: np.ndarray) -> np.ndarray:
    """Delta V_v / V_a (n,): stroke since P_a = 0 over the total pouch volume (paper, *Deformation and pressure-volume*).

    NaN while the pouches hold hardly anything. Without contact V_a is negative at rest, where the epicardium lies inside the
    endocardium, and passes through zero on its way.
    """
    return _over(stroke_volume, actuation_volume, SMALLEST_VOLUME)


def io_ratio_of_change(stroke_volume: np.ndarray, actuation_volume_change: np.ndarray) -> np.ndarray:
    """Delta V_v / Delta V_a (n,), both from P_a = 0; NaN while the actuation volume has hardly changed."""
    return _over(stroke_volume, actuation_volume_change, SMALLEST_CHANGE)


def _over(stroke_volume: np.ndarray, volume: np.ndarray, smallest: float) -> np.ndarray:
    """Their ratio where ``volume`` is more than a share of its largest value, and that is positive; else NaN."""
    volume = np.asarray(volume, float)
    if not len(volume) or not np.isfinite(volume).any():
        return np.full(len(volume), np.nan)
    usable = volume > smallest * max(np.nanmax(volume), 0.0)
    return np.where(usable, stroke_volume / np.where(usable, volume, 1.0), np.nan)


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
