"""A state of a layer of fabric on another mesh of the same flat pattern."""

from __future__ import annotations

import numpy as np

from limo.mechanics.kinematics import deformation_gradient
from limo.mechanics.model import Model, layer_thickness
from limo.mesh.elements import QUAD8, gauss, quad8_shape
from limo.mesh.transfer import interpolation

#: share of its volume below which other directors are looked for at the nodes of an element
CRUSHED = 0.3


def carried(source: Model, displacements: np.ndarray, target: Model) -> np.ndarray:
    """Displacements (n, 3) in mm of the nodes of ``target`` from those of ``source``: its middle surface, and its directors.

    Both are interpolated by shape functions over the flat pattern; directors keep half the thickness for their length, so
    that the layer has its thickness at rest. Where that leaves bricks crushed or inside out, a node may have the normal of the
    middle surface, or its flat director, instead. Reference nodes of ``target`` have none. Raises ``ResultError`` where the
    meshes are not of the same pattern.
    """
    there = source.expansion
    matrix = interpolation(source.mesh, target.mesh)
    before, half = (0.5 * np.broadcast_to(layer_thickness(m.mesh, m.fabric), len(m.mesh.nodes)) for m in (source, target))
    flat_before = np.multiply.outer(before, [0.0, 0.0, 1.0])
    middle = matrix @ (0.5 * (displacements[there.bottom] + displacements[there.top]))
    directors = matrix @ (0.5 * (displacements[there.top] - displacements[there.bottom]) + flat_before)
    directors *= (half / np.maximum(np.linalg.norm(directors, axis=1), np.finfo(float).tiny))[:, None]
    if not target.element.plane_stress:
        _mend(target, middle, directors, half)
    return _placed(target, middle, directors, half)


def _placed(model: Model, middle: np.ndarray, directors: np.ndarray, half: np.ndarray) -> np.ndarray:
    """Displacements of bottom, middle and top nodes from those of the middle surface, directors and half the thickness."""
    here = model.expansion
    found, corner, turned = np.zeros((len(here.nodes), 3)), here.middle >= 0, directors.copy()
    turned[:, 2] -= half
    found[here.bottom], found[here.top] = middle - turned, middle + turned
    found[here.middle[corner]] = middle[corner]
    return found


def _mend(model: Model, middle: np.ndarray, directors: np.ndarray, half: np.ndarray) -> None:
    """Give nodes of crushed bricks, one after the other, that director with which the worst of their bricks is best off.

    An edge that is held in the plane z = 0 cannot turn. On a coarse mesh it can be thin, or inside out at a corner, while the
    points of its bricks are whole; and next to it, directors that are interpolated can lie in the surface.
    """
    local, bricks, quads = gauss(2, 3)[0], model.expansion.bricks, model.mesh.quads

    def worst(elements: np.ndarray | slice) -> np.ndarray:
        found = _placed(model, middle, directors, half)
        return np.linalg.det(deformation_gradient(model.expansion.nodes, bricks[elements], found, local)[0]).min(axis=1)

    nodes = np.unique(quads[worst(slice(None)) < CRUSHED])
    normals = half[:, None] * _normals(model, middle)
    for node in nodes:
        elements = np.flatnonzero((quads == node).any(axis=1))
        choices = directors[node].copy(), normals[node], np.array([0.0, 0.0, half[node]])
        shares = []
        for each in choices:
            directors[node] = each
            shares.append(worst(elements).min())
        directors[node] = choices[int(np.argmax(shares))]


def _normals(model: Model, middle: np.ndarray) -> np.ndarray:
    """Unit normals (n, 3) of the displaced middle surface at its nodes: of the sum of those of their elements."""
    quads, total = model.mesh.quads, np.zeros((len(middle), 3))
    tangents = np.einsum("gnd,mnk->dmgk", quad8_shape(QUAD8)[1], (model.mesh.nodes + middle)[quads])
    np.add.at(total, quads, _unit(np.cross(*tangents)))
    return _unit(total)


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), np.finfo(float).tiny)
