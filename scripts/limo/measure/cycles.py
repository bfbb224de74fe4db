"""What a load cycle says: the curves of its legs, the energy that it takes, and what it leaves behind.

Legs are counted from the ramp, 0, to the points of the cycle, 1, 2, ... Along a leg

    W_a = int P_a dV_a,   W_v = int P_v dV_v,   D = W_a + W_v - Delta U

with the volumes that the pressures' work is conjugate to (``limo.mechanics.energy``). A quasi-static path takes energy where it
snaps; the loop that V_a makes over P_a has the area of W_a over a closed cycle. Pressures in kPa, volumes in ml, energies in mJ.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr

from limo.measure.frames import CaseFrames
from limo.measure.ramp import ramp_of
from limo.mechanics.energy import conjugate_volumes
from limo.mechanics.equilibrium import with_references
from limo.mechanics.model import Loading, Model

#: pressures (kPa) closer than this are the same
CLOSE = 1e-6
#: volumes (ml) and pressures (kPa) closer than this to the end of a leg are there
ARRIVED = 1e-2


def legs_of(history: xr.Dataset) -> list[xr.Dataset]:
    """The increments of each leg, from the last one of the leg before on; the ramp begins at rest. Empty without rest."""
    ramp = ramp_of(history)
    if not ramp.sizes["increment"]:
        return []
    legs, number = [ramp], history.leg.values
    for k in range(1, int(number.max(initial=0)) + 1):
        own = np.flatnonzero(number == k)
        if len(own):
            legs.append(history.isel(increment=np.append(own[0] - 1, own)))
    return legs


def leg_curves(leg: xr.Dataset, pressures: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """V_v and V_a (n,) in ml at P_a ``pressures`` (n,) of a leg; NaN beyond its P_a, or where that stays."""
    pressure = leg.actuation_pressure.values
    if abs(pressure[-1] - pressure[0]) < CLOSE:
        return np.full(len(pressures), np.nan), np.full(len(pressures), np.nan)
    order = slice(None) if pressure[-1] > pressure[0] else slice(None, None, -1)
    pressure = pressure[order]
    at = np.where(np.isclose(pressures, pressure[-1], atol=CLOSE), pressure[-1], pressures)
    ends = {"left": np.nan, "right": np.nan}
    return tuple(np.interp(at, pressure, leg[n].values[order], **ends) for n in ("ventricle_volume", "actuation_volume"))


def syringe_curves(leg: xr.Dataset, volumes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """P_a (kPa) and V_v (ml) (n,) at V_a ``volumes`` (n,) in ml along a leg that a syringe drives; NaN beyond its V_a."""
    held = leg.actuation_volume_conjugate.values
    order = slice(None) if held[-1] > held[0] else slice(None, None, -1)
    ends = {"left": np.nan, "right": np.nan}
    known = (leg[n].values[order] for n in ("actuation_pressure", "ventricle_volume"))
    return tuple(np.interp(volumes, held[order], values, **ends) for values in known)


def leg_energies(leg: xr.Dataset, ventricular_pressure: float) -> tuple[float, float, float]:
    """W_a, W_v and D (mJ) of a leg; ``ventricular_pressure`` where its increments do not say theirs."""
    p_a = leg.actuation_pressure.values
    p_v = leg.ventricular_pressure.values if "ventricular_pressure" in leg else np.full(len(p_a), ventricular_pressure)
    works = [
        float(np.trapezoid(p, leg[name].values))
        for p, name in ((p_a, "actuation_volume_conjugate"), (p_v, "ventricle_volume_conjugate"))
    ]
    stored = leg.strain_energy.values
    return works[0], works[1], sum(works) - float(stored[-1] - stored[0])


def arrived(volume: float, point: float | None, rest: float) -> bool:
    """Whether a syringe has come to a point, None for V_a at rest; volumes in ml, as P_a does work on them."""
    return abs(volume - (rest if point is None else point)) <= ARRIVED


def cycles_of(loading: Loading) -> list[tuple[int, int]]:
    """First and last leg of each stretch of the load that comes back to its first point."""
    if loading.syringe:
        return cycles_of_syringe(loading.syringe)
    ventricular = loading.ventricular_pressure
    return closed_cycles([(ventricular, 0.0), (ventricular, loading.actuation_pressure_max), *loading.cycle])


def cycles_of_syringe(points: Sequence[float | None]) -> list[tuple[int, int]]:
    """The same for points in ml to which a syringe goes from rest; leg 0, the ramp, has no length."""
    volumes = [(-1.0 if point is None else point, 0.0) for point in (None, *points)]
    return [(first + 1, last + 1) for first, last in closed_cycles(volumes)]


def states_of_last_cycle(model: Model, frames: CaseFrames) -> list[np.ndarray]:
    """Displacements (n, 3) in mm of the states kept along the last closed cycle, from its first point to its last.

    Empty where the load closes no cycle, or the case did not get to its end.
    """
    closed = cycles_of(model.loading)
    if not closed or not _is_whole(model, frames, closed[-1][1]):
        return []
    first, last = closed[-1]
    ramp = [frames.displacement[k] for k in np.argsort(frames.pressure)]
    of_legs = [ramp] + [list(frames.cycle_displacement[frames.cycle_leg == k]) for k in range(1, last + 1)]
    before = of_legs[first - 1][-1:] if first else []
    return before + [state for leg in of_legs[first:] for state in leg]


def _is_whole(model: Model, frames: CaseFrames, leg: int) -> bool:
    """Whether the last state that is kept of a leg lies at its end."""
    own, loading = np.flatnonzero(frames.cycle_leg == leg), model.loading
    if not len(own):
        return False
    if not loading.syringe:
        return bool(np.allclose(frames.cycle_pressures[own[-1]], loading.cycle[leg - 1], rtol=0.0, atol=ARRIVED))
    end, rest = (
        1e-3 * conjugate_volumes(model, with_references(model, displacement.astype(float)))[1]
        for displacement in (frames.cycle_displacement[own[-1]], frames.displacement[np.argmin(frames.pressure)])
    )
    return arrived(end, loading.syringe[leg - 1], rest)


def closed_cycles(points: list[tuple[float, float]]) -> list[tuple[int, int]]:
    """First and last leg of each stretch of a load that comes back to its first point, from points (P_v, P_a) of all legs' ends.

    ``points`` begins with the state at rest, which leg 0 leaves.
    """
    found, first = [], 0
    for k in range(1, len(points)):
        if k > first + 1 and np.allclose(points[k], points[first], atol=CLOSE):
            found.append((first, k - 1))
            first = k
    return found


def distance(curve: np.ndarray, other: np.ndarray) -> float:
    """Relative L2 distance of a curve (n,) to another one where both are known; NaN without such a place."""
    both = np.isfinite(curve) & np.isfinite(other)
    size = np.linalg.norm(other[both])
    return float(np.linalg.norm((curve - other)[both]) / size) if both.any() and size > 0 else float("nan")
