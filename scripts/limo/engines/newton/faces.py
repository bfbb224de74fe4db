"""Loaded faces of a layer: follower pressure, and what it adds to the tangent. Units: mm, N, MPa; pressures in kPa."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from limo.engines.newton import face_kernels
from limo.engines.newton.entries import entries_of
from limo.engines.newton.kernels import PAIRS
from limo.engines.newton.unknowns import Unknowns
from limo.mechanics.model import KPA, Model, Pressure
from limo.mesh.elements import gauss, quad8_shape


class Faces:
    """The loaded faces of a model, with as many integration points a direction as its bricks.

    ``nodes_of`` gives the nodes (f, 8) of a pressure's faces, ``rest`` (n, 3) in mm where nodes lie at first, ``count`` how many
    forces there are. ``nodes`` (f, 8): of all faces.
    """

    def __init__(self, model: Model, nodes_of: Callable[[Pressure], np.ndarray], rest: np.ndarray, count: int):
        self._count, self._rest = count, rest
        nodes, weights = [np.empty((0, 8), int)], [np.empty((0, 2))]
        for load in model.pressures:
            sign = 1.0 if load.side == "bottom" else -1.0
            nodes.append(nodes_of(load))
            weights.append(np.tile([sign * KPA * load.ventricular, sign * KPA * load.actuation], (len(load.quads), 1)))
        self.nodes = np.ascontiguousarray(np.vstack(nodes), np.int32)
        self._weights = np.vstack(weights)
        local, rule = gauss(model.element.gauss_points, 2)
        values, slopes = quad8_shape(local)
        self._values = np.ascontiguousarray((values * rule[:, None]).T)  # (8, g)
        self._slopes = np.ascontiguousarray(np.vstack([slopes[:, :, 0], slopes[:, :, 1]]))  # (2 g, 8)
        # (N_n dN_m - N_m dN_n) / 2 of each pair of nodes n < m at the points, weighted: what multiplies x_,1, and x_,2
        first, second = self._pair = np.triu_indices(8, 1)
        turned = [values[:, first] * d[:, second] - values[:, second] * d[:, first] for d in (slopes[:, :, 1], slopes[:, :, 0])]
        both = np.hstack([(rule[:, None] * turned[0]).T, -(rule[:, None] * turned[1]).T])
        self._turned = np.ascontiguousarray(0.5 * both)  # (28, 2 g)

    def entries(self, unknowns: Unknowns) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """As ``entries_of``, into what ``tangent`` gives: a pair's blocks are skew, and so is the pair.

        A node counts in the one or two slots that its displacement is made of.
        """
        slots, shares = unknowns.slots_of(self.nodes)
        keys, factors, sources = entries_of(slots, unknowns, PAIRS[3:], shares)
        face, n, part, m = np.unravel_index(sources, (len(self.nodes), slots.shape[1], 3, slots.shape[1]))
        n, m = n % 8, m % 8
        pair = np.zeros((8, 8), int)
        pair[self._pair] = np.arange(len(self._pair[0]))
        source = (face * len(self._pair[0]) + pair[np.minimum(n, m), np.maximum(n, m)]) * 3 + part
        apart = n != m
        return keys[apart], (factors * np.sign(m - n))[apart], source[apart]

    def _loaded(self, u: np.ndarray, ventricular: float, actuation: float) -> tuple[np.ndarray, np.ndarray]:
        """Places (n, 3) of the nodes, and the pressure (f,) on each face in MPa."""
        return self._rest + u[: len(self._rest)], self._weights @ (ventricular, actuation)

    def forces(self, u: np.ndarray, ventricular: float, actuation: float) -> np.ndarray:
        """f_p (n, 3) in N: int N p (x_,1 x x_,2) dxi, pushing into the face, at displacements (n, 3) in mm."""
        places, pressure = self._loaded(u, ventricular, actuation)
        total = np.zeros((self._count, 3))
        face_kernels.forces(places, self.nodes, self._values, self._slopes, pressure, total)
        return total

    def tangent(self, u: np.ndarray, ventricular: float, actuation: float) -> np.ndarray:
        """The symmetric part of -df_p/du, flat (f, 28, 3): pairs of nodes n < m and directions (0, 1), (0, 2), (1, 2).

        -df_p,ni / du_mj = -p eps_ijk A^k_nm with A^k_nm = int N_n (dN_m/dxi_1 x_,2 - dN_m/dxi_2 x_,1)_k dxi.
        """
        places, pressure = self._loaded(u, ventricular, actuation)
        found = np.empty((len(self.nodes), len(self._turned), 3))
        face_kernels.tangents(places, self.nodes, self._turned, self._slopes, pressure, found)
        return found.ravel()
