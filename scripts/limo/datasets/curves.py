"""Curves of a case over one grid of pressures, with what follows from them; the last value of a curve."""

from __future__ import annotations

import json

import numpy as np
import xarray as xr

from limo.config.project import same_content
from limo.datasets.variables import CURVE_DIMS, VARIABLES
from limo.measure.efficiency import efficiency_at_stroke, io_ratio, io_ratio_of_change
from limo.measure.ramp import ramp_of
from limo.store.statuses import MISSING

STROKE_FOR_EFFICIENCY = 90.0  # ml, physiological stroke volume (paper, Afterload sensitivity)


def curves(
    history: xr.Dataset, ventricular_pressure: float, pressures: np.ndarray, maximum: float = np.inf
) -> dict[str, np.ndarray]:
    """A case's curves at ``pressures`` (n,) in kPa, NaN beyond what it reached, and its values at a stroke of 90 ml.

    What lies beyond ``maximum`` (kPa) does not count: the case may have gone further for another study. Raises nothing for
    a case without a ramp: everything is NaN then.
    """
    ramp = ramp_of(history)
    result = {n: np.full(len(pressures), np.nan) for n, v in VARIABLES.items() if v.dims == CURVE_DIMS}
    result |= {"efficiency_90ml": np.nan, "pressure_90ml": np.nan}
    if not ramp.sizes["increment"]:
        return result
    pressure = ramp.actuation_pressure.values
    ventricle, actuation = ramp.ventricle_volume.values, ramp.actuation_volume.values
    energy = ramp.potential_energy.values if "potential_energy" in ramp else np.full(len(pressure), np.nan)
    if pressure[-1] > maximum:
        ends = np.append(pressure[pressure < maximum], maximum)
        ventricle, actuation, energy = (np.interp(ends, pressure, values) for values in (ventricle, actuation, energy))
        pressure = ends
    stroke, change = ventricle[0] - ventricle, actuation - actuation[0]
    known = {
        "ventricle_volume": ventricle,
        "actuation_volume": actuation,
        "stroke_volume": stroke,
        "actuation_volume_change": change,
        "potential_energy": energy,
    }
    # the solver's clock is rounded: an end a hair short of a wanted pressure is that pressure
    pressures = np.where(np.isclose(pressures, pressure[-1], rtol=1e-6, atol=1e-6), pressure[-1], pressures)
    for name, values in known.items():
        result[name] = np.interp(pressures, pressure, values, right=np.nan)
    result["io_ratio"] = io_ratio(result["stroke_volume"], result["actuation_volume"])
    result["io_ratio_of_change"] = io_ratio_of_change(result["stroke_volume"], result["actuation_volume_change"])
    eta, reached = efficiency_at_stroke(pressure, ventricular_pressure, stroke, change, STROKE_FOR_EFFICIENCY)
    return result | {"efficiency_90ml": eta, "pressure_90ml": reached}


def efficiency_reason(case_status: str, stroke: np.ndarray) -> str:
    """Why there is no efficiency at 90 ml, or "", also where no ramp of P_a was asked for."""
    if not np.isfinite(stroke).any():
        return f"no ramp ({case_status})"
    if len(stroke) > 1 and np.nanmax(stroke) < STROKE_FOR_EFFICIENCY:
        return f"largest stroke {np.nanmax(stroke):.1f} ml"
    return ""


def at_end(curve: xr.DataArray) -> xr.DataArray:
    """The last value that each case has of a curve (..., actuation_pressure), its dimension dropped; NaN where there is none."""
    last = curve.notnull().cumsum("actuation_pressure").argmax("actuation_pressure")
    return curve.isel(actuation_pressure=last)


def absent(dataset: xr.Dataset) -> xr.DataArray:
    """Which cases of a study's dataset are not solved, or not measured where the study wants that."""
    solved = dataset.case_status != MISSING
    return ~solved if "measure_status" not in dataset else ~solved | (dataset.measure_status == MISSING)


def completed(dataset: xr.Dataset, earlier: xr.Dataset) -> xr.Dataset:
    """A study's dataset in which the cases that are absent are those of an earlier one, where it has them.

    Raises ``ValueError`` where that has another configuration: its cases are others then.
    """
    if not same_content(*(json.loads(each.attrs["config"]) for each in (dataset, earlier))):
        raise ValueError("gathered with another configuration")
    taken = absent(dataset) & ~absent(earlier)
    filled = {
        name: earlier[name].where(taken, values).assign_attrs(values.attrs)
        for name, values in dataset.data_vars.items()
        if name in earlier and set(taken.dims) <= set(values.dims)
    }
    return dataset.assign(filled)
