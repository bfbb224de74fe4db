"""What the solvers take on ever larger models: CPU time, that of an iteration, and memory, with the fitted exponents."""

from __future__ import annotations

import numpy as np
import pandas as pd
import xarray as xr
from matplotlib.lines import Line2D

from limo.accuracy.statistics import exponent, models_of, rows_of, scaling_of, sizes_of
from limo.figures import style
from limo.figures.accuracy_cost import MARKERS

#: what is drawn: variable and label
PANELS = (
    ("cpu_seconds", "CPU time of a case [s]"),
    ("seconds_per_iteration", "CPU time of an iteration [s]"),
    ("memory_mib", "Peak memory [MiB]"),
)
_COLORS = {"newton": style.COLORS[0], "calculix": style.COLORS[1], "newton, SHELL8R": style.COLORS[2]}
_FILLS = ("full", "none", "left", "right")


def draw(dataset: xr.Dataset, measured: pd.DataFrame | None = None):
    """Over the displacements that are solved for, (a) CPU time, (b) that of an iteration, (c) memory; each with its exponent.

    Runs that differ in mesh level and symmetry alone, and their branches; of several devices the markers are filled differently.
    Crosses are models of the full device that were iterated a few times: (b) and (c) are fitted to them where there are some.
    """
    rows, sizes = scaling_of(rows_of(dataset)), sizes_of(dataset)
    names = list(dict.fromkeys(rows.device))
    figure, axes = style.panels(3, width=9.0, height=3.6)
    for axis, (name, label) in zip(axes, PANELS, strict=True):
        for engine, each in sizes.groupby("engine") if name in sizes else ():
            axis.plot(each.displacements, each[name], ls="", marker="x", color=_COLORS[engine], ms=5)
        for model, group in rows.groupby("model", sort=False):
            color, marker = _COLORS[model], MARKERS[group.engine.iloc[0]]
            for device, each in group.groupby("device", sort=False):
                fill = _FILLS[names.index(device) % len(_FILLS)]
                look = {"ls": "", "marker": marker, "color": color, "ms": 4.5, "fillstyle": fill}
                axis.plot(each.solved_degrees_of_freedom, each[name], **look)
            models = models_of(group, sizes if name in sizes else sizes[:0])
            power, factor = exponent(models.displacements, models[name])
            if np.isfinite(power):
                size = np.array([models.displacements.min(), models.displacements.max()])
                axis.plot(size, factor * size**power, color=color, lw=1.0, label=f"{model}: exponent {power:.2f}")
        axis.set(xscale="log", yscale="log", xlabel="Displacements solved for", ylabel=label)
        if axis.get_legend_handles_labels()[0]:
            axis.legend(loc="upper left", fontsize=7)
    handles = [Line2D([], [], ls="", marker=MARKERS[m.split(",")[0]], color=c, label=m) for m, c in _COLORS.items()]
    handles += [
        Line2D([], [], ls="", marker="o", color="black", fillstyle=_FILLS[k % len(_FILLS)], label=n) for k, n in enumerate(names)
    ]
    handles += [Line2D([], [], ls="", marker="x", color="black", label="a few iterations, full device")]
    style.legend(figure, handles, [], 6)
    return figure
