"""A flat mesh becomes a layered, sealed device with named surfaces and edges."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from limo.geometry.pattern import FlatPattern
from limo.mesh.elements import QUAD8_MIRROR
from limo.mesh.flat import FlatMesh

LAYERS = ("wall", "endo", "epi")


FACES = ("front", "back")


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


def degrees_of_freedom_of(mesh: DeviceMesh) -> int:
    """Displacements of the written-out bricks: three a corner node's triple and a mid-side node's pair."""
    corners = int(mesh.is_corner.sum())
    return 3 * (3 * corners + 2 * (len(mesh.nodes) - corners))


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

    def copy(nodes_of: np.ndarray, shared: np.ndarray, source: np.ndarray) -> np.ndarray:
        """New nodes for those that the quads ``of`` use and do not share; returns the map from old to new."""
        nonlocal count
        new = np.setdiff1d(np.unique(nodes_of), np.flatnonzero(shared))
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
