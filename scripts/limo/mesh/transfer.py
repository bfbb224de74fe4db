"""From a mesh of a device to another mesh of the same flat pattern: where its nodes lie among the elements of the other."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array

from limo.errors import ResultError
from limo.mesh.elements import quad8_shape
from limo.mesh.layers import DeviceMesh

#: elements around a node that are looked at, iterations of the place in one of them, and how far beyond it they may go
NEAR, ITERATIONS, BEYOND = 12, 12, 1.8
#: how far outside of its element, in local coordinates, a node may be found: curved edges are cut by chords of other lengths
OUTSIDE = 0.5


def interpolation(source: DeviceMesh, target: DeviceMesh) -> csr_array:
    """Matrix (n_target, n_source) that carries values at the nodes of one mesh to those of another by shape functions.

    Nodes are looked up in the flat state, layer by layer and pouch by pouch, so that layers that lie on each other stay apart.
    Exact for what is linear in the flat coordinates. Raises ``ResultError`` where the meshes are not of the same pattern.
    """
    parts = [np.stack([mesh.layer, mesh.face, mesh.pouch], axis=1) for mesh in (source, target)]
    owner = np.empty(len(target.nodes), int)
    owner[target.quads] = np.arange(len(target.quads))[:, None]
    nodes, weights = np.zeros((len(target.nodes), 8), int), np.zeros((len(target.nodes), 8))
    for part in np.unique(parts[1], axis=0):
        mine = np.flatnonzero((parts[1][owner] == part).all(axis=1))
        theirs = source.quads[(parts[0] == part).all(axis=1)]
        if not len(theirs):
            raise ResultError(f"a mesh without layer, face and pouch {part.tolist()}: it is of another pattern")
        nodes[mine], weights[mine], outside = _looked_up(target.nodes[mine, :2], source.nodes[theirs][..., :2], theirs)
        if outside > OUTSIDE:
            raise ResultError(f"a node lies {outside:.2g} of an element outside of the other mesh: it is of another pattern")
    rows = np.repeat(np.arange(len(nodes)), 8)
    return csr_array((weights.ravel(), (rows, nodes.ravel())), shape=(len(nodes), len(source.nodes)))


def _looked_up(points: np.ndarray, corners: np.ndarray, quads: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """Nodes (p, 8) and weights (p, 8) of points (p, 2) in the best of ``quads`` (k, 8) at ``corners`` (k, 8, 2), and how far the
    worst of them lies outside of its own, in local coordinates."""
    from scipy.spatial import cKDTree  # takes a tenth of a second, and most solves begin on no other mesh

    _, near = cKDTree(corners.mean(axis=1)).query(points, k=min(NEAR, len(quads)))
    near = near.reshape(len(points), -1)
    best, nodes, weights = np.full(len(points), np.inf), np.zeros((len(points), 8), int), np.zeros((len(points), 8))
    for candidate in near.T:
        values, outside = _located(points, corners[candidate])
        better = outside < best
        best[better], nodes[better], weights[better] = outside[better], quads[candidate[better]], values[better]
    return nodes, weights, float(best.max(initial=0.0))


def _located(points: np.ndarray, corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Shape functions (p, 8) at the places of points (p, 2) in elements with nodes at ``corners`` (p, 8, 2), by Newton's method,
    and how far outside of them these are, in local coordinates; infinite where there is no such place."""
    local = np.zeros((len(points), 2))
    for _ in range(ITERATIONS):
        values, slopes = quad8_shape(local)
        missing = points - np.einsum("pn,pnd->pd", values, corners)
        jacobian = np.einsum("pna,pnd->pda", slopes, corners)
        with np.errstate(all="ignore"):
            local = np.clip(local + np.linalg.solve(jacobian, missing[..., None])[..., 0], -BEYOND, BEYOND)
    values, _ = quad8_shape(local)
    missing = np.linalg.norm(points - np.einsum("pn,pnd->pd", values, corners), axis=1)
    size = np.linalg.norm(corners[:, 0] - corners[:, 2], axis=1)
    outside = np.maximum(np.abs(local).max(axis=1) - 1, 0.0) + missing / size
    return values, np.where(np.isfinite(outside), outside, np.inf)
