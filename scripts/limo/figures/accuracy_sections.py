"""Cross-sections of the device at y / L = 0.5 while its pouches inflate, mesh by mesh (paper, Fig. limo_valid_deformation)."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import xarray as xr
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.colors import Normalize

from limo.accuracy.statistics import rows_of
from limo.accuracy.surfaces import SECTION
from limo.figures import style
from limo.mesh.surface import mirrors


def draw(dataset: xr.Dataset, measured: pd.DataFrame | None = None):
    """A row a device, a column a mesh level from coarse to fine: cuts at the frames above P_a = 0, white at the lowest P_a."""
    rows = rows_of(dataset).iloc[dataset.section_run.values.astype(int)].reset_index(drop=True)
    names = list(dict.fromkeys(rows.device))
    columns = max([int((rows.device == name).sum()) for name in names], default=1)
    plt.rcParams.update(style.SETTINGS)
    width, height = (np.nanmax(np.abs(dataset.sections.values[..., k]), initial=1.0) for k in (0, 1))
    size = max(1.8 * columns, 5.0), (1.6 * height / width + 0.7) * max(len(names), 1) + 0.4
    figure, axes = plt.subplots(
        max(len(names), 1), columns, figsize=size, layout="constrained", squeeze=False, sharex=True, sharey=True
    )
    for axis in axes.ravel():
        axis.set_axis_off()
    shown = dataset.frame_pressure.values[dataset.section_run.values.astype(int)]
    shown = shown[shown > 0]
    norm = Normalize(*((shown.min(), shown.max()) if shown.size else (0.0, 1.0)))
    for device, line in zip(names, axes, strict=False):
        group = rows[rows.device == device].sort_values("degrees_of_freedom")
        for axis, (index, row) in zip(line, group.iterrows(), strict=False):
            pressure = dataset.frame_pressure.values[int(dataset.section_run[index])]
            _cuts(axis, dataset.sections.values[index], pressure, row.symmetry, norm)
            axis.set_axis_on()
            axis.set(aspect="equal", xlabel="x [mm]" if device == names[-1] else "", facecolor="0.93")
            axis.grid(visible=False)
            axis.set_title(f"{device}: {row.level}\n{row.degrees_of_freedom / 1000:.0f} thousand dof", fontsize=7.5)
        line[0].set_ylabel("z [mm]")
    bar = figure.colorbar(ScalarMappable(norm, "Greys"), ax=list(axes.ravel()), aspect=20)
    bar.set_label(f"$P_a$ [kPa], cut at $y/L$ = {SECTION:g}")
    return figure


def _cuts(axis, cuts: np.ndarray, pressure: np.ndarray, symmetry: str, norm: Normalize) -> None:
    """Segments (f, k, 2, 2) in mm at pressures (f,) of the full device."""
    grey = plt.get_cmap("Greys")
    for k in np.argsort(pressure):
        if not pressure[k] > 0:
            continue
        part = cuts[k][np.isfinite(cuts[k]).all(axis=(1, 2))]
        for sign in mirrors(symmetry):
            axis.add_collection(LineCollection(part * sign[[0, 2]], colors=[grey(norm(pressure[k]))], lw=0.6))
    axis.autoscale()
