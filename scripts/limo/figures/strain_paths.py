"""Strain paths: lines along the direction of the largest principal strain, outside and inside (paper, Fig. strain map)."""

from __future__ import annotations

import numpy as np
import pandas as pd
import xarray as xr

from limo.figures import pictures, style
from limo.figures.render import PLAIN, Scale, Scene
from limo.mesh.layers import LAYERS
from limo.mesh.surface import facets, mirrors

ROWS = {"epicardial": "outside", "endocardial": "inside, front cut away"}


def draw(dataset: xr.Dataset, measured: pd.DataFrame | None, shapes: xr.Dataset):
    """Columns are cases; the upper row shows the epicardial surface, the lower one the endocardial one of the back."""
    _, labels, cases = pictures.case_grid(shapes, "n_pouches")
    cases = [case for line in cases for case in line]
    labels = labels if len(labels) == len(cases) else [pictures.names(case, pictures.varying(shapes)) for case in cases]
    strain = shapes.line_strain.values
    scale = Scale("viridis", 0.0, pictures.rounded_up(np.nanquantile(strain, 0.98)) if np.isfinite(strain).any() else 1.0)
    grid, note = pictures.with_notes(pictures.Grid(width=1.85), len(cases), style.gaps(dataset))
    figure, axes = pictures.picture_figure(2, len(cases), grid)
    for k, (case, name) in enumerate(zip(cases, labels, strict=True)):
        axes[0, k].set_title(name, fontsize=9)
        for axis, side in zip(axes[:, k], ROWS, strict=True):
            pictures.show(axis, picture_of(case, side, scale), pictures.empty_reason(dataset, case))
    for axis, letter, text in zip(axes[:, 0], "ab", ROWS.values(), strict=True):
        pictures.row_label(axis, f"({letter}) {text}")
    pictures.colour_bar(figure, scale, "Largest principal strain in the fabric's plane $E_1$ [-]", extend="max", note=note)
    return figure


def picture_of(case: xr.Dataset, side: str, scale: Scale) -> np.ndarray | None:
    """One surface of a case with its lines, None without shapes."""
    frame = pictures.last_frame(case)
    if frame is None or (surface := pictures.device(case, case.displacement.values[frame])) is None:
        return None
    inside = side == "endocardial"
    if inside:
        surface = surface.part((surface.face == 1) & (surface.layer != LAYERS.index("epi")))
    lines = case.sel(side=side)
    known = lines.line_number.values >= 0
    place, number = lines.line_place.values[known].astype(float), lines.line_number.values[known].astype(int)
    face, strain = lines.line_face.values[known], lines.line_strain.values[known]
    scene = Scene().add(facets(surface), color=PLAIN)
    for sign in mirrors(str(case.symmetry.values)):
        shown = (face if sign[2] > 0 else 1 - face) == 1 if inside else np.ones(len(face), bool)
        if shown.any():
            scene.add_lines(place[shown] * sign, strain[shown], number[shown], scale)
    return pictures.picture(scene, pictures.DEFORMED, float(case.device_length), 560)
