"""From a drawn polyline to the curves of a pattern: corners kept, straight pieces of two points, splines through few points.

A pattern's curve is ``geometry.smooth`` of its points; points are added where that is further than a tolerance from the drawing.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import shapely
from shapely import LineString

from limo.geometry.pattern import smooth

SHARP = np.radians(15.0)  # a turn that may be a corner
_REACH = 3  # points of an Akima spline, beyond which it does not know of a point
STRAIGHT = 0.04  # of the tolerance, by which points on one line may miss it


def curves_of(points: np.ndarray, tolerance: float) -> list[np.ndarray]:
    """Curves (k, 2), end to start, whose smooth lines are within ``tolerance`` mm of a drawn polyline (n, 2) and it of them.

    The polyline is parted at corners, and where a straight piece begins or ends. A corner turns by more than ``SHARP`` and three
    times as much as around it. A straight piece is too long to be the chord of a curve that turns so:
    theta a^2 / (4 (a + b)) > tolerance, with the turn theta and the segments a >= b.
    """
    parts = _parts(points, tolerance)
    return [part[[0, -1]] if _is_straight(part, tolerance) else spline_points(part, tolerance) for part in parts]


def spline_points(points: np.ndarray, tolerance: float) -> np.ndarray:
    """Points (k, 2) of a drawn polyline (n, 2), its ends among them, whose smooth curve is within ``tolerance`` mm of it.

    Two points where the polyline is straight. Otherwise the drawn point is added that is furthest off, in each interval, until
    all are near enough; then points that are not needed go.
    """
    if _is_straight(points, tolerance):
        return points[[0, -1]]
    dense = _resolved(points, tolerance)
    drawn = LineString(dense)
    chosen = {0, len(dense) // 2, len(dense) - 1}
    while True:
        order = sorted(chosen)
        miss = _misses(dense, drawn, order)
        open_intervals = [(a, b) for a, b in pairwise(order) if b > a + 1 and miss[a : b + 1].max() > tolerance]
        if not open_intervals:
            break
        inside = ((a, b, miss[a + 1 : b]) for a, b in open_intervals)
        chosen |= {a + 1 + int(m.argmax()) if m.max() > 0.1 * tolerance else (a + b) // 2 for a, b, m in inside}
    return dense[_without_needless(dense, drawn, sorted(chosen), tolerance)]


def _misses(dense: np.ndarray, drawn: LineString, chosen: list[int]) -> np.ndarray:
    """How far (n,) the drawn points are from the smooth curve through the chosen ones, or it from the drawing near them."""
    curve = smooth(dense[chosen])
    miss = shapely.distance(shapely.points(dense), LineString(curve))
    off = shapely.distance(shapely.points(curve), drawn)
    station = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(dense, axis=0), axis=1))])
    nearest = np.searchsorted(station, shapely.line_locate_point(drawn, shapely.points(curve)), side="left")
    np.maximum.at(miss, np.clip(nearest, 0, len(dense) - 1), off)
    return miss


def _without_needless(dense: np.ndarray, drawn: LineString, chosen: list[int], tolerance: float) -> list[int]:
    """The chosen points without those whose absence leaves the curve within the tolerance, where it was.

    A point moves the curve no further than ``_REACH`` points away, so that only that part is looked at.
    """
    if _misses(dense, drawn, chosen).max() > tolerance:
        return chosen
    fewer = list(chosen)
    for index in chosen[1:-1]:
        at = fewer.index(index)
        first, last = max(at - 2 * _REACH, 0), min(at + 2 * _REACH, len(fewer) - 1)
        around = [k - fewer[first] for k in fewer[first : last + 1] if k != index]
        part = dense[fewer[first] : fewer[last] + 1]
        if len(fewer) > 3 and len(around) > 2:
            seen = slice(fewer[max(at - _REACH, 0)] - fewer[first], fewer[min(at + _REACH, len(fewer) - 1)] - fewer[first] + 1)
            if _misses(part, LineString(part), around)[seen].max() <= tolerance:
                fewer.remove(index)
    return fewer if _misses(dense, drawn, fewer).max() <= tolerance else chosen


def _resolved(points: np.ndarray, tolerance: float) -> np.ndarray:
    """The polyline with points as close together as curves may need: a fiftieth of its length at most, drawn points kept."""
    length = np.linalg.norm(np.diff(points, axis=0), axis=1).sum()
    return shapely.get_coordinates(shapely.segmentize(LineString(points), max(length / 50, 4.0 * tolerance)))


def _is_straight(points: np.ndarray, tolerance: float) -> bool:
    """Whether all points lie on the line from the first to the last, one behind the other."""
    along = points[-1] - points[0]
    length = np.linalg.norm(along)
    if length == 0.0:
        return False
    along = along / length
    aside = (points - points[0]) @ np.array([-along[1], along[0]])
    return bool(np.abs(aside).max() <= STRAIGHT * tolerance and (np.diff(points @ along) > -STRAIGHT * tolerance).all())


def _parts(points: np.ndarray, tolerance: float) -> list[np.ndarray]:
    """The polyline parted at its corners and at the ends of its straight pieces."""
    simple = shapely.get_coordinates(LineString(points).simplify(STRAIGHT * tolerance))
    if len(simple) < 3:
        return [points]
    step = np.diff(simple, axis=0)
    length = np.linalg.norm(step, axis=1)
    cross = step[:-1, 0] * step[1:, 1] - step[:-1, 1] * step[1:, 0]
    turn = np.abs(np.arctan2(cross, (step[:-1] * step[1:]).sum(axis=1)))
    before, after = length[:-1], length[1:]
    curvature = np.concatenate([[0.0], 2.0 * turn / (before + after), [0.0]])
    around = np.maximum(curvature[:-2], curvature[2:]) * (before + after) / 2.0
    sharp = (turn > SHARP) & (turn > 3.0 * around)
    too_long = turn * np.maximum(before, after) ** 2 / (4.0 * (before + after)) > tolerance
    corners, last = [], simple[0]
    for corner in simple[1:-1][sharp | too_long]:
        if np.linalg.norm(corner - last) > tolerance and np.linalg.norm(corner - simple[-1]) > tolerance:
            corners.append(corner)
            last = corner
    at = [int(np.flatnonzero((points == corner).all(axis=1))[0]) for corner in corners]
    return [points[a : b + 1] for a, b in zip([0, *at], [*at, len(points) - 1], strict=True)]
