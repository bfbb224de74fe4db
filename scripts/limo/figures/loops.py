"""Loops of a load cycle: V_v and V_a over P_a, or V_v and P_a over V_a of a syringe; a column for each P_v or each N_p."""

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
#: the same of a device that a syringe drives
OF_SYRINGE = {
    "leg_ventricle_of_volume": "Ventricle volume $V_v$ [ml]",
    "leg_pressure_of_volume": "Actuation pressure $P_a$ [kPa]",
}
#: of the ramp, then of way back and way there in turn: the first cycle in full, what follows thinner
_LINES = ("-", "--")
_NAMES = {"ventricular_pressure": "$P_v$ = {:g} kPa", "n_pouches": "$N_p$ = {}"}


def draw(dataset: xr.Dataset, measured: pd.DataFrame | None = None):
    """Loading solid, unloading dashed; legs after the first cycle thin and dark, so that one that repeats it lies on it.

    Columns are those of the axis with fewer values. Measured curves have no place here.
    """
    rest = {d: 0 for d in dataset.case_status.dims if d not in ("n_pouches", "ventricular_pressure", "branch")}
    dataset = lowest(dataset.isel(rest))
    across, within = sorted(_NAMES, key=lambda axis: dataset.sizes[axis])
    columns, lines = dataset[across].values, dataset[within].values
    is_syringe = "given_volume" in dataset
    shown = OF_SYRINGE if is_syringe else ROWS
    figure, *rows = style.two_rows(len(columns), len(columns), max(2.6 * len(columns), 7.5), 5.6)
    for row, (name, text) in zip(rows, shown.items(), strict=True):
        for axis, column in zip(row, columns, strict=True):
            for k, line in enumerate(lines):
                _legs(axis, dataset.sel({across: column, within: line}), name, style.COLORS[k % len(style.COLORS)])
            axis.set_title(_NAMES[across].format(column), fontsize=9)
            axis.set_xlabel("$V_a$ [ml]" if is_syringe else "$P_a$ [kPa]")
        row[0].set_ylabel(text)
    handles = [
        Line2D([], [], color=style.COLORS[k % len(style.COLORS)], label=_NAMES[within].format(line))
        for k, line in enumerate(lines)
    ]
    handles += [
        Line2D([], [], color="0.4", ls=line, label=label) for line, label in zip(_LINES, ("loading", "unloading"), strict=True)
    ]
    handles += [Line2D([], [], color="0.2", lw=0.6, label="second cycle")] if dataset.sizes["leg"] > 2 + is_syringe else []
    style.legend(figure, handles, style.gaps(dataset), min(len(handles), 5))
    return figure


def _legs(axis, case: xr.Dataset, name: str, color: str) -> None:
    is_syringe, before = name in OF_SYRINGE, 0.0
    along = case.given_volume if is_syringe else case.actuation_pressure
    for k in case.leg.values:
        values, end = case[name].sel(leg=k).values, float(case.leg_actuation_pressure.sel(leg=k))
        if np.isfinite(values).any():
            looks = {"color": color, "lw": 1.6} if k < 2 + is_syringe else {"color": "0.2", "lw": 0.6, "zorder": 3}
            axis.plot(along.values, values, _LINES[int(end < before)], **looks)
        before = end
