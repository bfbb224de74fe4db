"""Kinematics figure: the flat device, the device fitted to its valve, and the inflated device (paper, Fig. kinematics)."""

from __future__ import annotations

import numpy as np
import pandas as pd
import xarray as xr
from matplotlib.patches import Patch

from limo.figures import pictures, style
from limo.figures.render import Camera, Scene
from limo.mesh.layers import LAYERS
from limo.mesh.surface import Surface, facets

DOMAINS = {
    "wall": ("wall", "#9ecae8"),
    "endo": ("pouch, endocardial layer", "#f3c98b"),
    "epi": ("pouch, epicardial layer", "#7fc8ac"),
}
VIEW = Camera(azimuth=30.0, elevation=25.0)
_GAP = 0.8  # mm between layers that lie flat on each other, so that each is drawn


def draw(dataset: xr.Dataset, measured: pd.DataFrame | None, shapes: xr.Dataset):
    """Columns (a) reference, (b) initial, at P_a = 0, (c) inflated, at the highest P_a; rows are cases."""
    _, _, cases = pictures.case_grid(shapes, "")
    flat = [case for line in cases for case in line]
    grid, note = pictures.with_notes(pictures.Grid(width=2.3, bottom=0.35), 3, style.gaps(dataset))
    figure, axes = pictures.picture_figure(len(flat), 3, grid)
    for row, case in zip(axes, flat, strict=True):
        first, last = pictures.frame_at(case, 0.0), pictures.last_frame(case)
        reason = pictures.empty_reason(dataset, case)
        titles = ["(a) reference", "(b) initial", "(c) inflated"]
        for k, frame in ((1, first), (2, last)):
            if frame is not None:
                titles[k] += f", $P_a$ = {float(case.frame_pressure[frame]):.4g} kPa"
        for axis, frame, title, reference in zip(row, (last, first, last), titles, (True, False, False), strict=True):
            image = None if frame is None else picture_of(case, case.displacement.values[frame], reference)
            pictures.show(axis, image, reason)
            axis.set_title(title, fontsize=9)
        if len(flat) > 1:
            pictures.row_label(row[0], pictures.names(case, pictures.varying(shapes)))
    figure.legend(
        handles=[Patch(facecolor=color, edgecolor="0.3", lw=0.5, label=text) for text, color in DOMAINS.values()],
        loc="lower center",
        bbox_to_anchor=(0.5, pictures.note_below(figure, note)),
        ncols=3,
    )
    return figure


def picture_of(case: xr.Dataset, displacement: np.ndarray, reference: bool) -> np.ndarray | None:
    """The device with a colour for each kind of layer, flat or displaced."""
    surface = pictures.device(case, np.zeros_like(displacement) if reference else displacement)
    if surface is None:
        return None
    scene = Scene()
    for k, name in enumerate(LAYERS):
        for face, sign in ((0, 1.0), (1, -1.0)):
            part = surface.part((surface.layer == k) & (surface.face == face))
            if reference:
                offset = np.array([0.0, 0.0, sign * _GAP * (2 if name == "epi" else 1)])
                part = Surface(part.flat, part.points + offset, part.quads, part.layer, part.face, part.pouch)
            scene.add(facets(part), color=DOMAINS[name][1])
    return pictures.picture(scene, VIEW, float(case.device_length), 640)
