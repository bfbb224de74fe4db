"""The CalculiX input file of a model: one small class per block of keywords.

The stages follow each other in one implicit dynamic step. CalculiX knows one damping for the whole run, so a stage with
less damping is run in proportionally longer time: quasi-statically only damping times rate matters (``StageTime``). No
dependency writes steps and loads; meshio's input files have nodes, elements and sets.
"""

from __future__ import annotations

import math
from dataclasses import astuple, dataclass
from pathlib import Path

import numpy as np

from limo.mechanics.constitutive import engineering_constants, warp_and_weft
from limo.mechanics.model import KPA, Fabric, Loading, Model, Pressure
from limo.schema.numerics import Controls, Numerics, Stage
from limo.schema.section import PLANNED, STAGES

#: more than any run takes
MOST_INCREMENTS = 1_000_000
#: increments of the fit and of the hold that are kept with a cycle
_KEPT_OF_FIT, _KEPT_OF_HOLD = 5, 10
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


def stage_times(numerics: Numerics, actuation_pressure_max: float, ways: tuple[float, ...] = ()) -> tuple[StageTime, ...]:
    """The stages on the solver's clock. Pressure in kPa; ``ways``: how far the pressures go to each point of a cycle.

    The solver's damping is the largest of the stages'; a stage damped alpha runs for duration * alpha_max / alpha. A cycle has
    the rate and the damping of the ramp.
    """
    largest = numerics.solver_damping
    times, start = [], 0.0
    for name, way in (*((name, actuation_pressure_max) for name in PLANNED), *((STAGES[-1], way) for way in ways)):
        stage = getattr(numerics, name if name in PLANNED else PLANNED[-1])
        duration = stage.duration if stage.duration is not None else way / stage.rate
        scale = largest / stage.damping if stage.damping else 1.0
        times.append(StageTime(name, start, duration * scale, scale, stage))
        start += duration * scale
    return tuple(times)


def actuation_pressure_at(times: tuple[StageTime, ...], maximum: float, solver_time: np.ndarray) -> np.ndarray:
    """P_a (kPa) at solver times (n,): zero until the ramp starts, then linear to ``maximum`` (kPa)."""
    ramp = times[len(PLANNED) - 1]
    return maximum * np.clip((np.asarray(solver_time) - ramp.start) / ramp.duration, 0.0, 1.0)


def ways_of(loading: Loading) -> tuple[float, ...]:
    """How far (kPa) the pressure that changes more goes from the end of the ramp to each point of the cycle."""
    points = np.array([(loading.ventricular_pressure, loading.actuation_pressure_max), *loading.cycle])
    return tuple(float(way) for way in np.abs(np.diff(points, axis=0)).max(axis=1))


def history_of(loading: Loading, times: tuple[StageTime, ...]) -> np.ndarray:
    """Solver time (s), share of the fit, P_v and P_a (kPa) of the points (k, 4) between which loads go along straight lines."""
    fit, _, ramp, *legs = times
    p_v, p_a = loading.ventricular_pressure, loading.actuation_pressure_max
    points = [(0.0, 0.0, 0.0, 0.0), (fit.end, 1.0, p_v, 0.0), (ramp.start, 1.0, p_v, 0.0), (ramp.end, 1.0, p_v, p_a)]
    points += [(leg.end, 1.0, *point) for leg, point in zip(legs, loading.cycle, strict=True)]
    return np.array(points)


def kept_times(model: Model, times: tuple[StageTime, ...]) -> np.ndarray:
    """Times (k,) of the solver at which increments end and are kept; without a cycle none, for then every increment is.

    CalculiX meets a turn of the load only where it is told to, and then keeps the times that it is told alone: some of fit and
    hold, and on each leg those at most half of the largest increment apart.
    """
    loading = model.loading
    if not loading.cycle:
        return np.empty(0)
    counts, spacing = [_KEPT_OF_FIT, _KEPT_OF_HOLD], 0.5 * model.numerics.largest_increment
    counts += [max(1, math.ceil(way / spacing - 1e-9)) for way in (loading.actuation_pressure_max, *ways_of(loading))]
    return np.concatenate([np.linspace(t.start, t.end, n + 1)[1:] for t, n in zip(times, counts, strict=True)])


def _rows(values: np.ndarray, per_line: int = 12) -> list[str]:
    return [", ".join(map(str, values[i : i + per_line])) + "," for i in range(0, len(values), per_line)]


def number(value: float) -> str:
    """A number as decks have it."""
    return f"{value:.12g}"


def geometry(model: Model) -> list[str]:
    """*NODE, *ELEMENT: ids count from one in the model's order."""
    lines = ["*NODE, NSET=ALL"]
    lines += [f"{i + 1}, {x:.12g}, {y:.12g}, {z:.12g}" for i, (x, y, z) in enumerate(model.nodes)]
    connectivity = model.mesh.quads if model.element.is_shell else model.expansion.bricks
    lines.append(f"*ELEMENT, TYPE={model.element.name}, ELSET=DEVICE")
    for i, nodes in enumerate(connectivity + 1):
        row = [str(i + 1), *map(str, nodes)]
        lines += [", ".join(row[:11]) + ","] * (len(row) > 11)
        lines.append(", ".join(row[11:] if len(row) > 11 else row))
    return lines


def _sets(model: Model) -> list[str]:
    lines = []
    for load in model.pressures:
        lines += [f"*ELSET, ELSET={load.surface.upper()}", *_rows(load.quads + 1)]
    layer = model.mesh.layer
    for name, _, _ in _sheets(model):
        own = {"ENDOCARDIUM": layer == 1, "EPICARDIUM": layer == 2, "FABRIC": layer != 1}[name]
        if name == "FABRIC" and model.fabric.epicardium is not None:
            own = layer == 0
        lines += [f"*ELSET, ELSET={name}", *_rows(np.flatnonzero(own) + 1)]
    return lines


def _sheets(model: Model) -> list[tuple[str, Fabric, float]]:
    """Names of the sets of elements of one material, their fabric, and their moduli over its own."""
    sheets = [("ENDOCARDIUM", model.fabric, model.fabric.stiffness_ratio), ("FABRIC", model.fabric, 1.0)]
    outer = model.fabric.epicardium
    return sheets if outer is None else [*sheets, ("EPICARDIUM", outer, 1.0)]


def fabric(model: Model, name: str, sheet: Fabric, stiffness_ratio: float, damping: float) -> list[str]:
    """A St. Venant-Kirchhoff fabric on the elements of a set of the same name; mass-proportional ``damping`` in 1/s."""
    ratio, orientation = stiffness_ratio * sheet.stiffening, []
    lines = [f"*MATERIAL, NAME={name}"]
    if sheet.weave is None:
        lines += ["*ELASTIC", f"{number(ratio * sheet.youngs_modulus)}, {number(sheet.poisson_ratio)}"]
    else:
        constants = engineering_constants(*astuple(sheet.weave)[:4])
        row = [*(ratio * c for c in constants[:3]), *constants[3:6], *(ratio * c for c in constants[6:])]
        lines += ["*ELASTIC, TYPE=ENGINEERING CONSTANTS", ", ".join(map(number, row[:8])), number(row[8])]
        warp, weft, _ = warp_and_weft(sheet.weave.angle)
        axes = f"*ORIENTATION, NAME={name}, SYSTEM=RECTANGULAR"
        orientation = [axes, ", ".join(number(float(x)) for x in (*warp, *weft))]
    lines += ["*DENSITY", number(sheet.density)]
    if damping:
        lines.append(f"*DAMPING, ALPHA={number(damping)}")
    section = "SHELL" if model.element.is_shell else "SOLID"
    turned = f", ORIENTATION={name}" if orientation else ""
    lines += [*orientation, f"*{section} SECTION, ELSET={name}, MATERIAL={name}{turned}"]
    return [*lines, number(sheet.layer)] if model.element.is_shell else lines


def _materials(model: Model, damping: float) -> list[str]:
    order = ["FABRIC", "ENDOCARDIUM", "EPICARDIUM"]
    sheets = sorted(_sheets(model), key=lambda sheet: order.index(sheet[0]))
    return [line for sheet in sheets for line in fabric(model, *sheet, damping)]


def constraints(model: Model) -> list[str]:
    """*EQUATION and *BOUNDARY of what is held at zero."""
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
    fit, end, history = times[0], times[-1].end, history_of(model.loading, times)
    lines = ["*AMPLITUDE, NAME=FITTING", f"0, 0, {number(fit.end)}, 1, {number(end)}, 1"]
    for load in model.pressures:
        values = load.ventricular * (history[:, 2] * KPA) + load.actuation * (history[:, 3] * KPA)
        table = np.column_stack([history[:, 0], values]).ravel()
        lines.append(f"*AMPLITUDE, NAME=P_{load.surface.upper()}")
        lines += [", ".join(map(number, map(float, table[k : k + 8]))) for k in range(0, len(table), 8)]
    return lines


def _controls(controls: Controls) -> list[str]:
    """*CONTROLS: i_0, i_r, i_p, i_c, i_l, i_g, i_s, i_a; d_f, d_c, d_b, d_a, d_s, d_h, d_d; then the field limits."""
    iterations = f"4, 7, 9, 12, {controls.iterations_for_decrease}, {controls.iterations_for_growth}, , {controls.cutbacks}"
    cut = number(controls.cutback)
    return [
        "*CONTROLS, PARAMETERS=TIME INCREMENTATION",
        iterations,
        f"{cut}, 0.5, 0.75, 0.85, , , {number(controls.growth)}",
        "*CONTROLS, PARAMETERS=FIELD",
        f"{number(controls.residual)}, {number(controls.correction)}, , , {number(max(2e-2, controls.residual))}",
    ]


def step(
    model: Model,
    hht_alpha: float,
    limits: tuple[float, ...],
    controls: Controls,
    loads: list[str],
    increments: int = MOST_INCREMENTS,
    kept: np.ndarray | None = None,
) -> list[str]:
    """An implicit dynamic step: ``limits`` in s are first increment, length, smallest and largest increment.

    ``kept`` (k,): times in s of the increments that are kept, default all.
    """
    points = [] if kept is None else ["*TIME POINTS, NAME=KEPT", *(number(float(time)) for time in kept)]
    return [
        *points,
        f"*STEP, NLGEOM, INC={increments}",
        f"*DYNAMIC, ALPHA={hht_alpha:.10f}",
        ", ".join(map(number, limits)),
        *_controls(controls),
        *loads,
        # volumes are taken at every increment; 2D output keeps the node numbers of shells
        "*NODE OUTPUT, " + ("TIME POINTS=KEPT" if points else "FREQUENCY=1") + (", OUTPUT=2D" if model.element.is_shell else ""),
        "U",
        "*END STEP",
    ]


def pressure_label(model: Model, load: Pressure) -> str:
    """What *DLOAD calls the side of the elements that a pressure pushes on."""
    return "P" if model.element.is_shell else BRICK_SIDE[load.side]


def _stages(model: Model, numerics: Numerics, times: tuple[StageTime, ...], increments: int) -> list[str]:
    """All stages in one step, because a new *DYNAMIC step would throw the device away.

    CalculiX starts each step with an acceleration from forces without damping, integrated fully even for C3D20R. The equilibrium
    of that element knows the reduced rule only. In a thin layer the difference is enormous.
    """
    fit, _, ramp = times[: len(PLANNED)]
    largest = numerics.largest_increment / model.loading.actuation_pressure_max * ramp.duration
    # CalculiX calls a first increment below a millionth of the step an error
    end = times[-1].end
    first = max(numerics.first_increment * fit.duration, 2e-6 * end)
    limits = (first, end, min(first, numerics.smallest_increment * fit.duration), largest)
    loads = ["*BOUNDARY, AMPLITUDE=FITTING"]
    loads += [f"{n + 1}, {d + 1}, {d + 1}, {number(u)}" for (n, d), u in model.prescribed.items()]
    for load in model.pressures:
        surface = load.surface.upper()
        loads += [f"*DLOAD, AMPLITUDE=P_{surface}", f"{surface}, {pressure_label(model, load)}, 1"]
    kept = kept_times(model, times)
    return step(model, numerics.hht_alpha, limits, numerics.controls, loads, increments, kept if len(kept) else None)


def write_deck(model: Model, path: Path, increments: int = MOST_INCREMENTS) -> tuple[StageTime, ...]:
    """Write the CalculiX input of a model, to be ended after so many increments; returns the stages on the solver's clock."""
    numerics = model.numerics
    times = stage_times(numerics, model.loading.actuation_pressure_max, ways_of(model.loading))
    lines = [f"** {model.name}", "** mm, N, MPa, tonne, s"]
    lines += (
        geometry(model)
        + _sets(model)
        + _materials(model, numerics.solver_damping)
        + constraints(model)
        + _amplitudes(model, times)
    )
    lines += _stages(model, numerics, times, increments)
    path.write_text("\n".join(lines) + "\n", encoding="ascii")
    return times
