"""The CalculiX input file of an airbag: one implicit dynamic step, overdamped.

The pressure goes through its path over ``rise`` and rests over ``hold``. A static step would start almost without stiffness
out of plane.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from limo.airbag.model import AREAL_DENSITY, AirbagModel
from limo.engines.calculix.deck import constraints, fabric, geometry, number, pressure_label, step
from limo.mechanics.model import KPA
from limo.schema.accuracy import Airbag

HHT_ALPHA = -1 / 3
_POINTS_A_LINE = 4  # of an amplitude


def end_time(airbag: Airbag) -> float:
    """Length of the step in s."""
    return airbag.numerics.rise + airbag.numerics.hold


def damping(airbag: Airbag) -> float:
    """alpha in 1/s at which the viscous pressure m alpha v, m mass per area, is ``damping_share`` p for v = side / 2 / rise."""
    numerics, mass = airbag.numerics, AREAL_DENSITY * 1e-12
    return numerics.damping_share * airbag.pressure * KPA / (mass * airbag.side / 2 / numerics.rise)


def write_deck(model: AirbagModel, path: Path) -> None:
    """Write the CalculiX input of a run."""
    airbag, numerics = model.airbag, model.airbag.numerics
    first, smallest, largest = (
        numerics.rise * share for share in (numerics.first_increment, numerics.smallest_increment, numerics.largest_increment)
    )
    (load,) = model.pressures
    pushed = ["*DLOAD, AMPLITUDE=PATH", f"DEVICE, {pressure_label(model, load)}, {number(airbag.pressure * KPA)}"]
    lines = [
        f"** square airbag, {model.run.name}",
        "** mm, N, MPa, tonne, s",
        *geometry(model),
        *fabric(model, "DEVICE", 1.0, damping(airbag)),
        *constraints(model),
        *_amplitude(model),
        *step(model, HHT_ALPHA, (first, end_time(airbag), smallest, largest), numerics.controls, pushed),
    ]
    path.write_text("\n".join(lines) + "\n", encoding="ascii")


def _amplitude(model: AirbagModel) -> list[str]:
    """Pressure over p: the path in parts of equal time, then p."""
    levels = [0.0, *model.run.path, 1.0]
    times = np.linspace(0.0, model.airbag.numerics.rise, len(levels))
    points = [f"{number(t)}, {number(level)}" for t, level in zip(times, levels, strict=True)]
    points.append(f"{number(end_time(model.airbag))}, 1")
    rows = [", ".join(points[k : k + _POINTS_A_LINE]) for k in range(0, len(points), _POINTS_A_LINE)]
    return ["*AMPLITUDE, NAME=PATH", *rows]
