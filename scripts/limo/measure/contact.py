"""Where layers pass through each other: those that have no contact in the model do, and this says so.

Crossings are found on the middle surfaces, as triangles of one layer pierced by sides of triangles of the other. Endocardium and
epicardium are pairs that lie on each other in the flat state, so that the gap between them is known.
"""

from __future__ import annotations

import numpy as np
from shapely import STRtree, box

from limo.mechanics.contact import Touching, contact_of
from limo.mesh.elements import QUAD8_TRIANGLES
from limo.mesh.layers import LAYERS, DeviceMesh

#: measures of contact, in the order of their columns
CONTACTS = ("contact_front_back", "contact_endo_epi", "contact_outer")
_SIDES = np.array([[0, 1], [1, 2], [2, 0]])


def triangles(quads: np.ndarray) -> np.ndarray:
    """Six triangles (6 m, 3) on the nodes of each quadrilateral (m, 8)."""
    return quads[:, QUAD8_TRIANGLES].reshape(-1, 3)


def crossings(points: np.ndarray, first: np.ndarray, second: np.ndarray, apart: float = 0.0) -> np.ndarray:
    """Places (c, 3) in mm where surfaces of triangles ``first`` (a, 3) and ``second`` (b, 3) cross, on ``points`` (n, 3).

    A side of one pierces a triangle of the other. Triangles that share a node (a seam) are not compared. ``apart``: how far
    (mm) the first is moved up along z, away from the second, before they are compared.
    """
    up = np.array([0.0, 0.0, apart])
    return np.vstack([_pierced(points, first, second, up), _pierced(points, second, first, -up)])


def _pierced(points: np.ndarray, sides_of: np.ndarray, faces: np.ndarray, moved: np.ndarray) -> np.ndarray:
    if not len(sides_of) or not len(faces):
        return np.empty((0, 3))
    sides = np.unique(np.sort(sides_of[:, _SIDES].reshape(-1, 2), axis=1), axis=0)
    a, b = points[sides[:, 0]] + moved, points[sides[:, 1]] + moved
    corners = points[faces]
    low_s, high_s = np.minimum(a, b), np.maximum(a, b)
    low_f, high_f = corners.min(axis=1), corners.max(axis=1)
    tree = STRtree(box(low_f[:, 0], low_f[:, 1], high_f[:, 0], high_f[:, 1]))
    s, f = tree.query(box(low_s[:, 0], low_s[:, 1], high_s[:, 0], high_s[:, 1]))
    near = (low_s[s, 2] <= high_f[f, 2]) & (high_s[s, 2] >= low_f[f, 2])
    near &= ~(sides[s][:, :, None] == faces[f][:, None, :]).any(axis=(1, 2))
    s, f = s[near], f[near]
    origin, along = a[s], b[s] - a[s]
    p0 = corners[f, 0]
    e1, e2 = corners[f, 1] - p0, corners[f, 2] - p0
    h = np.cross(along, e2)
    determinant = (e1 * h).sum(axis=1)
    pierces = np.abs(determinant) > 1e-12  # a side within the plane of a triangle does not pierce it
    safe = np.where(pierces, determinant, 1.0)
    away = origin - p0
    u = (away * h).sum(axis=1) / safe
    q = np.cross(away, e1)
    v = (along * q).sum(axis=1) / safe
    t = (e2 * q).sum(axis=1) / safe
    hit = pierces & (u >= 0) & (v >= 0) & (u + v <= 1) & (t >= 0) & (t <= 1)
    return origin[hit] + t[hit, None] * along[hit]


def endo_through_epi(mesh: DeviceMesh, points: np.ndarray, thickness: float) -> np.ndarray:
    """Places (c, 3) where endocardium and epicardium have passed each other, from middle-surface positions (n, 3) in mm.

    By more than ``thickness`` (mm) along their common normal at integration points, as ``limo.mechanics.contact`` has it, where
    they face the same way: layers that touch come to a twentieth of that beyond each other, and in sharp creases further.
    """
    contact = contact_of(mesh, front_back=False, endo_epi=True, penalty=1.0, reach=thickness, span=thickness)
    if contact is None:
        return np.empty((0, 3))
    touching = Touching(contact, mesh.nodes)
    places = np.einsum("gn,mnk->mgk", touching.values, points[contact.lower])
    return places[touching.passed(points, thickness)[1]]


def front_through_back(mesh: DeviceMesh, points: np.ndarray, thickness: float) -> np.ndarray:
    """Places (c, 3) where the inner surfaces (wall and endocardium) of front and back cross, positions (n, 3) in mm.

    Each must be more than ``thickness`` (mm, the fabric's) beyond where they meet: in the creases beside the outer edge, which
    seals one to the other, single nodes come and go a fraction of that beyond it. In a model of the front alone they meet in
    the plane z = 0: the nodes beyond it.
    """
    inner = mesh.layer != LAYERS.index("epi")
    if mesh.symmetry == "full":
        front, back = (triangles(mesh.quads[inner & (mesh.face == f)]) for f in (0, 1))
        return crossings(points, front, back, apart=2 * thickness)
    nodes = np.unique(mesh.quads[inner])
    return points[nodes[points[nodes, 2] < -thickness]]


def outer_through_outer(mesh: DeviceMesh, points: np.ndarray, thickness: float) -> np.ndarray:
    """Places (c, 3) where outer surfaces cross: epicardia of two pouches, folds of the wall, or the wall and a pouch.

    In a part of the device its mirror images count, too: nodes more than ``thickness`` (mm) beyond the plane x = 0 of a quarter,
    and of the epicardium beyond z = 0. Positions (n, 3) in mm.
    """
    epi, pouch = mesh.layer == LAYERS.index("epi"), mesh.pouch
    wall = triangles(mesh.quads[mesh.layer == LAYERS.index("wall")])
    pouches = [triangles(mesh.quads[epi & (pouch == p)]) for p in np.unique(pouch[epi])]
    found = [_pierced(points, wall, wall, np.zeros(3))]
    for k, one in enumerate(pouches):
        found += [crossings(points, one, other) for other in (wall, *pouches[:k])]
    for symmetric, axis, quads in (("quarter", 0, mesh.quads), ("quarter front_back", 2, mesh.quads[epi])):
        if mesh.symmetry in symmetric.split():
            nodes = np.unique(quads)
            found.append(points[nodes[points[nodes, axis] < -thickness]])
    return np.vstack(found)


def first_contact(pressures: np.ndarray, touching: np.ndarray) -> tuple[float, float]:
    """(last clear, first touching) pressures in kPa of frames (f,) in rising order; NaN where there is no such frame.

    The answer is as fine as the frames that a study keeps.
    """
    pressures, touching = np.asarray(pressures, float), np.asarray(touching, bool)
    if not touching.any():
        return (float(pressures[-1]) if len(pressures) else float("nan")), float("nan")
    first = int(np.argmax(touching))
    return (float(pressures[first - 1]) if first else float("nan")), float(pressures[first])
