"""The device driven by a volume: a syringe sets V_a, and P_a is an unknown beside the displacements.

At rest the forces balance and the pouches hold what they are given,

    r(q, P_a) = 0,    V_a(q) = V

and a step of the shifted iteration (``iteration``) is that of the bordered system

    [K + sigma M   -f] [dq  ]   [r      ]
    [f^T            0] [dP_a] = [V - V_a],    f = dV_a/dq

found from the factors of K + sigma M and two right sides. It goes downhill among the displacements that hold V_a where that
matrix has no negative pivot, or one and f^T (K + sigma M)^-1 f < 0: a device may stand behind a limit of P_a, where K itself is
not positive. So a path goes through a snap of P_a without a jump. Where V_a has a limit along the path, it jumps. Source:
Wriggers, Nonlinear Finite Element Methods, Springer 2008, section 5.2.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import numpy as np

from limo.engines.load_path import PathEndedError
from limo.engines.newton.pardiso import SymmetricSolver
from limo.mechanics.energy import conjugate_volumes
from limo.schema.section import STAGES

if TYPE_CHECKING:
    from limo.engines.newton.iteration import Run

#: share of the step of V_a that may be lacking at rest
LACKING = 1e-6


class Syringe:
    """What drives a run by V_a. ``actuation``: P_a in kPa, an outcome. It takes the place of the run's factors."""

    def __init__(self, run: Run):
        self._run, run.factors = run, SymmetricSolver
        run.analyse()
        self.actuation = run.pressures[-1]

    def held(self, displacements: np.ndarray | None = None) -> float:
        """V_a in ml of the full device, as P_a has work on it, of the run's state or of displacements (n, 3) in mm."""
        at = self._run.displacements() if displacements is None else displacements
        return 1e-3 * conjugate_volumes(self._run.model, at)[1]

    def push(self, stage: int, ventricular: float, volume: float) -> None:
        """Bring the device to rest at P_v (kPa) and V_a (ml). Raises as ``Run.advance`` does."""
        run, settings = self._run, self._run.settings
        run.stage, before, correction, lacking = STAGES[stage], run.state.free, np.inf, volume - self.held()
        allowed = LACKING * max(abs(lacking), 1e-3)
        for _ in range(settings.iterations):
            if time.monotonic() > run.deadline:
                raise PathEndedError("timed_out", f"stopped at V_a = {volume:g} ml after the time limit")
            u, inside, pressed = run.forces_at(ventricular, self.actuation)
            residual, load = run.assembly.reduce(pressed - inside, u), run.load_of(inside, pressed)
            size, lacking = np.linalg.norm(residual), volume - self.held()
            if abs(lacking) <= allowed and run.at_rest(size, load, correction, before):
                break
            refused = run.state.rejected
            correction = self._iterate(residual, ventricular, lacking)
            run.calm(refused, correction)
        else:
            raise PathEndedError(
                "diverged",
                f"no equilibrium at V_a = {volume:g} ml in {settings.iterations} iterations: residual {size / load:.2g} of the "
                f"load, V_a off by {lacking:.2g} ml",
            )
        if run.assembly.smallest_volume(u) <= 0:
            raise PathEndedError("diverged", f"elements turned inside out at V_a = {volume:g} ml")
        run.accept(stage, ventricular, self.actuation, float(size / load))

    def _iterate(self, residual: np.ndarray, ventricular: float, lacking: float) -> float:
        """One step of displacements and P_a; the size (mm) of that of displacements before cuts."""
        run, state = self._run, self._run.state
        u, change = run.displacements(), 0.0
        along = run.assembly.reduce(run.assembly.forces(u, 0.0, 1.0)[1], u)  # N a kPa, of the modelled part
        wanted = lacking / run.model.mesh.copies  # ml are mJ a kPa

        def answer(negative: int) -> np.ndarray | None:
            nonlocal change
            if negative > 1:
                return None
            free, pressed = run.solution(residual), run.solution(along)
            compliance = float(along @ pressed)
            if (compliance < 0) != bool(negative) or not compliance:
                return None
            change = (wanted - float(along @ free)) / compliance
            return free + change * pressed

        values = run.tangent_at(ventricular, self.actuation)
        state.free, largest, part = run.step(values, 1.0, answer)
        self.actuation += part * change
        run.count()
        return largest
