"""What the page plots: every number of a study's dataset with its dimensions, names and units."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from limo.datasets.variables import SYMBOLS

_DIGITS = 6  # significant


def curves(dataset: xr.Dataset) -> dict[str, Any]:
    """Dimensions and variables of a study as plain data; values in the order of their dimensions, None for no number."""
    variables = {str(n): v for n, v in dataset.data_vars.items() if v.dtype.kind in "fiu" and v.dims}
    used = dict.fromkeys(str(d) for v in variables.values() for d in v.dims)
    return {
        "dims": {d: _dimension(dataset, d) for d in used},
        "case_dims": [str(d) for d in dataset.case_status.dims],
        "variables": {n: _variable(v) for n, v in variables.items()},
    }


def _dimension(dataset: xr.Dataset, name: str) -> dict[str, Any]:
    values = dataset[name].values if name in dataset.coords else np.arange(dataset.sizes[name])
    numeric = values.dtype.kind in "fiu"
    return {
        "symbol": SYMBOLS.get(name, name),
        "long_name": dataset[name].attrs.get("long_name", name) if name in dataset.coords else name,
        "units": dataset[name].attrs.get("units", "") if name in dataset.coords else "",
        "numeric": numeric,
        "values": [rounded(v) for v in values.tolist()] if numeric else [str(v) for v in values],
    }


def _variable(variable: xr.DataArray) -> dict[str, Any]:
    return {
        "long_name": variable.attrs.get("long_name", str(variable.name)),
        "units": variable.attrs.get("units", ""),
        "dims": [str(d) for d in variable.dims],
        "values": [rounded(v) for v in variable.values.ravel().tolist()],
    }


def rounded(value: float) -> float | None:
    """A number with six significant digits, None for none."""
    return float(f"{value:.{_DIGITS}g}") if np.isfinite(value) else None
