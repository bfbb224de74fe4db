"""Stress figure: von Mises stress at the pressures of a study's maps on flat and deformed device (paper, Fig. local stress)."""

from __future__ import annotations

import numpy as np
import pandas as pd
import xarray as xr

from limo.figures import pictures
from limo.figures.render import Scale, Scene
from limo.mesh.surface import facets


def stress_scale(shapes: xr.Dataset) -> Scale:
    """One scale for all cases of a study: up to what 99 % of their points do not exceed."""
    values = shapes.von_mises.values
    known = values[np.isfinite(values)]
    return Scale("viridis", 0.0, pictures.rounded_up(float(np.quantile(known, 0.99))) if known.size else 1.0)


def pictures_of(case: xr.Dataset, scale: Scale) -> tuple[np.ndarray, np.ndarray] | None:
    """Stress of one case at its highest pressure on the flat and on the deformed device; None without shapes."""
    frame = pictures.last_frame(case)
    if frame is None or (surface := pictures.device(case, case.displacement.values[frame], case.von_mises.values[frame])) is None:
        return None
    length = float(case.device_length)
    flat = pictures.picture(Scene().add(pictures.flat_facets(surface), scale=scale), pictures.REFERENCE, length)
    image = pictures.picture(Scene().add(facets(surface), scale=scale), pictures.DEFORMED, length)
    return flat, image


def draw(dataset: xr.Dataset, measured: pd.DataFrame | None, shapes: xr.Dataset):
    """Rows P_v, columns N_p (or what varies); each panel: on the flat device left, on the deformed one right."""
    scale = stress_scale(shapes)
    figure = pictures.pair_grid(dataset, shapes, lambda case: pictures_of(case, scale))
    pictures.colour_bar(figure, scale, "Von Mises stress [MPa]", extend="max", note=pictures.pairs(dataset, shapes)[1])
    return figure
