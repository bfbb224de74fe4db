"""The device on ever finer meshes: largest w / L and Chamfer distance (paper, Fig. limo_valid_metrics)."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import xarray as xr
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator, NullLocator, ScalarFormatter

from limo.accuracy.errors import PAPER_HEIGHT
from limo.accuracy.statistics import PAPER_CHAMFER, SHELLS, meshes_of, rows_of
from limo.figures import style
from limo.figures.accuracy_cost import MARKERS, SHELL_MARKER, marker_of

LINES = {"newton": "-", "calculix": "--"}


def draw(dataset: xr.Dataset, measured: pd.DataFrame | None = None):
    """A row a device: (a) largest w / L over P_a, (b) its last value and (c) Chamfer distance to the reference over mesh size.

    Runs that differ in the mesh level alone, and shells; a colour a level, squares and dashes are CalculiX, diamonds and dots
    shells. Several points of one mesh are branches, whose spread is the scatter of paths.
    """
    rows = rows_of(dataset)
    rows = meshes_of(rows[(rows.kind == "run") & (rows.status == "converged")])
    names = list(dict.fromkeys(rows.device))
    levels = list(dict.fromkeys(rows.sort_values("degrees_of_freedom").level))
    colors = {level: style.COLORS[k % len(style.COLORS)] for k, level in enumerate(levels)}
    plt.rcParams.update(style.SETTINGS)
    figure, axes = plt.subplots(
        max(len(names), 1), 3, figsize=(9.0, 2.8 * max(len(names), 1) + 0.7), layout="constrained", squeeze=False
    )
    for device, line in zip(names, axes, strict=False):
        group = rows[rows.device == device]
        for index, row in group.iterrows():
            color, marker = colors[row.level], marker_of(row)
            line_style = ":" if row.element == SHELLS else LINES[row.engine]
            pressure, height = dataset.frame_pressure.values[index], dataset.frame_height.values[index]
            if row.branch == 0:
                line[0].plot(pressure, height, line_style, color=color, lw=1.2)
            look = {"color": color, "marker": marker, "ls": "", "ms": 5, "mfc": color if row.branch == 0 else "none"}
            line[1].plot(row.degrees_of_freedom / 1000, row.height, **look)
            line[2].plot(row.degrees_of_freedom / 1000, row.error_chamfer, **look)
        _reference(line[1], group)
        line[0].set(xlabel="$P_a$ [kPa]", ylabel="Largest $w/L$ [-]")
        line[1].set(ylabel="Largest $w/L$ at $P_{a,max}$ [-]")
        line[2].set(ylabel="Chamfer distance $d_c/L$ [-]")
        line[2].axhline(PAPER_CHAMFER, color="0.5", lw=0.8, ls=":", zorder=0)
        line[2].set_ylim(0, None)
        for axis in line[1:]:
            axis.set(xscale="log", xlabel="Degrees of freedom [thousand]")
            axis.xaxis.set(
                major_locator=LogLocator(subs=(1, 2, 5)), major_formatter=ScalarFormatter(), minor_locator=NullLocator()
            )
        line[0].set_title(device, loc="left")
    handles = [Line2D([], [], color=c, label=level) for level, c in colors.items()]
    handles += [Line2D([], [], color="black", ls=ls, marker=MARKERS[e], label=e) for e, ls in LINES.items()]
    handles += [Line2D([], [], color="black", ls=":", marker=SHELL_MARKER, label=SHELLS)]
    handles += [Line2D([], [], color="black", ls="", marker="o", mfc="none", label="other branches")]
    handles += [plt.Rectangle((0, 0), 1, 1, color="0.85", label="2 % around the reference")]
    handles += [Line2D([], [], color="0.5", lw=0.8, ls=":", label="$d_c/L$ of the paper")]
    style.legend(figure, handles, [], 6)
    return figure


def _reference(axis, rows: pd.DataFrame) -> None:
    """The mean of the reference with the paper's 2 % on either side."""
    height = rows.height[(rows.part == "reference") & np.isfinite(rows.height)]
    if len(height):
        axis.axhspan((1 - PAPER_HEIGHT) * height.mean(), (1 + PAPER_HEIGHT) * height.mean(), color="0.85", lw=0, zorder=0)
        axis.axhline(height.mean(), color="0.5", lw=0.8, zorder=0)
