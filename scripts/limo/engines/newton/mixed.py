"""The stress of the geometric stiffness by mixed integration points: as the last step predicted it.

A step along a crease by a rotation stretches the fabric by the square of it, as the next tangent sees it. The stress of this
stretch makes the geometric stiffness far too large, and the next step takes it back. With the stresses of the integration
points as unknowns of their own, Newton's method has them follow the displacements linearly:

    sigma_k+1 = C : (E_k + sym(F_k^T d)) = S_k+1 - C : d d^T / 2

after a whole step, d its increment of the displacement gradient. After the share a of a step

    sigma_k+1 = S_k+1 - C : d d^T / 2 + (1 - a) (sigma_k - S_k)

Forces, and so equilibria, are those of the displacements: sigma stands in the tangent alone. Magisano, Leonetti and Garcea
(2017), *Comput. Methods Appl. Mech. Eng.* 313, 986-1005, call this mixed integration points.
"""

from __future__ import annotations

import numpy as np

from limo.engines.newton.assembly import Assembly
from limo.engines.newton.shell import ShellAssembly


class MixedStress:
    """J w sigma (m, g, 6) in N mm at the integration points of an assembly, step by step."""

    def __init__(self, assembly: Assembly | ShellAssembly):
        self._assembly = assembly
        #: None while there has been no step: sigma = S
        self.stress: np.ndarray | None = None
        self._before: tuple[np.ndarray, np.ndarray] | None = None

    def forget(self) -> None:
        """Begin at a load: a state at rest has its own stress, and so a path does not depend on what led to its last state."""
        self.stress = None

    def leave(self, displacements: np.ndarray) -> None:
        """A step begins at displacements (n, 3) in mm."""
        self._before = self._assembly.slopes(displacements)[0], self._assembly.inside(displacements)[1]

    def arrive(self, displacements: np.ndarray, share: float) -> None:
        """It ended at displacements (n, 3) in mm, after the ``share`` of it that was taken."""
        assembly, (slopes, stress) = self._assembly, self._before
        predicted = assembly.predicted_stress(displacements, slopes)
        if share < 1 and self.stress is not None:
            predicted += (1 - share) * (self.stress - stress)
        self.stress = predicted
