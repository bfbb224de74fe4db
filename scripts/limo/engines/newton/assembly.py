"""Forces and consistent tangent of the brick layer, assembled on the free displacements of a model.

    r(q) = T^T (f_p - f_int),   K = -dr/dq,   u = T q + lambda g

with f_int = int F S : Grad N dV_0 of a St. Venant-Kirchhoff layer (paper, Eq. stvenantkirchhoff), f_p the follower pressures
on the deformed faces, T the constraints, and lambda g the prescribed displacements. The tangent per node pair (n, m) is

    K_nm = sum_g w (dN_n/dX_K) A_iKjL (dN_m/dX_L),   A_iKjL = lambda F_iK F_jL + mu (b_ij delta_KL + F_iL F_jK) + delta_ij S_KL

with b = F F^T, plus that of the pressures. Follower pressure on a surface whose edges are held or meet others is
conservative, so K is symmetric. What single edges leave over (half a thickness of the rotating valve edge) is symmetrised. The
2 x 2 points that CalculiX gives the faces of C3D20R leave a rest inside, which is symmetrised too; 3 x 3 points leave none.
Units: mm, N, MPa, tonne, s.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csc_array

from limo.engines.newton import kernels
from limo.engines.newton.kernels import PAIRS
from limo.errors import ResultError
from limo.mechanics.kinematics import lame
from limo.mechanics.model import KPA, Model, reduction, scatter
from limo.mesh.elements import HEX20_BOTTOM, HEX20_TOP, gauss, hex20_shape, quad8_shape


class Assembly:
    """A model's residual and tangent; everything that does not change is computed once.

    ``indptr``, ``indices``: pattern of the upper triangle of the tangent in rows; ``size`` free displacements, of ``nodes``.
    """

    def __init__(self, model: Model):
        self.model = model
        shell = model.expansion
        self.bricks = np.ascontiguousarray(shell.bricks, np.int32)
        local, weights = gauss(model.element.gauss_points, 3)
        _, slopes = hex20_shape(local)
        jacobian = np.einsum("gnd,mnk->mgkd", slopes, shell.nodes[shell.bricks])
        gradient = np.einsum("gnd,mgdk->mgkn", slopes, np.linalg.inv(jacobian))  # dN_n / dX_k
        self._gradient = np.ascontiguousarray(gradient).reshape(len(shell.bricks), 3 * len(local), 20)
        self._volume = np.linalg.det(jacobian) * weights
        self._lame = np.stack(lame(model.youngs_modulus, model.fabric.poisson_ratio), axis=1)
        self._faces = _Faces(model)
        self._placed: tuple[np.ndarray, np.ndarray, np.ndarray] | None = None
        self._known: tuple[np.ndarray, np.ndarray, np.ndarray] | None = None
        self._constrain()
        self._plan()
        self.mass = self._assemble_mass()

    # --- constraints --------------------------------------------------------------------------------------------------

    def _constrain(self) -> None:
        model = self.model
        self.reduction = reduction(model)
        self.size = self.reduction.shape[0]
        columns = self.reduction.tocsc()
        if (np.diff(columns.indptr) > 1).any():
            raise ResultError("a displacement that depends on two free ones: this model's equations are not followed")
        held = np.diff(columns.indptr) == 0
        self._free = np.full(3 * len(model.nodes), -1)
        self._factor = np.zeros(3 * len(model.nodes))
        self._free[~held], self._factor[~held] = columns.indices, columns.data
        self.nodes = np.zeros(self.size, int)
        self.nodes[columns.indices[::-1]] = np.flatnonzero(~held)[::-1] // 3
        self.prescribed = np.zeros((len(model.nodes), 3))
        for (n, d), value in model.prescribed.items():
            self.prescribed[n, d] = value
        for equation in model.equations:
            (node, direction, leading), *others = equation.terms
            self.prescribed[node, direction] = -sum(c * self.prescribed[n, d] for n, d, c in others) / leading

    def expand(self, free: np.ndarray) -> np.ndarray:
        """T q: displacements (n, 3) of all nodes from the free ones (size,), prescribed ones zero."""
        return np.where(self._free >= 0, self._factor * free[self._free], 0.0).reshape(-1, 3)

    def gather_free(self, displacements: np.ndarray) -> np.ndarray:
        """q (size,) of displacements (n, 3) that meet the constraints; the inverse of ``expand`` up to prescribed ones."""
        free, taken = np.zeros(self.size), self._free >= 0
        moved = (displacements - self.prescribed).ravel()[taken]
        free[self._free[taken]] = moved / self._factor[taken]
        return free

    def reduce(self, forces: np.ndarray) -> np.ndarray:
        """T^T f: forces (n, 3) of all nodes -> (size,)."""
        return self.reduction @ forces.ravel()

    # --- pattern ------------------------------------------------------------------------------------------------------

    def _plan(self) -> None:
        """The pattern, and where in its values the entries of element matrices go."""
        bricks, faces = _entries(self.bricks, self._free, self._factor, PAIRS), self._faces.entries(self._free, self._factor)
        rows, columns = (np.concatenate([bricks[k], faces[k]]) for k in range(2))
        key = rows * self.size + columns
        unique, inverse = np.unique(key, return_inverse=True)
        self.indices = (unique % self.size).astype(np.int32)
        self.indptr = np.searchsorted(unique // self.size, np.arange(self.size + 1)).astype(np.int32)
        split = len(bricks[0])
        self._place_bricks(inverse[:split], *bricks[2:])
        _, _, factors, sources = faces
        shape = (len(unique), self._faces.entries_count)
        # by columns: element matrices are read in order
        self._from_faces = csc_array((factors, (inverse[split:].astype(np.int32), sources.astype(np.int32))), shape=shape)

    def _place_bricks(self, places: np.ndarray, factors: np.ndarray, sources: np.ndarray) -> None:
        """Tables for ``kernels.tangent``: an element's entries that count, their places, and factors where any is not one."""
        count, size = len(self.bricks), 400 * len(PAIRS)
        self._sources = np.unique(sources % size).astype(np.int32)
        place = sources // size, np.searchsorted(self._sources, sources % size)
        # what goes nowhere goes behind the last value
        self._places = np.full((count, len(self._sources)), len(self.indices), np.int32)
        self._places[place] = places
        weights = np.ones(self._places.shape)
        weights[place] = factors
        odd = (weights != 1).any(axis=1)
        self._special = np.where(odd, np.cumsum(odd) - 1, -1).astype(np.int32)
        self._weights = weights[odd]

    # --- forces and tangent -------------------------------------------------------------------------------------------

    def forces(self, u: np.ndarray, ventricular: float, actuation: float) -> tuple[np.ndarray, np.ndarray]:
        """f_int and f_p (n, 3) in N at displacements (n, 3) in mm and pressures in kPa."""
        return self._inside(u)[0], self._faces.forces(u, ventricular, actuation)

    def tangent(self, u: np.ndarray, ventricular: float, actuation: float, shift: float = 0.0) -> np.ndarray:
        """Values of K + shift M on the pattern at displacements (n, 3) in mm, pressures in kPa and a shift in 1/s^2."""
        values = np.zeros(len(self.indices) + 1)
        np.multiply(self.mass, shift, out=values[:-1])
        tables = self._sources, self._places, self._special, self._weights
        kernels.tangent(self._moved(u)[0], self._inside(u)[1], self._gradient, self._volume, self._lame, *tables, values)
        values[:-1] += self._from_faces @ self._faces.tangent(u, ventricular, actuation)
        return values[:-1]

    def drag(self, u: np.ndarray, moved: np.ndarray) -> np.ndarray:
        """How f_int (n, 3) changes from displacements u (n, 3) along ``moved`` (n, 3), prescribed ones included.

        dP = dF S + F dS with dS = lambda tr(dE) I + 2 mu dE and dE the symmetric part of F^T dF.
        """
        count, points = self._volume.shape
        stress = self._inside(u)[1][..., [[0, 3, 4], [3, 1, 5], [4, 5, 2]]]
        deformation = np.eye(3) + self._moved(u)[0].reshape(count, points, 3, 3)  # (K, i)
        change = (self._gradient @ moved[self.bricks]).reshape(deformation.shape)
        strain = change @ np.swapaxes(deformation, -1, -2)
        strain = 0.5 * (strain + np.swapaxes(strain, -1, -2))
        factors = self._lame.T[:, :, None, None, None] * self._volume[..., None, None]
        trace = np.trace(strain, axis1=-2, axis2=-1)[..., None, None]
        piola = stress @ change + (factors[0] * trace * np.eye(3) + 2 * factors[1] * strain) @ deformation
        forces = np.swapaxes(self._gradient, -1, -2) @ piola.reshape(count, 3 * points, 3)
        return scatter(forces, self.bricks, len(self.model.nodes))

    def volume_ratios(self, u: np.ndarray) -> np.ndarray:
        """det F (m, g) at the integration points; none positive means elements turned inside out."""
        return self._moved(u)[1]

    def smallest_volume(self, u: np.ndarray) -> float:
        """Smallest det F of all integration points."""
        return float(self.volume_ratios(u).min())

    def _moved(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Displacement gradients (m, 3 g, 3) and det F (m, g). The same array ``u`` again costs nothing, here and below."""
        if self._placed is None or self._placed[0] is not u:
            if u.shape != self.model.nodes.shape:  # compiled loops do not look
                raise ValueError(f"displacements of shape {u.shape}, the model has nodes {self.model.nodes.shape}")
            slopes, ratios = np.empty((*self._gradient.shape[:2], 3)), np.empty(self._volume.shape)
            kernels.displacement_gradients(np.ascontiguousarray(u, float), self.bricks, self._gradient, slopes, ratios)
            self._placed = u, slopes, ratios
        return self._placed[1:]

    def _inside(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """f_int (n, 3) and J w S (m, g, 6)."""
        if self._known is None or self._known[0] is not u:
            forces, stress = np.zeros((len(self.model.nodes), 3)), np.empty((*self._volume.shape, 6))
            kernels.internal_forces(self._moved(u)[0], self.bricks, self._gradient, self._volume, self._lame, stress, forces)
            self._known = u, forces, stress
        return self._known[1:]

    def _assemble_mass(self) -> np.ndarray:
        """Values of the consistent mass on the tangent's pattern (3 x 3 x 3 points)."""
        shell = self.model.expansion
        local, weights = gauss(3, 3)
        shapes, slopes = hex20_shape(local)
        jacobian = np.einsum("gnd,mnk->mgkd", slopes, shell.nodes[shell.bricks])
        volume = np.linalg.det(jacobian) * weights
        element = self.model.fabric.density * np.einsum("gn,gp,mg->mnp", shapes, shapes, volume, optimize=True)
        blocks = np.zeros((len(element), 20, len(PAIRS), 20))
        blocks[:, :, :3] = element[:, :, None]
        entries = blocks.reshape(len(element), -1)[:, self._sources]
        entries[self._special >= 0] *= self._weights
        return np.bincount(self._places.ravel(), entries.ravel(), len(self.indices) + 1)[:-1]


class _Faces:
    """The loaded faces of a model: follower pressure and its tangent, with as many points a direction as the bricks."""

    def __init__(self, model: Model):
        shell, count = model.expansion, len(model.nodes)
        self._count = count
        nodes, weights = [np.empty((0, 8), int)], [np.empty((0, 2))]
        for load in model.pressures:
            face, sign = (HEX20_BOTTOM, 1.0) if load.side == "bottom" else (HEX20_TOP, -1.0)
            nodes.append(shell.bricks[load.quads][:, face])
            weights.append(np.tile([sign * KPA * load.ventricular, sign * KPA * load.actuation], (len(load.quads), 1)))
        self.nodes = np.vstack(nodes)
        self._weights = np.vstack(weights)
        local, rule = gauss(model.element.gauss_points, 2)
        values, slopes = quad8_shape(local)
        self._values = np.ascontiguousarray((values * rule[:, None]).T)  # (8, g)
        self._slopes = np.vstack([slopes[:, :, 0], slopes[:, :, 1]])  # (2 g, 8)
        self._rest = shell.nodes
        # (N_n dN_m - N_m dN_n) / 2 of each pair of nodes n < m at the points, weighted: what multiplies x_,1, and x_,2
        first, second = self._pair = np.triu_indices(8, 1)
        turned = [values[:, first] * d[:, second] - values[:, second] * d[:, first] for d in (slopes[:, :, 1], slopes[:, :, 0])]
        self._turned = 0.5 * np.hstack([(rule[:, None] * turned[0]).T, -(rule[:, None] * turned[1]).T])  # (28, 2 g)
        self.entries_count = 3 * len(first) * len(self.nodes)

    def entries(self, free: np.ndarray, factor: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """As ``_entries``, into what ``tangent`` gives: a pair's blocks are skew, and so is the pair."""
        rows, columns, factors, sources = _entries(self.nodes, free, factor, PAIRS[3:])
        face, n, part, m = np.unravel_index(sources, (len(self.nodes), 8, 3, 8))
        pair = np.zeros((8, 8), int)
        pair[self._pair] = np.arange(len(self._pair[0]))
        source = (face * len(self._pair[0]) + pair[np.minimum(n, m), np.maximum(n, m)]) * 3 + part
        apart = n != m
        return rows[apart], columns[apart], (factors * np.sign(m - n))[apart], source[apart]

    def _tangents(self, u: np.ndarray) -> np.ndarray:
        """x_,1 at all points, then x_,2: (f, 2 g, 3)."""
        return self._slopes @ (self._rest + u[: len(self._rest)])[self.nodes]

    def forces(self, u: np.ndarray, ventricular: float, actuation: float) -> np.ndarray:
        """f_p (n, 3): int N p (x_,1 x x_,2) dxi, pushing into the face."""
        shape = len(self.nodes), 2, len(self._slopes) // 2, 3
        (x, y, z), (r, s, t) = np.moveaxis(self._tangents(u).reshape(shape), (1, 3), (0, 1))
        normal = np.stack([y * t - z * s, z * r - x * t, x * s - y * r], axis=-1)
        normal *= (self._weights @ (ventricular, actuation))[:, None, None]
        return scatter(self._values @ normal, self.nodes, self._count)

    def tangent(self, u: np.ndarray, ventricular: float, actuation: float) -> np.ndarray:
        """The symmetric part of -df_p/du, flat (f, 28, 3): pairs of nodes n < m and directions (0, 1), (0, 2), (1, 2).

        -df_p,ni / du_mj = -p eps_ijk A^k_nm with A^k_nm = int N_n (dN_m/dxi_1 x_,2 - dN_m/dxi_2 x_,1)_k dxi.
        """
        skew = (self._turned @ self._tangents(u)) * (self._weights @ (ventricular, actuation))[:, None, None]
        # eps_012 = 1, eps_021 = -1, eps_120 = 1
        return (skew[..., ::-1] * (1.0, -1.0, 1.0)).ravel()


def _entries(
    nodes: np.ndarray, free: np.ndarray, sign: np.ndarray, pairs: tuple[tuple[int, int], ...]
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Where the entries of element blocks (m, k, p, k) go in the upper triangle: rows, columns, factors, flat sources.

    Of a block on the diagonal only one triangle is taken, of the others all; an off-diagonal entry that constraints bring
    onto the diagonal stands for its mirror image too.
    """
    count, per = nodes.shape
    shape = (count, per, len(pairs), per)
    sources = np.arange(np.prod(shape)).reshape(shape)
    rows, columns, values, taken = [], [], [], []
    upper = np.triu(np.ones((per, per), bool))
    for k, (i, j) in enumerate(pairs):
        a = np.broadcast_to((3 * nodes + i)[:, :, None], (count, per, per))
        b = np.broadcast_to((3 * nodes + j)[:, None, :], (count, per, per))
        keep = (free[a] >= 0) & (free[b] >= 0)
        if i == j:
            keep &= upper
        a, b = a[keep], b[keep]
        twice = np.where((a != b) & (free[a] == free[b]), 2.0, 1.0)
        rows.append(np.minimum(free[a], free[b]))
        columns.append(np.maximum(free[a], free[b]))
        values.append(sign[a] * sign[b] * twice)
        taken.append(sources[:, :, k][keep])
    return tuple(np.concatenate(x) for x in (rows, columns, values, taken))
