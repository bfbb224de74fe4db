"""Shifted Newton: an engine that solves a model's bricks or shells quasi-statically, from one equilibrium to the next.

At a frozen load the free displacements q follow

    (K + sigma M) dq = r(q)

with the consistent tangent K (follower pressures included), the mass matrix M and a shift sigma. Pseudo-transient continuation
moves sigma: strong for small steps downhill, through a snap; negligible for Newton's method near equilibrium.

- Sigma is multiplied and the matrix factorised again after a negative pivot, a step beyond ``rejected_step``, and a step that
  would crush elements even when cut short. So every step goes downhill in energy and stays with bricks that can be;
- a step is cut to ``largest_step``. After it sigma falls, the faster the smaller the step was. Only where it has fallen all the
  way a state is accepted, so that none is unstable. Where it has to rise again, it begins near where it ended last time;
- a factor is used again as long as the residual falls tenfold without a new one, and a step that made it larger taken back.

``factor_precision: single`` factorises in single precision (``refined``) on means and half differences of bottom and top nodes
(``unknowns``); the unknowns of the iteration, its norms and its limits stay what they are. ``geometric_stiffness: mixed`` has
the tangent take another stress than that of the state (``mixed``), with a factor for each step.

No damping is left in the answer: a snap of the device is a jump at its load. Steps of some millimetres matter: with steps of
1 mm the wrinkles of the fit stay where they first appear, and nearly equal runs end with different ones (docs/performance.md).
"""

from __future__ import annotations

import logging
import resource
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from limo.engines.load_path import LoadPath, PathEndedError, count_stages
from limo.engines.newton import kernels
from limo.engines.newton.assembly import Assembly
from limo.engines.newton.build import mkl_version
from limo.engines.newton.coupling import Coupling
from limo.engines.newton.mixed import MixedStress
from limo.engines.newton.pardiso import FactorisationError, SymmetricSolver, set_threads
from limo.engines.newton.refined import RefinedSolver
from limo.engines.newton.shell import Directors, ShellAssembly, ShellTangent
from limo.engines.newton.syringe import Syringe
from limo.engines.newton.tangent import Tangent
from limo.engines.newton.unknowns import Unknowns, displacements, means
from limo.mechanics.energy import conjugate_volumes, stored_energy
from limo.mechanics.model import Model
from limo.schema.numerics import Newton
from limo.schema.section import STAGES
from limo.schema.solver import Solver
from limo.store.progress import report

log = logging.getLogger(__name__)
#: shift (1/s^2) beyond which a step is hopeless, and beyond which a first step from the state of another mesh is
LARGEST_SHIFT, UNGUARDED_SHIFT = 1e14, 1e16
#: a factor is used again while the residual falls below this share of the one before
REUSED_WHILE = 0.1
#: an equilibrium was easy to find with at most this many iterations
EASY = 4
#: several load steps at once are no more than this share of P_a, so that soft beginnings are resolved
EASY_SHARE = 0.2
#: a step shorter than this share of the largest one is short
SHORT_STEP = 0.1
#: powers of ``shift_decay`` that the shift falls by after a step that was not refused, and after a short one
QUICKLY, AT_ONCE = 2, 4
#: forces count as load from this share of the internal ones and this value (N) on, for devices without pressure
HELD_SHARE, SMALLEST_FORCE = 1e-3, 1e-9
#: share of its volume that every integration point keeps, and by how much |ln det F| may grow in one step: the first because St.
#: Venant-Kirchhoff fabric gives way below a stretch of 1/sqrt(3) (some 0.7 of its volume) and is at rest again as its own mirror
#: image, the second because on fine meshes a step of millimetres can overshoot to there. Devices at rest are above 0.75
SMALLEST_VOLUME, LARGEST_GROWTH = 0.7, 0.25
#: the share they keep where no step leaves them more: in snaps of single creases elements come down to 0.44 and recover, and
#: fabric that is stretched until its law gives way thins to that
LEAST_VOLUME = 0.2
#: first steps from the state of another mesh in which elements may lose what they like, as it has creases where it cannot fold,
#: but do not turn inside out
UNGUARDED = 3
#: how many times the most iterations at one load it may take to rest from there: the flat fit that it saves takes more
PATIENCE = 3
#: shares of a step that are tried before the shift is raised
CUTS = (1.0, 0.5, 0.25, 0.125)
TINY = np.finfo(float).tiny
FIT, HOLD, RAMP, CYCLE = range(4)
_CLOSE = 1e-6  # kPa, pressures closer than this are the same


@dataclass
class _State:
    """Where the iteration is: free displacements, share of the prescribed ones, shift, and what has been counted."""

    free: np.ndarray
    prescribed: float = 0.0
    shift: float = 0.0
    last_shift: float = 0.0  # that the last step needed for which it had to rise
    factorisations: int = 0
    solutions: int = 0
    iterations: dict[str, int] = field(default_factory=count_stages)
    rejected: int = 0


def solve(model: Model, solver: Solver, start: np.ndarray | None = None, after: LoadPath | None = None) -> LoadPath:
    """Carry a model through fit and ramp; a state at rest stands between them, so the hold takes no time.

    ``start`` (n, 3) in mm, a state with the valve fitted and P_v on, takes the place of the fit; it may lack the reference
    nodes, and where no equilibrium is found from there the fit begins flat. ``after``, a path of the same model with other
    limits that ended at rest or later, is carried on from its last equilibrium; it is part of the path that is returned, its
    costs are not. Never raises for a model that does not converge: what was accepted is in the path, with status and reason.
    """
    began, used = time.monotonic(), _cpu_seconds()
    set_threads(solver.threads)
    run = Run(model, model.numerics.newton, began + 60 * solver.time_limit)
    prepared, status, reason, interrupted = 0.0, "converged", "", False
    try:
        run.prepare()
        prepared = _cpu_seconds() - used
        run.travel(start, after)
    except PathEndedError as stop:
        status, reason = stop.status, stop.reason
    except FactorisationError as error:
        interrupted = error.no_memory
        status, reason = "crashed" if interrupted else "diverged", str(error)
    except MemoryError:
        status, reason, interrupted = "crashed", "not enough memory", True
    finally:
        run.close()
    details = run.details() | {"setup_seconds": round(prepared, 2)}
    return LoadPath(
        status=status,
        reason=reason,
        stage=np.array(run.stages, int),
        pressure=np.array(run.pressures, float),
        clock=np.arange(1, len(run.stages) + 1, dtype=float),
        displacements=run.kept.__getitem__,
        precision="float64",
        is_static=True,
        in_process=True,
        iterations=run.state.iterations,
        rejected=run.state.rejected,
        build={"engine": "newton", "version": f"mkl {mkl_version()}"},
        cpu_seconds=_cpu_seconds() - used,
        wall_seconds=time.monotonic() - began,
        memory=resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
        ended_in=run.stage,
        ventricular=np.array(run.ventriculars, float) if model.loading.legs else None,
        leg=np.array(run.legs, int) if model.loading.legs else None,
        interrupted=interrupted,
        details=details,
    )


class Run:
    """The iteration on one model; accepted states are kept in order. ``prepare`` makes the large arrays, the rest is cheap."""

    def __init__(self, model: Model, settings: Newton, deadline: float):
        self.model, self.settings, self.deadline = model, settings, deadline
        self._spent, self._equations = {"seconds": 0.0, "refinements": 0, "memory": 0.0, "patterns": 0}, 0
        self.solver: RefinedSolver | SymmetricSolver | None = None
        self.largest, self.rejected = settings.largest_step * model.length, settings.rejected_step * model.length
        self.state = _State(np.zeros(0), shift=settings.first_shift)
        self.stages: list[int] = []
        self.pressures: list[float] = []
        self.ventriculars: list[float] = []
        self.legs: list[int] = []
        self.leg = 0
        self.kept: list[np.ndarray] = []
        self.residuals: list[float] = []
        self.stage = STAGES[FIT]
        self._placed: tuple[np.ndarray, float, np.ndarray] | None = None
        self._known: tuple | None = None
        self._floor = SMALLEST_VOLUME
        self._unguarded = 0  # steps that may still crush elements
        self.fell_back = ""
        self.ways: list[dict[str, Any]] = []
        self._visits = False

    def prepare(self) -> None:
        """Forces, tangent and the analysis of its pattern. Raises ``MemoryError`` and ``FactorisationError``."""
        single = self.settings.factor_precision == "single"
        self.assembly, self.unknowns, self.tangent = _discrete(self.model, single)
        self.factors = RefinedSolver if single else partial(SymmetricSolver, definite=True)
        self._equations, self.solver = self.unknowns.size, self._analysed()
        touching = self.assembly.touching
        narrow = touching is not None and self.model.numerics.contact.coupling == "near"
        self.coupling = Coupling(touching, self.model.fabric.thickness) if narrow else None
        self.mixed = MixedStress(self.assembly) if self.settings.geometric_stiffness == "mixed" else None
        self.state.free = np.zeros(self.assembly.size)

    def close(self) -> None:
        """Give the memory of the factors back; their costs stay known."""
        if self.solver is not None:
            spent, solver, self.solver = self._spent, self.solver, None
            spent["seconds"] += solver.seconds
            spent["refinements"] += solver.refinements
            spent["memory"] = max(spent["memory"], solver.memory)
            solver.close()

    def _analysed(self) -> RefinedSolver | SymmetricSolver:
        self._spent["patterns"] += 1
        return self.factors(self.tangent.indptr, self.tangent.indices, groups=self.unknowns.groups)

    def analyse(self, pairs: np.ndarray | None = None) -> None:
        """Take other factors, for a matrix of another kind or on the pattern of ``pairs`` (q,) of layers."""
        self.close()
        if pairs is not None:
            self.tangent.touch(pairs)
        self.solver = self._analysed()

    def tangent_at(self, ventricular: float, actuation: float, stress: np.ndarray | None = None) -> np.ndarray:
        """Values of K + sigma M at the state and pressures in kPa, on a pattern that has all layers that touch there."""
        u = self.displacements()
        if self.coupling is not None:
            wanted = self.coupling.wanted(self.model.middle(u), self.tangent.pairs)
            if wanted is not None:
                self.analyse(wanted)
        return self.tangent.assemble(u, ventricular, actuation, self.state.shift, stress)

    def details(self) -> dict[str, Any]:
        """What is told of the iteration beside its path, once it is closed: counts, CPU seconds, MiB."""
        state = self.state
        return {
            "equations": self._equations,
            "factorisations": state.factorisations,
            "solutions": state.solutions,
            "patterns": self._spent["patterns"],
            "refinements": self._spent["refinements"],
            "factor_seconds": round(self._spent["seconds"], 2),
            "factor_memory_mib": round(self._spent["memory"]),
            "largest_residual": max(self.residuals, default=None),
            **({"not_begun_at": self.fell_back} if self.fell_back else {}),
            **({"ways": self.ways} if self.ways else {}),
        }

    def travel(self, start: np.ndarray | None, after: LoadPath | None) -> None:
        """Fit, rest, ramp and legs, as ``solve`` says. Raises ``PathEndedError`` where it ends, and ``FactorisationError``."""
        if after is not None and (after.stage >= HOLD).any():
            self.carry_on(after)
        else:
            if start is None or not self.begun_at(start):
                self.fit()
        if CYCLE not in self.stages:
            self.ramp()
        self.cycle()
        self.syringe()

    def begun_at(self, start: np.ndarray) -> bool:
        """Come to rest from a state of the fitted device; False where that fails, all but the costs as before."""
        self.start_from(start)
        self._unguarded = UNGUARDED
        try:
            self.advance(HOLD, 1.0, self.model.loading.ventricular_pressure, 0.0, PATIENCE)
        except PathEndedError as stop:
            if stop.status != "diverged":
                raise
            log.info("from the state of another mesh: %s; fitted from the flat state", stop.reason)
            self._unguarded, self.fell_back = 0, stop.reason
            self._begin_flat()
            return False
        self._unguarded = 0
        return True

    def _begin_flat(self) -> None:
        """The flat state again; what has been counted stays."""
        self.state.free, self.state.prescribed = np.zeros(self.assembly.size), 0.0
        self.state.shift, self.state.last_shift, self._floor = self.settings.first_shift, 0.0, SMALLEST_VOLUME

    def fit(self) -> None:
        """Valve and P_v brought on by all ways of ``fit_via``; the path goes on from the state of least potential energy.

        A way that finds no equilibrium is left out; where none does, the first one's reason is the path's.
        """
        if len(self.settings.fit_via) == 1:
            self._fit_via(self.settings.fit_via[0])
            return
        ways, first = {}, None
        for via in self.settings.fit_via:
            try:
                self._fit_via(via)
                ways[via] = self._energy_at_rest(), replace(self.state), self._taken_back()
            except PathEndedError as stop:
                if stop.status != "diverged":
                    raise
                taken = self._taken_back()
                first = first or (stop, taken)
            self.ways.append({"via": via, "potential_energy_mj": round(ways[via][0], 4) if via in ways else None})
            if via != self.settings.fit_via[-1]:
                self._begin_flat()
        if not ways:
            stop, history = first
            self._put_back(history)
            raise stop
        _, state, history = min(ways.values(), key=lambda way: way[0])  # of equal ones the first
        self.state.free, self.state.prescribed = state.free, state.prescribed
        self.state.shift, self.state.last_shift = state.shift, state.last_shift
        self._put_back(history)

    def _fit_via(self, via: float) -> None:
        """Valve and ``via`` times P_v in equal steps, P_v back by halves, and rest."""
        steps, ventricular = self.settings.fit_steps, self.model.loading.ventricular_pressure
        for share in np.arange(1, steps + 1) / steps:
            self.advance(FIT, share, share * via * ventricular, 0.0)
        while via > 1:
            via = max(1.0, 0.5 * via)
            self.advance(FIT, 1.0, via * ventricular, 0.0)
        self.advance(HOLD, 1.0, ventricular, 0.0)

    def _energy_at_rest(self) -> float:
        """Pi = U - P_v V_v of the full device in mJ."""
        ventricle = conjugate_volumes(self.model, self.displacements())[0]
        return stored_energy(self.model, self.displacements()) - 1e-3 * self.model.loading.ventricular_pressure * ventricle

    def _taken_back(self) -> tuple[list, ...]:
        """What was accepted so far, which is then forgotten."""
        taken = tuple(list(each) for each in self._histories)
        for each in self._histories:
            each.clear()
        return taken

    def _put_back(self, history: tuple[list, ...]) -> None:
        for each, before in zip(self._histories, history, strict=True):
            each[:] = before

    @property
    def _histories(self) -> tuple[list, ...]:
        """What is kept of every accepted state."""
        return self.stages, self.pressures, self.ventriculars, self.legs, self.kept, self.residuals

    def start_from(self, displacements: np.ndarray) -> None:
        self.state.prescribed = 1.0
        whole = self.assembly.prescribed.copy()
        whole[: len(displacements)] = displacements
        self.state.free = self.assembly.gather_free(whole)

    def carry_on(self, path: LoadPath) -> None:
        """Begin where a path ended, with all that it accepted."""
        self.stages, self.pressures = path.stage.tolist(), path.pressure.tolist()
        self.kept = [path.displacements(k) for k in range(len(self.stages))]
        if path.leg is not None:
            self.ventriculars, self.legs = path.ventricular.tolist(), path.leg.tolist()
        self.start_from(self.kept[-1])

    def displacements(self, free: np.ndarray | None = None, prescribed: float | None = None) -> np.ndarray:
        """Displacements (n, 3) of the state, or with other free and another share of the prescribed ones.

        Asked again for the same, it returns the same array, by which the assembly knows what it has computed.
        """
        free = self.state.free if free is None else free
        prescribed = self.state.prescribed if prescribed is None else prescribed
        if self._placed is None or self._placed[0] is not free or self._placed[1] != prescribed:
            self._placed = free, prescribed, self.assembly.expand(free) + prescribed * self.assembly.prescribed
        return self._placed[2]

    def advance(self, stage: int, share: float, ventricular: float, actuation: float, patience: int = 1) -> None:
        """Bring the device to rest at a share of the prescribed displacements and at pressures in kPa.

        ``patience``: how many times the setting's ``iterations`` it may take. Raises ``PathEndedError``.
        """
        name = self.stage = STAGES[stage]
        state, assembly, settings = self.state, self.assembly, self.settings
        before, correction, most = state.free, np.inf, patience * settings.iterations
        moved = (share - state.prescribed) * assembly.prescribed if share != state.prescribed else None
        if self.mixed is not None:
            self.mixed.forget()
        for _ in range(most):
            if time.monotonic() > self.deadline:
                raise PathEndedError("timed_out", f"stopped at P_a = {actuation:g} kPa of the {name} after the time limit")
            u, inside, pressed = self.forces_at(ventricular, actuation)
            residual, load = assembly.reduce(pressed - inside, u), self.load_of(inside, pressed)
            size = np.linalg.norm(residual)
            if moved is None and self.at_rest(size, load, correction, before):
                if assembly.smallest_volume(u) <= 0:
                    raise PathEndedError("diverged", f"elements turned inside out at P_a = {actuation:g} kPa of the {name}")
                break
            if moved is not None:
                # the edges move with this step: what they drag along is part of its right side
                residual = residual - assembly.reduce(assembly.drag(u, moved), u)
            refused, edges = state.rejected, moved is not None
            correction = largest = self._iterate(residual, share, ventricular, actuation)
            moved = None
            if not edges and largest <= self.largest and self.mixed is None:
                correction = self._reuse(size, load, correction, before, ventricular, actuation)
            self.calm(refused, largest)
        else:
            raise PathEndedError(
                "diverged",
                f"no equilibrium at P_a = {actuation:g} kPa of the {name} in {most} iterations: residual "
                f"{size / load:.2g} of the load, correction {correction:.2g} mm",
            )
        self.accept(stage, ventricular, actuation, float(size / load))

    def _iterate(self, residual: np.ndarray, share: float, ventricular: float, actuation: float) -> float:
        """One step of the state for a residual (size,), to a share of the prescribed displacements; its size (mm) before cuts."""
        state, mixed, u, free = self.state, self.mixed, self.displacements(), self.state.free
        stress = None if mixed is None else mixed.stress
        values = self.tangent_at(ventricular, actuation, stress)
        if mixed is not None:
            mixed.leave(u)
        state.free, largest, _ = self.step(values, share, lambda negative: None if negative else self.solution(residual))
        state.prescribed = share
        if mixed is not None:
            mixed.arrive(self.displacements(), min(1.0, np.abs(state.free - free).max() / max(largest, TINY)))
        self.count()
        return largest

    def calm(self, refused: int, largest: float) -> None:
        """Lower the shift after a step of a size (mm), before which so many had been refused."""
        state, settings = self.state, self.settings
        powers = 1 if state.rejected > refused else AT_ONCE if largest <= SHORT_STEP * self.largest else QUICKLY
        state.shift = max(settings.smallest_shift, state.shift * settings.shift_decay**powers)

    def count(self) -> None:
        """One more iteration, which is told of."""
        state = self.state
        state.iterations[self.stage] += 1
        report(
            stage=self.stage,
            fitted=float(state.prescribed),
            actuation_pressure=max(self.pressures, default=0.0),
            increments=len(self.stages),
            rejected=state.rejected,
            iterations=sum(state.iterations.values()),
        )

    def accept(self, stage: int, ventricular: float, actuation: float, residual: float) -> None:
        """Keep the state, which is at rest up to a residual over the load."""
        self._floor = SMALLEST_VOLUME
        self.stages.append(stage)
        self.pressures.append(actuation)
        self.ventriculars.append(ventricular)
        self.legs.append(self.leg)
        self.kept.append(self.displacements())
        self.residuals.append(residual)
        if self.coupling is not None and not self._visits:
            fewer = self.coupling.at_rest(self.model.middle(self.kept[-1]), self.tangent.pairs)
            if fewer is not None:
                self.analyse(fewer)
        iterations = sum(self.state.iterations.values())
        log.info("%s, P_a = %.4g kPa: %d iterations so far, shift %.1e", self.stage, actuation, iterations, self.state.shift)

    def ramp(self) -> None:
        """Raise P_a in multiples of ``load_step`` to its maximum, several of them at once where that is easy and P_a is high.

        A lower maximum leaves the steps below it as they are, so that a case that goes further passes through the same states.
        """
        loading, settings, state = self.model.loading, self.settings, self.state
        ventricular, maximum = loading.ventricular_pressure, loading.actuation_pressure_max
        pressure, easy = self.pressures[-1], False  # zero, or where an earlier attempt ended
        steps = int(pressure / settings.load_step + _CLOSE)
        while pressure < maximum - _CLOSE:
            steps += max(1, min(settings.easy_steps, int(EASY_SHARE * steps))) if easy else 1
            before, pressure = pressure, min(steps * settings.load_step, maximum)
            left, done = state.free, sum(state.iterations.values())
            self.advance(RAMP, 1.0, ventricular, pressure)
            easy = sum(state.iterations.values()) - done <= EASY
            self.visit([f for f in loading.frames if before + _CLOSE < f < pressure - _CLOSE], before, left, easy)

    def cycle(self) -> None:
        """Go to the points of the cycle in turn, along straight lines, in steps of ``load_step`` at most of either pressure.

        As on the ramp, several steps are one where that is easy, up to ``EASY_SHARE`` of what was gone of the line.
        """
        settings, state = self.settings, self.state
        for number, point in enumerate(self.model.loading.cycle, start=1):
            if self.legs and self.legs[-1] > number:
                continue
            self.leg = number
            begins = self.model.loading.cycle[number - 2] if number > 1 else self._end_of_the_ramp()
            way = np.subtract(point, begins)
            count = max(1, int(np.ceil(np.abs(way).max() / settings.load_step - _CLOSE)))
            gone = np.subtract((self.ventriculars[-1], self.pressures[-1]), begins)
            done = round(count * float(gone @ way) / max(float(way @ way), TINY)) if self.legs[-1] == number else 0
            easy = False
            while done < count:
                done = min(count, done + (max(1, min(settings.easy_steps, int(EASY_SHARE * done))) if easy else 1))
                before = sum(state.iterations.values())
                self.advance(CYCLE, 1.0, *(float(x) for x in begins + way * (done / count)))
                easy = sum(state.iterations.values()) - before <= EASY

    def syringe(self) -> None:
        """Bring V_a to the points of the syringe in turn, in steps of ``load_step`` ml at most, or several where that is easy.

        The first leg begins at rest, whose V_a is that of the points None.
        """
        points, settings, state = self.model.loading.syringe, self.settings, self.state
        if not points:
            return
        syringe = Syringe(self)
        rest = syringe.held(self.kept[self.stages.index(HOLD)])
        ventricular = self.model.loading.ventricular_pressure
        for number, point in enumerate(points, start=1):
            if self.legs and self.legs[-1] > number:
                continue
            self.leg = number
            begins, ends = syringe.held(), rest if point is None else point
            count, done, easy = max(1, int(np.ceil(abs(ends - begins) / settings.load_step - _CLOSE))), 0, False
            while done < count:
                done = min(count, done + (max(1, min(settings.easy_steps, int(EASY_SHARE * done))) if easy else 1))
                before = sum(state.iterations.values())
                syringe.push(CYCLE, ventricular, begins + (ends - begins) * done / count)
                easy = sum(state.iterations.values()) - before <= EASY

    def _end_of_the_ramp(self) -> tuple[float, float]:
        """P_v and P_a in kPa."""
        return self.model.loading.ventricular_pressure, self.model.loading.actuation_pressure_max

    def visit(self, frames: list[float], before: float, left: np.ndarray, easy: bool) -> None:
        """Find the equilibria at frames (kPa) within the last step, which left free displacements ``left`` at P_a ``before``.

        Each starts between the two ends of the step where that was ``easy``, else where it began: between the ends of a snap
        lie crushed elements. The path goes on as if nobody had looked; a frame without an equilibrium is left out.
        """
        if not frames:
            return
        state, arrived, pressure, end = self.state, replace(self.state), self.pressures[-1], len(self.stages) - 1
        pairs, missed, self._visits = self.tangent.pairs, self.coupling and self.coupling.missed, True
        for frame in frames:
            share = easy * (frame - before) / (pressure - before)
            state.free = self.assembly.retracted(left + share * (arrived.free - left))
            try:
                self.advance(RAMP, 1.0, self.model.loading.ventricular_pressure, frame)
            except PathEndedError as stop:
                if stop.status != "diverged":
                    raise
                log.info("no state for the frame at P_a = %g kPa: %s", frame, stop.reason)
                self._floor = SMALLEST_VOLUME
                continue
            for history in self._histories:
                history.insert(end, history.pop())
            end += 1
        state.free, state.shift, state.last_shift = arrived.free, arrived.shift, arrived.last_shift
        self._visits = False
        if self.coupling is not None:
            self.coupling.missed = missed
        if self.tangent.pairs is not pairs:
            self.analyse(pairs)

    def forces_at(self, ventricular: float, actuation: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Displacements, f_int and f_p (n, 3) of the state; computed once for a state and its loads."""
        u = self.displacements()
        if self._known is None or self._known[0] is not u or self._known[3:] != (ventricular, actuation):
            self._known = u, *self.assembly.forces(u, ventricular, actuation), ventricular, actuation
        return self._known[:3]

    def load_of(self, inside: np.ndarray, pressed: np.ndarray) -> float:
        """What residuals are compared with (N): the pressures on the free displacements, and without any the held forces."""
        load = np.linalg.norm(self.assembly.reduce(pressed, self.displacements()))
        return max(load, HELD_SHARE * np.linalg.norm(inside), SMALLEST_FORCE)

    def at_rest(self, size: float, load: float, correction: float, before: np.ndarray) -> bool:
        """Residual small beside the load, the last correction beside the way gone at this load, and the shift at its smallest.

        A larger shift would hide an unstable equilibrium, and how far the stable one is.
        """
        settings = self.settings
        gone = max(np.abs(self.state.free - before).max(), 1e-3 * self.largest)
        quiet = size <= settings.residual * load and correction <= settings.correction * gone
        return quiet and self.state.shift <= settings.smallest_shift

    def step(
        self, values: np.ndarray, share: float, answer: Callable[[int], np.ndarray | None]
    ) -> tuple[np.ndarray, float, float]:
        """Free displacements after a step cut to ``largest_step``, its size (mm) before that, and the part of it that was taken.

        ``values`` are those of K with the shift, and change with it; ``answer`` gives the step that their factors make, by how
        many of their pivots are negative, None where they are of no use. The step is cut further where elements would lose their
        volume; the shift is raised until the matrix is positive, the step no leap, and such a cut enough. Where no shift does,
        elements may come down to ``LEAST_VOLUME`` until the next rest.
        """
        state, growth, refused, shift = self.state, self.settings.shift_growth, self.state.rejected, self.state.shift
        before = self.assembly.volume_ratios(self.displacements())
        most = UNGUARDED_SHIFT if self._unguarded else LARGEST_SHIFT
        growth_limit = LARGEST_GROWTH if share == state.prescribed else np.inf  # moved edges stretch what they drag along
        while True:
            negative = self.solver.factorise(values)
            state.factorisations += 1
            step = answer(negative)
            if step is not None:
                largest = np.abs(step).max()
                if largest <= self.rejected:
                    for cut in CUTS if share == state.prescribed else (1.0,):
                        part = cut * min(1.0, self.largest / max(largest, TINY))
                        free = self.assembly.retracted(state.free + part * step)
                        after = self.assembly.volume_ratios(self.displacements(free, share))
                        turned = (after <= 0) & (before > 0)  # inside out
                        if (self._unguarded and not turned.any()) or _whole(before, after, self._floor, growth_limit):
                            self._unguarded = max(0, self._unguarded - 1)
                            if state.rejected > refused:
                                state.last_shift = state.shift
                            elif cut < 1:
                                state.rejected += 1
                            return free, largest, part
            first, tried = state.rejected == refused, state.shift
            state.rejected += 1
            state.shift = max(growth * state.shift, state.last_shift / growth if first else 0.0)
            if state.shift > most and self._floor > LEAST_VOLUME:
                self._floor, state.shift = LEAST_VOLUME, shift
            elif state.shift > most:
                raise PathEndedError("diverged", f"no downhill step with a shift up to {most:.0e} 1/s2 leaves all elements whole")
            kernels.add_times(self.tangent.mass, state.shift - tried, values)

    def solution(self, residual: np.ndarray) -> np.ndarray | None:
        """The free displacements (size,) that the last factors give for a residual; None where the matrix is not positive."""
        solution = self.solver.solve(self.unknowns.reduce(residual))
        self.state.solutions += 1
        return None if solution is None else self.unknowns.expand(solution)

    def _reuse(
        self, size: float, load: float, correction: float, before: np.ndarray, ventricular: float, actuation: float
    ) -> float:
        """Further steps with the factor at hand, as long as the residual falls tenfold; returns the last correction.

        A step after which the residual is larger is taken back: a creased fabric is soft, and an old factor can leap.
        """
        state, assembly, came_from = self.state, self.assembly, None
        while True:
            u, inside, pressed = self.forces_at(ventricular, actuation)
            residual = assembly.reduce(pressed - inside, u)
            now = np.linalg.norm(residual)
            if came_from is not None and now > size:
                state.free, correction = came_from
                return correction
            if now > REUSED_WHILE * size or self.at_rest(now, load, correction, before):
                return correction
            if (step := self.solution(residual)) is None:
                return correction
            came_from = state.free, correction
            correction, size = np.abs(step).max(), now
            if correction > self.largest:
                return correction
            state.free = assembly.retracted(state.free + step)


def _discrete(model: Model, single: bool) -> tuple[Assembly, Unknowns, Tangent] | tuple[ShellAssembly, Directors, ShellTangent]:
    """Forces, unknowns and tangent of a model, on unknowns whose matrix may be rounded to ``single`` precision."""
    if model.element.plane_stress:
        shells = ShellAssembly(model)
        directors = Directors(shells)
        return shells, directors, ShellTangent(shells, directors)
    bricks = Assembly(model)
    unknowns = means(bricks) if single else displacements(bricks)
    return bricks, unknowns, Tangent(bricks, unknowns)


def _cpu_seconds() -> float:
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return usage.ru_utime + usage.ru_stime


def _whole(before: np.ndarray, after: np.ndarray, floor: float, growth: float) -> bool:
    """Whether a step from det F ``before`` to ``after`` (m, g) leaves all points their volume, |ln det F| growing that much."""
    if after.min() <= 0 or (after < np.minimum(before, floor)).any():
        return False
    return bool((np.abs(np.log(after)) <= np.abs(np.log(np.abs(before))) + growth).all())
