"""Young's modulus of the fabric from a tensile test (paper, *Material model calibration*)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

from limo.errors import ConfigError
from limo.schema.device import TensileTest

_COLUMNS = ("elongation", "force")
_EXAMPLE = "elongation,force\n1.0,12.7"


def fit_modulus(strain: np.ndarray, stress: np.ndarray) -> tuple[float, float]:
    """E = sum(sigma eps) / sum(eps^2), the least-squares line through the origin, and its standard error.

    Nominal strains and stresses (n,), n > 1; both numbers in the unit of the stress.
    """
    modulus = float(stress @ strain / (strain @ strain))
    scatter = stress - modulus * strain
    return modulus, float(np.sqrt(scatter @ scatter / (len(strain) - 1) / (strain @ strain)))


def tensile_test(test: TensileTest) -> xr.Dataset:
    """A tensile test and its fit: sigma = F / A_0 (MPa) over eps = (l - l_0) / l_0, E (MPa) below ``largest_strain``.

    Raises ``ConfigError`` for a file that is no table of elongations (mm) and forces (N), or holds too little to fit.
    """
    path = Path(test.data)
    try:
        table = pd.read_csv(path, comment="#")
    except (OSError, ValueError) as error:
        raise ConfigError(path, "(file)", str(error), "a CSV file", _EXAMPLE) from None
    if missing := [c for c in _COLUMNS if c not in table]:
        raise ConfigError(path, "(header)", ",".join(table.columns), f"the columns {', '.join(missing)} as well", _EXAMPLE)
    try:
        elongation, force = (pd.to_numeric(table[c]).to_numpy(float) for c in _COLUMNS)
    except ValueError as error:
        raise ConfigError(path, "(rows)", str(error), "numbers", _EXAMPLE) from None
    strain, stress = elongation / test.length, force / (test.width * test.thickness)
    fitted = (strain > 0) & (strain < test.largest_strain) & np.isfinite(stress)
    if fitted.sum() < 3:
        expected = f"three or more strains below tensile_test.largest_strain = {test.largest_strain:g}"
        raise ConfigError(path, "(rows)", int(fitted.sum()), expected, _EXAMPLE)
    modulus, error = fit_modulus(strain[fitted], stress[fitted])
    first = path.read_text(encoding="utf-8").splitlines()[0]
    return xr.Dataset(
        {
            "stress": ("point", stress, {"units": "MPa", "long_name": "nominal stress, F / A_0"}),
            "fitted": ("point", fitted.astype(np.int8), {"long_name": "whether the fit uses a point"}),
            "youngs_modulus": ((), modulus, {"units": "MPa", "long_name": "Young's modulus, E"}),
            "youngs_modulus_error": ((), error, {"units": "MPa", "long_name": "standard error of E"}),
        },
        coords={"strain": ("point", strain, {"units": "1", "long_name": "nominal strain, (l - l_0) / l_0"})},
        attrs={"title": "tensile test of the fabric", "data": test.data, "synthetic": str("SYNTHETIC" in first)},
    )
