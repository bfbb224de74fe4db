"""One style for all figures: fonts for print, a colour-blind safe palette, byte-identical files."""

from __future__ import annotations

from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

#: Okabe-Ito, in the order in which curves take them
COLORS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#F0E442", "#000000")
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


def panels(count: int, width: float = 7.5, height: float = 3.0):
    """A row of ``count`` panels with letters; sizes in inches."""
    plt.rcParams.update(SETTINGS)
    figure, axes = plt.subplots(1, count, figsize=(width, height), layout="constrained", squeeze=False)
    for letter, axis in zip("abcdefgh", axes[0], strict=False):
        axis.set_title(f"({letter})", loc="left")
    return figure, list(axes[0])


def save(figure, path: Path) -> None:
    """Write PNG, PDF or SVG by the path's ending, the same bytes for the same figure."""
    unsteady = {".pdf": "CreationDate", ".svg": "Date"}.get(path.suffix, "Software")
    figure.savefig(path, metadata={unsteady: None})
    plt.close(figure)
