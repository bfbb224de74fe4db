"""One style for all figures: fonts for print, a colour-blind safe palette, byte-identical files."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from PIL import Image

from limo.measure.states import folded_otherwise, in_contact, remarked
from limo.schema.figures import shown_places

if TYPE_CHECKING:
    import xarray as xr

#: Okabe-Ito, in the order in which curves take them: yellow, pale on white, last
COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#F0E442")
FADED = 0.35  # what is left of a line where layers would touch
_NOTE = 0.22  # inches that a line above all panels takes
_LETTER = 0.043  # inches that a letter of the small print above a legend takes
WIDEST_PNG, LARGEST_PNG = 1600, 300_000  # pixels across, bytes
SETTINGS = {
    "axes.grid": True,
    "axes.labelsize": 9,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlesize": 9,
    "figure.dpi": 100,
    "font.family": "DejaVu Sans",
    "font.size": 9,
    "grid.alpha": 0.25,
    "grid.linewidth": 0.5,
    "legend.fontsize": 8,
    "legend.frameon": False,
    "lines.linewidth": 1.6,
    "pdf.fonttype": 42,
    "savefig.dpi": 200,
    "svg.hashsalt": "limo",
}


def panels(count: int, width: float = 7.5, height: float = 3.0, **shares):
    """A row of ``count`` panels with letters; sizes in inches, ``shares``: for example ``width_ratios``."""
    plt.rcParams.update(SETTINGS)
    figure, axes = plt.subplots(1, count, figsize=(width, height), layout="constrained", squeeze=False, **shares)
    for letter, axis in zip("abcdefgh", axes[0], strict=False):
        axis.set_title(f"({letter})", loc="left")
    return figure, list(axes[0])


def two_rows(upper: int, lower: int, width: float, height: float):
    """Two rows of panels with letters running on; sizes in inches. Returns the figure and the axes of both."""
    plt.rcParams.update(SETTINGS)
    figure = plt.figure(figsize=(width, height), layout="constrained")
    figure.get_layout_engine().set(w_pad=0.08)
    parts = figure.subfigures(2, 1)
    above, below = (part.subplots(1, n, squeeze=False)[0] for part, n in zip(parts, (upper, lower), strict=True))
    for letter, axis in zip("abcdefghijkl", (*above, *below), strict=False):
        axis.set_title(f"({letter})", loc="left")
    return figure, list(above), list(below)


def stacked(width: float, *heights: float):
    """A figure in parts one below the other; sizes in inches. Returns the figure and its parts."""
    plt.rcParams.update(SETTINGS)
    figure = plt.figure(figsize=(width, sum(heights)), layout="constrained")
    return figure, *figure.subfigures(len(heights), 1, height_ratios=heights)


def line_of(case: xr.Dataset) -> str:
    """Solid for a case that converged, dash-dotted for one that is degraded, dashed for one that failed."""
    return {"converged": "-", "degraded": "-."}.get(str(case.case_status.values), "--")


def curve(axis, case: xr.Dataset, name: str, color: str, **looks) -> None:
    """A curve over P_a by the case's status, lighter from the first stored frame on in which front and back would touch.

    ``looks``: what else matplotlib's ``plot`` takes. Without the output contact, nothing is known of that and nothing lighter;
    nor where front and back do touch in the model.
    """
    pressure, values = case.actuation_pressure.values, drawn(case, name).values
    known = "contact_front_back" in case and not in_contact(case)
    touching = float(case.contact_front_back) if known else np.nan
    clear = ~(pressure > touching)
    axis.plot(pressure[clear], values[clear], line_of(case), color=color, **looks)
    if not clear.all():
        light = ~clear
        light[:-1] |= light[1:]  # so that the two parts meet
        axis.plot(pressure[light], values[light], line_of(case), color=color, alpha=FADED, **{**looks, "label": None})


def drawn(case: xr.Dataset, name: str) -> xr.DataArray:
    """A curve as it is drawn: the ratio from P_v on, below which nothing inflates and V_a is that of layers in each other."""
    values = case[name]
    if name != "io_ratio" or "ventricular_pressure" not in case.coords:
        return values
    return values.where(case.actuation_pressure >= case.ventricular_pressure)


def band(axis, case: xr.Dataset, name: str, color: str, zorder: float = 1) -> None:
    """Shade what the branches of a case reach of a curve, from the lowest to the highest; nothing where there is one."""
    if "branch" in case.dims:
        values = drawn(case, name)
        low, high = values.min("branch"), values.max("branch")
        axis.fill_between(case.actuation_pressure, low, high, color=color, alpha=0.25, lw=0, zorder=zorder)


def bars_of_branches(axis, places: np.ndarray, values: xr.DataArray, factor: float = 1.0) -> None:
    """Thin bars from the lowest to the highest of the branches of values (places, branch); nothing where there is one."""
    if "branch" in values.dims:
        axis.vlines(places, factor * values.min("branch"), factor * values.max("branch"), color="black", lw=0.8)


def shown_cases(dataset: xr.Dataset) -> tuple[xr.Dataset, str]:
    """The cases of a study that its figures show, and how many these are; all and nothing where they can be told apart.

    A dataset without cases, such as that of an airbag, as it is.
    """
    if "case_status" not in dataset:
        return dataset, ""
    sizes = {name: dataset.sizes[name] for name in dataset.case_status.dims}
    shown = dataset.isel(shown_places(sizes))
    count, left = (d.case_status.size // d.sizes.get("branch", 1) for d in (dataset, shown))
    return (dataset, "") if count == left else (shown, f"{left} of {count} cases are shown, evenly chosen")


def note_above(figure, note: str) -> None:
    """Write a line above all panels, wherever a figure has them; nothing without a note."""
    if not note:
        return
    if figure.get_layout_engine() is not None:
        figure.suptitle(note, fontsize=8)
        return
    wide, tall = figure.get_size_inches()
    share = tall / (tall + _NOTE)
    places = [axis.get_position() for axis in figure.axes]
    figure.set_size_inches(wide, tall + _NOTE)
    for axis, place in zip(figure.axes, places, strict=True):
        axis.set_position((place.x0, place.y0 * share, place.width, place.height * share))
    for text in figure.texts:
        text.set_y(text.get_position()[1] * share)
    figure.text(0.5, 1 - 0.04 / (tall + _NOTE), note, ha="center", va="top", fontsize=8)


def gaps(dataset: xr.Dataset, most: int = 5) -> list[str]:
    """What stands under a figure: the first ``most`` cases that failed or are degraded, with reasons, other folds, remarks."""
    dims = list(dataset.case_status.dims)
    cases = dataset[["case_id", "case_status", "case_reason"]].stack(case=dims) if dims else dataset.expand_dims("case")
    failed = [cases.isel(case=k) for k in range(cases.sizes["case"]) if str(cases.case_status.values[k]) != "converged"]
    lines = [f"{case.case_id.values}: {case.case_status.values}, {case.case_reason.values}" for case in failed[:most]]
    more = [f"and {len(failed) - most} more"] if len(failed) > most else []
    return [*lines, *more, *folded_otherwise(dataset), *remarked(dataset)]


def wrapped(notes: list[str], wide: float, letter: float) -> str:
    """Notes in lines that are no wider than so many inches, of which a letter takes so many."""
    return "\n".join(line for note in notes for line in textwrap.wrap(note, int(wide / letter)))


def legend(figure, handles: list, notes: list[str], ncols: int) -> None:
    """A legend below all panels, with ``notes`` in small print above it, in lines that are no wider than the figure."""
    figure.legend(
        handles=handles,
        loc="outside lower center",
        ncols=ncols,
        title=wrapped(notes, figure.bbox.width / figure.dpi, _LETTER) or None,
        title_fontsize=5.5,
        fontsize=7.5,
        handlelength=1.6,
        columnspacing=1.3,
    )


def save(figure, path: Path) -> None:
    """Write PNG, PDF or SVG by the path's ending, the same bytes for the same figure; a PNG has at most ``LARGEST_PNG`` bytes."""
    if unsteady := {".pdf": "CreationDate", ".svg": "Date"}.get(path.suffix):
        figure.savefig(path, metadata={unsteady: None})
        return
    path.write_bytes(_png(figure))


def _png(figure) -> bytes:
    """A figure in the most colours that fit into ``LARGEST_PNG``; with fewer dots where the fewest are still too many."""
    dpi = min(SETTINGS["savefig.dpi"], WIDEST_PNG / figure.get_size_inches()[0])
    while True:
        drawn = BytesIO()
        figure.savefig(drawn, format="png", dpi=dpi, pil_kwargs={"compress_level": 1})
        with Image.open(drawn) as image:
            for reduced in _reductions(image.convert("RGB")):
                written = BytesIO()
                reduced.save(written, "png", optimize=True, dpi=image.info["dpi"])
                if (size := len(written.getvalue())) <= LARGEST_PNG:
                    return written.getvalue()
        dpi *= 0.95 * (LARGEST_PNG / size) ** 0.5


def _reductions(image: Image.Image) -> Iterator[Image.Image]:
    """A picture as it is, with 64 levels of red, green and blue, and in 256 colours."""
    yield image
    yield image.point([round(round(v * 63 / 255) * 255 / 63) for v in range(256)] * 3)
    # of Pillow's palettes the one that moves no colour far, refined until hardly a pixel changes; dithered ones take more room
    steady = image.width * image.height // 100
    yield image.quantize(256, Image.Quantize.MAXCOVERAGE, kmeans=steady, dither=Image.Dither.NONE)


def close(figure) -> None:
    """Forget a figure that has been written."""
    plt.close(figure)
