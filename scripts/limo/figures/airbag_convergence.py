"""Square airbag: height and draw-in against degrees of freedom, with published values, and run time (paper, Fig. convergence)."""

from __future__ import annotations

import json

import numpy as np
import pandas as pd
import xarray as xr

from limo.figures import style

#: what is drawn: variable, label, and which published values are lines in its panel
PANELS = (
    ("height", "Height of the centre $w_M$ [mm]", "height"),
    ("edge_draw_in_smooth", "Smoothed draw-in of the edge's middle $u_B$ [mm]", "edge_draw_in"),
    ("cpu_seconds", "CPU time over that of the fastest run [-]", None),
)
#: heights below this share of the largest are arrows at the bottom of the panel
_SHOWN_FROM = 0.75
#: colours of the elements, C3D20 that of the shell of which CalculiX makes it
COLORS = dict(zip(("S3", "S4", "S4R", "S6", "S8", "S8R", "C3D20R"), style.COLORS, strict=False))
COLORS["C3D20"] = COLORS["S8"]
COLORS["SHELL8R"] = "#882255"
_LOOKS = (("o", "-"), ("^", "--"), ("s", "--"), ("D", "-."), ("v", ":"), ("P", (0, (5, 1, 1, 1, 1, 1))))


def draw(dataset: xr.Dataset, measured: pd.DataFrame | None = None):
    """(a) w_M, (b) draw-in without folds, (c) CPU time over that of the fastest run.

    Crosses mark runs that failed, arrows heights far below the panel.
    """
    figure, axes = style.panels(3, width=9.0, height=4.6)
    table = dataset.drop_vars("displacement").to_dataframe()
    table["cpu_seconds"] /= table.cpu_seconds[table.status == "converged"].min()
    lowest = _SHOWN_FROM * table.height.max()
    drawn = dict.fromkeys(COLORS.values(), 0)
    for series, group in table.groupby("series", sort=False):
        good, failed, element = group[group.status == "converged"], group[group.status != "converged"], group.element.iloc[0]
        color = COLORS[element]
        marker, line = _LOOKS[drawn[color] % len(_LOOKS)]
        drawn[color] += 1
        look = {"color": color, "marker": marker, "ls": line, "ms": 3.5, "mfc": "none", "lw": 1.1}
        for axis, (name, _, _) in zip(axes, PANELS, strict=True):
            axis.plot(good.degrees_of_freedom, good[name], label=series, **look)
        low = good[good.height < lowest]
        axes[0].plot(low.degrees_of_freedom, np.full(len(low), 1.01 * lowest), ls="", marker=7, color=look["color"])
        axes[2].plot(failed.degrees_of_freedom, failed.cpu_seconds, "x", color=look["color"], ms=6)
    references = json.loads(dataset.attrs["config"])["references"]
    for axis, (_, label, published) in zip(axes, PANELS, strict=True):
        for value in sorted({r["value"] for r in references if r["quantity"] == published}):
            axis.axhline(value, color="0.6", lw=0.8, zorder=0, label="published")
        axis.set(xscale="log", xlabel="Degrees of freedom", ylabel=label)
    axes[0].set_ylim(lowest, None)
    axes[1].set_ylim(0, None)
    axes[2].set_yscale("log")
    handles = dict(zip(*reversed(axes[0].get_legend_handles_labels()), strict=True))
    style.legend(figure, list(handles.values()), [], 3)
    return figure
