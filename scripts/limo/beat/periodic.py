"""The periodic state of a beating heart, and what it does: flows, pressures, work, air.

Of the last beat, with the period T, of each device:

    SV = int Q_out dt,  CO = SV / T,  EF = SV / max V_v
    W_v = oint P_v dV_v (into the blood),  W_a = oint P_a dV_a (into the pouches)
    n = int max(0, dn/dt) dt,  W_s = P_0 n ln((P_source + P_0) / P_0): air of a beat, and what an ideal compressor needs for it
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr

from limo.beat.loop import ATMOSPHERE, OUTSIDE, STEP, TRACE, run, system_of
from limo.beat.surface import Surface
from limo.schema.beat import Beat

SIDES = ("left", "right")
#: relative change of stroke volume and of arterial pressure from beat to beat below which no further beat is needed
SETTLED = 1e-4
#: the same below which a heart beats periodically; where its sheets change, beats may differ by as much for ever
PERIODIC = 5e-3
MOST_BEATS = 100
#: ml that a beat must eject to count as one
LEAST_STROKE = 1.0
#: steps of the integration in a step of what is told
EVERY = 5
MMHG = 0.13332239  # kPa

PERIODIC_STATE, OUT_OF_SURFACE, NOT_PERIODIC, NO_OUTPUT = ("periodic", "outside_surface", "not_periodic", "no_output")
#: numbers of a device over a beat: units and meaning
NUMBERS = {
    "stroke_volume": ("ml", "volume that a beat ejects"),
    "cardiac_output": ("l/min", "volume that is ejected in a minute"),
    "ejection_fraction": ("1", "stroke volume over the largest ventricle volume"),
    "arterial_systolic": ("kPa", "largest arterial pressure"),
    "arterial_diastolic": ("kPa", "smallest arterial pressure"),
    "arterial_mean": ("kPa", "arterial pressure over a beat"),
    "venous_mean": ("kPa", "pressure before the inlet valve over a beat"),
    "ventricular_peak": ("kPa", "largest ventricular pressure"),
    "actuation_peak": ("kPa", "largest actuation pressure"),
    "blood_work": ("mJ", "work on the blood over a beat"),
    "pouch_work": ("mJ", "work of the air on the pouches over a beat"),
    "air": ("ml", "air of a beat, at one atmosphere"),
    "source_work": ("mJ", "isothermal work that the air of a beat takes from the source"),
    "power": ("W", "source work over time"),
    "pouch_efficiency": ("1", "work on the blood over that on the pouches"),
    "source_efficiency": ("1", "work on the blood over that of the source"),
}


@dataclass(frozen=True)
class Beating:
    """The last beat of a heart: ``time`` (r,) in s, ``traces`` (D, 7, r) of ``TRACE``, ``vessels`` (2 D, r) in kPa.

    ``drift``: relative change from the beat before. ``status`` is ``periodic`` where all of it can be believed; ``reason`` says
    why not.
    """

    status: str
    reason: str
    beats: int
    drift: float
    time: np.ndarray
    traces: np.ndarray
    vessels: np.ndarray
    numbers: dict[str, np.ndarray]

    def dataset(self) -> xr.Dataset:
        """Traces and numbers with units."""
        sides = list(SIDES[: len(self.traces)])
        units = {name: "kPa" if name.endswith("pressure") else "ml" if name.endswith("volume") else "ml/s" for name in TRACE}
        values = {n: (("side", "time"), self.traces[:, k], {"units": units[n]}) for k, n in enumerate(TRACE)}
        count = len(sides)
        for k, name in enumerate(("arterial_pressure", "venous_pressure")):
            values[name] = ("side", "time"), self.vessels[k * count : (k + 1) * count], {"units": "kPa"}
        for name, each in self.numbers.items():
            values[name] = "side", each, {"units": NUMBERS[name][0], "long_name": NUMBERS[name][1]}
        attributes = {"status": self.status, "reason": self.reason, "beats": self.beats, "drift": self.drift}
        return xr.Dataset(values, {"side": sides, "time": ("time", self.time, {"units": "s"})}, attributes)


def beating(surface: Surface, beat: Beat, most_beats: int = MOST_BEATS) -> Beating:
    """Beat until stroke volume and arterial pressure repeat, ``most_beats`` times at most."""
    system = system_of(surface, beat)
    count, steps = len(system.circuits), round(system.period / STEP / EVERY) * EVERY
    step, rows = system.period / steps, steps // EVERY
    traces, vessels = np.zeros((count, len(TRACE), rows)), np.zeros((2 * count, rows))
    state, sheets = system.start.copy(), np.zeros(count, np.int64)
    fixed = (system.table, system.joined, system.grid, system.circuits, system.drivers, steps, step, EVERY, traces, vessels)
    time, before, drift = EVERY * step * np.arange(rows), None, np.inf
    done = 0
    for done in range(1, most_beats + 1):
        where, which, pressure = run(state, sheets, *fixed)
        if where:
            ends = surface.places[0 if where < 3 else 1]
            reason = (
                f"{OUTSIDE[where]} the surface in beat {done}: the {SIDES[which]} device came to {pressure:.2f} kPa, the surface "
                f"covers {ends[0]:g} to {ends[-1]:g} kPa; extend the study that it is from"
            )
            empty = {name: np.full(count, np.nan) for name in NUMBERS}
            return Beating(OUT_OF_SURFACE, reason, done, drift, time, traces, vessels, empty)
        now = np.concatenate([traces[:, TRACE.index("outflow")].mean(axis=1), vessels[:count].mean(axis=1)])
        if before is not None:
            drift = float(np.max(np.abs(now - before) / np.maximum(np.abs(now), 1e-6)))
            if drift < SETTLED:
                break
        before = now
    numbers = _numbers(traces, vessels, time, system.period, system.drivers)
    status, reason = PERIODIC_STATE, ""
    if drift >= PERIODIC:
        status, reason = NOT_PERIODIC, f"after {done} beats the heart still changes by {100 * drift:.2g} % from beat to beat"
    elif (numbers["stroke_volume"] < LEAST_STROKE).any():
        side = SIDES[int(np.argmin(numbers["stroke_volume"]))]
        peak, artery = (float(numbers[n].min()) for n in ("ventricular_peak", "arterial_mean"))
        status = NO_OUTPUT
        reason = f"the driver of the {side} device cannot deliver: P_v comes to {peak:.3g} kPa, arteries are at {artery:.3g} kPa"
    return Beating(status, reason, done, drift, time, traces, vessels, numbers)


def _numbers(traces, vessels, time: np.ndarray, period: float, drivers: np.ndarray) -> dict[str, np.ndarray]:
    p_v, p_a, v_v, v_a, _, outflow, air = np.swapaxes(traces, 0, 1)
    count, share = len(traces), period / len(time)
    arteries, veins = vessels[:count], vessels[count:]
    stroke, used = outflow.sum(axis=1) * share, np.maximum(air, 0.0).sum(axis=1) * share
    source = ATMOSPHERE * used * np.log((drivers[:, 0] + ATMOSPHERE) / ATMOSPHERE)
    blood, pouch = -_loop(p_v, v_v), _loop(p_a, v_a)
    with np.errstate(divide="ignore", invalid="ignore"):
        return {
            "stroke_volume": stroke,
            "cardiac_output": 0.06 * stroke / period,
            "ejection_fraction": stroke / v_v.max(axis=1),
            "arterial_systolic": arteries.max(axis=1),
            "arterial_diastolic": arteries.min(axis=1),
            "arterial_mean": arteries.mean(axis=1),
            "venous_mean": np.roll(veins, 1, axis=0).mean(axis=1),
            "ventricular_peak": p_v.max(axis=1),
            "actuation_peak": p_a.max(axis=1),
            "blood_work": blood,
            "pouch_work": pouch,
            "air": used,
            "source_work": source,
            "power": 1e-3 * source / period,
            "pouch_efficiency": blood / pouch,
            "source_efficiency": blood / source,
        }


def _loop(pressure: np.ndarray, volume: np.ndarray) -> np.ndarray:
    """oint p dV (D,) of closed loops (D, r)."""
    closed = np.concatenate([volume, volume[:, :1]], axis=1), np.concatenate([pressure, pressure[:, :1]], axis=1)
    return np.trapezoid(closed[1], closed[0], axis=1)
