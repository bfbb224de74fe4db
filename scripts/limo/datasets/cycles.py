"""The cycles of a study: curves and energies of all legs of its cases, and what these leave behind."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import xarray as xr

from limo.cases.case import Case
from limo.cases.grid import GridPoint
from limo.datasets.gather import GridArrays, members
from limo.measure.cycles import (
    arrived,
    closed_cycles,
    cycles_of_syringe,
    distance,
    leg_curves,
    leg_energies,
    legs_of,
    syringe_curves,
)
from limo.store.files import UNREADABLE

#: of a leg, over P_a or not: units and meaning; leg 0 is the ramp
OF_LEGS = {
    "leg_ventricle_volume": (True, "ml", "ventricle volume along a leg of the cycle, V_v"),
    "leg_actuation_volume": (True, "ml", "total pouch volume along a leg of the cycle, V_a"),
    "leg_actuation_pressure": (False, "kPa", "actuation pressure at the end of a leg, P_a"),
    "leg_ventricular_pressure": (False, "kPa", "ventricular pressure at the end of a leg, P_v"),
    "leg_actuation_work": (False, "mJ", "work of P_a along a leg"),
    "leg_ventricular_work": (False, "mJ", "work of P_v along a leg"),
    "leg_dissipated": (False, "mJ", "work along a leg that is not stored: what snaps take"),
}
#: of a leg that a syringe drives, over V_a
OF_SYRINGES = {
    "leg_pressure_of_volume": ("kPa", "actuation pressure at a given total pouch volume, P_a"),
    "leg_ventricle_of_volume": ("ml", "ventricle volume at a given total pouch volume, V_v"),
}
#: ml between the volumes of their curves
VOLUME_STEP = 0.5
#: of a case
OF_CYCLES = {
    "hysteresis_actuation": ("mJ", "area of the loop of V_a over P_a of the first closed cycle"),
    "hysteresis_ventricle": ("mJ", "work of P_v over the first closed cycle"),
    "hysteresis_dissipated": ("mJ", "energy that the first closed cycle takes"),
    "residual_ventricle_volume": ("ml", "V_v after the first closed cycle less that before"),
    "residual_actuation_volume": ("ml", "V_a after the first closed cycle less that before"),
    "second_cycle_difference": ("1", "relative L2 distance of V_v over the second closed cycle to the first"),
}


def gather_cycles(
    cases: Mapping[GridPoint, Case], axes: Mapping[str, tuple], case_folder: Path, sources: Sequence[str], pressures: np.ndarray
) -> xr.Dataset:
    """Legs and cycles of cases over ``pressures`` (n,) in kPa; NaN for what a case did not come to."""
    count = 1 + max(len(case.cycle) + len(case.syringe) for case in cases.values())
    volumes = np.arange(0.0, max((v or 0.0 for c in cases.values() for v in c.syringe), default=-1.0) + VOLUME_STEP, VOLUME_STEP)
    arrays = GridArrays(axes)
    for name, (is_curve, units, long_name) in OF_LEGS.items():
        arrays.add(name, np.nan, long_name, units, {"leg": count} | ({"actuation_pressure": len(pressures)} if is_curve else {}))
    for name, (units, long_name) in OF_SYRINGES.items() if len(volumes) else ():
        arrays.add(name, np.nan, long_name, units, {"leg": count, "given_volume": len(volumes)})
    for name, (units, long_name) in OF_CYCLES.items():
        arrays.add(name, np.nan, long_name, units)
    for member in members(cases, arrays.axes, case_folder, sources):
        try:
            with xr.open_dataset(member.files.volumes) as history:
                found = cycle_of(history.load(), member.case, pressures, volumes)
        except UNREADABLE:
            continue
        for name, value in found.items():
            if name in OF_LEGS or name in OF_SYRINGES:
                arrays[name][member.index][: len(value)] = value
            else:
                arrays[name][member.index] = value
    legs = ("leg", np.arange(count), {"long_name": "leg of the cycle, 0 for the ramp"})
    given = ("given_volume", volumes, {"units": "ml", "long_name": "total pouch volume that a syringe gives"})
    return arrays.dataset({"actuation_pressure": pressures, "leg": legs} | ({"given_volume": given} if len(volumes) else {}))


def cycle_of(history: xr.Dataset, case: Case, pressures: np.ndarray, volumes: np.ndarray) -> dict[str, np.ndarray | float]:
    """What is gathered of one case: of legs (k, ...) as far as it came, and of its first closed cycles."""
    if "leg" not in history:
        history = history.assign(leg=("increment", np.zeros(history.sizes["increment"], int)))
    legs = legs_of(history)
    if not legs:
        return {}
    curves = [leg_curves(leg, pressures) for leg in legs]
    energies = np.array([leg_energies(leg, case.ventricular_pressure) for leg in legs])
    ends = np.array([_end(leg, case.ventricular_pressure) for leg in legs])
    found: dict[str, np.ndarray | float] = {
        "leg_ventricle_volume": np.array([ventricle for ventricle, _ in curves]),
        "leg_actuation_volume": np.array([actuation for _, actuation in curves]),
        "leg_ventricular_pressure": ends[:, 0],
        "leg_actuation_pressure": ends[:, 1],
        "leg_actuation_work": energies[:, 0],
        "leg_ventricular_work": energies[:, 1],
        "leg_dissipated": energies[:, 2],
    }
    if case.syringe:
        driven = [syringe_curves(leg, volumes) for leg in legs[1:]]
        of_ramp = np.full(len(volumes), np.nan)
        for k, name in enumerate(OF_SYRINGES):
            found[name] = np.array([of_ramp, *(both[k] for both in driven)])
        rest = float(legs[0].actuation_volume_conjugate[0])
        ends = [float(leg.actuation_volume_conjugate[-1]) for leg in legs[1:]]
        there = [arrived(end, point, rest) for end, point in zip(ends, case.syringe, strict=False)]
        closed = cycles_of_syringe(case.syringe[: sum(there)])  # a path ends at the first point that it misses
    else:
        closed = closed_cycles([(case.ventricular_pressure, 0.0), *map(tuple, ends)])
    if not closed:
        return found
    first, last = closed[0]
    work = energies[first : last + 1].sum(axis=0)
    found |= dict(zip(("hysteresis_actuation", "hysteresis_ventricle", "hysteresis_dissipated"), map(float, work), strict=True))
    for name in ("ventricle", "actuation"):
        values = [leg[f"{name}_volume"].values for leg in (legs[first], legs[last])]
        found[f"residual_{name}_volume"] = float(values[1][-1] - values[0][0])
    if len(closed) > 1 and closed[1][1] - closed[1][0] == last - first:
        again = slice(closed[1][0], closed[1][1] + 1)
        ventricle = found["leg_ventricle_of_volume" if case.syringe else "leg_ventricle_volume"]
        found["second_cycle_difference"] = distance(ventricle[again].ravel(), ventricle[first : last + 1].ravel())
    return found


def _end(leg: xr.Dataset, ventricular_pressure: float) -> tuple[float, float]:
    p_v = float(leg.ventricular_pressure[-1]) if "ventricular_pressure" in leg else ventricular_pressure
    return p_v, float(leg.actuation_pressure[-1])
