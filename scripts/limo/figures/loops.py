"""Loops of a load cycle: V_v and V_a over P_a on all legs, a column for each P_v or each N_p, whatever has fewer values."""

from __future__ import annotations

import numpy as np
import pandas as pd
import xarray as xr
from matplotlib.lines import Line2D

from limo.figures import style
from limo.measure.states import lowest

#: volume drawn in each row, and what stands beside it
ROWS = {
    "leg_ventricle_volume": "Ventricle volume $V_v$ [ml]",
    "leg_actuation_volume": "Pouch volume $V_a$ [ml]",
}
#: of the ramp, then of way back and way there in turn: the first cycle in full, what follows thinner
_LINES = ("-", "--")
_NAMES = {"ventricular_pressure": "$P_v$ = {:g} kPa", "n_pouches": "$N_p$ = {}"}


def draw(dataset: xr.Dataset, measured: pd.DataFrame | None = None):
    """Loading solid, unloading dashed; legs after the first cycle thin and dark, so that one that repeats it lies on it.

    Measured curves have no place here.
    """
    rest = {d: 0 for d in dataset.case_status.dims if d not in ("n_pouches", "ventricular_pressure", "branch")}
    dataset = lowest(dataset.isel(rest))
    across, within = sorted(_NAMES, key=lambda axis: dataset.sizes[axis])
    columns, lines = dataset[across].values, dataset[within].values
    figure, *rows = style.two_rows(len(columns), len(columns), max(2.6 * len(columns), 7.5), 5.6)
    for row, (name, text) in zip(rows, ROWS.items(), strict=True):
        for axis, column in zip(row, columns, strict=True):
            for k, line in enumerate(lines):
                _legs(axis, dataset.sel({across: column, within: line}), name, style.COLORS[k % len(style.COLORS)])
            axis.set_title(_NAMES[across].format(column), fontsize=9)
            axis.set_xlabel("$P_a$ [kPa]")
        row[0].set_ylabel(text)
    handles = [
        Line2D([], [], color=style.COLORS[k % len(style.COLORS)], label=_NAMES[within].format(line))
        for k, line in enumerate(lines)
    ]
    handles += [
        Line2D([], [], color="0.4", ls=line, label=label) for line, label in zip(_LINES, ("loading", "unloading"), strict=True)
    ]
    handles += [Line2D([], [], color="0.2", lw=0.6, label="second cycle")] if dataset.sizes["leg"] > 2 else []
    style.legend(figure, handles, style.gaps(dataset), min(len(handles), 5))
    return figure


def _legs(axis, case: xr.Dataset, name: str, color: str) -> None:
    before = 0.0
    for k in case.leg.values:
        pressure, volume = case.actuation_pressure.values, case[name].sel(leg=k).values
        end = float(case.leg_actuation_pressure.sel(leg=k))
        if np.isfinite(volume).any():
            looks = {"color": color, "lw": 1.6} if k < 2 else {"color": "0.2", "lw": 0.6, "zorder": 3}
            axis.plot(pressure, volume, _LINES[int(end < before)], **looks)
        before = end
