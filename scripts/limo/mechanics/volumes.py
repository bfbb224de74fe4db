"""Cavity volumes by the divergence theorem (paper, *Cavity volume calculation*).

V = 1/3 * integral of x . n dS over the closed surface. The planes that close a model (valve plane y = 0, symmetry planes
x = 0 and z = 0) pass through the origin and add nothing. So only the fabric is integrated, on its middle surface.
"""

from __future__ import annotations

import numpy as np

from limo.mesh.elements import QUAD8_TRIANGLES, gauss, quad8_shape
from limo.mesh.layers import DeviceMesh


def flux(points: np.ndarray, quads: np.ndarray) -> np.ndarray:
    """1/3 integral of x . n dS of each curved quadrilateral (m,) in mm^3, from node positions (n, 3) in mm.

    The integrand is a polynomial of degree 5 in each local coordinate, so 3 x 3 Gauss points are exact.
    """
    local, weights = gauss(3, 2)
    values, slopes = quad8_shape(local)
    corner = points[quads]  # (m, 8, 3)
    x = np.einsum("gn,mnk->mgk", values, corner)
    tangents = np.einsum("gnd,mnk->mgdk", slopes, corner)
    normal = np.cross(tangents[:, :, 0], tangents[:, :, 1])
    return np.einsum("mgk,mgk,g->m", x, normal, weights) / 3.0


def flux_triangles(points: np.ndarray, quads: np.ndarray) -> np.ndarray:
    """The same with the paper's method: flat triangles and one integration point each; second order in the size."""
    corner = points[quads[:, QUAD8_TRIANGLES]]  # (m, 6, 3, 3)
    a, b, c = corner[:, :, 0], corner[:, :, 1], corner[:, :, 2]
    return (np.cross(b - a, c - a) * (a + b + c)).sum(axis=(1, 2)) / 18.0


def volumes(mesh: DeviceMesh, points: np.ndarray, method=flux) -> tuple[float, float]:
    """Ventricle and total actuation volume (V_v, V_a) of the full device in mm^3, from middle-surface points (n, 3).

    V_v is enclosed by walls and endocardium; V_a lies between endocardium and epicardium. All normals are +z in the flat
    state, so they point out of the ventricle on the front and into it on the back.
    """
    signed = method(points, mesh.quads) * np.where(mesh.face == 0, 1.0, -1.0)
    ventricle = signed[mesh.layer <= 1].sum()
    actuation = signed[mesh.layer == 2].sum() - signed[mesh.layer == 1].sum()
    return mesh.copies * float(ventricle), mesh.copies * float(actuation)
