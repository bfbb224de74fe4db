"""Afterload figure: volumes, efficiency and ratio over pouches and ventricular pressures (paper, Fig. afterload)."""

from __future__ import annotations

import numpy as np
import pandas as pd
import xarray as xr
from matplotlib.lines import Line2D

from limo.figures import overlay, style
from limo.measure.states import lowest

#: colours of the ventricular pressures, from low to high
COLORS = ("#E69F00", "#D55E00", "#7B3294", "#0072B2", "#009E73")


def draw(dataset: xr.Dataset, measured: pd.DataFrame | None = None):
    """Above: (a) Delta V_a, (b) Delta V_v, (c) efficiency at 90 ml; below the ratio, a panel for each P_v.

    Lines are thicker for more pouches; beyond the first stored frame in which front and back would touch they are lighter.
    Branches make bands, and thin bars on the efficiencies.
    """
    rest = {d: 0 for d in dataset.case_status.dims if d not in ("n_pouches", "ventricular_pressure", "branch")}
    every = dataset.isel(rest)
    dataset = lowest(every)
    pressures = dataset.ventricular_pressure.values
    figure, upper, lower = style.two_rows(3, max(3, len(pressures)), 7.5, 5.2)
    for j, p_v in enumerate(pressures):
        for k, n_pouches in enumerate(dataset.n_pouches.values):
            case, branches = (d.sel(ventricular_pressure=p_v, n_pouches=n_pouches) for d in (dataset, every))
            color, width = COLORS[j % len(COLORS)], _width(k)
            for axis, name in ((upper[0], "actuation_volume_change"), (upper[1], "stroke_volume")):
                style.band(axis, branches, name, color)
            if j < len(lower):
                style.band(lower[j], branches, "io_ratio", color)
            style.curve(upper[0], case, "actuation_volume_change", color, lw=width)
            style.curve(upper[1], case, "stroke_volume", color, lw=width)
            for other, axis in enumerate(lower[: len(pressures)]):
                looks = {"color": color, "lw": width, "zorder": 2} if other == j else {"color": "0.85", "lw": 0.7, "zorder": 1}
                style.curve(axis, case, "io_ratio", **looks)
    laid_over = _measured(upper, lower, measured, pressures) if measured is not None else []
    _bars(upper[2], every)
    if measured is not None:
        overlay.bars(upper[2], measured, dataset.n_pouches.values)
    xlim = (0, overlay.reach(float(dataset.actuation_pressure.max()), measured))
    upper[0].set(xlabel="$P_a$ [kPa]", ylabel="Actuation volume $\\Delta V_a$ [ml]", xlim=xlim)
    upper[1].set(xlabel="$P_a$ [kPa]", ylabel="Stroke volume $\\Delta V_v$ [ml]", xlim=xlim)
    ratio = dataset.io_ratio.values[np.isfinite(dataset.io_ratio.values)]
    top = max(2.0, 1.1 * np.quantile(ratio, 0.98)) if len(ratio) else 2.0
    for axis, p_v in zip(lower, pressures, strict=False):
        axis.axhline(1.0, color="0.5", lw=0.8, ls="--", zorder=0)
        axis.set(xlabel="$P_a$ [kPa]", xlim=xlim, ylim=(0, top))
        axis.set_title(f"$P_v$ = {p_v:g} kPa", fontsize=9)
    for axis in lower[len(pressures) :]:
        axis.set_visible(False)
    lower[0].set_ylabel("Ratio $\\Delta V_v / V_a$ [-]")
    handles = [Line2D([], [], color=COLORS[j % len(COLORS)], label=f"$P_v$ = {p:g} kPa") for j, p in enumerate(pressures)]
    handles += [Line2D([], [], color="0.4", lw=_width(k), label=f"$N_p$ = {n}") for k, n in enumerate(dataset.n_pouches.values)]
    handles += laid_over
    style.legend(figure, handles, style.gaps(every), min(len(handles), 5 if laid_over else 7))
    return figure


def _measured(upper, lower, measured: pd.DataFrame, pressures: np.ndarray) -> list[Line2D]:
    """Measured curves at each P_v, in its colour, and what a legend needs of them."""
    handles = []
    for j, p_v in enumerate(pressures):
        own = overlay.shown_at(measured.dropna(subset="ventricular_pressure"), p_v)
        if own.empty:
            continue
        color = COLORS[j % len(COLORS)]
        colors = {int(n): color for n in own.n_pouches.dropna()}
        for axis, name in ((upper[0], "actuation_volume_change"), (upper[1], "stroke_volume"), (lower[j], "io_ratio")):
            overlay.curves(axis, own, name, colors)
        text = f"measured, $P_v$ = {p_v:g} kPa"
        handles.append(Line2D([], [], ls="-", lw=0.6, marker="o", ms=4, mfc="white", color=color, label=text))
    return handles + ([overlay.bar_handle()] if measured.efficiency.notna().any() else [])


def _width(k: int) -> float:
    return 0.8 + 0.55 * k


def _bars(axis, dataset: xr.Dataset) -> None:
    """Efficiency at 90 ml, a group of bars for each number of pouches; a cross where a case does not reach 90 ml."""
    pouches, pressures = dataset.n_pouches.values, dataset.ventricular_pressure.values
    width = 0.8 / len(pressures)
    for j, p_v in enumerate(pressures):
        positions = np.arange(len(pouches)) + (j - (len(pressures) - 1) / 2) * width
        cases = dataset.sel(ventricular_pressure=p_v)
        style.bars_of_branches(axis, positions, cases.efficiency_90ml, 100)
        eta = 100 * lowest(cases).efficiency_90ml.values
        axis.bar(positions, np.nan_to_num(eta), width=0.9 * width, color=COLORS[j % len(COLORS)])
        axis.plot(positions[~np.isfinite(eta)], np.full((~np.isfinite(eta)).sum(), 2.0), "x", ms=4, color=COLORS[j % len(COLORS)])
    axis.set_xticks(np.arange(len(pouches)), [f"{n}" for n in pouches])
    axis.set(xlabel="Pouches $N_p$", ylabel="Efficiency at 90 ml $\\eta$ [%]", ylim=(0, 100))
    axis.grid(axis="x", visible=False)
