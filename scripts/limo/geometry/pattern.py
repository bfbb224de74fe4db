"""The flat pattern of a fabric device: outline, pouch array and seams as plane curves (no mesher here).

The pattern lies in the plane z = 0, in mm, with the valve edge on y = 0 and the apex at y = L.
Only the right half (x >= 0) is described; the left half is its mirror image (paper, *Geometric parametrization*).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from shapely import LineString, Point, Polygon

from limo.errors import ConfigError
from limo.geometry.valve import quarter_perimeter
from limo.schema.device import Pattern

SAMPLING = 1.0  # mm between the points that stand for a smooth curve
SNAP = 1.0e-6  # mm, below which two points are one


@dataclass(frozen=True)
class Curve:
    """A piece of the pattern: ``points`` (n, 2) in mm and what it is.

    ``kind`` is ``valve``, ``outer`` (the sealed outer edge), ``seam`` (pouch boundary), or ``axis`` (x = 0, no seam).
    """

    name: str
    kind: str
    points: np.ndarray

    @cached_property
    def length(self) -> float:
        return float(np.linalg.norm(np.diff(self.points, axis=0), axis=1).sum())


@dataclass(frozen=True)
class Region:
    """A patch bounded by curves: the wall (``pouch`` = -1) or the part x >= 0 of a pouch, counted from the axis.

    ``loop`` lists (curve index, direction) anticlockwise.
    """

    pouch: int
    loop: tuple[tuple[int, int], ...]

    @property
    def name(self) -> str:
        return "wall" if self.pouch < 0 else f"pouch{self.pouch}"


@dataclass(frozen=True)
class FlatPattern:
    """The right half of one face, as curves and the patches between them.

    ``length`` and ``half_width`` (of the valve edge, a quarter of the valve's perimeter) are in mm.
    ``axis_is_seam`` says whether a seam runs along x = 0, so that pouches do not cross the axis.
    """

    length: float
    half_width: float
    n_pouches: int
    axis_is_seam: bool
    curves: tuple[Curve, ...]
    regions: tuple[Region, ...]

    def polygon(self, region: Region) -> Polygon:
        """The patch as a polygon (mm)."""
        return Polygon(np.vstack([self.curves[i].points[::d][:-1] for i, d in region.loop]))


def smooth(points: np.ndarray) -> np.ndarray:
    """Dense points (m, 2) on a smooth curve through the given ones (n, 2); two points give a straight line.

    Modified Akima interpolation over the chord length: passes through every point and does not overshoot on flat runs.
    """
    from scipy.interpolate import Akima1DInterpolator  # takes 0.3 s, and most processes only read meshes

    points = np.asarray(points, float)
    chord = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    count = max(int(np.ceil(chord[-1] / SAMPLING)), 2)
    grid = np.union1d(np.linspace(0.0, chord[-1], count + 1), chord)
    grid = grid[np.concatenate([[True], np.diff(grid) > 1e-9])]
    if len(points) == 2:
        return np.stack([np.interp(grid, chord, points[:, k]) for k in (0, 1)], axis=1)
    return Akima1DInterpolator(chord, points, method="makima")(grid)


def _chain(curves: list[np.ndarray]) -> np.ndarray:
    """Dense points of a chain of smooth curves that meet end to start."""
    dense = [smooth(c) for c in curves]
    return np.vstack([dense[0], *(d[1:] for d in dense[1:])])


def _split(line: np.ndarray, point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Cut a polyline at the point nearest to ``at``; both pieces contain the cut."""
    ls = LineString(line)
    s = ls.project(Point(point))
    stations = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    cut = np.array(ls.interpolate(s).coords[0])
    head, tail = line[stations < s - SNAP], line[stations > s + SNAP]
    return np.vstack([head, cut]), np.vstack([cut, tail])


def seam_fractions(pattern: Pattern, n_pouches: int) -> tuple[float, ...]:
    """Positions of the seams with x >= 0 as multiples of the device's reference seam.

    As listed by the pattern. Otherwise evenly counted seams u = 2 k / n_face (k from the axis) lie at 1 - (1 - u)^p of the
    half width. This narrows the outer pouches as on the recovered pattern.
    """
    if not n_pouches:
        return ()
    if n_pouches in pattern.seams.fractions:
        return tuple(pattern.seams.fractions[n_pouches])
    per_face = n_pouches // 2
    first = 0 if per_face % 2 == 0 else 1
    u = np.arange(first, per_face, 2) / per_face
    seams = (1.0 - (1.0 - u) ** pattern.seams.spacing_exponent) / pattern.seams.reference_position
    return tuple(float(round(f, 6)) for f in seams)


def flat_pattern(pattern: Pattern, n_pouches: int, source: object = "pattern") -> FlatPattern:
    """Curves and patches of the right half of one face, for an even number of pouches; with 0 the wall alone.

    ``source`` is the file that errors name. Raises ``ConfigError`` for an outline that crosses itself, an array that leaves
    it, seams that cross each other or leave the array, and pouches without an array.
    """
    if n_pouches and pattern.pouch_array is None:
        expected = "0 of a device without pouch_array and seams, or these in its pattern"
        raise ConfigError(source, "n_pouches", n_pouches, expected, "n_pouches: [0]")
    length, half_width = pattern.length, quarter_perimeter(pattern)

    def scaled(points: np.ndarray) -> np.ndarray:
        """To mm, with width_scale blended to 1 at the valve edge (smooth step over width_blend)."""
        points = np.array(points, float)
        blend = np.clip(points[:, 1] / pattern.width_blend, 0.0, 1.0)
        blend = blend**2 * (3.0 - 2.0 * blend)
        points[:, 0] *= 1.0 + (pattern.width_scale - 1.0) * blend
        return points * length

    outline = scaled(_smooth_unit(pattern.outline, length))
    outline[0], outline[-1, 0] = (half_width, 0.0), 0.0
    array = scaled(_smooth_unit(pattern.pouch_array, length)) if n_pouches else np.empty((0, 2))
    array[[0, -1] if n_pouches else [], 0] = 0.0
    fractions = seam_fractions(pattern, n_pouches)
    positions = [f for f in fractions if f > 0]
    seams = [scaled(_smooth_unit([pattern.seams.reference], length) * [f, 1.0]) for f in positions]
    axis_is_seam = bool(fractions) and fractions[0] == 0.0
    _check(source, n_pouches, outline, array, positions, seams)

    curves: list[Curve] = []

    def add(name: str, kind: str, points: np.ndarray) -> int:
        curves.append(Curve(name, kind, points))
        return len(curves) - 1

    edge = [(add("valve", "valve", smooth([[0.0, 0.0], [half_width, 0.0]])), 1)] if pattern.valve else []
    outer = add("outer", "outer", outline)
    if not n_pouches:
        axis = add("axis", "axis", smooth([outline[-1], [0.0, 0.0]]))
        wall = Region(-1, (*edge, (outer, 1), (axis, 1)))
        return FlatPattern(length, half_width, 0, False, tuple(curves), (wall,))
    axis_top = add("axis_top", "axis", smooth([outline[-1], array[-1]]))
    axis_low = add("axis_low", "axis", smooth([array[0], [0.0, 0.0]]))
    axis_mid = add("axis_mid", "seam" if axis_is_seam else "axis", smooth([array[-1], array[0]]))

    # the border of the array, cut where seams end: from the axis outwards below, back to the axis above
    below, above, rest = [], [], array
    for k, seam in enumerate(seams):
        low, rest = _split(rest, seam[0])
        rest, top = _split(rest, seam[-1])
        seam[0], seam[-1] = low[-1], top[0]
        below.append(add(f"array_low{k}", "seam", low))
        above.append(add(f"array_top{k}", "seam", top))
    border = [*((b, 1) for b in below), (add("array_side", "seam", rest), 1), *((t, 1) for t in reversed(above))]
    inner = [add(f"seam{k}", "seam", s) for k, s in enumerate(seams)]

    regions = [Region(-1, (*edge, (outer, 1), (axis_top, 1), *((i, -d) for i, d in reversed(border)), (axis_low, 1)))]
    left = (axis_mid, 1)
    for k, seam in enumerate(inner):
        regions.append(Region(k, ((below[k], 1), (seam, 1), (above[k], 1), left)))
        left = (seam, -1)
    regions.append(Region(len(inner), ((border[len(inner)][0], 1), left)))
    return FlatPattern(length, half_width, n_pouches, axis_is_seam, tuple(curves), tuple(regions))


def _smooth_unit(curves: list[list[tuple[float, float]]], length: float) -> np.ndarray:
    """A chain of curves given in units of the length, dense points in the same units."""
    return _chain([np.asarray(c, float) * length for c in curves]) / length


def _check(
    source: object, n_pouches: int, outline: np.ndarray, array: np.ndarray, positions: list[float], seams: list[np.ndarray]
) -> None:
    """Raise ``ConfigError`` for a pattern that cannot be cut or sealed."""
    face = Polygon(np.vstack([[[0.0, 0.0]], outline]))
    if not face.is_valid:
        raise ConfigError(
            source,
            "outline",
            "curve",
            "a simple curve from the valve edge to the apex with x >= 0 that does not cross itself",
            "outline: [[[0.4, 0.0], [0.44, 0.5], [0.0, 1.0]]]",
        )
    if not n_pouches:
        return
    block = Polygon(array)
    if (
        not block.is_valid
        or not face.buffer(-1e-3).contains(block.intersection(face.buffer(-1e-3)))
        or not (face.buffer(SNAP).contains(block) and LineString(outline).distance(block) > 0.5)
    ):
        raise ConfigError(
            source,
            "pouch_array",
            "curve",
            "a simple curve from (0, y_bottom) to (0, y_top) at least 0.5 mm inside the outline",
            "pouch_array: [[[0.0, 0.2], [0.4, 0.2]], [[0.4, 0.2], [0.4, 0.9]], [[0.4, 0.9], [0.0, 0.9]]]",
        )
    key, lines = f"pattern.seams.fractions.{n_pouches}", [LineString(s) for s in seams]
    for k, (fraction, line) in enumerate(zip(positions, lines, strict=True)):
        ends = [block.exterior.distance(Point(line.coords[i])) for i in (0, -1)]
        inside = LineString(line.coords[1:-1])
        if (
            not line.is_simple
            or max(ends) > 1.0
            or not block.buffer(SNAP).contains(inside)
            or block.exterior.distance(inside.centroid) < 0.5
        ):
            raise ConfigError(
                source,
                key,
                fraction,
                "multiples of the reference seam whose seams start and end on the border of the pouch array and stay inside it",
                "fractions: {8: [0.0, 1.0]}",
            )
        near = [other.distance(line) for other in lines[:k]]
        if line.bounds[0] < 0.5 or (near and min(near) < 0.5):
            raise ConfigError(
                source,
                key,
                fraction,
                "multiples of the reference seam whose seams do not cross or touch each other or the axis x = 0 (0.5 mm apart)",
                "fractions: {10: [0.5, 1.3]}",
            )
