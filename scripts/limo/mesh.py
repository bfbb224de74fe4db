"""From a flat pattern to the layered, sealed device as second-order quadrilaterals.

gmsh meshes the right half of one face; mirroring, stacking the layers and sealing them are exact copies of its nodes,
so that the mesh is as symmetric as the device and the same input gives the same bytes.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import meshio
import numpy as np

from limo.config import MeshLevel, Pattern
from limo.elements import QUAD8_MIRROR, gauss, quad8_shape
from limo.errors import MeshError, ResultError
from limo.geometry import FlatPattern, flat_pattern

GOOD_SHAPE = 0.30  # smallest Jacobian over its mean within an element
GOOD_COUNT = 0.06  # miss of the wanted degrees of freedom that is accepted
SIZE_CHANGES = tuple(1.0 + 0.015 * k * s for k in range(14) for s in ((1, -1) if k else (1,)))  # nearest first
SMALLER = (0.7, 0.5, 0.35)  # when seams are too close for elements of the wanted size
STRATEGIES = ((8, 0), (6, 0), (8, 1), (5, 0))
LAYERS = ("wall", "endo", "epi")
FACES = ("front", "back")


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


@dataclass(frozen=True)
class DeviceMesh:
    """The layered device in its flat state, all normals along +z.

    ``nodes`` (n, 3) mm, all at z = 0; ``quads`` (m, 8); ``layer``, ``face``, ``pouch`` (m,): indices into ``LAYERS`` and
    ``FACES``, and the pouch from 0 to N_p - 1 (front from -x to +x, then back likewise) or -1 on walls.
    The masks (n,) mark the valve edge, the sealed outer edge, the seams, and the plane x = 0 of a quarter model.
    ``symmetry`` is ``full``, ``front_back`` or ``quarter``.
    """

    nodes: np.ndarray
    quads: np.ndarray
    layer: np.ndarray
    face: np.ndarray
    pouch: np.ndarray
    on_valve: np.ndarray
    on_outer: np.ndarray
    on_seam: np.ndarray
    on_axis: np.ndarray
    symmetry: str

    @property
    def copies(self) -> int:
        """How many times the model fits into the full device."""
        return {"full": 1, "front_back": 2, "quarter": 4}[self.symmetry]

    @property
    def surfaces(self) -> dict[str, np.ndarray]:
        """Indices of the quadrilaterals of every named surface, such as ``wall_front``, ``epi_back``, ``pouch3_endo``."""
        named = {}
        for f, face in enumerate(FACES):
            for k, layer in enumerate(LAYERS):
                named[f"{layer}_{face}"] = np.flatnonzero((self.layer == k) & (self.face == f))
        for pouch in np.unique(self.pouch[self.pouch >= 0]):
            for k, layer in ((1, "endo"), (2, "epi")):
                named[f"pouch{pouch}_{layer}"] = np.flatnonzero((self.layer == k) & (self.pouch == pouch))
        return {name: index for name, index in named.items() if len(index)}

    @property
    def is_corner(self) -> np.ndarray:
        """Mask (n,) of the nodes at corners of quadrilaterals (the others are mid-side nodes)."""
        mask = np.zeros(len(self.nodes), bool)
        mask[self.quads[:, :4]] = True
        return mask


# --------------------------------------------------------------------------------------------------------------------
# gmsh


def mesh_pattern(pattern: FlatPattern, size: float, grading: float, strategy: tuple[int, int] = (8, 0)) -> FlatMesh:
    """All-quadrilateral second-order mesh of a flat pattern.

    ``size`` is the edge length in mm away from seams and edges, ``grading`` times that on them; ``strategy`` is gmsh's
    algorithm (8 frontal for quadrilaterals, 6 frontal Delaunay, 5 Delaunay) and recombination (0 simple, 1 blossom). A
    mesh of twice the size is recombined and every element split, which leaves quadrilaterals only. Raises ``MeshError``
    when gmsh fails; folded elements are the caller's to judge.
    """
    import gmsh

    gmsh.initialize(["-v", "0"], readConfigFiles=False, interruptible=False)
    try:
        options = {
            "General.Terminal": 0,
            "General.NumThreads": 1,
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
        for name, value in options.items():
            gmsh.option.setNumber(name, value)
        gmsh.model.add("pattern")
        return _run_gmsh(gmsh.model, pattern, size, grading)
    except MeshError:
        raise
    except Exception as error:
        if type(error) is not Exception:  # gmsh raises bare Exception; anything else is not its doing
            raise
        raise MeshError(f"gmsh could not mesh N_p = {pattern.n_pouches} at size {size:.3g} mm: {error}") from error
    finally:
        gmsh.finalize()


def _run_gmsh(model, pattern: FlatPattern, size: float, grading: float) -> FlatMesh:
    geo = model.geo
    points: dict[tuple[float, float], int] = {}

    def point(xy: np.ndarray) -> int:
        key = (round(float(xy[0]), 6), round(float(xy[1]), 6))
        if key not in points:
            points[key] = geo.addPoint(*key, 0.0)
        return points[key]

    edge_size = grading * size
    tags = []
    for curve in pattern.curves:
        ends = [point(curve.points[0]), point(curve.points[-1])]
        inner = [geo.addPoint(*xy, 0.0) for xy in curve.points[1:-1]]
        straight = (
            len(
                np.unique(
                    np.round(np.diff(curve.points, axis=0) / np.linalg.norm(np.diff(curve.points, axis=0), axis=1)[:, None], 9),
                    axis=0,
                )
            )
            == 1
        )
        tags.append(geo.addLine(*ends) if straight else geo.addSpline([ends[0], *inner, ends[1]]))
    surfaces = []
    for region in pattern.regions:
        loop = geo.addCurveLoop([d * tags[i] for i, d in region.loop])
        surfaces.append(geo.addPlaneSurface([loop]))
    geo.synchronize()
    for tag, curve in zip(tags, pattern.curves, strict=True):
        target = size if curve.kind == "axis" else edge_size
        divisions = max(1, round(curve.length / (2 * target)))
        model.mesh.setTransfiniteCurve(tag, divisions + 1)
    fine = [t for t, c in zip(tags, pattern.curves, strict=True) if c.kind != "axis"]
    field = model.mesh.field
    distance, threshold = field.add("Distance"), field.add("Threshold")
    field.setNumbers(distance, "CurvesList", fine)
    field.setNumber(distance, "Sampling", 200)
    for key, value in {
        "InField": distance,
        "SizeMin": 2 * edge_size,
        "SizeMax": 2 * size,
        "DistMin": edge_size,
        "DistMax": 4 * size,
    }.items():
        field.setNumber(threshold, key, value)
    field.setAsBackgroundMesh(threshold)
    model.mesh.generate(2)
    model.mesh.optimize("Laplace2D", niter=5)
    model.mesh.setOrder(2)

    node_tags, xyz, _ = model.mesh.getNodes()
    order = np.argsort(node_tags)
    node_tags, xyz = node_tags[order], xyz.reshape(-1, 3)[order]
    quads, region = [], []
    for k, surface in enumerate(surfaces):
        types, _, connectivity = model.mesh.getElements(2, surface)
        if list(types) != [16]:
            raise MeshError(f"gmsh left elements other than quadrilaterals in {pattern.regions[k].name} (types {list(types)})")
        quads.append(np.searchsorted(node_tags, connectivity[0].reshape(-1, 8)))
        region.append(np.full(len(quads[-1]), k))
    quads, region = np.vstack(quads), np.concatenate(region)

    def on(kind: str) -> np.ndarray:
        mask = np.zeros(len(node_tags), bool)
        for tag, curve in zip(tags, pattern.curves, strict=True):
            if curve.kind == kind:
                found, _, _ = model.mesh.getNodes(1, tag, includeBoundary=True)
                mask[np.searchsorted(node_tags, found)] = True
        return mask

    valve, outer, seam = on("valve"), on("outer"), on("seam")
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


def mesh_to_target(pattern: FlatPattern, degrees_of_freedom: int, grading: float) -> FlatMesh:
    """A well-shaped mesh, four quarters of which have about the wanted number of degrees of freedom (within 6 %).

    Where seams lie closer together than elements of that size would, it gets finer than asked for.

    The size follows from the area, then from the counts of three trials; among a fixed list of changes of size and of
    gmsh's strategies the first mesh is taken whose count and worst element are good enough, else the best of them.
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


def degrees_of_freedom_of(mesh: DeviceMesh) -> int:
    """Displacements of the written-out bricks: three a corner node's triple and a mid-side node's pair."""
    corners = int(mesh.is_corner.sum())
    return 3 * (3 * corners + 2 * (len(mesh.nodes) - corners))


# --------------------------------------------------------------------------------------------------------------------
# layers and symmetry


def layered(flat: FlatMesh, pattern: FlatPattern, symmetry: str) -> DeviceMesh:
    """Stack and seal the layers: epi shares the seam nodes of endo, front and back share the outer edge.

    Nothing is shared at the valve edge except its two ends, which lie on the outer edge.
    """
    per_face, n_right = pattern.n_pouches // 2, len(pattern.regions) - 1
    nodes, quads, layer, pouch = [flat.nodes], [flat.quads], [], []
    right = np.array([r.pouch for r in pattern.regions])[flat.region]
    layer.append(np.where(right < 0, 0, 1))
    pouch.append(np.where(right < 0, -1, right + per_face - n_right))
    masks = {"on_valve": [flat.on_valve], "on_outer": [flat.on_outer], "on_seam": [flat.on_seam], "on_axis": [flat.on_axis]}
    count = len(flat.nodes)

    def copy(of: np.ndarray, shared: np.ndarray, source: np.ndarray) -> np.ndarray:
        """New nodes for those that the quads ``of`` use and do not share; returns the map from old to new."""
        nonlocal count
        new = np.setdiff1d(np.unique(of), np.flatnonzero(shared))
        mapping = np.arange(len(source))
        mapping[new] = count + np.arange(len(new))
        nodes.append(source[new])
        count += len(new)
        for values in masks.values():
            values.append(np.concatenate(values)[new])
        return mapping

    # epicardial layer over the pouches of the right half
    epi = flat.quads[right >= 0]
    quads.append(copy(epi, flat.on_seam, flat.nodes)[epi])
    layer.append(np.full(len(epi), 2))
    pouch.append(pouch[0][right >= 0])

    if symmetry != "quarter":  # left half: mirror in x, nodes on the axis are shared
        one, all_nodes = np.vstack(quads), np.vstack(nodes)
        axis = np.concatenate(masks["on_axis"])
        mirrored = all_nodes * [-1.0, 1.0]
        mapping = copy(one, axis, mirrored)
        quads.append(mapping[one][:, QUAD8_MIRROR])
        layer.append(np.concatenate(layer))
        p = np.concatenate(pouch)
        pouch.append(np.where(p < 0, -1, per_face - 1 - p))
    face = [np.zeros(sum(map(len, quads)), int)]
    if symmetry == "full":  # back: the same nodes again, the outer edge is shared
        one, all_nodes = np.vstack(quads), np.vstack(nodes)
        mapping = copy(one, np.concatenate(masks["on_outer"]), all_nodes)
        quads.append(mapping[one])
        layer.append(np.concatenate(layer))
        p = np.concatenate(pouch)
        pouch.append(np.where(p < 0, -1, p + per_face))
        face.append(np.ones(len(one), int))
    plane = np.vstack(nodes)
    flags = {k: np.concatenate(v) for k, v in masks.items()}
    if symmetry != "quarter":
        flags["on_axis"] = np.zeros(len(plane), bool)
    return DeviceMesh(
        np.column_stack([plane, np.zeros(len(plane))]),
        np.vstack(quads),
        np.concatenate(layer),
        np.concatenate(face),
        np.concatenate(pouch),
        symmetry=symmetry,
        **flags,
    )


def mesh_device(content: dict) -> DeviceMesh:
    """The mesh that ``Case.mesh_content`` describes: pattern, number of pouches, level and symmetry."""
    pattern = flat_pattern(Pattern.model_validate(content["pattern"]), content["n_pouches"])
    level = MeshLevel.model_validate(content["level"])
    flat = mesh_to_target(pattern, level.degrees_of_freedom, level.grading)
    return layered(flat, pattern, content["symmetry"])


# --------------------------------------------------------------------------------------------------------------------
# file

_MASKS = ("on_valve", "on_outer", "on_seam", "on_axis")


def write_mesh(mesh: DeviceMesh, path: Path) -> None:
    """Keep a mesh as VTU: quadrilaterals of 8 nodes, ``layer``/``face``/``pouch`` as cell data, masks as point data."""
    cells = {"layer": [mesh.layer], "face": [mesh.face], "pouch": [mesh.pouch]}
    cells |= {f"surface_{n}": [np.isin(np.arange(len(mesh.quads)), i).astype(np.int8)] for n, i in mesh.surfaces.items()}
    points = {k: getattr(mesh, k).astype(np.int8) for k in _MASKS}
    data = meshio.Mesh(mesh.nodes, [("quad8", mesh.quads)], point_data=points, cell_data=cells)
    meshio.write(path, data, file_format="vtu", binary=True)


def read_mesh(path: Path, symmetry: str) -> DeviceMesh:
    """Read what ``write_mesh`` wrote. Raises ``ResultError`` for anything else."""
    try:
        data = meshio.read(path)
        if [b.type for b in data.cells] != ["quad8"]:
            raise ResultError(f"{path}: not a device mesh (cells: {', '.join(b.type for b in data.cells)})")
        block, cells = data.cells[0], {k: v[0] for k, v in data.cell_data.items()}
        masks = {k: data.point_data[k].astype(bool) for k in _MASKS}
        return DeviceMesh(
            data.points, block.data.astype(np.int64), cells["layer"], cells["face"], cells["pouch"], symmetry=symmetry, **masks
        )
    except ResultError:
        raise
    except (Exception, SystemExit) as error:  # meshio leaves through sys.exit on some damage
        raise ResultError(f"{path}: not a device mesh ({error})") from error
