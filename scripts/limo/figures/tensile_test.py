"""Tensile test of the fabric with the lines that give its modulus (paper, Fig. material model)."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.lines import Line2D

from limo.bench.tensile import with_error
from limo.figures import style

#: points of a specimen that are drawn at most, specimens whose names fit into the panel, and letters of a name that are shown
_POINTS, _INSIDE, _LONGEST = 1500, 3, 32


def draw(dataset: xr.Dataset):
    """Nominal stress over nominal strain: points that a fit uses filled, others hollow and grey, and the line of each specimen.

    A line is drawn beyond its window as far as the axes, thinner.
    """
    count = dataset.sizes["specimen"]
    inside = count <= _INSIDE
    figure, (axis,) = style.panels(1, width=4.4 if inside else 5.6, height=3.4)
    axis.set_title("", loc="left")
    strain, stress = 100 * dataset.strain.values, dataset.stress.values
    fitted, number = dataset.fitted.values.astype(bool), dataset.specimen_number.values
    source = "synthetic data, no measurement" if dataset.attrs["synthetic"] == "True" else "measured"
    top, right = 1.12 * max(stress[fitted].max(), np.quantile(stress, 0.99)), strain.max() + 0.04 * np.ptp(strain)
    left, bottom = min(0.0, strain.min()), min(0.0, stress.min() - 0.03 * np.ptp(stress))
    handles = []
    if count == 1:
        looks = {"marker": "o", "ls": "", "ms": 3, "color": style.COLORS[0]}
        handles = [Line2D([], [], label=source, **looks)]
        if not fitted.all():
            handles.append(Line2D([], [], label="not fitted", **looks | {"color": "0.6"}, mfc="none"))
    for k in range(count):
        own = np.flatnonzero(number == k)
        color = style.COLORS[k % len(style.COLORS)]
        for part, looks in (
            (own[fitted[own]], {"color": color}),
            (own[~fitted[own]], {"color": "0.6", "mfc": "none", "zorder": 1}),
        ):
            shown = part[:: max(1, len(part) // _POINTS)]
            axis.plot(strain[shown], stress[shown], "o", ms=3 if len(shown) < 300 else 1.2, **looks)
        one = dataset.isel(specimen=k)
        handles.append(_line(axis, one, color if count > 1 else style.COLORS[1], (left, right, top), count))
    if count > 1:
        modulus, error = float(dataset.youngs_modulus), float(dataset.youngs_modulus_error)
        text = f"mean: {_modulus(modulus, error)}"
        handles.append(Line2D([], [], ls="", label=text if source == "measured" else f"{text}\n({source})"))
    axis.set(xlabel=r"Nominal strain $\varepsilon_\mathrm{nom}$ [%]", ylabel=r"Nominal stress $\sigma_\mathrm{nom}$ [MPa]")
    axis.set(xlim=(left, right), ylim=(bottom, top))
    if inside:
        axis.legend(handles=handles, loc="best")
    else:
        figure.legend(handles=handles, loc="outside right upper", fontsize=7)
    return figure


def _line(axis, one: xr.Dataset, color: str, ends: tuple[float, float, float], count: int) -> Line2D:
    """The line of a specimen: over its window, and thinner from zero stress to the ends of the axes."""
    modulus, intercept = float(one.specimen_modulus) / 100, float(one.specimen_intercept)
    window = 100 * one.window.values
    start = max(-intercept / modulus, ends[0]) if modulus > 0 else ends[0]
    beyond = np.array([start, min(ends[1], (ends[2] - intercept) / modulus if modulus > 0 else ends[1])])
    axis.plot(beyond, intercept + modulus * beyond, color=color, lw=0.8, ls="--", zorder=3)
    axis.plot(window, intercept + modulus * window, color=color, zorder=4)
    if count == 1:
        axis.axvspan(*window, color="0.5", alpha=0.08, lw=0)
    error = float(np.hypot(one.specimen_error_fit, one.specimen_error_window))
    name = "" if count == 1 else f"{str(one.specimen_name.values)[-_LONGEST:]}: "
    return Line2D([], [], color=color, label=f"{name}{_modulus(100 * modulus, error)}")


def _modulus(value: float, error: float) -> str:
    """A modulus with its error in MPa, as mathematics."""
    text = with_error(value, error).replace("+-", r"$\pm$")
    return f"$E$ = {text} MPa"
