"""From a flat pattern to second-order quadrilaterals of the right half of one face, by gmsh.

Mirroring, stacking the layers and sealing them copy its nodes exactly (``layers``). So the mesh is as symmetric as the device,
and the same input gives the same bytes.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np

from limo.errors import MeshError
from limo.geometry.pattern import FlatPattern
from limo.mesh.elements import QUAD8_MIRROR, gauss, quad8_shape


@dataclass(frozen=True)
class FlatMesh:
    """Quadrilaterals of the right half of one face: ``nodes`` (n, 2) mm, ``quads`` (m, 8), ``region`` (m,) index.

    The masks (n,) say which nodes lie on the valve edge, the outer edge, seams, and the axis.
    """

    nodes: np.ndarray
    quads: np.ndarray
    region: np.ndarray
    on_valve: np.ndarray
    on_outer: np.ndarray
    on_seam: np.ndarray
    on_axis: np.ndarray


def mesh_pattern(pattern: FlatPattern, size: float, grading: float, strategy: tuple[int, int] = (8, 0)) -> FlatMesh:
    """All-quadrilateral second-order mesh of a flat pattern.

    ``size`` is the edge length in mm away from seams and edges, ``grading`` times that on them; ``strategy`` is gmsh's
    algorithm (8 frontal for quadrilaterals, 6 frontal Delaunay, 5 Delaunay) and recombination (0 simple, 1 blossom). A
    mesh of twice the size is recombined and every element split, which leaves quadrilaterals only. Raises ``MeshError``
    when gmsh fails; folded elements are the caller's to judge.
    """
    options = {
        "Mesh.MeshSizeExtendFromBoundary": 0,
        "Mesh.MeshSizeFromPoints": 0,
        "Mesh.MeshSizeFromCurvature": 0,
        "Mesh.Algorithm": strategy[0],
        "Mesh.RecombineAll": 1,
        "Mesh.RecombinationAlgorithm": strategy[1],
        "Mesh.SubdivisionAlgorithm": 1,
        "Mesh.SecondOrderIncomplete": 1,
        "Mesh.RandomSeed": 1,
    }
    with gmsh_model(f"N_p = {pattern.n_pouches} at size {size:.3g} mm", options) as model:
        model.add("pattern")
        return _run_gmsh(model, pattern, size, grading)


@contextmanager
def gmsh_model(what: str, options: Mapping[str, float]) -> Iterator[Any]:
    """The model of a session of gmsh of its own, quiet, on one thread. Raises ``MeshError`` about ``what`` where gmsh fails."""
    import gmsh

    gmsh.initialize(["-v", "0"], readConfigFiles=False, interruptible=False)
    try:
        for name, value in {"General.Terminal": 0, "General.NumThreads": 1, **options}.items():
            gmsh.option.setNumber(name, value)
        yield gmsh.model
    except Exception as error:
        if type(error) is not Exception:  # gmsh raises bare Exception; anything else is not its doing
            raise
        raise MeshError(f"gmsh could not mesh {what}: {error}") from error
    finally:
        gmsh.finalize()


def _run_gmsh(model, pattern: FlatPattern, size: float, grading: float) -> FlatMesh:
    """Curves and regions, sizes, quadrilaterals, and the mesh read back; ``model`` is gmsh's."""
    curves = _add_curves(model.geo, pattern)
    surfaces = [model.geo.addPlaneSurface([model.geo.addCurveLoop([d * curves[i] for i, d in r.loop])]) for r in pattern.regions]
    model.geo.synchronize()
    _set_sizes(model, pattern, curves, size, grading * size)
    model.mesh.generate(2)
    model.mesh.optimize("Laplace2D", niter=5)
    model.mesh.setOrder(2)
    return _read_back(model.mesh, pattern, curves, surfaces)


def _add_curves(geo, pattern: FlatPattern) -> list[int]:
    """gmsh's tags of the curves of a pattern, in its order; curves that meet share a point."""
    points: dict[tuple[float, float], int] = {}

    def point(xy: np.ndarray) -> int:
        key = (round(float(xy[0]), 6), round(float(xy[1]), 6))
        if key not in points:
            points[key] = geo.addPoint(*key, 0.0)
        return points[key]

    tags = []
    for curve in pattern.curves:
        ends = [point(curve.points[0]), point(curve.points[-1])]
        inner = [geo.addPoint(*xy, 0.0) for xy in curve.points[1:-1]]
        tags.append(geo.addLine(*ends) if _is_straight(curve.points) else geo.addSpline([ends[0], *inner, ends[1]]))
    return tags


def _is_straight(points: np.ndarray) -> bool:
    """Whether all pieces of a polyline (n, 2) have one direction."""
    steps = np.diff(points, axis=0)
    return len(np.unique(np.round(steps / np.linalg.norm(steps, axis=1)[:, None], 9), axis=0)) == 1


def _set_sizes(model, pattern: FlatPattern, curves: list[int], size: float, edge_size: float) -> None:
    """Divisions of every curve, and sizes that grow from ``edge_size`` on seams and edges to ``size`` away from them (mm).

    Lengths are doubled, because every element is split afterwards.
    """
    for tag, curve in zip(curves, pattern.curves, strict=True):
        target = size if curve.kind == "axis" else edge_size
        model.mesh.setTransfiniteCurve(tag, max(1, round(curve.length / (2 * target))) + 1)
    fine = [tag for tag, curve in zip(curves, pattern.curves, strict=True) if curve.kind != "axis"]
    field = model.mesh.field
    distance, threshold = field.add("Distance"), field.add("Threshold")
    field.setNumbers(distance, "CurvesList", fine)
    field.setNumber(distance, "Sampling", 200)
    sizes = {"SizeMin": 2 * edge_size, "SizeMax": 2 * size, "DistMin": edge_size, "DistMax": 4 * size}
    for key, value in {"InField": distance, **sizes}.items():
        field.setNumber(threshold, key, value)
    field.setAsBackgroundMesh(threshold)


def _read_back(mesh, pattern: FlatPattern, curves: list[int], surfaces: list[int]) -> FlatMesh:
    """The mesh from gmsh's nodes and elements. Raises ``MeshError`` for elements other than quadrilaterals."""
    node_tags, xyz, _ = mesh.getNodes()
    order = np.argsort(node_tags)
    node_tags, xyz = node_tags[order], xyz.reshape(-1, 3)[order]
    parts = []
    for surface, region in zip(surfaces, pattern.regions, strict=True):
        types, _, connectivity = mesh.getElements(2, surface)
        if list(types) != [16]:
            raise MeshError(f"gmsh left elements other than quadrilaterals in {region.name} (types {list(types)})")
        parts.append(np.searchsorted(node_tags, connectivity[0].reshape(-1, 8)))
    quads, region = np.vstack(parts), np.repeat(np.arange(len(parts)), [len(part) for part in parts])

    def lies_on(kind: str) -> np.ndarray:
        mask = np.zeros(len(node_tags), bool)
        for tag, curve in zip(curves, pattern.curves, strict=True):
            if curve.kind == kind:
                mask[np.searchsorted(node_tags, mesh.getNodes(1, tag, includeBoundary=True)[0])] = True
        return mask

    valve, outer, seam = lies_on("valve"), lies_on("outer"), lies_on("seam")
    axis = np.abs(xyz[:, 0]) < 1e-9 * pattern.length
    used, inverse = np.unique(quads, return_inverse=True)
    nodes = xyz[used, :2].copy()
    nodes[axis[used], 0] = 0.0
    nodes[valve[used], 1] = 0.0
    quads = _anticlockwise(nodes, inverse.reshape(quads.shape))
    return FlatMesh(nodes, quads, region, valve[used], outer[used], seam[used], axis[used])


def _anticlockwise(nodes: np.ndarray, quads: np.ndarray) -> np.ndarray:
    x, y = nodes[quads[:, :4], 0], nodes[quads[:, :4], 1]
    area = 0.5 * (x * np.roll(y, -1, 1) - y * np.roll(x, -1, 1)).sum(axis=1)
    quads = quads.copy()
    quads[area < 0] = quads[area < 0][:, QUAD8_MIRROR]
    return quads


def smallest_jacobian(nodes: np.ndarray, quads: np.ndarray) -> np.ndarray:
    """Smallest Jacobian determinant of each quadrilateral over 3 x 3 Gauss points and corners, over its mean (m,)."""
    local = np.vstack([gauss(3, 2)[0], [[-1, -1], [1, -1], [1, 1], [-1, 1]]])
    _, slope = quad8_shape(local)
    jacobian = np.einsum("gnk,enx->egxk", slope, nodes[quads][..., :2])
    determinant = jacobian[..., 0, 0] * jacobian[..., 1, 1] - jacobian[..., 0, 1] * jacobian[..., 1, 0]
    return determinant.min(axis=1) / np.abs(determinant).mean(axis=1)
