"""Fatigue map: expected number of cycles near seams, on the flat and on the deformed device (paper, Fig. fatigue)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import xarray as xr

from limo.figures import pictures
from limo.figures.render import Scale, Scene
from limo.measure.fatigue import cycles_to_failure
from limo.mesh.surface import Facets, facets
from limo.schema.fatigue import Fatigue


def cycles_of(amplitude: np.ndarray, distance: np.ndarray, fatigue: Fatigue) -> np.ndarray:
    """N_f (p,) of strain amplitudes (p,), the end of the curve in the endurance range, NaN away from seams (mm)."""
    cycles, _ = cycles_to_failure(np.maximum(amplitude, 0.0), fatigue)
    cycles = np.where(np.isfinite(cycles), cycles, fatigue.endurance_cycles.value)
    return np.where((distance <= fatigue.seam_distance.value + 1e-6) & np.isfinite(amplitude), cycles, np.nan)


def life_scale(shapes: xr.Dataset, fatigue: Fatigue) -> Scale:
    """One scale for all cases of a study: from the power of ten below the fewest cycles to the end of the curve."""
    amplitude = shapes.fatigue_amplitude.values
    largest = np.nanmax(amplitude) if np.isfinite(amplitude).any() else 1.0
    shortest = cycles_to_failure(np.array([largest]), fatigue)[0][0]
    last = fatigue.endurance_cycles.value
    low = 10 ** np.floor(np.log10(shortest)) if np.isfinite(shortest) else 1.0
    return Scale("plasma", float(np.clip(low, 1.0, last / 10)), last, log=True)


def pictures_of(case: xr.Dataset, scale: Scale, fatigue: Fatigue, pixels: int = 340) -> tuple[np.ndarray, np.ndarray] | None:
    """Cycles of one case on the flat and on the deformed device at its highest pressure; None without shapes."""
    frame = pictures.last_frame(case)
    if frame is None:
        return None
    distance = case.seam_distance.isel(mesh=int(case.mesh_number)).values
    values = np.column_stack([case.fatigue_amplitude.values, distance])
    surface = pictures.device(case, case.displacement.values[frame], values)
    length = float(case.device_length)

    def image(shown_facets: Facets, camera) -> np.ndarray:
        shown_facets = replace(shown_facets, values=cycles_of(*shown_facets.values.T, fatigue))
        return pictures.picture(Scene().add(shown_facets, scale=scale), camera, length, pixels)

    return image(pictures.flat_facets(surface), pictures.REFERENCE), image(facets(surface), pictures.DEFORMED)


def draw(dataset: xr.Dataset, measured: pd.DataFrame | None, shapes: xr.Dataset):
    """Rows P_v, columns N_p (or what varies); each panel: on the flat device left, on the deformed one right."""
    fatigue = Fatigue.model_validate_json(dataset.attrs["fatigue"])
    scale = life_scale(shapes, fatigue)
    figure = pictures.pair_grid(dataset, shapes, lambda case: pictures_of(case, scale, fatigue))
    text = f"Expected cycles $N_f$ [-] near seams; grey: more than {fatigue.seam_distance.value:g} mm from a seam, not estimated"
    pictures.colour_bar(figure, scale, text, extend="max", note=pictures.pairs(dataset, shapes)[1])
    return figure
