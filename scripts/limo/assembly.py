"""Forces and consistent tangent of the brick layer, assembled on the free displacements of a model.

    r(q) = T^T (f_p - f_int),   K = -dr/dq,   u = T q + lambda g

with f_int = int F S : Grad N dV_0 of a St. Venant-Kirchhoff layer (paper, Eq. stvenantkirchhoff), f_p the follower pressures
on the deformed faces, T the constraints, and lambda g the prescribed displacements. The tangent per node pair (n, m) is

    K_nm = sum_g w (dN_n/dX_K) A_iKjL (dN_m/dX_L),   A_iKjL = lambda F_iK F_jL + mu (b_ij delta_KL + F_iL F_jK) + delta_ij S_KL

with b = F F^T, plus that of the pressures. Follower pressure on a surface whose edges are held or meet others is
conservative, so K is symmetric. What single edges leave over (half a thickness of the rotating valve edge) is symmetrised, and
so is what remains inside with the 2 x 2 points that CalculiX gives the faces of C3D20R (with 3 x 3 points nothing does).
Units: mm, N, MPa, tonne, s.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csc_array

from limo.elements import HEX20_BOTTOM, HEX20_TOP, gauss, hex20_shape, quad8_shape
from limo.errors import ResultError
from limo.kinematics import lame
from limo.model import KPA, Model, reduction, scatter

#: the six blocks of a symmetric tangent by direction, (i, j) with i <= j
PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
#: elements whose tangents are formed together
CHUNK = 64
FIRST, SECOND = np.array(PAIRS).T


class Assembly:
    """A model's residual and tangent; everything that does not change is computed once.

    ``indptr``, ``indices``: pattern of the upper triangle of the tangent in rows; ``size`` free displacements.
    """

    def __init__(self, model: Model):
        self.model = model
        shell = model.expansion
        self.bricks = shell.bricks
        local, weights = gauss(model.gauss_points, 3)
        _, slopes = hex20_shape(local)
        jacobian = np.einsum("gnd,mnk->mgkd", slopes, shell.nodes[shell.bricks])
        count, points = len(shell.bricks), len(local)
        gradient = np.einsum("gnd,mgdk->mngk", slopes, np.linalg.inv(jacobian))  # dN_n / dX_k
        self._points = points
        self._gradient = np.ascontiguousarray(gradient.reshape(count, 20, 3 * points))
        self._gradient_t = np.ascontiguousarray(gradient.transpose(0, 2, 3, 1))  # (m, g, k, n)
        self._volume = np.linalg.det(jacobian) * weights
        self._lambda, self._mu = lame(model.youngs_modulus, model.case.device.material.poisson_ratio)
        self._faces = _Faces(model)
        self._blocks = np.empty((count, 20, 120))
        self._half = np.empty((min(count, CHUNK), points, 18, 20))
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
        """The pattern, and the sparse matrices that carry element matrices to its values."""
        faces = self._faces
        parts = [
            _entries(self.bricks, self._free, self._factor, PAIRS),
            _entries(faces.nodes, self._free, self._factor, PAIRS[3:]),
        ]
        rows = np.concatenate([p[0] for p in parts])
        columns = np.concatenate([p[1] for p in parts])
        key = rows * self.size + columns
        unique, inverse = np.unique(key, return_inverse=True)
        self.indices = (unique % self.size).astype(np.int32)
        self.indptr = np.searchsorted(unique // self.size, np.arange(self.size + 1)).astype(np.int32)
        split, start = len(parts[0][0]), 0
        self._gather = []
        for (_, _, values, sources, total), stop in zip(parts, (split, len(key)), strict=True):
            places = (inverse[start:stop].astype(np.int32), sources.astype(np.int32))
            # by columns: element matrices are read in order
            self._gather.append(csc_array((values, places), shape=(len(unique), total)))
            start = stop

    # --- forces and tangent -------------------------------------------------------------------------------------------

    def forces(self, u: np.ndarray, ventricular: float, actuation: float) -> tuple[np.ndarray, np.ndarray]:
        """f_int and f_p (n, 3) in N at displacements (n, 3) in mm and pressures in kPa."""
        _, piola = self._stresses(u)
        return self._internal(piola), self._faces.forces(u, ventricular, actuation)

    def tangent(self, u: np.ndarray, ventricular: float, actuation: float) -> np.ndarray:
        """Values of K on the pattern at displacements (n, 3) in mm and pressures in kPa."""
        deformation, _ = self._stresses(u)
        blocks = self._element_tangent(deformation)
        return self._gather[0] @ blocks.ravel() + self._gather[1] @ self._faces.tangent(u, ventricular, actuation).ravel()

    def drag(self, moved: np.ndarray) -> np.ndarray:
        """Internal forces (n, 3) that the last tangent gives to displacements ``moved`` (n, 3), prescribed ones included."""
        return _multiply(self._blocks.reshape(-1, 20, len(PAIRS), 20), self.bricks, moved)

    def volume_ratios(self, u: np.ndarray) -> np.ndarray:
        """det F (m, g) at the integration points; none positive means elements turned inside out."""
        return np.linalg.det(self._kinematics(u)[0])

    def smallest_volume(self, u: np.ndarray) -> float:
        """Smallest det F of all integration points."""
        return float(self.volume_ratios(u).min())

    def _kinematics(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """F and Grad u (m, g, 3, 3). The same array ``u`` again costs nothing, here and below."""
        if self._placed is None or self._placed[0] is not u:
            self._placed = u, *self._gradients(u)
        return self._placed[1:]

    def _gradients(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        moved = np.ascontiguousarray(u[self.bricks].transpose(0, 2, 1))  # (m, 3, 20)
        gradient = (moved @ self._gradient).reshape(len(moved), 3, self._points, 3).transpose(0, 2, 1, 3)
        return gradient + np.eye(3), gradient

    def _stresses(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """F (m, g, 3, 3) and J w P with P = F S; leaves J w S for the tangent."""
        if self._known is not None and self._known[0] is u:
            return self._known[1:]
        deformation, gradient = self._kinematics(u)
        # E from the displacement gradient: no difference of nearly equal numbers in thin layers
        strain = 0.5 * (gradient + np.swapaxes(gradient, -1, -2) + np.swapaxes(gradient, -1, -2) @ gradient)
        trace = np.trace(strain, axis1=-2, axis2=-1)
        stress = 2.0 * self._mu[:, None, None, None] * strain
        stress[..., [0, 1, 2], [0, 1, 2]] += (self._lambda[:, None] * trace)[..., None]
        self._stress = stress * self._volume[..., None, None]
        self._known = u, deformation, deformation @ self._stress
        return self._known[1:]

    def _internal(self, piola: np.ndarray) -> np.ndarray:
        count = len(piola)
        forces = self._gradient @ np.ascontiguousarray(piola.transpose(0, 1, 3, 2)).reshape(count, 3 * self._points, 3)
        return scatter(forces, self.bricks, len(self.model.nodes))

    def _element_tangent(self, deformation: np.ndarray) -> np.ndarray:
        """Blocks (m, 20, 6, 20) of the element tangents: node, pair of directions, node; overwritten by the next call.

        The order of axes lets two products of matrices do all the work: (K pair, L) (L, m) a point, (n, g K) (g K, pair m)
        an element. Some elements at a time, so that what lies between the products stays in the cache.
        """
        for start in range(0, len(deformation), CHUNK):
            part = slice(start, start + CHUNK)
            tensor = self._tensor(deformation[part], part)
            count, points = tensor.shape[:2]
            half = np.matmul(tensor.reshape(count, points, 18, 3), self._gradient_t[part], out=self._half[:count])
            np.matmul(self._gradient[part], half.reshape(count, 3 * points, 120), out=self._blocks[part])
        return self._blocks.reshape(-1, 20, len(PAIRS), 20)

    def _tensor(self, deformation: np.ndarray, part: slice) -> np.ndarray:
        """J w A_iKjL (m, g, K, pair, L) of some elements."""
        lam = (self._lambda[part, None] * self._volume[part])[..., None, None, None]
        mu = (self._mu[part, None] * self._volume[part])[..., None, None, None]
        one, other = deformation[:, :, FIRST], deformation[:, :, SECOND]  # (m, g, pair, 3)
        one_t, other_t = (np.swapaxes(x, -1, -2)[..., None] for x in (one, other))
        tensor = one_t * (lam * other[:, :, None])  # F_iK F_jL
        tensor += (mu * one[:, :, None]) * other_t  # F_iL F_jK
        left = mu[..., 0] * (one * other).sum(axis=-1)[:, :, None]  # mu b_ij
        for k in range(3):
            tensor[:, :, k, :, k] += left[:, :, 0]
        tensor[:, :, :, :3] += self._stress[part, :, :, None]
        return tensor

    def _assemble_mass(self) -> np.ndarray:
        """Values of the consistent mass on the tangent's pattern (3 x 3 x 3 points)."""
        shell = self.model.expansion
        local, weights = gauss(3, 3)
        shapes, slopes = hex20_shape(local)
        jacobian = np.einsum("gnd,mnk->mgkd", slopes, shell.nodes[shell.bricks])
        volume = np.linalg.det(jacobian) * weights
        element = self.model.density * np.einsum("gn,gp,mg->mnp", shapes, shapes, volume, optimize=True)
        blocks = np.zeros((len(element), 20, len(PAIRS), 20))
        blocks[:, :, :3] = element[:, :, None]
        return self._gather[0] @ blocks.ravel()


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
        local, self._rule = gauss(model.gauss_points, 2)
        self._values, slopes = quad8_shape(local)
        self._slopes = [np.ascontiguousarray(slopes[:, :, d]) for d in range(2)]
        self._rest = shell.nodes
        # N_n dN_m at the points, weighted, for both directions: (g, 64)
        self._pairs = [np.einsum("gn,gm,g->gnm", self._values, s, self._rule).reshape(len(local), 64) for s in self._slopes]

    def _tangents(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        place = (self._rest + u[: len(self._rest)])[self.nodes]
        return self._slopes[0] @ place, self._slopes[1] @ place

    def forces(self, u: np.ndarray, ventricular: float, actuation: float) -> np.ndarray:
        """f_p (n, 3): int N p (x_,1 x x_,2) dxi, pushing into the face."""
        first, second = self._tangents(u)
        normal = np.cross(first, second) * (self._weights @ (ventricular, actuation))[:, None, None]
        return scatter((self._values * self._rule[:, None]).T @ normal, self.nodes, self._count)

    def tangent(self, u: np.ndarray, ventricular: float, actuation: float) -> np.ndarray:
        """The symmetric part of -df_p/du: blocks (f, 8, 3, 8) of the directions (0, 1), (0, 2), (1, 2).

        -df_p,ni / du_mj = -p eps_ijk A^k_nm with A^k_nm = int N_n (dN_m/dxi_1 x_,2 - dN_m/dxi_2 x_,1)_k dxi.
        """
        pressure = self._weights @ (ventricular, actuation)
        first, second = self._tangents(u)
        turned = np.einsum("fgk,gp->fkp", second, self._pairs[0], optimize=True)
        turned -= np.einsum("fgk,gp->fkp", first, self._pairs[1], optimize=True)
        turned = turned.reshape(-1, 3, 8, 8)
        skew = 0.5 * (turned - np.swapaxes(turned, -1, -2)) * -pressure[:, None, None, None]
        # eps_012 = 1, eps_021 = -1, eps_120 = 1
        return np.stack([skew[:, 2], -skew[:, 1], skew[:, 0]], axis=2)


def _entries(
    nodes: np.ndarray, free: np.ndarray, sign: np.ndarray, pairs: tuple[tuple[int, int], ...]
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, int]:
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
    return (*(np.concatenate(x) for x in (rows, columns, values, taken)), sources.size)


def _multiply(blocks: np.ndarray, nodes: np.ndarray, moved: np.ndarray) -> np.ndarray:
    """Forces (n, 3) that element blocks (m, k, 6, k) give to displacements (n, 3)."""
    local = moved[nodes]
    forces = np.zeros_like(local)
    for k, (i, j) in enumerate(PAIRS):
        forces[..., i] += (blocks[:, :, k] @ local[..., j, None])[..., 0]
        if i != j:
            forces[..., j] += (np.swapaxes(blocks[:, :, k], -1, -2) @ local[..., i, None])[..., 0]
    return scatter(forces, nodes, len(moved))
