"""From the shapes of a case to what a renderer takes: the full device, smooth, with its borders. No renderer is needed here."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import xarray as xr

from limo.mesh.elements import QUAD8_MIRROR, quad8_shape

DIVISIONS = 3  # linear quadrilaterals along a side of a quadratic one
_AXES = {"quarter": (0, 2), "front_back": (2,), "full": ()}


@dataclass(frozen=True)
class Surface:
    """Quadratic quadrilaterals: ``flat`` (p, 2) and ``points`` (p, 3) in mm, ``quads`` (m, 8), ``values`` (p, ...) or None.

    ``layer``, ``face`` and ``pouch`` (m,) as in a mesh.
    """

    flat: np.ndarray
    points: np.ndarray
    quads: np.ndarray
    layer: np.ndarray
    face: np.ndarray
    pouch: np.ndarray
    values: np.ndarray | None = None

    def part(self, keep: np.ndarray) -> Surface:
        """The quadrilaterals ``keep`` (m,), a mask, on the same points."""
        return Surface(self.flat, self.points, self.quads[keep], self.layer[keep], self.face[keep], self.pouch[keep], self.values)


@dataclass(frozen=True)
class Facets:
    """Linear quadrilaterals to draw: ``points`` (p, 3), ``quads`` (m, 4), ``normals`` (p, 3), ``values`` (p, ...) or None.

    ``borders`` (s, 2): pairs of points along seams and edges.
    """

    points: np.ndarray
    quads: np.ndarray
    normals: np.ndarray
    values: np.ndarray | None
    borders: np.ndarray


def surface_of(shapes: xr.Dataset, displacement: np.ndarray, values: np.ndarray | None = None) -> Surface | None:
    """The part of one case that was solved, or None where it has no shapes.

    ``shapes`` holds that case alone; ``displacement`` (point, 3) in mm and ``values`` (point, ...) may be padded.
    """
    number = int(shapes.mesh_number)
    if number < 0 or not np.isfinite(displacement).any():
        return None
    mesh = shapes.isel(mesh=number)
    quads = mesh.quads.values.astype(int)
    used = quads[:, 0] >= 0
    count = int(quads.max()) + 1
    flat = mesh.flat.values[:count].astype(float)
    points = np.column_stack([flat, np.zeros(count)]) + displacement[:count]
    tags = (getattr(mesh, n).values[used].astype(int) for n in ("layer", "face", "pouch"))
    return Surface(flat, points, quads[used], *tags, None if values is None else values[:count].astype(float))


def full_device(surface: Surface, symmetry: str, n_pouches: int) -> Surface:
    """All of the device: mirrored in x = 0 and z = 0 as ``symmetry`` (quarter, front_back or full) says."""
    for axis in _AXES[symmetry]:
        surface = _joined(surface, _mirror(surface, axis, n_pouches // 2))
    return surface


def mirrors(symmetry: str) -> list[np.ndarray]:
    """Factors (3,) of coordinates that make the copies of which the full device consists, the part itself first."""
    signs = [np.ones(3)]
    for axis in _AXES[symmetry]:
        signs += [sign * np.where(np.arange(3) == axis, -1.0, 1.0) for sign in signs]
    return signs


def _mirror(surface: Surface, axis: int, per_face: int) -> Surface:
    sign = np.ones(3)
    sign[axis] = -1.0
    pouch, face, quads = surface.pouch, surface.face, surface.quads
    if axis == 0:
        first = pouch - pouch % per_face  # of its face
        pouch = np.where(pouch < 0, -1, 2 * first + per_face - 1 - pouch)
        quads = quads[:, QUAD8_MIRROR]
    else:
        pouch, face = np.where(pouch < 0, -1, pouch + per_face), 1 - face
    return Surface(surface.flat * sign[:2], surface.points * sign, quads, surface.layer, face, pouch, surface.values)


def _joined(first: Surface, second: Surface) -> Surface:
    quads = np.vstack([first.quads, second.quads + len(first.points)])
    values = None if first.values is None else np.concatenate([first.values, second.values])
    both = {n: np.concatenate([getattr(first, n), getattr(second, n)]) for n in ("layer", "face", "pouch")}
    return Surface(np.vstack([first.flat, second.flat]), np.vstack([first.points, second.points]), quads, values=values, **both)


@cache
def grid(divisions: int = DIVISIONS) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Values (g, 8) and slopes (g, 8, 2) of the shape functions on a grid within a quadrilateral, and its cells (c, 4)."""
    n = divisions + 1
    ticks = np.linspace(-1, 1, n)
    local = np.stack(np.meshgrid(ticks, ticks), axis=-1).reshape(-1, 2)
    corner = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    return *quad8_shape(local), np.stack([corner, corner + 1, corner + n + 1, corner + n], axis=1)


def divided(surface: Surface, divisions: int = DIVISIONS) -> tuple[np.ndarray, np.ndarray]:
    """Where the points of a divided surface lie: each point (f,) as one of those of ``grid`` of all quadrilaterals in turn, and
    for all of these (m, g) which point they are. They are joined within each layer, face and pouch.
    """
    flat = np.einsum("gn,mnk->mgk", grid(divisions)[0], surface.flat[surface.quads])
    piece = 3000 * surface.face + 1000 * surface.layer + surface.pouch + 1
    place = np.round(1e3 * flat).astype(np.int64) + 2**20  # micrometres
    keys = (piece[:, None] * 2**21 + place[..., 0]) * 2**21 + place[..., 1]
    _, first, inverse = np.unique(keys.ravel(), return_index=True, return_inverse=True)
    return first, inverse.reshape(keys.shape)


def facets(surface: Surface) -> Facets:
    """Divide quadratic quadrilaterals into linear ones along their true shape; smooth within each layer, face and pouch.

    Normals are averaged over what is one piece of fabric in the flat state, and borders are the edges of these pieces.
    """
    shape, slope, cells = grid()
    quads = surface.quads
    points = np.einsum("gn,mnk->mgk", shape, surface.points[quads])
    tangents = np.einsum("gnd,mnk->mgdk", slope, surface.points[quads])
    normals = np.cross(tangents[:, :, 0], tangents[:, :, 1])
    first, inverse = divided(surface)
    summed = np.stack([np.bincount(inverse.ravel(), c, minlength=len(first)) for c in normals.reshape(-1, 3).T], axis=1)
    summed /= np.maximum(np.linalg.norm(summed, axis=1, keepdims=True), 1e-12)
    small = inverse[:, cells].reshape(-1, 4)
    values = None
    if surface.values is not None:
        values = np.einsum("gn,mn...->mg...", shape, surface.values[quads])
        values = values.reshape(-1, *values.shape[2:])[first]
    return Facets(points.reshape(-1, 3)[first], small, summed, values, borders(small))


def borders(quads: np.ndarray) -> np.ndarray:
    """Sides (s, 2) that belong to one quadrilateral only."""
    sides = np.sort(np.stack([quads, np.roll(quads, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1).astype(np.int64)
    most = quads.max(initial=0) + 1
    unique, count = np.unique(sides[:, 0] * most + sides[:, 1], return_counts=True)
    once = unique[count == 1]
    return np.stack([once // most, once % most], axis=1)
