"""Shape functions, node orders and quadrature of the two elements: the 8-node quadrilateral and the 20-node brick.

Every table of nodes stands here and nowhere else. Orders are CalculiX's (and Abaqus'): corners first, then mid-sides.
"""

from __future__ import annotations

import numpy as np

# 8-node quadrilateral (S8, serendipity): corners anticlockwise, then the mid-sides 1-2, 2-3, 3-4, 4-1
QUAD8 = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [0, -1], [1, 0], [0, 1], [-1, 0]], float)
#: the same quadrilateral seen in a mirror, turned so that its normal is kept
QUAD8_MIRROR = np.array([1, 0, 3, 2, 4, 7, 6, 5])
#: six triangles on the nodes of a quadrilateral (corner triangles and the inner square halved)
QUAD8_TRIANGLES = np.array([[0, 4, 7], [4, 1, 5], [5, 2, 6], [7, 6, 3], [4, 5, 6], [4, 6, 7]])
#: two 6-node triangles (S6: corners anticlockwise, then mid-sides 1-2, 2-3, 3-1) on a quadrilateral and its centre, number 8
QUAD9_TRIANGLES = np.array([[0, 1, 2, 4, 5, 8], [0, 2, 3, 8, 6, 7]])

# 20-node brick (C3D20): bottom corners, top corners, bottom mid-sides, top mid-sides, verticals
HEX20 = np.array(
    [
        [-1, -1, -1],
        [1, -1, -1],
        [1, 1, -1],
        [-1, 1, -1],
        [-1, -1, 1],
        [1, -1, 1],
        [1, 1, 1],
        [-1, 1, 1],
        [0, -1, -1],
        [1, 0, -1],
        [0, 1, -1],
        [-1, 0, -1],
        [0, -1, 1],
        [1, 0, 1],
        [0, 1, 1],
        [-1, 0, 1],
        [-1, -1, 0],
        [1, -1, 0],
        [1, 1, 0],
        [-1, 1, 0],
    ],
    float,
)
#: nodes of a brick's bottom and top faces in the order of the quadrilateral they come from (both seen from above)
HEX20_BOTTOM = np.array([0, 1, 2, 3, 8, 9, 10, 11])
HEX20_TOP = np.array([4, 5, 6, 7, 12, 13, 14, 15])


def gauss(points: int, dimensions: int) -> tuple[np.ndarray, np.ndarray]:
    """Tensor Gauss-Legendre rule: local points (n, dimensions) and weights (n,), first coordinate fastest."""
    x, w = np.polynomial.legendre.leggauss(points)
    grids = np.meshgrid(*[x] * dimensions, indexing="ij")
    weights = np.meshgrid(*[w] * dimensions, indexing="ij")
    return (
        np.stack([g.ravel() for g in reversed(grids)], axis=1),
        np.prod([g.ravel() for g in weights], axis=0),
    )


def quad8_shape(local: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Values (n, 8) and local derivatives (n, 8, 2) of the quadrilateral at local points (n, 2)."""
    return _serendipity(local, QUAD8)


def hex20_shape(local: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Values (n, 20) and local derivatives (n, 20, 3) of the brick at local points (n, 3)."""
    return _serendipity(local, HEX20)


def _serendipity(local: np.ndarray, nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Quadratic serendipity functions on [-1, 1]^d.

    Corner: prod(1 + x_i a_i) (sum x_i a_i - (d - 1)) / 2^d; mid-side (a_k = 0): (1 - x_k^2) prod_{i != k}(1 + x_i a_i) / 2^(d-1).
    """
    x = np.asarray(local, float)[:, None, :]  # (n, 1, d)
    d = x.shape[2]
    factor = 1.0 + x * nodes  # (n, m, d)
    is_mid = nodes == 0  # (m, d)
    factor = np.where(is_mid, 1.0 - x**2, factor)
    slope = np.where(is_mid, -2.0 * x, nodes)
    corner = ~is_mid.any(axis=1)
    scale = np.where(corner, 0.5**d, 0.5 ** (d - 1))
    linear = np.where(corner, (x * nodes).sum(axis=2) - (d - 1), 1.0)  # (n, m)
    product = factor.prod(axis=2)
    values = scale * product * linear
    derivatives = np.empty(factor.shape)
    for k in range(d):
        others = np.delete(factor, k, axis=2).prod(axis=2)
        derivatives[:, :, k] = scale * (slope[:, :, k] * others * linear + product * np.where(corner, nodes[:, k], 0.0))
    return values, derivatives
