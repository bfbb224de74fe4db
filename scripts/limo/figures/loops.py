"""Loops of a load cycle: V_v and V_a over P_a on all legs, a column for each P_v."""

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


def draw(dataset: xr.Dataset, measured: pd.DataFrame | None = None):
    """Loading solid, unloading dashed; legs after the first cycle thin and dark, so that one that repeats it lies on it.

    Measured curves have no place here.
    """
    rest = {d: 0 for d in dataset.case_status.dims if d not in ("n_pouches", "ventricular_pressure", "branch")}
    dataset = lowest(dataset.isel(rest))
    pressures, pouches = dataset.ventricular_pressure.values, dataset.n_pouches.values
    figure, *rows = style.two_rows(len(pressures), len(pressures), max(3.2 * len(pressures), 4.8), 5.6)
    for row, (name, text) in zip(rows, ROWS.items(), strict=True):
        for axis, p_v in zip(row, pressures, strict=True):
            for k, n_pouches in enumerate(pouches):
                case = dataset.sel(ventricular_pressure=p_v, n_pouches=n_pouches)
                _legs(axis, case, name, style.COLORS[k % len(style.COLORS)])
            axis.set_title(f"$P_v$ = {p_v:g} kPa", fontsize=9)
            axis.set_xlabel("$P_a$ [kPa]")
        row[0].set_ylabel(text)
    handles = [Line2D([], [], color=style.COLORS[k % len(style.COLORS)], label=f"$N_p$ = {n}") for k, n in enumerate(pouches)]
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
