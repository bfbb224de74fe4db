"""Simulated against measured curves: relative L2 errors by N_p, and efficiencies side by side (paper, *Pressure-volume*).

Measured curves at their own numbers of pouches are interpolated linearly to the simulated ones, at equal P_a and P_v.
"""

from __future__ import annotations

import json
from dataclasses import dataclass

import numpy as np
import pandas as pd
import xarray as xr

from limo.bench import units
from limo.bench.curves import LOADING, SAME_PRESSURE, Curves, Expected, read_curves
from limo.cases.grid import GridPoint
from limo.config.project import Project
from limo.errors import ConfigError
from limo.schema.bench import MeasuredCurves

#: what is compared: units and meaning
QUANTITIES = {
    "io_ratio": ("1", "input-output ratio"),
    "stroke_volume": ("ml", "stroke volume"),
    "actuation_volume_change": ("ml", "pouch volume since P_a = 0"),
}
#: pressures that an error is taken over at least
_FEWEST = 3
#: highest pressures over P_a,max that are believed where a file names no unit, and the highest in kPa beyond P_a,max
_SHORT, _BEYOND, _HIGHEST = 0.2, 2.2, 140.0
#: volumes over the cube of a device's length that are believed where a file names no unit
_SMALLEST, _LARGEST = 0.002, 1.0


def expected_of(project: Project, name: str) -> Expected:
    """What a study leads to expect of measurements that are laid over it."""
    study = project.studies[name]
    pressures = study.axes.ventricular_pressure
    maxima = [study.maximum_for(p) for p in pressures]
    lengths = [setting.device.pattern.length for setting in project.settings(name).values()]
    return Expected(
        (max(min(pressures), _SHORT * min(maxima)), max(min(_BEYOND * max(maxima), _HIGHEST), 1.05 * max(maxima))),
        (_SMALLEST * min(lengths) ** 3 / 1000, _LARGEST * max(lengths) ** 3 / 1000),
        tuple(pressures),
        tuple(study.axes.n_pouches),
    )


def study_curves(project: Project, name: str, measured: MeasuredCurves | None = None) -> Curves | None:
    """The measured curves of a study, or others for it; None where it has none. Raises ``ConfigError``."""
    study = project.studies[name]
    measured = measured or study.measured_curves
    if measured is None:
        return None
    expected = expected_of(project, name)
    curves = read_curves(measured, expected)
    highest = max(study.maximum_for(p) for p in study.axes.ventricular_pressure)
    beyond = int((curves.table.actuation_pressure > highest + 1e-6).sum())
    if beyond:
        curves.understood.insert(-1, f"{beyond} of {len(curves.table)} points lie beyond the P_a,max of the study")
    own = curves.table.ventricular_pressure.dropna().unique()
    if len(own) and not any(abs(p - q) < SAME_PRESSURE for p in own for q in expected.ventricular_pressures):
        at = ", ".join(f"{p:g}" for p in expected.ventricular_pressures)
        value, text = (
            ", ".join(f"{p:g} kPa" for p in own),
            f"curves at a P_v of the study, {at} kPa; ventricular_pressure says at which",
        )
        example = f"ventricular_pressure: {expected.ventricular_pressures[0]:g}"
        for unit in ("mmHg", "cmH2O", "mbar"):
            scale = units.factor(unit, "pressure")
            if any(abs(scale * p - q) < SAME_PRESSURE for p in own for q in expected.ventricular_pressures):
                text, example = f"{text}; in {unit} they would be", f"units: {{ventricular_pressure: {unit}}}"
                break
        raise ConfigError(measured.data, "ventricular_pressure", value, text, example)
    return curves


# --------------------------------------------------------------------------------------------------------------------
# the curves at one N_p and P_v


@dataclass(frozen=True)
class _Reference:
    """The loading of all curves of one N_p and P_v (NaN: unknown), averaged at the pressures (n,) of a study."""

    n_pouches: float
    ventricular_pressure: float
    values: dict[str, np.ndarray]
    efficiency: float


def _references(curves: Curves, pressures: np.ndarray) -> list[_Reference]:
    table = curves.table
    found = []
    for (count, ventricular), rows in table.groupby(["n_pouches", "ventricular_pressure"], dropna=False, sort=True):
        values = {name: _mean_loading(rows, name, pressures) for name in QUANTITIES}
        efficiency = float(rows.groupby("label").efficiency.first().mean())
        found.append(_Reference(float(count), float(ventricular), values, efficiency))
    return found


def _mean_loading(rows: pd.DataFrame, name: str, pressures: np.ndarray) -> np.ndarray:
    """A quantity over P_a (n,), mean of the loading of all cycles and curves; NaN where none of them reaches."""
    each = []
    for _, branch in rows[rows.direction == LOADING].groupby(["label", "cycle"]):
        known = branch.dropna(subset=["actuation_pressure", name]).sort_values("actuation_pressure")
        if len(known) < 2:
            continue
        x, y = known.actuation_pressure.to_numpy(float), known[name].to_numpy(float)
        each.append(np.interp(pressures, x, y, left=np.nan, right=np.nan))
    if not each:
        return np.full(len(pressures), np.nan)
    stacked = np.array(each)
    count = np.isfinite(stacked).sum(0)
    return np.where(count > 0, np.nansum(stacked, 0) / np.maximum(count, 1), np.nan)


def _between(references: list[_Reference], count: int, name: str) -> tuple[np.ndarray, bool]:
    """A quantity over P_a at a number of pouches, from measured ones by a straight line in N_p, and whether beyond them.

    Beyond the measured numbers the line through the nearest two goes on. Raises ``LookupError`` where that is not possible.
    """
    known = {r.n_pouches: r for r in references if np.isfinite(r.values[name]).any() and np.isfinite(r.n_pouches)}
    if count in known:
        return known[count].values[name], False
    if len(known) < 2:
        if not known:
            raise LookupError("N_p of the measurement is unknown: n_pouches says it")
        raise LookupError(f"measured at N_p = {next(iter(known)):g} alone")
    numbers = np.array(sorted(known))
    at = int(np.clip(np.searchsorted(numbers, count), 1, len(numbers) - 1))
    low, high = numbers[at - 1], numbers[at]
    share = (count - low) / (high - low)
    return (1 - share) * known[low].values[name] + share * known[high].values[name], bool(
        count < numbers[0] or count > numbers[-1]
    )


def relative_l2(simulated: np.ndarray, measured: np.ndarray, pressures: np.ndarray) -> tuple[float, tuple[float, float]]:
    """||simulated - measured|| / ||measured|| over the pressures (n,) at which both are known, and the range of these.

    The norms are integrals over P_a by the trapezoidal rule: sqrt(int (s - m)^2 dP / int m^2 dP). NaN with fewer than three
    common pressures.
    """
    both = np.isfinite(simulated) & np.isfinite(measured)
    if both.sum() < _FEWEST:
        return float("nan"), (float("nan"), float("nan"))
    p, s, m = pressures[both], simulated[both], measured[both]
    total = float(np.trapezoid(m**2, p))
    error = float(np.sqrt(np.trapezoid((s - m) ** 2, p) / total)) if total > 0 else float("nan")
    return error, (float(p[0]), float(p[-1]))


# --------------------------------------------------------------------------------------------------------------------
# what a dataset keeps of it


def comparison(dataset: xr.Dataset, curves: Curves, measured: MeasuredCurves) -> xr.Dataset:
    """Measured curves at the N_p and P_v of a study's cases, the relative L2 errors of these, and measured efficiencies.

    ``dataset`` has the dimensions of cases and of curves that a study has. What was not measured is NaN, with the reason in
    ``measured_reason``.
    """
    dims = tuple(d for d in dataset.case_status.dims if d in GridPoint._fields)
    curve_dims = (*dims, "actuation_pressure")
    pressures = dataset.actuation_pressure.values
    references = _references(curves, pressures)
    shape = tuple(dataset.sizes[d] for d in dims)
    values = {name: np.full((*shape, len(pressures)), np.nan) for name in QUANTITIES}
    errors = {name: np.full(shape, np.nan) for name in QUANTITIES}
    ends = np.full((*shape, 2), np.nan)
    beyond, reasons = np.zeros(shape, np.int8), np.full(shape, "", object)
    for index in np.ndindex(*shape):
        case = dataset.isel(dict(zip(dims, index, strict=True)))
        own = [r for r in references if abs(r.ventricular_pressure - float(case.ventricular_pressure)) < SAME_PRESSURE]
        said = [] if own else [_no_reference(references, float(case.ventricular_pressure))]
        for name in QUANTITIES if own else ():
            try:
                values[name][index], extrapolated = _between(own, int(case.n_pouches), name)
            except LookupError as error:
                said.append(str(error) if curves.measured(name) else f"{name} not measured")
                continue
            errors[name][index], both = relative_l2(case[name].values, values[name][index], pressures)
            if np.isfinite(both).all():
                ends[index] = np.fmin(ends[index][0], both[0]), np.fmax(ends[index][1], both[1])
                beyond[index] |= extrapolated
            else:
                said.append(f"{name}: no common pressures")
        reasons[index] = "; ".join(dict.fromkeys(said))
    stored: dict[str, tuple] = {}
    for name, (unit, text) in QUANTITIES.items():
        stored[f"measured_{name}"] = (
            curve_dims,
            values[name],
            {"units": unit, "long_name": f"measured {text} at the case's N_p"},
        )
        long_name = f"relative L2 error of the {text} to the measured"
        stored[f"measured_error_{name}"] = (dims, errors[name], {"units": "1", "long_name": long_name})
    stored["measured_range"] = ((*dims, "end"), ends, {"units": "kPa", "long_name": "P_a that the errors are taken over"})
    stored["measured_beyond"] = (dims, beyond, {"long_name": "whether N_p is beyond the measured ones"})
    stored["measured_reason"] = (dims, reasons.astype(str), {"long_name": "why something is not compared"})
    known = [r for r in references if np.isfinite(r.n_pouches)]
    at = {
        "n_pouches": ("1", "number of pouches of a measured device"),
        "ventricular_pressure": ("kPa", "its ventricular pressure"),
    }
    for name, (unit, text) in at.items():
        values_at = np.array([getattr(r, name) for r in known], float)
        stored[f"measurement_{name}"] = ("measurement", values_at, {"units": unit, "long_name": text})
    efficiency = np.array([r.efficiency for r in known], float)
    long_name = "its efficiency at a stroke of 90 ml, stated or by its volumes"
    stored["measurement_efficiency_90ml"] = ("measurement", efficiency, {"units": "1", "long_name": long_name})
    described = json.dumps(measured.model_dump(mode="json", exclude_defaults=True), sort_keys=True)
    return xr.Dataset(stored, attrs={"measured": described, "measured_understood": "\n".join(curves.understood)})


def _no_reference(references: list[_Reference], pressure: float) -> str:
    if any(np.isnan(r.ventricular_pressure) for r in references):
        return "P_v of the measurement is unknown: ventricular_pressure says it"
    return f"not measured at P_v = {pressure:g} kPa"


def with_comparison(dataset: xr.Dataset, project: Project, name: str) -> xr.Dataset:
    """A study's dataset with the comparison to its measured curves; the same without any."""
    curves = study_curves(project, name)
    if curves is None:
        return dataset
    found = comparison(dataset, curves, project.studies[name].measured_curves)
    return dataset.merge(found).assign_attrs(found.attrs)
