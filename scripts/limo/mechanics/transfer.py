"""A state of a layer of fabric on another mesh of the same flat pattern."""

from __future__ import annotations

import numpy as np

from limo.mechanics.model import Model, layer_thickness
from limo.mesh.transfer import interpolation


def carried(source: Model, displacements: np.ndarray, target: Model) -> np.ndarray:
    """Displacements (n, 3) in mm of the nodes of ``target`` from those of ``source``: its middle surface, and its directors.

    Both are interpolated by shape functions over the flat pattern, directors of bricks with the length that the thickness of
    the layer gives them. (At an edge whose nodes are held in the plane, they can be short, or point the other way: with half
    the thickness for their length bricks were inside out there.) Directors of shells have half the thickness for their length.
    Reference nodes of ``target`` have no displacement. Raises ``ResultError`` where the meshes are not of the same pattern.
    """
    there, here = source.expansion, target.expansion
    matrix = interpolation(source.mesh, target.mesh)
    before, half = (0.5 * np.broadcast_to(layer_thickness(m.mesh, m.fabric), len(m.mesh.nodes)) for m in (source, target))
    flat_before, flat = (np.multiply.outer(each, [0.0, 0.0, 1.0]) for each in (before, half))
    middle = matrix @ (0.5 * (displacements[there.bottom] + displacements[there.top]))
    directors = matrix @ (0.5 * (displacements[there.top] - displacements[there.bottom]) + flat_before)
    if target.element.plane_stress:
        directors *= (half / np.maximum(np.linalg.norm(directors, axis=1), np.finfo(float).tiny))[:, None]
    found, corner = np.zeros((len(here.nodes), 3)), here.middle >= 0
    found[here.bottom], found[here.top] = middle - (directors - flat), middle + (directors - flat)
    found[here.middle[corner]] = middle[corner]
    return found
