"""Errors of the device's settings against what they cost: the picture by which a setting is chosen."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import xarray as xr
from matplotlib.lines import Line2D

from limo.accuracy.statistics import SHELLS, pareto, rows_of, scatter_row, settings_of
from limo.figures import style

#: errors of the panels of a device
PANELS = (("error_volumes", "Error of the volumes [-]"), ("error_stress", "Error of the stress [-]"))
#: what a setting has instead of the default, and its colour
COLORS = dict(zip(("", "level", "symmetry", "element", "contact", "numerics"), style.COLORS, strict=False))
_NAMES = {"": "default", "level": "mesh level"}
_OTHER = "0.45"
MARKERS = {"calculix": "s", "newton": "o"}
#: shells of whichever engine
SHELL_MARKER = "D"
#: errors below this are drawn there
_LOWEST = 1e-4


def draw(dataset: xr.Dataset, measured: pd.DataFrame | None = None):
    """A row a device: error of the volumes and of the stress over CPU seconds, the Pareto front, and the presets on it.

    The dark band is the scatter of paths on the finest mesh, the light one that on the default mesh: an error within them says
    nothing. Triangles at the bottom are errors below the panel. Names that would cover others are left out.
    """
    rows = rows_of(dataset)
    names = list(dict.fromkeys(rows.device))
    plt.rcParams.update(style.SETTINGS)
    figure, axes = plt.subplots(len(names), 2, figsize=(9.0, 3.6 * len(names) + 0.7), layout="constrained", squeeze=False)
    for device, line in zip(names, axes, strict=True):
        group = rows[rows.device == device]
        for axis, (error, label) in zip(line, PANELS, strict=True):
            _panel(axis, group, error)
            axis.set(xlabel="CPU time of a case [s]", ylabel=label)
            axis.set_title(device, loc="left")
    handles = [Line2D([], [], ls="", marker="o", color=c, label=_NAMES.get(n, n)) for n, c in COLORS.items()]
    handles += [Line2D([], [], ls="", marker="o", color=_OTHER, label="several of these")]
    handles += [Line2D([], [], ls="", marker=m, mfc="none", color="black", label=f"engine {e}") for e, m in MARKERS.items()]
    handles += [Line2D([], [], ls="", marker=SHELL_MARKER, mfc="none", color="black", label=SHELLS)]
    handles += [Line2D([], [], color="black", lw=1.0, label="Pareto front")]
    handles += [Line2D([], [], ls="", marker="*", ms=11, mfc="none", color="black", label="preset")]
    handles += [plt.Rectangle((0, 0), 1, 1, color="0.75", label="scatter, finest mesh")]
    handles += [plt.Rectangle((0, 0), 1, 1, color="0.9", label="scatter, default mesh")]
    style.legend(figure, handles, [], 6)
    figure.draw_without_rendering()
    for axis in axes.ravel():
        _thin(axis)
    return figure


def marker_of(row) -> str:
    """The marker of a run: that of its engine, or of shells."""
    return SHELL_MARKER if row.element == SHELLS else MARKERS[row.engine]


def _thin(axis) -> None:
    """Take away names of settings that would cover another text."""
    presets = [t for t in axis.texts if t.get_fontweight() == "bold"]
    taken = [t.get_window_extent() for t in presets]
    for text in [t for t in axis.texts if t not in presets]:
        box = text.get_window_extent()
        if any(box.overlaps(other) for other in taken):
            text.remove()
        else:
            taken.append(box)


def _panel(axis, rows: pd.DataFrame, error: str) -> None:
    settings = settings_of(rows)
    known = settings[np.isfinite(settings[error]) & np.isfinite(settings.cpu_seconds)]
    axis.set(xscale="log", yscale="log")
    scatters = [(part, scatter_row(rows, part)) for part in ("scatter", "reference")]
    for (part, row), color in zip(scatters, ("0.9", "0.75"), strict=True):
        if row is not None and row[error] > 0:
            axis.axhspan(_LOWEST / 10, row[error], color=color, lw=0, zorder=0 if part == "scatter" else 0.5)
    if known.empty:
        axis.text(0.5, 0.5, "not measured", transform=axis.transAxes, ha="center")
        return
    scale = [row[error] for _, row in scatters if row is not None and row[error] > 0]
    bottom = max(_LOWEST, 0.3 * min([*scale, known[error][known[error] > 0].min()]))
    for row in known.itertuples():
        value = getattr(row, error)
        low = value < bottom
        axis.plot(
            row.cpu_seconds,
            max(value, 1.06 * bottom),
            marker=7 if low else marker_of(row),
            color=COLORS.get(row.varied, _OTHER),
            ms=5,
            ls="",
        )
    front = known.iloc[pareto(known.cpu_seconds.values, known[error].values)]
    axis.step(front.cpu_seconds, np.maximum(front[error], bottom), where="post", color="black", lw=1.0, zorder=1)
    for row in front.itertuples():
        axis.annotate(
            row.setting,
            (row.cpu_seconds, max(getattr(row, error), bottom)),
            xytext=(3, 4),
            textcoords="offset points",
            fontsize=6,
        )
    for row in known[known.preset != ""].itertuples():
        position = row.cpu_seconds, max(getattr(row, error), 1.06 * bottom)
        axis.plot(*position, marker="*", ms=14, mfc="none", color="black", ls="")
        axis.annotate(
            row.preset,
            position,
            xytext=(0, -12),
            textcoords="offset points",
            fontsize=6.5,
            fontweight="bold",
            ha="center",
        )
    axis.set_ylim(bottom, None)
    axis.margins(x=0.12)
