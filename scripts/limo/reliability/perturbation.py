"""The same device on other meshes: jittered, renumbered, mirrored, rotated. What is solved on them must agree."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from limo.mechanics.model import Model
from limo.mesh.elements import QUAD8_MIRROR
from limo.mesh.flat import smallest_jacobian
from limo.mesh.layers import DeviceMesh

#: share of the smallest Jacobian of an element that moved corners leave it
KEPT = 0.5
MASKS = ("on_valve", "on_outer", "on_seam", "on_axis")


def jittered(mesh: DeviceMesh, seed: int, share: float) -> DeviceMesh:
    """Corners inside of layers moved in their plane by up to ``share`` of the shortest edge there; mid-sides follow.

    Those of an element that would keep less than ``KEPT`` of its smallest Jacobian stay where they are.
    """
    corners = mesh.quads[:, :4]
    edges = np.linalg.norm(mesh.nodes[corners] - mesh.nodes[np.roll(corners, -1, axis=1)], axis=2)
    shortest = np.full(len(mesh.nodes), np.inf)
    np.minimum.at(shortest, corners, np.minimum(edges, np.roll(edges, 1, axis=1)))
    fixed = np.any([getattr(mesh, mask) for mask in MASKS], axis=0) | (np.abs(mesh.nodes[:, 0]) < 1e-9)
    reach = np.where(fixed | ~mesh.is_corner, 0.0, share * np.where(np.isfinite(shortest), shortest, 0.0))
    ways = np.random.default_rng(seed).uniform(-1.0, 1.0, (len(mesh.nodes), 3)) * [1.0, 1.0, 0.0] / np.sqrt(2.0)
    before = smallest_jacobian(mesh.nodes, mesh.quads)
    while True:
        moved = ways * reach[:, None]
        sides = 0.5 * (moved[corners] + moved[np.roll(corners, -1, axis=1)])
        moved[mesh.quads[:, 4:]] = np.where(fixed[mesh.quads[:, 4:], None], 0.0, sides)
        crushed = smallest_jacobian(mesh.nodes + moved, mesh.quads) < KEPT * before
        crushed &= (reach[corners] > 0.0).any(axis=1)
        if not crushed.any():
            return replace(mesh, nodes=mesh.nodes + moved)
        reach[corners[crushed]] = 0.0


def renumbered(mesh: DeviceMesh, seed: int) -> DeviceMesh:
    """Nodes and elements in a random order."""
    rng = np.random.default_rng(seed)
    nodes, quads = rng.permutation(len(mesh.nodes)), rng.permutation(len(mesh.quads))
    new = np.argsort(nodes)
    return replace(
        mesh,
        nodes=mesh.nodes[nodes],
        quads=new[mesh.quads[quads]],
        **{name: getattr(mesh, name)[quads] for name in ("layer", "face", "pouch")},
        **{name: getattr(mesh, name)[nodes] for name in MASKS},
    )


def mirrored(mesh: DeviceMesh) -> DeviceMesh:
    """The mesh with x and -x exchanged."""
    return replace(mesh, nodes=mesh.nodes * [-1.0, 1.0, 1.0], quads=mesh.quads[:, QUAD8_MIRROR])


def rotated(model: Model, rotation: np.ndarray) -> Model:
    """A full model turned about the origin by a matrix (3, 3), with what is prescribed. Raises ``ValueError`` for a part."""
    if model.mesh.symmetry != "full" or model.fixed:
        raise ValueError("only the full device can be turned: the planes of a part do not turn with it")
    nodes = sorted({n for n, _ in model.prescribed})
    prescribed = {}
    for n in nodes:
        turned = rotation @ [model.prescribed[n, d] for d in range(3)]
        prescribed |= {(n, d): float(turned[d]) for d in range(3)}
    return replace(
        model,
        mesh=replace(model.mesh, nodes=model.mesh.nodes @ rotation.T),
        expansion=replace(model.expansion, nodes=model.expansion.nodes @ rotation.T),
        nodes=model.nodes @ rotation.T,
        prescribed=prescribed,
    )
