"""Pressure-volume figure: actuation volume, stroke volume and input-output ratio against P_a (paper, Fig. pressure-volume)."""

from __future__ import annotations

import numpy as np
import pandas as pd
import xarray as xr

from limo.figures import overlay, style
from limo.measure.states import lowest


def curve_label(case: xr.Dataset, varying: list[str]) -> str:
    """Name of one case's curve by the axes that vary in its study."""
    symbols = {
        "n_pouches": "$N_p$",
        "ventricular_pressure": "$P_v$",
        "aspect_ratio": "AR",
        "stiffness_ratio": r"$\hat E$",
        "width_scale": "width",
        "fabric_angle": "warp",
        "bending_factor": "bending",
    }
    units = {"ventricular_pressure": " kPa", "fabric_angle": " degrees"}
    values = {d: case[d].item() for d in varying or ["n_pouches"]}
    label = ", ".join(v if d == "variant" else f"{symbols[d]} = {v:g}{units.get(d, '')}" for d, v in values.items())
    status = str(case.case_status.values)
    return label if status == "converged" else f"{label} ({status})"


def draw(dataset: xr.Dataset, measured: pd.DataFrame | None = None):
    """Three panels over P_a: (a) Delta V_a, (b) stroke volume, (c) ratio, one curve a case, measured curves on top."""
    figure, axes = style.panels(3)
    every, dataset = dataset, lowest(dataset)
    dims = [d for d in dataset.case_status.dims]
    varying = [d for d in dims if dataset.sizes[d] > 1]
    cases = dataset.stack(case=dims) if dims else dataset.expand_dims("case")
    panels = (
        (axes[0], "actuation_volume_change", "Actuation volume $\\Delta V_a$ [ml]"),
        (axes[1], "stroke_volume", "Stroke volume $\\Delta V_v$ [ml]"),
        (axes[2], "io_ratio", "Ratio $\\Delta V_v / V_a$ [-]"),
    )
    pressure = dataset.actuation_pressure.values
    spread = every.stack(case=dims) if dims else every.expand_dims("case")
    for k in range(cases.sizes["case"]):
        case = cases.isel(case=k)
        color = style.COLORS[k % len(style.COLORS)]
        for axis, name, _ in panels:
            style.curve(axis, case, name, color, label=curve_label(case, varying))
            style.band(axis, spread.isel(case=k), name, color)
        if "check_stroke_volume" in case and np.isfinite(case.check_stroke_volume).any():
            axes[1].plot(pressure, case.check_stroke_volume, ":", color=color, lw=1.2)
    laid_over = []
    if measured is not None:
        measured = overlay.shown_at(measured, dataset.ventricular_pressure.values)
        colors = {} if varying not in ([], ["n_pouches"]) else _colors(cases)
        for axis, name, _ in panels:
            handles = overlay.curves(axis, measured, name, colors)
            laid_over = handles if len(handles) > len(laid_over) else laid_over
    for axis, _, ylabel in panels:
        axis.set(xlabel="Actuation pressure $P_a$ [kPa]", ylabel=ylabel, xlim=(0, overlay.reach(float(pressure.max()), measured)))
    for value in np.unique(dataset.ventricular_pressure.values):
        axes[0].axvline(value, color="0.6", lw=0.8, ls=":")
        axes[1].axvline(value, color="0.6", lw=0.8, ls=":")
    axes[2].axhline(1.0, color="0.5", lw=0.8, ls="--")
    finite = dataset.io_ratio.values[np.isfinite(dataset.io_ratio.values)]
    axes[2].set_ylim(0, max(2.0, 1.1 * np.quantile(finite, 0.99)) if len(finite) else 2.0)
    handles = [*axes[1].get_legend_handles_labels()[0], *laid_over]
    style.legend(figure, handles, style.gaps(every), min(4, len(handles)))
    return figure


def _colors(cases: xr.Dataset) -> dict[int, str]:
    """The colour of each number of pouches."""
    return {int(cases.isel(case=k).n_pouches): style.COLORS[k % len(style.COLORS)] for k in range(cases.sizes["case"])}
