"""Polylines as a drawing has them, made one: ends that almost meet are joined, lines are cut where they meet, and chained."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence

import numpy as np
import shapely
from scipy.spatial import KDTree
from shapely import LineString, MultiLineString, STRtree

GRID = 1e-4  # mm, to which points are rounded where lines are cut at each other


def as_line(points: np.ndarray, closed: bool) -> LineString:
    """A polyline (n, 2), with its first point again where it is closed."""
    return LineString(np.vstack([points, points[:1]]) if closed else points)


def noded(lines: Sequence[LineString], gap: float) -> list[LineString]:
    """The lines, cut wherever they meet, each piece once. Gaps at ends up to ``gap`` mm are closed.

    What sticks out at a crossing by up to twice as much is cut off.
    """
    lines = [line for line in lines if line.length > GRID]
    if not lines:
        return []
    with np.errstate(divide="ignore", invalid="ignore"):  # of parallel lines, on the way to a right result
        cut = shapely.unary_union([*lines, *_bridges(lines, gap)], grid_size=GRID)
    return _trimmed(list(getattr(cut, "geoms", [cut])), 2.0 * gap)


def chains(lines: Sequence[LineString], gap: float) -> list[LineString]:
    """The lines joined end to end as far as that goes without a choice, longest first."""
    pieces = noded(lines, gap)
    merged = shapely.line_merge(MultiLineString(pieces)) if pieces else MultiLineString()
    return sorted(getattr(merged, "geoms", [merged]), key=lambda line: -line.length)


def _bridges(lines: list[LineString], gap: float) -> list[LineString]:
    """Short lines from each end to the nearest other one no further than ``gap``, or where there is none to a line.

    An end beyond a line that its own one crosses needs none.
    """
    owners = [k for k, line in enumerate(lines) if not line.is_closed]
    if not owners:
        return []
    whose = np.repeat(owners, 2)
    at = np.array([lines[k].coords[i][:2] for k in owners for i in (0, -1)])
    made = []
    distance, nearest = KDTree(at).query(at, k=2)
    own = nearest[:, 0] != np.arange(len(at))  # the first of two in one place may be the other one
    nearest, distance = np.where(own, nearest[:, 0], nearest[:, 1]), np.where(own, distance[:, 0], distance[:, 1])
    alone = []
    for k in range(len(at)):
        too_short = whose[nearest[k]] == whose[k] and lines[whose[k]].length < 4.0 * gap
        if distance[k] > gap or too_short:
            alone.append(k)
        elif distance[k] > 0.0:
            made.append(LineString([at[k], at[nearest[k]]]))
    if not alone:
        return made
    ends = shapely.points(at[alone])
    near: dict[int, list[tuple[float, int]]] = defaultdict(list)
    for k, j in zip(*STRtree(lines).query(ends, predicate="dwithin", distance=gap), strict=True):
        if whose[alone[k]] != j:
            near[k].append((ends[k].distance(lines[j]), int(j)))
    for k, found in near.items():
        (distance_to, j), line = min(found), lines[whose[alone[k]]]
        if distance_to == 0.0:
            continue
        crossing = line.intersection(lines[j])
        if crossing.is_empty or crossing.distance(ends[k]) > 2.0 * gap:
            made.append(LineString([ends[k], lines[j].interpolate(lines[j].project(ends[k]))]))
    return made


def _trimmed(pieces: list[LineString], shortest: float) -> list[LineString]:
    """Without the pieces shorter than ``shortest`` that stick out: one end on other pieces, the other on nothing."""
    count: dict[tuple[float, ...], int] = defaultdict(int)
    for piece in pieces:
        for i in (0, -1):
            count[piece.coords[i]] += 1

    def sticks_out(piece: LineString) -> bool:
        meets = sorted(count[piece.coords[i]] for i in (0, -1))
        return piece.length < shortest and meets[0] == 1 and meets[1] > 2

    return [piece for piece in pieces if not sticks_out(piece)]


def points_of(line: LineString) -> np.ndarray:
    """Points (n, 2) of a line."""
    return shapely.get_coordinates(line)


def densified(points: np.ndarray, spacing: float) -> np.ndarray:
    """The same polyline (n, 2) with points no further apart than ``spacing``."""
    return shapely.get_coordinates(shapely.segmentize(LineString(points), spacing))


def apart(first: np.ndarray, second: np.ndarray) -> tuple[float, np.ndarray]:
    """How far two polylines are apart: the largest distance from a point of either to the other (mm), and that point (2,)."""
    worst, where = 0.0, first[0]
    for of, to in ((first, second), (second, first)):
        dense = densified(of, 0.2)
        distance = shapely.distance(shapely.points(dense), LineString(to))
        if distance.max() > worst:
            worst, where = float(distance.max()), dense[distance.argmax()]
    return worst, where
