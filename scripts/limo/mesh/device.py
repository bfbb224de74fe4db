"""The mesh of a device at a mesh level: flat quadrilaterals of the right number, good shapes, layered and sealed."""

from __future__ import annotations

import numpy as np

from limo.errors import MeshError
from limo.geometry.pattern import FlatPattern, flat_pattern
from limo.mesh.flat import FlatMesh, mesh_pattern, smallest_jacobian
from limo.mesh.layers import DeviceMesh, degrees_of_freedom_of, layered
from limo.schema.device import Pattern
from limo.schema.numerics import MeshLevel

GOOD_SHAPE = 0.30  # smallest Jacobian over its mean within an element


GOOD_COUNT = 0.06  # miss of the wanted degrees of freedom that is accepted


SIZE_CHANGES = tuple(1.0 + 0.015 * k * s for k in range(14) for s in ((1, -1) if k else (1,)))  # nearest first


SMALLER = (0.7, 0.5, 0.35)  # when seams are too close for elements of the wanted size


STRATEGIES = ((8, 0), (6, 0), (8, 1), (5, 0))


def mesh_to_target(pattern: FlatPattern, degrees_of_freedom: int, grading: float) -> FlatMesh:
    """A well-shaped mesh, four quarters of which have about the wanted number of degrees of freedom (within 6 %).

    Where seams lie closer together than elements of that size would, it gets finer than asked for.

    The size follows from the area, then from the counts of three trials. A fixed list of changes of size and of gmsh's
    strategies is tried. The first mesh whose count and worst element are good enough is taken, else the best of them.
    Raises ``MeshError`` when every one of them has a folded element.
    """

    def count(mesh: FlatMesh) -> int:
        return degrees_of_freedom_of(layered(mesh, pattern, "quarter"))

    area = sum(pattern.polygon(r).area * (1 if r.pouch < 0 else 2) for r in pattern.regions)
    wanted = degrees_of_freedom / 4
    size = guess = np.sqrt(21.0 * area / wanted) / (0.5 + 0.5 * grading)
    for _ in range(3):  # a count that short curves hold up must not drive the size beyond all bounds
        size = min(size * np.sqrt(count(mesh_pattern(pattern, size, grading)) / wanted), 1.5 * guess)
    best, best_score = None, -np.inf
    for change in (*SIZE_CHANGES, *SMALLER):
        if change in SMALLER and best is not None:
            break
        for strategy in STRATEGIES:
            mesh = mesh_pattern(pattern, size * change, grading, strategy)
            shape = smallest_jacobian(mesh.nodes, mesh.quads).min()
            miss = abs(count(mesh) / wanted - 1)
            score = min(shape, GOOD_SHAPE) - max(miss - GOOD_COUNT, 0.0)
            if shape > 0 and score > best_score:
                best, best_score = mesh, score
            if best_score >= GOOD_SHAPE:
                return best
    if best is None:
        raise MeshError(
            f"gmsh folds elements at every size near {size:.3g} mm for N_p = {pattern.n_pouches}: "
            "a finer mesh level, or seams further apart, may help"
        )
    return best


def mesh_device(content: dict) -> DeviceMesh:
    """The mesh that ``Case.mesh_content`` describes: pattern, number of pouches, level and symmetry."""
    pattern = flat_pattern(Pattern.model_validate(content["pattern"]), content["n_pouches"])
    level = MeshLevel.model_validate(content["level"])
    flat = mesh_to_target(pattern, level.degrees_of_freedom, level.grading)
    return layered(flat, pattern, content["symmetry"])
