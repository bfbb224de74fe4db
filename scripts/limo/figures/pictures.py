"""What figures of surfaces share: the cases of a study in a grid, their pictures, labels, colour bars and empty panels."""

from __future__ import annotations

import textwrap
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import product

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from matplotlib.cm import ScalarMappable
from matplotlib.patches import Rectangle

from limo.figures import style
from limo.figures.render import Camera, Scale, Scene, render
from limo.measure.states import in_contact, lowest
from limo.mesh.layers import LAYERS
from limo.mesh.surface import Facets, Surface, facets, full_device, surface_of
from limo.store.statuses import USABLE

SYMBOLS = {
    "n_pouches": "$N_p$ = {:g}",
    "ventricular_pressure": "$P_v$ = {:g} kPa",
    "aspect_ratio": "AR = {:g}",
    "stiffness_ratio": r"$\hat E$ = {:g}",
    "width_scale": "width {:g}",
    "fabric_angle": "warp at {:g} degrees",
    "bending_factor": "bending {:g}",
    "variant": "{}",
    "branch": "branch {:g}",
}
REFERENCE = Camera(azimuth=0.0, elevation=0.0)
DEFORMED = Camera()
FADED = 0.45  # what is left of a picture's darkness where layers would touch


def varying(shapes: xr.Dataset) -> list[str]:
    """Dimensions of the cases along which there are several."""
    return [d for d in shapes.mesh_number.dims if shapes.sizes[d] > 1]


def label(dim: str, value: object) -> str:
    """How a value of a dimension is written beside a panel."""
    return SYMBOLS[dim].format(value.item() if hasattr(value, "item") else value)


def squeezed(shapes: xr.Dataset, dims: list[str]) -> xr.Dataset:
    """The same without the dimensions of the cases that do not vary, except ``dims``."""
    drop = {d: 0 for d in shapes.mesh_number.dims if d not in dims and shapes.sizes[d] == 1}
    return shapes.isel(drop)


def case_grid(shapes: xr.Dataset, across: str) -> tuple[list[str], list[str], list[list[xr.Dataset]]]:
    """Cases in rows and columns: labels of both, and the case of each panel.

    The dimension ``across`` makes the columns if it varies, else the last that does; all others together make the rows.
    """
    shapes = squeezed(shapes, [])
    dims = list(shapes.mesh_number.dims)
    column = across if across in dims else dims[-1] if dims else None
    rest = [d for d in dims if d != column]
    rows = list(product(*(range(shapes.sizes[d]) for d in rest)))
    columns = range(shapes.sizes[column]) if column else [0]
    cases = [[shapes.isel(dict(zip(rest, row, strict=True)) | ({column: k} if column else {})) for k in columns] for row in rows]
    row_labels = [", ".join(label(d, line[0][d].values) for d in rest) for line in cases]
    return row_labels, [label(column, case[column].values) if column else "" for case in cases[0]], cases


def length_of(shapes: xr.Dataset) -> float:
    """The length of the device (mm), the largest where a study has several."""
    return float(np.nanmax(shapes.device_length.values))


def frame_at(case: xr.Dataset, pressure: float) -> int | None:
    """Index of the frame that was asked for at a pressure (kPa), None where the case has none."""
    near = np.abs(case.frame_requested.values - pressure) < 1e-3
    hits = np.flatnonzero(near & np.isfinite(case.frame_pressure.values))
    return int(hits[0]) if len(hits) else None


def last_frame(case: xr.Dataset) -> int | None:
    """Index of the frame with the highest pressure, None for a case without any."""
    pressure = case.frame_pressure.values
    return int(np.nanargmax(pressure)) if np.isfinite(pressure).any() else None


def device(case: xr.Dataset, displacement: np.ndarray, values: np.ndarray | None = None) -> Surface | None:
    """The full device of one case under ``displacement`` (point, 3) in mm, None without shapes."""
    part = surface_of(case, displacement, values)
    return None if part is None else full_device(part, str(case.symmetry.values), int(case.n_pouches))


def outside(surface: Surface) -> Surface:
    """What is seen from the front of the flat device: wall and epicardium of the front."""
    return surface.part((surface.face == 0) & (surface.layer != LAYERS.index("endo")))


def flat_facets(surface: Surface) -> Facets:
    """The front of the device on the flat pattern."""
    flat = np.column_stack([surface.flat, np.zeros(len(surface.flat))])
    return facets(
        outside(Surface(surface.flat, flat, *(getattr(surface, n) for n in ("quads", "layer", "face", "pouch", "values"))))
    )


def faded(image: np.ndarray) -> np.ndarray:
    """The same picture, lighter: for states in which layers would touch."""
    return np.round(255 - FADED * (255.0 - image)).astype(np.uint8)


def picture(scene: Scene, camera: Camera, length: float, pixels: int = 340) -> np.ndarray:
    """A picture at the scale of a device of ``length`` mm."""
    return render(scene, camera.scaled(length / 140.0), pixels)


def show(axis, image: np.ndarray | None, reason: str = "") -> None:
    """Put a picture into a panel, or mark the panel as empty and write the ``reason`` beneath."""
    axis.set_axis_off()
    if image is not None:
        axis.imshow(image, interpolation="antialiased")
        return
    axis.set(xlim=(0, 1), ylim=(0, 1), aspect=DEFORMED.height / DEFORMED.width)
    axis.add_patch(Rectangle((0.05, 0.2), 0.9, 0.75, fill=False, ls="--", lw=0.8, ec="0.5"))
    axis.plot([0.05, 0.95], [0.2, 0.95], [0.05, 0.95], [0.95, 0.2], lw=0.5, color="0.75")
    lines = textwrap.wrap(reason or "no result", 28)[:4]
    axis.text(0.5, 0.17, "\n".join(lines), ha="center", va="top", fontsize=5.5, color="0.3")


@dataclass(frozen=True)
class Grid:
    """Where pictures stand, in inches: their width, what is left around all of them and above each."""

    width: float = 1.25
    left: float = 0.28
    right: float = 0.05
    top: float = 0.1
    bottom: float = 0.62
    title: float = 0.2
    block: tuple[int, int] = (0, 0)  # rows and columns after which there is more room
    room: tuple[float, float] = (0.25, 0.3)

    @property
    def height(self) -> float:
        """Height of a picture."""
        return self.width * DEFORMED.height / DEFORMED.width

    def _start(self, k: int, step: float, along: int) -> float:
        size, room = self.block[along], self.room[along]
        return k * step + (room * (k // size) if size else 0.0)

    def size(self, rows: int, columns: int) -> tuple[float, float]:
        """Width and height of all pictures with what is around them."""
        wide = self._start(columns - 1, self.width, 1) + self.width
        tall = self._start(rows - 1, self.height + self.title, 0) + self.height + self.title
        return self.left + wide + self.right, self.top + tall + self.bottom

    def axes(self, figure, rows: int, columns: int) -> np.ndarray:
        """Axes (rows, columns) within a figure or a part of one of the size that the grid has, from its upper left corner."""
        whole = figure.bbox.width / figure.figure.dpi, figure.bbox.height / figure.figure.dpi
        axes = np.empty((rows, columns), object)
        for i, j in product(range(rows), range(columns)):
            x = self.left + self._start(j, self.width, 1)
            y = whole[1] - self.top - self._start(i, self.height + self.title, 0) - self.title - self.height
            axes[i, j] = figure.add_axes((x / whole[0], y / whole[1], self.width / whole[0], self.height / whole[1]))
            axes[i, j].set_axis_off()
        return axes


#: room below the colour bar for a line of small print, and width of one of its letters, in inches
_LINE, _LETTER = 0.12, 0.047
#: what the star behind a pressure means
STAR = "* front and back pass each other here by more than a thickness"


def with_notes(grid: Grid, columns: int, notes: list[str]) -> tuple[Grid, str]:
    """The same grid with room for notes below the colour bar, and these in lines that are no wider than all columns."""
    lines = style.wrapped(notes, grid.size(1, columns)[0], _LETTER)
    return replace(grid, bottom=grid.bottom + _LINE * len(lines.splitlines())), lines


def pairs(dataset: xr.Dataset, shapes: xr.Dataset) -> tuple[Grid, str]:
    """Where pictures in pairs stand, and the note below: what a star means where there is one, and what is wrong with cases."""
    _, columns, cases = case_grid(shapes, "n_pouches")
    starred = any(is_touching(case, last_frame(case)) for line in cases for case in line)
    return with_notes(Grid(width=1.15, block=(0, 2), room=(0.0, 0.12)), 2 * len(columns), [STAR] * starred + style.gaps(dataset))


def picture_figure(rows: int, columns: int, grid: Grid):
    """A new figure with axes (rows, columns) for pictures."""
    plt.rcParams.update(style.SETTINGS)
    figure = plt.figure(figsize=grid.size(rows, columns))
    return figure, grid.axes(figure, rows, columns)


def beside(figure, axis, start: float, width: float):
    """Axes for a curve left of a picture, as high as most of it; from ``start``, ``width`` wide, in inches."""
    whole, place = figure.bbox.width / figure.figure.dpi, axis.get_position()
    return figure.add_axes((start / whole, place.y0 + 0.17 * place.height, width / whole, 0.83 * place.height))


def pair_grid(dataset: xr.Dataset, shapes: xr.Dataset, draw: Callable[[xr.Dataset], tuple | None], parent=None):
    """Two pictures of each case side by side, which ``draw`` makes; cases in rows P_v and columns N_p, or what varies."""
    rows, columns, cases = case_grid(shapes, "n_pouches")
    count = len(rows), 2 * len(columns)
    grid, _ = pairs(dataset, shapes)
    figure, axes = picture_figure(*count, grid) if parent is None else (parent, grid.axes(parent, *count))
    for i, (line, row, name) in enumerate(zip(cases, axes, rows, strict=True)):
        for k, case in enumerate(line):
            images = draw(case) or (None, None)
            reason = empty_reason(dataset, case)
            for axis, image in zip(row[2 * k : 2 * k + 2], images, strict=True):
                show(axis, image, reason)
            row[2 * k].set_title(columns[k] if i == 0 else "", loc="left", fontsize=9, pad=2)
            row[2 * k + 1].set_title(pressure_label(case, last_frame(case)), fontsize=7, pad=2)
        row_label(row[0], name)
    return figure


def is_touching(case: xr.Dataset, frame: int | None) -> bool:
    """Whether front and back pass each other by more than a thickness in a frame; not without a frame."""
    return frame is not None and bool(case.frame_contact.values[frame] > 0)


def is_pale(case: xr.Dataset, frame: int | None) -> bool:
    """Whether a frame lies beyond a contact of front and back that the model does not have."""
    return is_touching(case, frame) and not in_contact(case)


def pressure_label(case: xr.Dataset, frame: int | None) -> str:
    """The pressure of a frame, with a star where front and back pass each other; nothing without a frame."""
    if frame is None:
        return ""
    star = "*" if is_touching(case, frame) else ""
    return f"$P_a$ = {float(case.frame_pressure[frame]):.4g} kPa{star}"


def row_label(axis, text: str) -> None:
    """Write a label upright at the left of a panel."""
    axis.annotate(text, (-0.02, 0.5), xycoords="axes fraction", ha="right", va="center", rotation=90, fontsize=9)


def note_below(figure, note: str) -> float:
    """Write a ``note`` in small print at the bottom; returns the share of the figure's height that it takes."""
    tall = figure.bbox.height / figure.figure.dpi
    figure.text(0.5, 0.03 / tall, note, ha="center", va="bottom", fontsize=6.5)
    return _LINE * (note.count("\n") + 1) / tall if note else 0.0


def colour_bar(figure, scale: Scale, text: str, extend: str = "neither", note: str = ""):
    """A colour bar at the bottom, below all panels, and below it a ``note`` in small print."""
    wide, tall = figure.bbox.width / figure.figure.dpi, figure.bbox.height / figure.figure.dpi
    length, low = min(0.6 * wide, 5.0), 0.42 / tall + note_below(figure, note)
    axis = figure.add_axes((0.5 - length / wide / 2, low, length / wide, 0.11 / tall))
    bar = figure.colorbar(ScalarMappable(scale.norm, scale.map), cax=axis, orientation="horizontal", extend=extend)
    bar.ax.tick_params(labelsize=8)
    bar.set_label(text, labelpad=1, fontsize=9)
    return bar


def rounded_up(value: float) -> float:
    """The next number with one or two digits: 1, 1.5, 2, 2.5, 3, 4, 5, 6, 8 times a power of ten."""
    if not np.isfinite(value) or value <= 0:
        return 1.0
    power = 10.0 ** np.floor(np.log10(value))
    return float(next(s for s in (1, 1.5, 2, 2.5, 3, 4, 5, 6, 8, 10) if s * power >= value * (1 - 1e-9)) * power)


def branches_of(dataset: xr.Dataset, case: xr.Dataset) -> xr.Dataset:
    """The same case in the study's dataset of curves, with all of its branches."""
    return dataset.sel({d: case[d].values for d in dataset.case_status.dims if d in case.coords and d != "branch"})


def study_case(dataset: xr.Dataset, case: xr.Dataset) -> xr.Dataset:
    """The same case in the study's dataset of curves; of its branches the first."""
    return lowest(branches_of(dataset, case))


def empty_reason(dataset: xr.Dataset, case: xr.Dataset, otherwise: str = "") -> str:
    """Why a panel is empty: the case's status in the study's dataset, or why it has no shapes."""
    selected = study_case(dataset, case)
    status = str(selected.case_status.values)
    if status not in USABLE:
        return f"{status}: {selected.case_reason.values}"
    return str(case.shape_reason.values) or otherwise


def names(case: xr.Dataset, dims: list[str]) -> str:
    """All that a case differs in from others of its study."""
    return ", ".join(label(d, case[d].values) for d in dims)
