"""The CalculiX input file of a model: one small class per block of keywords.

The stages follow each other in one implicit dynamic step. CalculiX knows one damping for the whole run, so a stage with
less damping is run in proportionally longer time: quasi-statically only damping times rate matters (``StageTime``).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from limo.config import STAGES, Controls, Numerics, Stage
from limo.model import KPA, Model

BRICK_SIDE = {"bottom": "P1", "top": "P2"}


@dataclass(frozen=True)
class StageTime:
    """A stage on the solver's clock: ``start`` and ``duration`` in solver seconds, ``scale`` solver s per physical s."""

    name: str
    start: float
    duration: float
    scale: float
    stage: Stage

    @property
    def end(self) -> float:
        return self.start + self.duration


def stage_times(numerics: Numerics, actuation_pressure_max: float) -> tuple[StageTime, ...]:
    """The stages on the solver's clock. Pressure in kPa.

    The solver's damping is the largest of the stages'; a stage damped alpha runs for duration * alpha_max / alpha.
    """
    largest = numerics.solver_damping
    times, start = [], 0.0
    for name in STAGES:
        stage = getattr(numerics, name)
        duration = stage.duration if stage.duration is not None else actuation_pressure_max / stage.rate
        scale = largest / stage.damping if stage.damping else 1.0
        times.append(StageTime(name, start, duration * scale, scale, stage))
        start += duration * scale
    return tuple(times)


def actuation_pressure_at(times: tuple[StageTime, ...], maximum: float, solver_time: np.ndarray) -> np.ndarray:
    """P_a (kPa) at solver times (n,): zero until the ramp starts, then linear to ``maximum`` (kPa)."""
    ramp = times[-1]
    return maximum * np.clip((np.asarray(solver_time) - ramp.start) / ramp.duration, 0.0, 1.0)


def _rows(values: np.ndarray, per_line: int = 12) -> list[str]:
    return [", ".join(map(str, values[i : i + per_line])) + "," for i in range(0, len(values), per_line)]


def _number(value: float) -> str:
    return f"{value:.12g}"


def _geometry(model: Model) -> list[str]:
    """*NODE, *ELEMENT: ids count from one in the model's order."""
    lines = ["*NODE, NSET=ALL"]
    lines += [f"{i + 1}, {x:.12g}, {y:.12g}, {z:.12g}" for i, (x, y, z) in enumerate(model.nodes)]
    connectivity = model.mesh.quads if model.is_shell else model.expansion.bricks
    lines.append(f"*ELEMENT, TYPE={model.case.mesh.element}, ELSET=DEVICE")
    for i, nodes in enumerate(connectivity + 1):
        row = [str(i + 1), *map(str, nodes)]
        lines += [", ".join(row[:11]) + ","] * (len(row) > 11)
        lines.append(", ".join(row[11:] if len(row) > 11 else row))
    return lines


def _sets(model: Model) -> list[str]:
    lines = []
    for load in model.pressures:
        lines += [f"*ELSET, ELSET={load.surface.upper()}", *_rows(load.quads + 1)]
    endo = np.flatnonzero(model.mesh.layer == 1) + 1
    rest = np.flatnonzero(model.mesh.layer != 1) + 1
    return [*lines, "*ELSET, ELSET=ENDOCARDIUM", *_rows(endo), "*ELSET, ELSET=FABRIC", *_rows(rest)]


def _materials(model: Model, damping: float) -> list[str]:
    """Two St. Venant-Kirchhoff fabrics; mass-proportional damping ALPHA."""
    material, lines = model.case.device.material, []
    for name, ratio in (("FABRIC", 1.0), ("ENDOCARDIUM", model.case.stiffness_ratio)):
        lines += [
            f"*MATERIAL, NAME={name}",
            "*ELASTIC",
            f"{_number(ratio * material.youngs_modulus)}, {_number(material.poisson_ratio)}",
            "*DENSITY",
            _number(model.density),
        ]
        if damping:
            lines.append(f"*DAMPING, ALPHA={_number(damping)}")
        section = "SHELL" if model.is_shell else "SOLID"
        lines.append(f"*{section} SECTION, ELSET={name}, MATERIAL={name}")
        if model.is_shell:
            lines.append(_number(material.thickness))
    return lines


def _constraints(model: Model) -> list[str]:
    lines = []
    for equation in model.equations:
        lines += ["*EQUATION", str(len(equation.terms))]
        lines.append(", ".join(f"{n + 1}, {d + 1}, {c:g}" for n, d, c in equation.terms))
    if model.fixed:
        lines.append("*BOUNDARY")
        lines += [f"{n + 1}, {d + 1}, {d + 1}" for n, d in model.fixed]
    return lines


def _amplitudes(model: Model, times: tuple[StageTime, ...]) -> list[str]:
    """Fitting ramp, and the pressure of each loaded surface in MPa, all over the one step."""
    fit, _, ramp = times
    ventricular, maximum = (p * KPA for p in (model.case.ventricular_pressure, model.case.actuation_pressure_max))
    lines = ["*AMPLITUDE, NAME=FITTING", f"0, 0, {_number(fit.end)}, 1, {_number(ramp.end)}, 1"]
    for load in model.pressures:
        start, end = load.ventricular * ventricular, load.ventricular * ventricular + load.actuation * maximum
        table = (0.0, 0.0, fit.end, start, ramp.start, start, ramp.end, end)
        lines += [f"*AMPLITUDE, NAME=P_{load.surface.upper()}", ", ".join(map(_number, table))]
    return lines


def _controls(controls: Controls) -> list[str]:
    """*CONTROLS: i_0, i_r, i_p, i_c, i_l, i_g, i_s, i_a; d_f, d_c, d_b, d_a, d_s, d_h, d_d; then the field limits."""
    iterations = f"4, 7, 9, 12, {controls.iterations_for_decrease}, {controls.iterations_for_growth}, , {controls.cutbacks}"
    cut = _number(controls.cutback)
    return [
        "*CONTROLS, PARAMETERS=TIME INCREMENTATION",
        iterations,
        f"{cut}, 0.5, 0.75, 0.85, , , {_number(controls.growth)}",
        "*CONTROLS, PARAMETERS=FIELD",
        f"{_number(controls.residual)}, {_number(controls.correction)}, , , {_number(max(2e-2, controls.residual))}",
    ]


def _step(model: Model, numerics: Numerics, times: tuple[StageTime, ...]) -> list[str]:
    """All stages in one step, because a new *DYNAMIC step would throw the device away.

    CalculiX starts each step with an acceleration from forces that are integrated fully even for C3D20R, whose
    equilibrium knows the reduced rule only, and that leave damping out. In a thin layer the difference is enormous.
    """
    fit, _, ramp = times
    largest = numerics.largest_increment / model.case.actuation_pressure_max * ramp.duration
    # CalculiX calls a first increment below a millionth of the step an error
    first = max(numerics.first_increment * fit.duration, 2e-6 * ramp.end)
    limits = (first, ramp.end, min(first, numerics.smallest_increment * fit.duration), largest)
    lines = ["*STEP, NLGEOM, INC=1000000", f"*DYNAMIC, ALPHA={numerics.hht_alpha:.10f}", ", ".join(map(_number, limits))]
    lines += [*_controls(numerics.controls), "*BOUNDARY, AMPLITUDE=FITTING"]
    lines += [f"{n + 1}, {d + 1}, {d + 1}, {_number(u)}" for (n, d), u in model.prescribed.items()]
    for load in model.pressures:
        label = "P" if model.is_shell else BRICK_SIDE[load.side]
        lines += [f"*DLOAD, AMPLITUDE=P_{load.surface.upper()}", f"{load.surface.upper()}, {label}, 1"]
    # FREQUENCY=1, because volumes are taken at every increment; 2D output keeps the node numbers of shells
    return [*lines, "*NODE OUTPUT, FREQUENCY=1" + (", OUTPUT=2D" if model.is_shell else ""), "U", "*END STEP"]


def write_deck(model: Model, path: Path) -> tuple[StageTime, ...]:
    """Write the CalculiX input of a model; returns the stages on the solver's clock."""
    numerics = model.case.numerics
    times = stage_times(numerics, model.case.actuation_pressure_max)
    lines = [f"** {model.case.case_id}", "** mm, N, MPa, tonne, s"]
    lines += (
        _geometry(model)
        + _sets(model)
        + _materials(model, numerics.solver_damping)
        + _constraints(model)
        + _amplitudes(model, times)
    )
    lines += _step(model, numerics, times)
    path.write_text("\n".join(lines) + "\n", encoding="ascii")
    return times
