"""Measured curves on the axes of a figure: loading and unloading, cycles, and measured efficiencies beside simulated ones."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.lines import Line2D

from limo.bench.curves import LOADING, SAME_PRESSURE, UNLOADING

#: points of a branch that are drawn at most; what is left of cycles after the first
_POINTS, _LATER = 60, 0.35
#: markers of curves, and greys of those whose N_p no simulated curve has
_MARKERS, _GREYS = ("o", "s", "D", "^", "P", "X"), ("0.0", "0.35", "0.55", "0.2", "0.45", "0.65")
_BAR = "0.55"


def color_of(label: str, measured: pd.DataFrame, colors: Mapping[int, str]) -> str:
    """The colour of the simulated curve of the same N_p (``colors``), or a grey."""
    count = measured.n_pouches[measured.label == label].iloc[0]
    if np.isfinite(count) and int(count) in colors:
        return colors[int(count)]
    return _GREYS[_number(label, measured) % len(_GREYS)]


def _number(label: str, measured: pd.DataFrame) -> int:
    return list(dict.fromkeys(measured.label)).index(label)


def curves(axis, measured: pd.DataFrame, name: str, colors: Mapping[int, str], size: float = 2.6) -> list[Line2D]:
    """Draw a measured quantity over P_a, with markers of a ``size``; returns what a legend needs, nothing where there is none.

    Loading is hollow with a thin line, unloading filled with a dashed one; the loop between both is shaded, cycles after the
    first are paler.
    """
    handles, falls = [], False
    for label, table in measured.groupby("label", sort=False):
        known = table.dropna(subset=["actuation_pressure", name])
        if known.empty:
            continue
        color, marker = color_of(label, measured, colors), _MARKERS[_number(label, measured) % len(_MARKERS)]
        for (cycle, direction), branch in known.groupby(["cycle", "direction"], sort=False):
            alpha, up = 1.0 if cycle == known.cycle.min() else _LATER, direction == LOADING
            pressure, values = branch.actuation_pressure.to_numpy(float), branch[name].to_numpy(float)
            axis.plot(pressure, values, "-" if up else "--", lw=0.6, color=color, alpha=0.7 * alpha)
            every, face = max(1, len(pressure) // _POINTS), "white" if up else color
            axis.plot(pressure[::every], values[::every], marker, ms=size, mew=size / 4, mfc=face, color=color, alpha=alpha)
        _shade(axis, known[known.cycle == known.cycle.min()], name, color)
        handles.append(Line2D([], [], ls="-", lw=0.6, marker=marker, ms=4, mfc="white", color=color, label=f"measured, {label}"))
        falls |= bool((known.direction == UNLOADING).any())
    if falls:
        handles.append(Line2D([], [], ls="--", lw=0.6, marker="o", ms=4, color="0.35", label="measured, unloading"))
    return handles


def _shade(axis, cycle: pd.DataFrame, name: str, color: str) -> None:
    """The area between loading and unloading of a cycle: what hysteresis takes."""
    up, down = (cycle[cycle.direction == d].sort_values("actuation_pressure") for d in (LOADING, UNLOADING))
    if len(up) < 2 or len(down) < 2:
        return
    low, high = max(x.actuation_pressure.min() for x in (up, down)), min(x.actuation_pressure.max() for x in (up, down))
    pressure = np.linspace(low, high, 100)
    ends = [np.interp(pressure, x.actuation_pressure.to_numpy(float), x[name].to_numpy(float)) for x in (up, down)]
    axis.fill_between(pressure, *ends, color=color, alpha=0.12, lw=0, zorder=0)


def shown_at(measured: pd.DataFrame, ventricular_pressures: np.ndarray) -> pd.DataFrame:
    """The curves that were measured at some P_v (kPa), and those of which nobody said at which."""
    own = measured.ventricular_pressure.to_numpy(float)
    away = np.abs(own[:, None] - np.atleast_1d(ventricular_pressures)).min(1)
    return measured[np.isnan(own) | (away < SAME_PRESSURE)]


def reach(highest: float, measured: pd.DataFrame | None) -> float:
    """The highest P_a (kPa) of an axis: that of the simulated curves (``highest``), or of the measured ones."""
    return highest if measured is None else float(np.nanmax([highest, measured.actuation_pressure.max()]))


def bars(axis, measured: pd.DataFrame, pouches: np.ndarray, width: float = 0.18) -> None:
    """Grey bars of measured efficiencies at their own N_p, between those of the simulated numbers of pouches (n,).

    An axis of bars has the simulated ones at 0, 1, 2, ...; others stand between and beside these by a straight line.
    """
    known = measured.dropna(subset=["efficiency", "n_pouches"]).groupby("n_pouches").efficiency.mean()
    if known.empty:
        return
    at = [_place(count, np.asarray(pouches, float)) for count in known.index]
    axis.bar(at, 100 * known.to_numpy(), width=width, color=_BAR, zorder=3)
    for place, count, eta in zip(at, known.index, known, strict=True):
        axis.text(place, 100 * eta + 1, f"{count:g}", ha="center", fontsize=6, color="0.3")


def bar_handle() -> Line2D:
    """What a legend shows for the bars."""
    return Line2D([], [], ls="", marker="s", ms=6, color=_BAR, label="measured $\\eta$, its $N_p$ above")


def _place(count: float, pouches: np.ndarray) -> float:
    """Where a number of pouches stands on an axis of numbers at 0, 1, 2, ..., a straight line beyond its ends."""
    if len(pouches) < 2:
        return float(0.5 * (count - pouches[0]))
    places = np.arange(len(pouches))
    if pouches[0] <= count <= pouches[-1]:
        return float(np.interp(count, pouches, places))
    end = 0 if count < pouches[0] else len(pouches) - 2
    return float(end + (count - pouches[end]) / (pouches[end + 1] - pouches[end]))
