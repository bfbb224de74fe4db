"""A model without a ramp in CalculiX: one implicit dynamic step, overdamped.

The pressure goes through its levels over ``rise`` and rests over ``hold``. A static step would start almost without stiffness
out of plane.
"""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from limo.engines.calculix.deck import constraints, fabric, geometry, number, pressure_label, step
from limo.engines.calculix.run import JOB, load_path, results, run
from limo.engines.load_path import LoadPath, count_stages
from limo.mechanics.model import KPA, Model
from limo.schema.accuracy import AirbagNumerics
from limo.schema.section import STAGES
from limo.schema.solver import Solver

HHT_ALPHA = -1 / 3
_POINTS_A_LINE = 4  # of an amplitude


def inflate(model: Model, levels: Sequence[float], folder: Path, solver: Solver, command: Path) -> LoadPath:
    """Run a model in ``folder``; the path reads displacements from the solver's results until it is closed."""
    write_deck(model, levels, folder / f"{JOB}.inp")
    with contextlib.ExitStack() as stack:
        ended = run(folder, command, solver, end_time(model.numerics))
        outcome, frd, usable = stack.enter_context(results(folder, ended))
        return load_path(
            outcome,
            frd,
            usable,
            model,
            command,
            stage=np.zeros(len(usable), int),
            pressure=np.zeros(len(usable)),
            ended_in=STAGES[0],
            iterations=count_stages() | {STAGES[0]: outcome.iterations},
            close=stack.pop_all().close,
        )


def end_time(numerics: AirbagNumerics) -> float:
    """Length of the step in s."""
    return numerics.rise + numerics.hold


def damping(model: Model) -> float:
    """alpha in 1/s at which the viscous pressure m alpha v, m mass per area, is ``damping_share`` p for v = length / 2 / rise."""
    numerics, mass = model.numerics, model.fabric.areal_density * 1e-12
    return numerics.damping_share * model.loading.ventricular_pressure * KPA / (mass * model.length / 2 / numerics.rise)


def write_deck(model: Model, levels: Sequence[float], path: Path) -> None:
    """Write the CalculiX input of a model whose one pressure acts on all of it and goes to ``levels`` of P_v in turn."""
    numerics = model.numerics
    first, smallest, largest = (
        numerics.rise * share for share in (numerics.first_increment, numerics.smallest_increment, numerics.largest_increment)
    )
    (load,) = model.pressures
    full = number(model.loading.ventricular_pressure * KPA)
    pushed = ["*DLOAD, AMPLITUDE=PATH", f"DEVICE, {pressure_label(model, load)}, {full}"]
    lines = [
        f"** {model.name}",
        "** mm, N, MPa, tonne, s",
        *geometry(model),
        *fabric(model, "DEVICE", model.fabric, 1.0, damping(model)),
        *constraints(model),
        *_amplitude(numerics, levels),
        *step(model, HHT_ALPHA, (first, end_time(numerics), smallest, largest), numerics.controls, pushed),
    ]
    path.write_text("\n".join(lines) + "\n", encoding="ascii")


def _amplitude(numerics: AirbagNumerics, levels: Sequence[float]) -> list[str]:
    """Pressure over P_v: from zero to each level in parts of equal time, then the last one."""
    times = np.linspace(0.0, numerics.rise, len(levels) + 1)
    points = [f"{number(t)}, {number(level)}" for t, level in zip(times, (0.0, *levels), strict=True)]
    points.append(f"{number(end_time(numerics))}, {number(levels[-1])}")
    rows = [", ".join(points[k : k + _POINTS_A_LINE]) for k in range(0, len(points), _POINTS_A_LINE)]
    return ["*AMPLITUDE, NAME=PATH", *rows]
