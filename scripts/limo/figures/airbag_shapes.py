"""Square airbag: final shapes by element and mesh (paper, Fig. deformation)."""

from __future__ import annotations

import numpy as np
import pandas as pd
import xarray as xr
from matplotlib import pyplot as plt
from matplotlib.cm import ScalarMappable

from limo.figures import style
from limo.figures.render import Scale

#: displacement over the side, in the levels of the paper
SCALE = Scale("viridis", 0.0, 0.24, levels=20)
_ROWS = 5


def surface(run: xr.Dataset, side: float) -> tuple[np.ndarray, np.ndarray]:
    """Displaced lattice (k, k, 3) in mm of one run, with |u| / side (k, k). Centres of S8 squares follow from their edges.

    The 8-node square at its centre: u = (u_5 + u_6 + u_7 + u_8) / 2 - (u_1 + u_2 + u_3 + u_4) / 4.
    """
    moved = run.displacement.values.astype(float)
    size = int(np.isfinite(moved[0, :, 0]).sum())
    moved = moved[:size, :size].copy()
    if size and np.isnan(moved).any():
        mid = moved[:-1:2, 1::2] + moved[2::2, 1::2] + moved[1::2, :-1:2] + moved[1::2, 2::2]
        corner = moved[:-1:2, :-1:2] + moved[2::2, :-1:2] + moved[:-1:2, 2::2] + moved[2::2, 2::2]
        moved[1::2, 1::2] = 0.5 * mid - 0.25 * corner
    flat = np.linspace(0, side / 2, size) if size else np.empty(0)
    x, y = np.meshgrid(flat, flat)
    return moved + np.stack([x, y, np.zeros_like(x)], axis=-1), np.linalg.norm(moved, axis=-1) / side


def draw(dataset: xr.Dataset, measured: pd.DataFrame | None = None):
    """A column a series, a row a mesh; colours are |u| over the side; runs that failed show their last accepted state."""
    plt.rcParams.update(style.SETTINGS)
    side = dataset.attrs["side"]
    table = dataset.drop_vars("displacement").to_dataframe().reset_index()
    groups = list(table.groupby("series", sort=False))
    rows = min(_ROWS, max(len(group) for _, group in groups))
    figure = plt.figure(figsize=(1.35 * len(groups), 1.35 * rows + 0.9), layout="constrained")
    for j, (series, group) in enumerate(groups):
        for i, (index, row) in enumerate(group.tail(rows).iterrows()):
            axis = figure.add_subplot(rows, len(groups), i * len(groups) + j + 1, projection="3d", computed_zorder=False)
            place, size = surface(dataset.isel(run=index), side)
            if len(place):
                middle = 0.25 * (size[:-1, :-1] + size[1:, :-1] + size[:-1, 1:] + size[1:, 1:])
                faces = SCALE.colours(middle.ravel()).reshape(*middle.shape, 3) / 255
                axis.plot_surface(
                    *place.transpose(2, 0, 1), facecolors=faces, rstride=1, cstride=1, shade=True, lw=0, clip_on=False
                )
            axis.set(xlim=(0, side / 2), ylim=(0, side / 2), zlim=(0, side / 4))
            axis.set_box_aspect((2, 2, 1), zoom=1.25)
            axis.view_init(28, 40)
            axis.set_axis_off()
            note = "" if row.status == "converged" else f"\n{row.status}"
            title = (
                series.replace(" (", "\n(").replace("symmetric, ", "symmetric,\n").replace("hinged, ", "hinged,\n") + "\n"
                if i == 0
                else ""
            )
            axis.set_title(f"{title}{row.divisions} x {row.divisions}{note}", fontsize=6)
    colours = ScalarMappable(SCALE.norm, SCALE.map)
    bar = figure.colorbar(colours, ax=figure.axes, location="bottom", shrink=0.4, aspect=40)
    bar.set_label("Displacement over the side $|u| / L$ [-]")
    return figure
