"""Deformed surfaces as clouds of points and as sections, from which distances are measured."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from limo.cases.case import Case
from limo.errors import ResultError
from limo.measure.frames import open_case
from limo.mesh.elements import gauss, quad8_shape
from limo.mesh.surface import grid, mirrors

#: points on the full device whose distance to another is taken, and steps of the stored coordinates in mm
CLOUD, STEP = 6000, 0.01


#: where the device is cut, y / L
SECTION = 0.5


#: linear quadrilaterals along a side of an element that is cut, and of one to which distances are taken
_CUT, _MEASURED = 2, 4


@dataclass(frozen=True)
class Surface:
    """What is kept of a run's shapes: w / L (f,) at pressures (f,) in kPa, and the deformed middle surface of its last frame.

    ``points`` (n, 3) in mm and ``quads`` (m, 8) are those of the part that was solved, of which ``symmetry`` makes the full
    device. ``sections``: for each frame the segments (k, 2, 2) in which the plane y / L = ``SECTION`` cuts that part; x and z of
    both ends in mm.
    """

    pressure: np.ndarray
    height: np.ndarray
    points: np.ndarray
    quads: np.ndarray
    symmetry: str
    sections: tuple[np.ndarray, ...] = ()

    @cached_property
    def cloud(self) -> np.ndarray:
        """Points (``CLOUD``, 3) in mm, equally dense all over the full device."""
        signs = mirrors(self.symmetry)
        part = sampled(self.points, self.quads, CLOUD // len(signs))
        return np.vstack([part * sign for sign in signs])

    @cached_property
    def _distance(self) -> Callable[[np.ndarray], np.ndarray]:
        """Distances (p,) in mm of points (p, 3) from the part."""
        from limo.accuracy.nearest import distance_to

        values, _, cells = grid(_MEASURED)
        points = np.einsum("gn,mnk->mgk", values, self.points[self.quads])
        corners = np.arange(points.size // 3).reshape(points.shape[:2])[:, cells][:, :, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3)
        return distance_to(points.reshape(-1, 3), corners)

    def distances(self, points: np.ndarray) -> np.ndarray:
        """Distances (p,) in mm of points (p, 3) from the full device, whose elements are divided into flat triangles."""
        images = points * np.array(mirrors(self.symmetry))[:, None]
        low, high = self.points.min(axis=0), self.points.max(axis=0)
        beyond = np.linalg.norm(np.maximum(0.0, np.maximum(low - images, images - high)), axis=-1)
        distances = np.full(len(points), np.inf)
        for turn in np.argsort(beyond, axis=0, kind="stable"):  # the image nearest to the part first: searches from afar are slow
            image = turn, np.arange(len(points))
            near = beyond[image] < distances
            distances[near] = np.minimum(distances[near], self._distance(images[image][near]))
        return distances


def surface_of(case: Case, mesh_file: Path, folder: Path) -> Surface:
    """Heights and sections at all frames, the surface at the last. Raises ``LimoError`` where there are none."""
    model, frames = open_case(case, mesh_file, folder)
    if not len(frames.pressure):
        raise ResultError(f"{frames.file}: no frames")
    mesh, length = model.mesh, case.device.pattern.length
    middle = [model.expansion.midsurface(u.astype(float)) for u in frames.displacement]
    height = np.array([np.abs(u[:, 2]).max() for u in middle]) / length
    sections = tuple(section(mesh.nodes + u, mesh.quads, SECTION * length) for u in middle)
    last = np.round((mesh.nodes + middle[int(np.argmax(frames.pressure))]) / STEP) * STEP
    return Surface(frames.pressure, height, last, mesh.quads, mesh.symmetry, sections)


def sampled(points: np.ndarray, quads: np.ndarray, count: int) -> np.ndarray:
    """Points (count, 3) spread over quadrilaterals in proportion to their area, the same for the same surface.

    ``points`` (n, 3) in mm, ``quads`` (m, 8). Along the order of the elements the points lie at equal steps
    of area; within an element at points of a low-discrepancy sequence.
    """
    place = points[quads]
    local, weights = gauss(2, 2)
    _, slopes = quad8_shape(local)
    tangents = np.einsum("gnd,mnk->mgdk", slopes, place)
    areas = np.linalg.norm(np.cross(tangents[:, :, 0], tangents[:, :, 1]), axis=-1) @ weights
    steps = (np.arange(count) + 0.5) / count * areas.sum()
    element = np.searchsorted(np.cumsum(areas), steps).clip(max=len(quads) - 1)
    # additive recurrence with the plastic number: even in two dimensions for every count
    inside = np.mod(0.5 + np.arange(1, count + 1)[:, None] * np.array([0.7548776662466927, 0.5698402909980532]), 1.0)
    values, _ = quad8_shape(2.0 * inside - 1.0)
    return np.einsum("pn,pnk->pk", values, place[element])


def section(points: np.ndarray, quads: np.ndarray, y: float) -> np.ndarray:
    """Segments (k, 2, 2), x and z in mm of both ends, in which the plane at ``y`` (mm) cuts quadrilaterals.

    ``points`` (n, 3) in mm, ``quads`` (m, 8). Elements are divided and cut as flat triangles.
    """
    values, _, cells = grid(_CUT)
    place = np.einsum("gn,mnk->mgk", values, points[quads])
    triangles = place[:, cells][:, :, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3, 3)
    above = triangles[:, :, 1] > y
    crossed = above.any(axis=1) & ~above.all(axis=1)
    triangles, above = triangles[crossed], above[crossed]
    single = np.argmax(above == (above.sum(axis=1) == 1)[:, None], axis=1)  # the corner that has its side to itself
    rows = np.arange(len(triangles))[:, None]
    tip, others = triangles[rows, single[:, None]], triangles[rows, (single[:, None] + [1, 2]) % 3]
    share = (y - tip[..., 1]) / (others[..., 1] - tip[..., 1])
    return (tip + share[..., None] * (others - tip))[..., [0, 2]]
