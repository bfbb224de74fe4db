"""Deformation figure: the device at rising P_a, coloured with its displacement (paper, Figs. deformation and appendix)."""

from __future__ import annotations

import numpy as np
import pandas as pd
import xarray as xr

from limo.figures import pictures
from limo.figures.render import Scale, Scene
from limo.mesh.surface import facets

#: pressures of the columns: what is added to P_v in kPa, None for P_a = 0; beyond P_a,max the highest P_a stands for it
COLUMNS = (None, 10.0, 20.0, 40.0, 60.0)


def draw(dataset: xr.Dataset, measured: pd.DataFrame | None, shapes: xr.Dataset):
    """One block for each number of pouches if something else varies too; rows are cases, columns pressures."""
    shapes = pictures.squeezed(shapes, ["n_pouches"])
    others = [d for d in shapes.mesh_number.dims if d != "n_pouches"]
    blocks = [shapes.isel(n_pouches=[k]) for k in range(shapes.sizes["n_pouches"])] if others else [shapes]
    cases = [[c for line in pictures.case_grid(b, "n_pouches")[2] for c in line] for b in blocks]
    across = min(2, len(blocks))
    down, lines = -(-len(blocks) // across), len(cases[0])
    scale = Scale("viridis", 0.0, pictures.rounded_up(_largest(shapes)))
    grid = pictures.Grid(width=1.3, top=0.25 if others else 0.05, block=(lines if others else 0, len(COLUMNS)))
    figure, axes = pictures.picture_figure(down * lines, across * len(COLUMNS), grid)
    for k, (block, solution) in enumerate(zip(blocks, cases, strict=True)):
        first, left = k // across * lines, k % across * len(COLUMNS)
        for row, case in zip(axes[first : first + lines, left : left + len(COLUMNS)], solution, strict=True):
            _row(row, case, scale, pictures.empty_reason(dataset, case))
            pictures.row_label(row[0], pictures.names(case, others or ["n_pouches"]))
        if others:
            name = pictures.label("n_pouches", block.n_pouches.values[0])
            axes[first, left].set_title(f"({'abcdefgh'[k]}) {name}\n", loc="left", fontsize=9, pad=2)
    pictures.colour_bar(figure, scale, r"Displacement $\Vert u \Vert / L$ [-]", extend="max")
    return figure


def _row(axes, case: xr.Dataset, scale: Scale, reason: str) -> None:
    """The pictures of one case, one for each column."""
    for axis, offset in zip(axes, COLUMNS, strict=True):
        frame = _frame(case, offset)
        if frame is None:
            pictures.show(axis, None, reason or "no such frame")
            continue
        displacement = case.displacement.values[frame]
        length = float(case.device_length)
        surface = pictures.device(case, displacement, np.linalg.norm(displacement, axis=1) / length)
        image = pictures.picture(Scene().add(facets(surface), scale=scale), pictures.DEFORMED, length)
        pictures.show(axis, pictures.faded(image) if case.frame_contact.values[frame] > 0 else image)
        axis.set_title(pictures.pressure_label(case, frame), fontsize=7, pad=2)


def _frame(case: xr.Dataset, offset: float | None) -> int | None:
    """The frame of a column: at P_a = 0 or at P_v + ``offset`` kPa, and the last one where that is beyond the range."""
    if offset is None:
        return pictures.frame_at(case, 0.0)
    pressure = float(case.ventricular_pressure) + offset
    requested = case.frame_requested.values
    if np.isfinite(requested).any() and pressure > np.nanmax(requested) + 1e-3:
        return pictures.frame_at(case, float(np.nanmax(requested)))
    return pictures.frame_at(case, pressure)


def _largest(shapes: xr.Dataset) -> float:
    """Displacement over L that 99.5 % of all points do not exceed."""
    size = np.sqrt((shapes.displacement**2).sum("axis", skipna=False)) / shapes.device_length
    return float(size.quantile(0.995)) if np.isfinite(size).any() else 1.0
