"""Tensile test of the fabric with the line that gives its modulus (paper, Fig. material model)."""

from __future__ import annotations

import numpy as np
import xarray as xr

from limo.figures import style


def draw(dataset: xr.Dataset):
    """Nominal stress over nominal strain, the points that the fit uses filled, and the line through the origin."""
    figure, (axis,) = style.panels(1, width=4.0, height=3.2)
    axis.set_title("", loc="left")
    fitted = dataset.fitted.values.astype(bool)
    strain, stress = 100 * dataset.strain.values, dataset.stress.values
    source = "synthetic data, no measurement" if dataset.attrs["synthetic"] == "True" else "measured"
    axis.plot(strain[fitted], stress[fitted], "o", ms=3, color=style.COLORS[0], label=source)
    axis.plot(strain[~fitted], stress[~fitted], "o", ms=3, mfc="none", color=style.COLORS[0], label="not fitted")
    modulus, error = float(dataset.youngs_modulus), float(dataset.youngs_modulus_error)
    ends = np.array([0.0, strain[fitted].max()])
    axis.plot(ends, modulus * ends / 100, color=style.COLORS[1], label=f"$E$ = {modulus:.1f} $\\pm$ {error:.1f} MPa")
    axis.set(xlabel=r"Nominal strain $\varepsilon_\mathrm{nom}$ [%]", ylabel=r"Nominal stress $\sigma_\mathrm{nom}$ [MPa]")
    axis.set(xlim=(0, None), ylim=(0, None))
    axis.legend(loc="lower right")
    return figure
