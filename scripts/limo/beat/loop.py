"""A closed loop of one device or two: pressures of ventricles, pouches, arteries and veins over time.

Volumes of a device follow both of its pressures, (V_v, V_a) = F(P_v, P_a), on the sheet that it is on. With flows Q in ml/s,
air n (in ml at one atmosphere, isothermal), the atmosphere P_0 and the dead volume V_d,

    dV_v/dt = Q_in - Q_out
    P_0 dn/dt = d/dt [(P_a + P_0)(V_a + V_d)] = P_0 (P_source - P_a) / R_line
    C_art dP_art/dt = Q_out - (P_art - P_ven) / R_p
    C_ven dP_ven/dt = (P_art - P_ven) / R_p - Q_in

Q_in = max(0, P_ven - P_v) / R_in and Q_out = max(0, P_v - P_art) / R_out: valves are diodes. The first two are linear in dP_v/dt
and dP_a/dt with the gradient of F. Pressures in kPa above the atmosphere, volumes in ml, times in s.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from limo.beat.surface import Surface
from limo.schema.beat import Beat, Circuit, Driver

ATMOSPHERE = 101.325  # kPa
#: s, of the fourth-order Runge-Kutta steps
STEP = 2e-4
#: rows of a trace of a device: what ``run`` records at every time
TRACE = ("ventricular_pressure", "actuation_pressure", "ventricle_volume", "actuation_volume", "inflow", "outflow", "air_inflow")
#: why a run stopped
OUTSIDE = ("", "P_v below", "P_v above", "P_a below", "P_a above")


@dataclass(frozen=True)
class System:
    """Numbers of a loop of D devices for ``run``: table of a surface, its grid, circuits (D, 5), drivers (D, 6)."""

    table: np.ndarray
    joined: np.ndarray
    grid: np.ndarray
    circuits: np.ndarray
    drivers: np.ndarray
    start: np.ndarray

    @property
    def period(self) -> float:
        """Of a beat, in s."""
        return 60.0 / float(self.drivers[0, 4])


def system_of(surface: Surface, beat: Beat) -> System:
    """The loop of a surface, as left device or as both, in a circulation."""
    circuits = [beat.systemic] + ([beat.pulmonary] if beat.pulmonary else [])
    drivers = [beat.driver] + ([beat.right_driver or beat.driver] if beat.pulmonary else [])
    p_v, p_a = surface.places
    grid = np.array([p_v[0], p_v[1] - p_v[0], p_a[0], p_a[1] - p_a[0]])
    count = len(circuits)
    before = [circuits[k - 1] for k in range(count)]
    start = np.concatenate(
        [
            [max(p_v[0], min(each.venous_pressure, p_v[-1])) for each in before],
            [max(0.0, drivers[k].vent_pressure) for k in range(count)],
            [each.arterial_pressure for each in circuits],
            [each.venous_pressure for each in circuits],
        ]
    )
    return System(
        np.ascontiguousarray(surface.table),
        np.ascontiguousarray(surface.joined),
        grid,
        np.array([_circuit(each) for each in circuits]),
        np.array([_driver(each) for each in drivers]),
        start,
    )


def _circuit(circuit: Circuit) -> tuple[float, ...]:
    return (
        circuit.outlet_resistance,
        circuit.inlet_resistance,
        circuit.peripheral_resistance,
        circuit.arterial_compliance,
        circuit.venous_compliance,
    )


def _driver(driver: Driver) -> tuple[float, ...]:
    return driver.source_pressure, driver.vent_pressure, driver.line_resistance, driver.dead_volume, driver.rate, driver.duty


@njit(cache=True)
def volumes_at(table: np.ndarray, grid: np.ndarray, sheet: int, p_v: float, p_a: float, out: np.ndarray) -> int:
    """V_v, its slopes over P_v and P_a, and the same of V_a into ``out`` (6,); returns where the pressures lie (``OUTSIDE``)."""
    rows, columns = table.shape[2], table.shape[3]
    x, y = (p_v - grid[0]) / grid[1], (p_a - grid[2]) / grid[3]
    outside = 0
    if x < 0.0:
        outside = 1
    elif x > rows - 1:
        outside = 2
    if y < -3.0:  # a vented pouch swings about zero by some 1 kPa; there the first cell goes on
        outside = 3
    elif y > columns - 1:
        outside = 4
    i, j = min(max(int(x), 0), rows - 2), min(max(int(y), 0), columns - 2)
    u, w = x - i, y - j
    for v in range(2):
        a, b = table[sheet, v, i, j], table[sheet, v, i + 1, j]
        c, d = table[sheet, v, i, j + 1], table[sheet, v, i + 1, j + 1]
        out[3 * v] = (1 - u) * ((1 - w) * a + w * c) + u * ((1 - w) * b + w * d)
        out[3 * v + 1] = ((1 - w) * (b - a) + w * (d - c)) / grid[1]
        out[3 * v + 2] = ((1 - u) * (c - a) + u * (d - b)) / grid[3]
    return outside


@njit(cache=True)
def _rates(y, table, grid, sheets, circuits, drivers, sources, out, flows) -> int:
    """dy/dt of pressures y (4 D,) into ``out``, and Q_in, Q_out, air of each device into ``flows`` (D, 3)."""
    count, found = len(circuits), np.empty(6)
    outside = 0
    for k in range(count):
        before = k - 1 if k else count - 1
        p_v, p_a, p_art, p_ven = y[k], y[count + k], y[2 * count + k], y[3 * count + before]
        inlet, outlet = circuits[before, 1], circuits[k, 0]
        q_in, q_out = max(0.0, p_ven - p_v) / inlet, max(0.0, p_v - p_art) / outlet
        air = (sources[k] - p_a) / drivers[k, 2]
        where = volumes_at(table, grid, sheets[k], p_v, p_a, found)
        if where:
            outside = where
        absolute = p_a + ATMOSPHERE
        a11, a12 = max(found[1], 1e-3), found[2]
        a21, a22 = absolute * found[4], found[3] + drivers[k, 3] + absolute * max(found[5], 0.0)
        r1, r2 = q_in - q_out, ATMOSPHERE * air
        determinant = a11 * a22 - a12 * a21
        out[k] = (r1 * a22 - a12 * r2) / determinant
        out[count + k] = (a11 * r2 - a21 * r1) / determinant
        flows[k, 0], flows[k, 1], flows[k, 2] = q_in, q_out, air
    for k in range(count):
        after = k + 1 if k + 1 < count else 0
        peripheral = (y[2 * count + k] - y[3 * count + k]) / circuits[k, 2]
        out[2 * count + k] = (flows[k, 1] - peripheral) / circuits[k, 3]
        out[3 * count + k] = (peripheral - flows[after, 0]) / circuits[k, 4]
    return outside


@njit(cache=True)
def run(y, sheets, table, joined, grid, circuits, drivers, steps: int, step: float, every: int, trace, vessels) -> tuple:
    """One beat of ``steps`` steps of s from ``y`` (4 D,), which is moved on, as are the sheets (D,) that the devices are on.

    ``trace`` (D, 7, r) takes ``TRACE`` of every ``every``-th step, ``vessels`` (2 D, r) the pressures of arteries and veins.
    Returns where a device left its surface (``OUTSIDE``), which one, and the pressure there; 0 where none did.
    """
    count = len(circuits)
    k1, k2, k3, k4 = np.empty_like(y), np.empty_like(y), np.empty_like(y), np.empty_like(y)
    sources, flows, found = np.empty(count), np.empty((count, 3)), np.empty(6)
    period = 60.0 / drivers[0, 4]
    for n in range(steps):
        t = n * step
        for k in range(count):
            sources[k] = drivers[k, 0] if t < drivers[k, 5] * period else drivers[k, 1]
        _rates(y, table, grid, sheets, circuits, drivers, sources, k1, flows)
        if n % every == 0:
            r = n // every
            for k in range(count):
                volumes_at(table, grid, sheets[k], y[k], y[count + k], found)
                trace[k, 0, r], trace[k, 1, r], trace[k, 2, r], trace[k, 3, r] = y[k], y[count + k], found[0], found[3]
                trace[k, 4, r], trace[k, 5, r], trace[k, 6, r] = flows[k, 0], flows[k, 1], flows[k, 2]
                vessels[k, r], vessels[count + k, r] = y[2 * count + k], y[3 * count + k]
        _rates(y + 0.5 * step * k1, table, grid, sheets, circuits, drivers, sources, k2, flows)
        _rates(y + 0.5 * step * k2, table, grid, sheets, circuits, drivers, sources, k3, flows)
        _rates(y + step * k3, table, grid, sheets, circuits, drivers, sources, k4, flows)
        y += step / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        for k in range(count):
            where = volumes_at(table, grid, sheets[k], y[k], y[count + k], found)
            if where:
                return where, k, y[k] if where < 3 else y[count + k]
            row = min(max(int((y[k] - grid[0]) / grid[1]), 0), joined.shape[1] - 2)
            if sheets[k] == 0 and y[count + k] >= max(joined[1, row], joined[1, row + 1]):
                sheets[k] = 1
            elif sheets[k] == 1 and y[count + k] <= min(joined[0, row], joined[0, row + 1]):
                sheets[k] = 0
    return 0, 0, 0.0
