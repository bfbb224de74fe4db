"""Design figure: how one change of the design acts on curves and stress (paper, Figs. valve support and compliance)."""

from __future__ import annotations

import numpy as np
import pandas as pd
import xarray as xr
from matplotlib.lines import Line2D

from limo.figures import overlay, pictures, style
from limo.figures.von_mises import pictures_of, stress_scale
from limo.measure.states import lowest

_NARROWEST = 7.5  # inches that the curves need


def draw(dataset: xr.Dataset, measured: pd.DataFrame | None, shapes: xr.Dataset):
    """Above: (a) Delta V_a, (b) Delta V_v, (c) ratio, (d) efficiency at 90 ml; below (e) stress at the highest P_a.

    Where N_p varies, too, lines are thicker for more pouches. Branches make bands, and thin bars on the efficiencies.
    """
    dims = pictures.varying(shapes)
    cases = [case for line in pictures.case_grid(shapes, "")[2] for case in line]
    rows, columns, _ = pictures.case_grid(shapes, "n_pouches")
    grid, note = pictures.pairs(dataset, shapes)
    wide, tall = grid.size(len(rows), 2 * len(columns))
    figure, above, below = style.stacked(max(wide, _NARROWEST), 3.0, tall)
    axes = above.subplots(1, 4, width_ratios=[1, 1, 1, 0.8 + 0.1 * max(0, len(cases) - 5)])
    panels = (
        ("actuation_volume_change", "Actuation volume $\\Delta V_a$ [ml]"),
        ("stroke_volume", "Stroke volume $\\Delta V_v$ [ml]"),
        ("io_ratio", "Ratio $\\Delta V_v / V_a$ [-]"),
    )
    for letter, axis in zip("abcd", axes, strict=True):
        axis.set_title(f"({letter})", loc="left")
    solutions = [pictures.branches_of(dataset, case) for case in cases]
    grouped = "n_pouches" in dims and len(dims) > 1
    own = [d for d in dims if d != "n_pouches"] if grouped else dims
    labels = [pictures.names(case, own) or pictures.names(case, ["n_pouches"]) for case in cases]
    groups = [pictures.names(case, ["n_pouches"]) if grouped else "" for case in cases]
    colors = {name: style.COLORS[k % len(style.COLORS)] for k, name in enumerate(dict.fromkeys(labels))}
    widths = {name: 1.0 + 1.2 * k for k, name in enumerate(dict.fromkeys(groups))} if grouped else {"": None}
    for branches, name, group in zip(solutions, labels, groups, strict=True):
        curves, looks = lowest(branches), {"lw": widths[group]} if grouped else {}
        for axis, (variable, _) in zip(axes, panels, strict=False):
            style.curve(axis, curves, variable, colors[name], label=name, **looks)
            style.band(axis, branches, variable, colors[name])
    handles, highest = axes[0].get_legend_handles_labels()[0], float(dataset.actuation_pressure.max())
    if grouped:
        handles = [Line2D([], [], color=color, label=name) for name, color in colors.items()]
        handles += [Line2D([], [], color="0.4", lw=width, label=name) for name, width in widths.items()]
    if measured is not None:
        measured = overlay.shown_at(measured, dataset.ventricular_pressure.values)
        laid_over = [overlay.curves(axis, measured, name, {}) for axis, (name, _) in zip(axes, panels, strict=False)]
        handles, highest = [*handles, *max(laid_over, key=len)], overlay.reach(highest, measured)
    for axis, (_, text) in zip(axes, panels, strict=False):
        axis.set(xlabel="$P_a$ [kPa]", ylabel=text, xlim=(0, highest))
    ratio = dataset.io_ratio.values[np.isfinite(dataset.io_ratio.values)]
    axes[2].axhline(1.0, color="0.5", lw=0.8, ls="--", zorder=0)
    axes[2].set_ylim(0, max(2.0, 1.1 * np.quantile(ratio, 0.98)) if len(ratio) else 2.0)
    _bars(axes[3], solutions, labels, groups, colors)
    style.legend(above, handles, [], min(len(handles), 7))
    scale = stress_scale(shapes)
    pictures.pair_grid(dataset, shapes, lambda case: pictures_of(case, scale), below)
    below.text(0.005, 0.97, "(e)", fontsize=9)
    pictures.colour_bar(below, scale, "Von Mises stress [MPa]", extend="max", note=note)
    return figure


def _bars(axis, solutions: list[xr.Dataset], labels: list[str], groups: list[str], colors: dict[str, str]) -> None:
    """Efficiency at 90 ml of each case with its number, in groups; a cross for one that does not reach 90 ml."""
    efficiencies = xr.concat([case.efficiency_90ml for case in solutions], "case")
    eta = 100 * np.array([float(lowest(case).efficiency_90ml) for case in solutions])
    order = list(dict.fromkeys(groups))
    places = sorted(range(len(eta)), key=lambda k: order.index(groups[k]))
    positions = np.empty(len(eta))
    positions[places] = np.arange(len(eta)) + np.array([order.index(groups[k]) for k in places])
    crowded = len(eta) > 5
    axis.bar(positions, np.nan_to_num(eta), color=[colors[name] for name in labels])
    style.bars_of_branches(axis, positions, efficiencies, 100)
    for k, value in zip(positions, eta, strict=True):
        text = f"{value:.1f}" if np.isfinite(value) else "×"
        looks = {"rotation": 90, "va": "top", "color": "white"} if crowded and np.isfinite(value) else {}
        axis.text(k, np.nan_to_num(value) + (-4 if looks else 0.8), text, ha="center", fontsize=6.5, **looks)
    for group in order if len(order) > 1 else []:
        axis.text(np.mean([positions[k] for k in range(len(eta)) if groups[k] == group]), 95, group, ha="center", fontsize=7)
    ticks = {"fontsize": 6, "rotation": 90} if crowded else {}
    axis.set_xticks(positions, [text.rpartition("=")[2].strip() for text in labels], **ticks)
    axis.set(ylabel="Efficiency at 90 ml $\\eta$ [%]", xlabel=labels[0].rpartition("=")[0].strip(), ylim=(0, 100))
    axis.grid(axis="x", visible=False)
