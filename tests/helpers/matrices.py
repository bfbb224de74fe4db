"""Tangents as whole matrices, and states and directions to test them at."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array, triu
from scipy.spatial import cKDTree

from limo.engines.newton.assembly import Assembly
from limo.engines.newton.tangent import Tangent
from tests.helpers.cases import shaken


def whole(tangent: Tangent, values: np.ndarray) -> csr_array:
    """Both triangles of a matrix on a tangent's pattern."""
    upper = csr_array((values, tangent.indices, tangent.indptr), shape=(tangent.size, tangent.size))
    return csr_array(upper + triu(upper, 1).T)


def stiffness(tangent: Tangent, u: np.ndarray, ventricular: float = 0.0, actuation: float = 0.0, shift: float = 0.0) -> csr_array:
    """Both triangles of a tangent at displacements (n, 3), pressures in kPa."""
    return whole(tangent, tangent.assemble(u, ventricular, actuation, shift))


def deformed(assembly: Assembly) -> np.ndarray:
    """Large smooth displacements with a little disorder that leave the edges where the constraints have them."""
    model, mesh = assembly.model, assembly.model.mesh
    edge = cKDTree(mesh.nodes[mesh.on_valve | mesh.on_outer])
    inward = 1 - np.exp(-((edge.query(model.nodes)[0] / 20) ** 2))
    u = shaken(model, 0.0) * inward[:, None]
    u += np.random.default_rng(9).uniform(-0.002, 0.002, u.shape)
    return assembly.expand(assembly.gather_free(u + assembly.prescribed))


def directions(assembly: Assembly, count: int = 3) -> np.ndarray:
    """Random free displacements (count, size)."""
    return np.random.default_rng(11).normal(size=(count, assembly.size))
