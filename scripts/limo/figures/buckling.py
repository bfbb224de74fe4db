"""Buckling figure: the largest jump of the stroke volume and what moves in it, front and back (paper, Fig. buckling)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import xarray as xr

from limo.figures import overlay, pictures, style
from limo.figures.render import Scale, Scene
from limo.measure.buckling import displacement_difference
from limo.measure.states import lowest
from limo.mesh.surface import facets

WINDOW = 4.0  # kPa shown on either side of a jump


def draw(dataset: xr.Dataset, measured: pd.DataFrame | None, shapes: xr.Dataset):
    """Rows are cases; (a) stroke volume around the jump, (b) front and (c) back coloured with the difference across it."""
    _, _, cases = pictures.case_grid(shapes, "n_pouches")
    cases = [case for line in cases for case in line]
    grid, note = pictures.with_notes(pictures.Grid(width=2.0, left=3.5), 2, style.gaps(dataset))
    figure, axes = pictures.picture_figure(len(cases), 2, grid)
    curves = [pictures.beside(figure, axis, 0.7, 2.5) for axis in axes[:, 0]]
    scale = Scale("viridis", 0.0, pictures.rounded_up(_largest(shapes)))
    for axis, row, case in zip(curves, axes, cases, strict=True):
        _curve(axis, pictures.branches_of(dataset, case), case, measured)
        images, reason = _both_sides(case, scale), pictures.empty_reason(dataset, case, "no jump in the stroke volume")
        for panel, image, title in zip(row, images, ("(b) front", "(c) back"), strict=True):
            pictures.show(panel, image, reason)
            panel.set_title(title, loc="left")
        if len(cases) > 1:
            axis.text(0.03, 0.97, pictures.names(case, pictures.varying(shapes)), transform=axis.transAxes, va="top")
    text = r"Displacement difference $\Vert u(P_{a,c+}) - u(P_{a,c-}) \Vert / L$ [-]"
    pictures.colour_bar(figure, scale, text, extend="max", note=note)
    return figure


def _curve(axis, branches: xr.Dataset, case: xr.Dataset, measured: pd.DataFrame | None) -> None:
    """The stroke volume around the jump, whose ends are marked, and what branches reach; all of it, small, in the corner.

    Measured strokes are those at the case's own P_v and N_p, or of unknown ones.
    """
    curves = lowest(branches)
    pressure, stroke = curves.actuation_pressure.values, curves.stroke_volume.values
    if not np.isfinite(stroke).any():
        axis.set_visible(False)
        return
    before, after = case.event_pressure.values.astype(float)
    axis.set_title("(a)", loc="left")
    axis.set(xlabel="Actuation pressure $P_a$ [kPa]", ylabel="Stroke volume $\\Delta V_v$ [ml]")
    style.curve(axis, curves, "stroke_volume", style.COLORS[0])
    style.band(axis, branches, "stroke_volume", style.COLORS[0])
    own = None
    if measured is not None:
        own = overlay.shown_at(measured, float(case.ventricular_pressure))
        own = own[own.n_pouches.isna() | (own.n_pouches == float(case.n_pouches))]
        if handles := overlay.curves(axis, own, "stroke_volume", {}):
            axis.legend(handles=handles, loc="upper left", bbox_to_anchor=(0, 0.93), fontsize=6)
    if not np.isfinite(before):
        return
    ends = np.interp([before, after], pressure, stroke)
    near = (pressure >= before - WINDOW) & (pressure <= after + WINDOW) & np.isfinite(stroke)
    shown = branches.stroke_volume.isel(actuation_pressure=near).values
    low, high = np.nanmin(shown), np.nanmax(shown)
    margin = 0.08 * (high - low)
    axis.set(xlim=(before - WINDOW, after + WINDOW), ylim=(low - margin, high + margin))
    for x, y, name in ((before, ends[0], "-"), (after, ends[1], "+")):
        axis.plot(x, y, "o", ms=4.5, color=style.COLORS[1])
        text = f"$P_{{a,c{name}}}$ = {x:.4g} kPa"
        axis.annotate(text, (x, y), xytext=(-6, 4), textcoords="offset points", ha="right", va="bottom", fontsize=7)
    inset = axis.inset_axes((0.62, 0.1, 0.36, 0.3))
    style.curve(inset, curves, "stroke_volume", style.COLORS[0], lw=0.9)
    if own is not None:
        overlay.curves(inset, own, "stroke_volume", {}, size=1.2)
    inset.axvspan(before - WINDOW, after + WINDOW, color=style.COLORS[1], alpha=0.25, lw=0)
    inset.tick_params(labelsize=5, length=2, pad=1)
    inset.grid(False)


def _difference(case: xr.Dataset) -> np.ndarray:
    before, after = case.event_displacement.values
    return displacement_difference(before, after, float(case.device_length))


def _both_sides(case: xr.Dataset, scale: Scale) -> tuple[np.ndarray | None, np.ndarray | None]:
    """Front and back of the device after the jump; None without one."""
    if not np.isfinite(case.event_pressure.values).all():
        return None, None
    surface = pictures.device(case, case.event_displacement.values[1], _difference(case))
    if surface is None:
        return None, None
    scene, length = Scene().add(facets(surface), scale=scale), float(case.device_length)
    views = (pictures.DEFORMED, replace(pictures.DEFORMED, back=True))
    front, back = (pictures.picture(scene, view, length, 560) for view in views)
    return front, back


def _largest(shapes: xr.Dataset) -> float:
    """What 99 % of the points of all cases do not exceed of the difference, over L."""
    difference = shapes.event_displacement.isel(end=1) - shapes.event_displacement.isel(end=0)
    size = np.linalg.norm(difference.transpose(..., "axis").values, axis=-1) / pictures.length_of(shapes)
    return float(np.nanquantile(size, 0.99)) if np.isfinite(size).any() else 1.0
