"""Deformation figure: the device at rising P_a, coloured with its displacement (paper, Figs. deformation and appendix)."""

from __future__ import annotations

import numpy as np
import pandas as pd
import xarray as xr

from limo.figures import pictures, style
from limo.figures.render import Scale, Scene
from limo.mesh.surface import facets

#: pressures of the columns: what is added to P_v in kPa, None for P_a = 0; the highest P_a stands for the first beyond P_a,max
COLUMNS = (None, 10.0, 20.0, 40.0, 60.0)


def draw(dataset: xr.Dataset, measured: pd.DataFrame | None, shapes: xr.Dataset):
    """One block for each number of pouches if something else varies too; rows are cases, columns pressures."""
    shapes = pictures.squeezed(shapes, ["n_pouches"])
    others = [d for d in shapes.mesh_number.dims if d != "n_pouches"]
    blocks = [shapes.isel(n_pouches=[k]) for k in range(shapes.sizes["n_pouches"])] if others else [shapes]
    cases = [[c for line in pictures.case_grid(b, "n_pouches")[2] for c in line] for b in blocks]
    shown = columns_of([case for solution in cases for case in solution])
    across, wide = min(2, len(blocks)), len(shown)
    down, lines = -(-len(blocks) // across), len(cases[0])
    scale = Scale("viridis", 0.0, pictures.rounded_up(_largest(shapes)))
    grid = pictures.Grid(width=1.3, top=0.25 if others else 0.05, block=(lines if others else 0, wide))
    grid, note = pictures.with_notes(
        grid, across * wide, _notes(dataset, [case for solution in cases for case in solution], shown)
    )
    figure, axes = pictures.picture_figure(down * lines, across * wide, grid)
    for k, (block, solution) in enumerate(zip(blocks, cases, strict=True)):
        first, left = k // across * lines, k % across * wide
        for row, case in zip(axes[first : first + lines, left : left + wide], solution, strict=True):
            _row(row, case, shown, scale, pictures.empty_reason(dataset, case))
            pictures.row_label(row[0], pictures.names(case, others or ["n_pouches"]))
        if others:
            name = pictures.label("n_pouches", block.n_pouches.values[0])
            axes[first, left].set_title(f"({'abcdefgh'[k]}) {name}\n", loc="left", fontsize=9, pad=2)
    pictures.colour_bar(figure, scale, r"Displacement $\Vert u \Vert / L$ [-]", extend="max", note=note)
    return figure


def columns_of(cases: list[xr.Dataset]) -> tuple[float | None, ...]:
    """The columns of ``COLUMNS`` that show something new for one of the cases: where P_a,max is low, there are fewer."""
    known = [case for case in cases if np.isfinite(case.frame_requested.values).any()]  # others failed, and say why in any number
    return tuple(c for k, c in enumerate(COLUMNS) if not known or any(not _repeats(case, k) for case in known))


def _repeats(case: xr.Dataset, k: int) -> bool:
    """Whether a column would show the state at P_a,max that an earlier one shows."""
    return k > 0 and _is_beyond(case, COLUMNS[k - 1])


def _is_beyond(case: xr.Dataset, offset: float | None) -> bool:
    """Whether P_v + ``offset`` kPa lies beyond all pressures that were asked for, or is the highest of them."""
    requested = case.frame_requested.values
    return offset is not None and np.isfinite(requested).any() and _pressure(case, offset) > np.nanmax(requested) - 1e-3


def _pressure(case: xr.Dataset, offset: float) -> float:
    return float(case.ventricular_pressure) + offset


def _notes(dataset: xr.Dataset, cases: list[xr.Dataset], shown: tuple[float | None, ...]) -> list[str]:
    """What stands below: why there are fewer pictures, what a star and a pale picture mean, and what is wrong with cases."""
    frames = [(case, _frame(case, offset)) for case in cases for offset in shown]
    starred = any(pictures.is_touching(case, frame) for case, frame in frames)
    few = f"fewer pictures: $P_{{a,max}}$ is $P_v$ + {COLUMNS[len(shown) - 1] or 0:g} kPa at most"
    pale = "; the picture is pale" * any(pictures.is_pale(case, frame) for case, frame in frames)
    return [few] * (len(shown) < len(COLUMNS)) + [pictures.STAR + pale] * starred + style.gaps(dataset)


def _row(axes, case: xr.Dataset, shown: tuple[float | None, ...], scale: Scale, reason: str) -> None:
    """The pictures of one case, one for each column; nothing but words where P_a,max was shown already."""
    for axis, offset in zip(axes, shown, strict=True):
        if _repeats(case, COLUMNS.index(offset)) and not reason:
            text = f"beyond\n$P_{{a,max}}$ = {np.nanmax(case.frame_requested.values):.4g} kPa"
            axis.text(0.5, 0.5, text, transform=axis.transAxes, ha="center", va="center", fontsize=6, color="0.4")
            continue
        frame = _frame(case, offset)
        if frame is None:
            pictures.show(axis, None, reason or "no such frame")
            continue
        displacement = case.displacement.values[frame]
        length = float(case.device_length)
        surface = pictures.device(case, displacement, np.linalg.norm(displacement, axis=1) / length)
        image = pictures.picture(Scene().add(facets(surface), scale=scale), pictures.DEFORMED, length)
        pictures.show(axis, pictures.faded(image) if pictures.is_pale(case, frame) else image)
        axis.set_title(pictures.pressure_label(case, frame), fontsize=7, pad=2)


def _frame(case: xr.Dataset, offset: float | None) -> int | None:
    """The frame of a column: at P_a = 0 or at P_v + ``offset`` kPa, and the last one where that is beyond the range."""
    if offset is None:
        return pictures.frame_at(case, 0.0)
    pressure, requested = _pressure(case, offset), case.frame_requested.values
    if np.isfinite(requested).any() and pressure > np.nanmax(requested) + 1e-3:
        return pictures.frame_at(case, float(np.nanmax(requested)))
    return pictures.frame_at(case, pressure)


def _largest(shapes: xr.Dataset) -> float:
    """Displacement over L that 99.5 % of all points do not exceed."""
    size = np.sqrt((shapes.displacement**2).sum("axis", skipna=False)) / shapes.device_length
    return float(size.quantile(0.995)) if np.isfinite(size).any() else 1.0
