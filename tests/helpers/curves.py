"""Histories of cases whose curves are known."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from limo.engines.calculix.deck import actuation_pressure_at, stage_times
from limo.solve.harvest import _history

# synthetic curves: V_v = V_0 - 2 P_a, V_a = V_1 + 1.5 P_a in ml and kPa
STROKE, FILLING = 2.0, 1.5


def history_of(case, until=None, count=241):
    """The history of a case with those curves, up to ``until`` (kPa), through all three stages."""
    times = stage_times(case.numerics, case.actuation_pressure_max)
    until = case.actuation_pressure_max if until is None else until
    pressure = np.linspace(0.0, until, count)
    ramp = times[2].start + pressure[1:] / case.actuation_pressure_max * times[2].duration
    clock = np.concatenate([np.linspace(0.1, 1.0, 5) * times[0].end, np.linspace(times[0].end, times[1].end, 6)[1:], ramp])
    level = np.concatenate([np.zeros(10), pressure[1:]])
    ventricle, actuation = 4e5 - STROKE * 1e3 * level, 2e3 + FILLING * 1e3 * level
    ventricle[:9] = 3e5  # the state before rest must not matter
    return _history(path_at(case, clock), np.column_stack([ventricle, actuation] * 3))


def path_at(case, clock):
    """What a history needs of CalculiX's path: stage and pressure at times of its clock."""
    times = stage_times(case.numerics, case.actuation_pressure_max)
    stage = np.searchsorted([t.end * (1 + 1e-9) for t in times[:-1]], clock)
    return SimpleNamespace(stage=stage, clock=clock, pressure=actuation_pressure_at(times, case.actuation_pressure_max, clock))
