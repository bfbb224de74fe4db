"""Where on the device a point lies: near a seam or an edge, on the wall, or on a pouch."""

from __future__ import annotations

import numpy as np
import shapely

from limo.mesh.layers import DeviceMesh

#: what a point counts as: the nearest seam or edge if it is near one, else the patch it lies on
ZONES = ("seam", "valve_edge", "outer_edge", "wall", "pouch_endo", "pouch_epi")
_SIDES = np.array([[0, 4, 1], [1, 5, 2], [2, 6, 3], [3, 7, 0]])


def edge_segments(mesh: DeviceMesh, marked: np.ndarray) -> np.ndarray:
    """Straight segments (s, 2, 2) in mm along the sides of quadrilaterals whose three nodes are all ``marked`` (n,)."""
    sides = mesh.quads[:, _SIDES].reshape(-1, 3)
    sides = sides[marked[sides].all(axis=1)]
    pairs = np.vstack([sides[:, :2], sides[:, 1:]])
    ends = np.round(mesh.nodes[pairs][..., :2], 9)
    order = np.lexsort((ends[..., 1], ends[..., 0]), axis=1)  # shared sides are met from both elements and on every layer
    return np.unique(np.take_along_axis(ends, order[..., None], axis=1).reshape(-1, 4), axis=0).reshape(-1, 2, 2)


def distance_to(points: np.ndarray, segments: np.ndarray) -> np.ndarray:
    """Smallest distance (...,) in mm of points (..., 2) to segments (s, 2, 2); infinite when there are none.

    A tree finds the segments that are nearest but for rounding. The distance to each of them is |d - t e| with d from its start
    to the point, e along it, and t = d . e / e . e cut to 0 to 1.
    """
    flat = points.reshape(-1, 2)
    nearest = np.full(len(flat), np.inf)
    if len(segments):
        tree, places = shapely.STRtree(shapely.linestrings(segments)), shapely.points(flat)
        _, about = tree.query_nearest(places, all_matches=False, return_distance=True)
        point, segment = tree.query(places, predicate="dwithin", distance=about * (1 + 1e-9) + 1e-9)
        start, along = segments[segment, 0], segments[segment, 1] - segments[segment, 0]
        away = flat[point] - start
        foot = np.clip((away * along).sum(axis=1) / np.maximum((along**2).sum(axis=1), 1e-30), 0.0, 1.0)
        np.minimum.at(nearest, point, np.linalg.norm(away - foot[:, None] * along, axis=1))
    return nearest.reshape(points.shape[:-1])


def distances(mesh: DeviceMesh, points: np.ndarray) -> dict[str, np.ndarray]:
    """Distances (...,) in mm along the flat fabric of points (..., 2 or 3) to the nearest seam, valve edge, outer edge.

    The outer edge, where front and back are sealed, is a seam of the fabric too but is kept apart.
    """
    flat = points[..., :2]
    marked = {"seam": mesh.on_seam, "valve_edge": mesh.on_valve, "outer_edge": mesh.on_outer}
    return {name: distance_to(flat, edge_segments(mesh, mask)) for name, mask in marked.items()}


def zone_of(mesh: DeviceMesh, away: dict[str, np.ndarray], near: float) -> np.ndarray:
    """Index (m, g) into ``ZONES`` of the points of m elements, from ``distances`` (m, g) and what counts as ``near`` (mm)."""
    patch = (ZONES.index("wall") + np.asarray(mesh.layer))[:, None]  # ZONES ends in the order of the layers
    stacked = np.stack([away[name] for name in ZONES[:3]])
    nearest = stacked.argmin(axis=0)
    return np.where(stacked.min(axis=0) <= near, nearest, patch)
