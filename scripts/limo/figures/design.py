"""Design figure: how one change of the design acts on curves and stress (paper, Figs. valve support and compliance)."""

from __future__ import annotations

import numpy as np
import pandas as pd
import xarray as xr

from limo.figures import overlay, pictures, style
from limo.figures.von_mises import pictures_of, stress_scale
from limo.measure.states import lowest


def draw(dataset: xr.Dataset, measured: pd.DataFrame | None, shapes: xr.Dataset):
    """Above: (a) Delta V_a, (b) Delta V_v, (c) ratio, (d) efficiency at 90 ml; below (e) stress at the highest P_a.

    Branches make bands, and thin bars on the efficiencies.
    """
    dims = pictures.varying(shapes)
    cases = [case for line in pictures.case_grid(shapes, "")[2] for case in line]
    rows, columns, _ = pictures.case_grid(shapes, "n_pouches")
    grid, note = pictures.pairs(shapes)
    wide, tall = grid.size(len(rows), 2 * len(columns))
    figure, above, below = style.stacked(wide, 3.0, tall)
    axes = above.subplots(1, 4, width_ratios=[1, 1, 1, 0.8])
    panels = (
        ("actuation_volume_change", "Actuation volume $\\Delta V_a$ [ml]"),
        ("stroke_volume", "Stroke volume $\\Delta V_v$ [ml]"),
        ("io_ratio", "Ratio $\\Delta V_v / V_a$ [-]"),
    )
    for letter, axis in zip("abcd", axes, strict=True):
        axis.set_title(f"({letter})", loc="left")
    solutions = [pictures.branches_of(dataset, case) for case in cases]
    labels = [pictures.names(case, dims) or pictures.names(case, ["n_pouches"]) for case in cases]
    for k, (branches, name) in enumerate(zip(solutions, labels, strict=True)):
        curves, color = lowest(branches), style.COLORS[k % len(style.COLORS)]
        for axis, (variable, _) in zip(axes, panels, strict=False):
            style.curve(axis, curves, variable, color, label=name)
            style.band(axis, branches, variable, color)
    handles, highest = axes[0].get_legend_handles_labels()[0], float(dataset.actuation_pressure.max())
    if measured is not None:
        measured = overlay.shown_at(measured, dataset.ventricular_pressure.values)
        laid_over = [overlay.curves(axis, measured, name, {}) for axis, (name, _) in zip(axes, panels, strict=False)]
        handles, highest = [*handles, *max(laid_over, key=len)], overlay.reach(highest, measured)
    for axis, (_, text) in zip(axes, panels, strict=False):
        axis.set(xlabel="$P_a$ [kPa]", ylabel=text, xlim=(0, highest))
    ratio = dataset.io_ratio.values[np.isfinite(dataset.io_ratio.values)]
    axes[2].axhline(1.0, color="0.5", lw=0.8, ls="--", zorder=0)
    axes[2].set_ylim(0, max(2.0, 1.1 * np.quantile(ratio, 0.98)) if len(ratio) else 2.0)
    _bars(axes[3], solutions, labels)
    style.legend(above, handles, style.gaps(dataset), min(len(handles), max(len(cases), 5)))
    scale = stress_scale(shapes)
    pictures.pair_grid(dataset, shapes, lambda case: pictures_of(case, scale), below)
    below.text(0.005, 0.97, "(e)", fontsize=9)
    pictures.colour_bar(below, scale, "Von Mises stress [MPa]", extend="max", note=note)
    return figure


def _bars(axis, solutions: list[xr.Dataset], labels: list[str]) -> None:
    """Efficiency at 90 ml of each case with its number; a cross for one that does not reach 90 ml."""
    efficiencies = xr.concat([case.efficiency_90ml for case in solutions], "case")
    eta = 100 * np.array([float(lowest(case).efficiency_90ml) for case in solutions])
    positions = np.arange(len(eta))
    style.bars_of_branches(axis, positions, efficiencies, 100)
    axis.bar(positions, np.nan_to_num(eta), color=[style.COLORS[k % len(style.COLORS)] for k in positions])
    for k, value in zip(positions, eta, strict=True):
        axis.text(k, np.nan_to_num(value) + 0.8, f"{value:.1f}" if np.isfinite(value) else "×", ha="center", fontsize=6.5)
    axis.set_xticks(positions, [text.rpartition("=")[2].strip() for text in labels])
    axis.set(ylabel="Efficiency at 90 ml $\\eta$ [%]", xlabel=labels[0].rpartition("=")[0].strip(), ylim=(0, 100))
    axis.grid(axis="x", visible=False)
