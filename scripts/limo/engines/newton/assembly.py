"""Forces of the brick layer on the free displacements of a model; ``tangent`` beside it has their slope.

    r(q) = T^T (f_p - f_int),   u = T q + lambda g

with f_int = int F S : Grad N dV_0 of a St. Venant-Kirchhoff layer (paper, Eq. stvenantkirchhoff), f_p the follower pressures
on the deformed faces, T the constraints, and lambda g the prescribed displacements. Units: mm, N, MPa, tonne, s.
"""

from __future__ import annotations

import numpy as np

from limo.engines.newton import kernels, woven_kernels
from limo.engines.newton.contact import CompiledTouching
from limo.engines.newton.faces import Faces
from limo.errors import ResultError
from limo.mechanics.constitutive import COMPONENTS, stress_of
from limo.mechanics.kinematics import lame
from limo.mechanics.model import Model, reduction, scatter
from limo.mesh.elements import HEX20_BOTTOM, HEX20_TOP, gauss, hex20_shape

#: nodes of the sides of a brick
SIDES = {"bottom": HEX20_BOTTOM, "top": HEX20_TOP}


def constraints(model: Model) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The free displacement (3 n,) of each displacement of a model, or -1, its multiple, and what is prescribed (n, 3) in mm.

    Raises ``ResultError`` where one depends on two free ones.
    """
    columns = reduction(model).tocsc()
    if (np.diff(columns.indptr) > 1).any():
        raise ResultError("a displacement that depends on two free ones: this model's equations are not followed")
    held = np.diff(columns.indptr) == 0
    free, factor = np.full(3 * len(model.nodes), -1), np.zeros(3 * len(model.nodes))
    free[~held], factor[~held] = columns.indices, columns.data
    prescribed = np.zeros((len(model.nodes), 3))
    for (n, d), value in model.prescribed.items():
        prescribed[n, d] = value
    for equation in model.equations:
        (node, direction, leading), *others = equation.terms
        prescribed[node, direction] = -sum(c * prescribed[n, d] for n, d, c in others) / leading
    return free, factor, prescribed


class Assembly:
    """A model's forces and constraints; everything that does not change is computed once.

    ``size`` free displacements, of ``nodes``. ``free`` (3 n,): that of each displacement, or -1; ``factor`` (3 n,) its multiple.
    ``bricks`` (m, 20); ``gradient`` (m, 3 g, 20), ``volume`` (m, g) and ``lame`` (m, 2) as in ``kernels``.
    """

    def __init__(self, model: Model):
        self.model = model
        shell = model.expansion
        self.bricks = np.ascontiguousarray(shell.bricks, np.int32)
        local, weights = gauss(model.element.gauss_points, 3)
        _, slopes = hex20_shape(local)
        jacobian = np.einsum("gnd,mnk->mgkd", slopes, shell.nodes[shell.bricks])
        gradient = np.einsum("gnd,mgdk->mgkn", slopes, np.linalg.inv(jacobian))  # dN_n / dX_k
        self.gradient = np.ascontiguousarray(gradient).reshape(len(shell.bricks), 3 * len(local), 20)
        self.volume = np.linalg.det(jacobian) * weights
        self.lame = np.stack(lame(model.youngs_modulus, model.poisson_ratio), axis=1)
        #: of woven fabric, in the place of ``lame``
        self.stiffness = model.stiffness
        self.law = None if self.stiffness is None else woven_kernels.law_of(self.stiffness)
        self.faces = Faces(model, lambda load: shell.bricks[load.quads][:, SIDES[load.side]], shell.nodes, len(model.nodes))
        self.touching = CompiledTouching.of(model)
        self._placed: tuple[np.ndarray, np.ndarray, np.ndarray] | None = None
        self._known: tuple[np.ndarray, np.ndarray, np.ndarray] | None = None
        self._constrain()

    # --- constraints --------------------------------------------------------------------------------------------------

    def _constrain(self) -> None:
        model = self.model
        self.free, self.factor, self.prescribed = constraints(model)
        self.reduction = reduction(model)
        self.size = self.reduction.shape[0]
        self.nodes = np.zeros(self.size, int)
        held = self.free < 0
        self.nodes[self.free[~held][::-1]] = np.flatnonzero(~held)[::-1] // 3

    def expand(self, free: np.ndarray) -> np.ndarray:
        """T q: displacements (n, 3) of all nodes from the free ones (size,), prescribed ones zero."""
        return np.where(self.free >= 0, self.factor * free[self.free], 0.0).reshape(-1, 3)

    def gather_free(self, displacements: np.ndarray) -> np.ndarray:
        """q (size,) of displacements (n, 3) that meet the constraints; the inverse of ``expand`` up to prescribed ones."""
        free, taken = np.zeros(self.size), self.free >= 0
        moved = (displacements - self.prescribed).ravel()[taken]
        free[self.free[taken]] = moved / self.factor[taken]
        return free

    def retracted(self, free: np.ndarray) -> np.ndarray:
        """``free`` (size,) as it is: bricks may be moved to any place."""
        return free

    def reduce(self, forces: np.ndarray, u: np.ndarray | None = None) -> np.ndarray:
        """T^T f: forces (n, 3) of all nodes -> (size,), whatever the displacements u (n, 3)."""
        return self.reduction @ forces.ravel()

    # --- forces -------------------------------------------------------------------------------------------------------

    def forces(self, u: np.ndarray, ventricular: float, actuation: float) -> tuple[np.ndarray, np.ndarray]:
        """f_int, contact included, and f_p (n, 3) in N at displacements (n, 3) in mm and pressures in kPa."""
        inside = self.inside(u)[0]
        if self.touching is not None:
            inside = inside + self.contact_forces(u)
        return inside, self.faces.forces(u, ventricular, actuation)

    def contact_forces(self, u: np.ndarray) -> np.ndarray:
        """What touching layers add to f_int (n, 3): half of it on the bottom, half on the top."""
        shell, found = self.model.expansion, np.zeros(u.shape)
        found[shell.bottom] = found[shell.top] = 0.5 * self.touching.forces(self.model.middle(u))
        return found

    def drag(self, u: np.ndarray, moved: np.ndarray) -> np.ndarray:
        """How f_int (n, 3) changes from displacements u (n, 3) along ``moved`` (n, 3), prescribed ones included.

        dP = dF S + F dS with dS = lambda tr(dE) I + 2 mu dE and dE the symmetric part of F^T dF.
        """
        count, points = self.volume.shape
        stress = self.inside(u)[1][..., [[0, 3, 4], [3, 1, 5], [4, 5, 2]]]
        deformation = np.eye(3) + self.slopes(u)[0].reshape(count, points, 3, 3)  # (K, i)
        change = (self.gradient @ moved[self.bricks]).reshape(deformation.shape)
        strain = change @ np.swapaxes(deformation, -1, -2)
        strain = 0.5 * (strain + np.swapaxes(strain, -1, -2))
        piola = stress @ change + self.stress_of(strain) @ deformation
        forces = np.swapaxes(self.gradient, -1, -2) @ piola.reshape(count, 3 * points, 3)
        return scatter(forces, self.bricks, len(self.model.nodes))

    def stress_of(self, strain: np.ndarray) -> np.ndarray:
        """J w C : E (m, g, 3, 3) in N mm of strains (m, g, 3, 3)."""
        if self.stiffness is not None:
            return stress_of(strain, self.stiffness) * self.volume[..., None, None]
        factors = self.lame.T[:, :, None, None, None] * self.volume[..., None, None]
        trace = np.trace(strain, axis1=-2, axis2=-1)[..., None, None]
        return factors[0] * trace * np.eye(3) + 2 * factors[1] * strain

    def predicted_stress(self, u: np.ndarray, slopes: np.ndarray) -> np.ndarray:
        """J w (S - C : d d^T / 2) (m, g, 6) at displacements u (n, 3), d since displacement gradients ``slopes`` (m, 3 g, 3)."""
        stress, there = self.inside(u)[1], self.slopes(u)[0]
        if self.law is not None:
            return stress - self.quadratic_stress(there - slopes)
        predicted = np.empty_like(stress)
        kernels.predicted_stress(stress, there, slopes, self.volume, self.lame, predicted)
        return predicted

    def quadratic_stress(self, added: np.ndarray) -> np.ndarray:
        """J w C : d d^T / 2 (m, g, 6) in N mm of displacement gradients d (m, 3 g, 3) that a step added."""
        d = added.reshape(*self.volume.shape, 3, 3)
        found = self.stress_of(0.5 * d @ np.swapaxes(d, -1, -2))
        return np.stack([found[..., i, j] for i, j in COMPONENTS], axis=-1)

    def volume_ratios(self, u: np.ndarray) -> np.ndarray:
        """det F (m, g) at the integration points; none positive means elements turned inside out."""
        return self.slopes(u)[1]

    def smallest_volume(self, u: np.ndarray) -> float:
        """Smallest det F of all integration points."""
        return float(self.volume_ratios(u).min())

    def slopes(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Displacement gradients (m, 3 g, 3) and det F (m, g). The same array ``u`` again costs nothing, here and below."""
        if self._placed is None or self._placed[0] is not u:
            if u.shape != self.model.nodes.shape:  # compiled loops do not look
                raise ValueError(f"displacements of shape {u.shape}, the model has nodes {self.model.nodes.shape}")
            slopes, ratios = np.empty((*self.gradient.shape[:2], 3)), np.empty(self.volume.shape)
            kernels.displacement_gradients(np.ascontiguousarray(u, float), self.bricks, self.gradient, slopes, ratios)
            self._placed = u, slopes, ratios
        return self._placed[1:]

    def inside(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """f_int (n, 3) and J w S (m, g, 6)."""
        if self._known is None or self._known[0] is not u:
            forces, stress = np.zeros((len(self.model.nodes), 3)), np.empty((*self.volume.shape, 6))
            tables, slopes = (self.bricks, self.gradient, self.volume), self.slopes(u)[0]
            if self.law is None:
                kernels.internal_forces(slopes, *tables, self.lame, stress, forces)
            else:
                woven_kernels.internal_forces(slopes, *tables, self.law, stress, forces)
            self._known = u, forces, stress
        return self._known[1:]
