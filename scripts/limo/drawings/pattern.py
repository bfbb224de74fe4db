"""From the lines of a drawing to a pattern in the model's own terms: outline, array, seams and valve edge of the right half.

The valve edge gives the frame: it lies on y = 0, its middle is the origin, and the outline is above it, however the drawing lies.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import shapely
from scipy.optimize import minimize_scalar
from shapely import LineString, Point, Polygon

from limo.config.yaml_file import parse
from limo.drawings.fit import curves_of, spline_points
from limo.drawings.lines import GRID, apart, chains, densified, noded, points_of
from limo.drawings.roles import Roles
from limo.errors import ConfigError
from limo.geometry.pattern import FlatPattern, flat_pattern
from limo.schema.device import Pattern

Half = Literal["right", "left"]
DIGITS = 6  # of lengths over the length of the device
MOST_POUCHES = 16
LONGEST = 1000.0  # mm
#: what the layout model carries, for messages
MODEL = (
    "one array of 1 to 8 pouches side by side in a face, the same left and right: each seam runs from the lower border of the "
    "array to the upper one, meets no other and does not cross the axis"
)
_FIT = 0.9  # of the tolerance, for the curves; the rest is for rounding and what the model does with their ends


@dataclass(frozen=True)
class Drawn:
    """What a drawing says, in mm in the pattern's frame: points (n, 2) of the right half.

    ``outline`` runs from the valve edge to the apex, ``array`` from (0, y_bottom) to (0, y_top), ``seams`` upwards, from the
    axis outwards; those on the axis are ``axis_is_seam``. ``asymmetry`` is how far left and right are apart (mm), None where
    only one half is drawn or was taken. ``everything`` are the lines of the drawing in this frame, by role.
    """

    half_width: float
    outline: np.ndarray
    array: np.ndarray
    seams: tuple[np.ndarray, ...]
    axis_is_seam: bool
    asymmetry: float | None
    everything: dict[str, list[np.ndarray]]

    @property
    def length(self) -> float:
        """L in mm, from the valve edge to the apex."""
        return float(self.outline[-1, 1])

    @property
    def n_pouches(self) -> int:
        """N_p, both faces together."""
        return 2 * (2 * len(self.seams) + (2 if self.axis_is_seam else 1))


@dataclass(frozen=True)
class Imported:
    """A pattern made of a drawing: ``data`` are the keys of a device's ``pattern``, ``flat`` is what the model makes of them.

    ``deviations``: how far outline, array and seams are from the drawing, in mm.
    """

    data: dict[str, Any]
    drawn: Drawn
    flat: FlatPattern
    deviations: dict[str, float]


# --------------------------------------------------------------------------------------------------------------------
# what is drawn


def find_pattern(roles: Roles, tolerance: float, half: Half | None = None) -> Drawn:
    """Outline, array and seams of the right half from the lines of a drawing.

    ``tolerance`` (mm): ends that are no further apart meet, and left and right may differ by it. ``half`` takes one half for
    both. Raises ``ConfigError`` for what the layout model cannot carry.
    """
    file = roles.drawing.file
    _check_size(roles)
    valve = _one_chain(roles, "valve", tolerance)
    first, last = np.array(valve.coords[0]), np.array(valve.coords[-1])
    off = float(shapely.distance(shapely.points(points_of(valve)), LineString([first, last])).max()) if valve.length else 0.0
    if valve.is_closed or off > tolerance:
        found = "a closed line" if valve.is_closed else f"a line that is {off:.3g} mm off straight"
        raise ConfigError(file, roles.where("valve"), found, "a straight valve edge", "draw it as one line, or --tolerance")
    outline = _without_valve(roles, _one_chain(roles, "outline", tolerance), first, last, tolerance)
    frame, is_half, outline = _frame(roles, outline, first, last, tolerance)
    everything = {role: [frame(points_of(line)) for line in lines] for role, lines in roles.lines.items() if role != "scale"}
    if is_half:
        everything = {role: [side for p in lines for side in (p, _mirrored(p))] for role, lines in everything.items()}
    half_width = float(np.linalg.norm(last - first)) * (1.0 if is_half else 0.5)
    if outline[:, 1].min() < -tolerance:
        found = f"a point {-outline[:, 1].min():.3g} mm below the valve edge"
        raise ConfigError(file, roles.where("outline"), found, "an outline above the valve edge", "move the valve edge down")
    right, left = _outline_halves(roles, outline, is_half)
    array, seams = _layout(roles, everything, tolerance)
    low_high = _cut_at_axis(roles, array)
    sides = {
        "right": (right, low_high[0], _side(seams, 1.0, tolerance)),
        "left": (left, low_high[1], _side(seams, -1.0, tolerance)),
    }
    on_axis = [seam for seam in seams if np.abs(seam[:, 0]).max() <= tolerance]
    asymmetry = None
    if half is None and not is_half:
        asymmetry = _compare(roles, sides["right"], sides["left"], tolerance)
    outline, border, chosen = sides[half or "right"]
    outline = outline.copy()
    outline[0], outline[-1, 0] = (half_width, 0.0), 0.0
    outline[:, 1] = np.maximum(outline[:, 1], 0.0)
    drawn = Drawn(half_width, outline, border, tuple(chosen), bool(on_axis), asymmetry, everything)
    if drawn.n_pouches > MOST_POUCHES:
        _refuse(roles, f"{drawn.n_pouches // 2} pouches in a face", "draw fewer seams")
    if not 1.0 <= drawn.length <= LONGEST:
        expected = f"a length from valve edge to apex of 1 to {LONGEST:g} mm"
        raise ConfigError(file, "(units)", f"{drawn.length:.5g} mm, in units of {roles.unit}", expected, "--units mm")
    return drawn


def _check_size(roles: Roles) -> None:
    """Raise for an outline that is no outline of a device in this unit."""
    bounds = np.array([line.bounds for line in roles.lines["outline"]] or [[0.0] * 4])
    size = float((bounds[:, 2:].max(axis=0) - bounds[:, :2].min(axis=0)).max())
    if not 1.0 <= size <= 2.0 * LONGEST:
        found = f"an outline of {size:.5g} mm, with the unit {roles.unit}"
        raise ConfigError(roles.drawing.file, "(units)", found, f"a device of 1 to {LONGEST:g} mm", "--units mm")


def _mirrored(points: np.ndarray) -> np.ndarray:
    return points * [-1.0, 1.0]


def _one_chain(roles: Roles, role: str, tolerance: float) -> LineString:
    """The lines of a role as one chain; raises where they are none or several."""
    found = chains(roles.lines[role], tolerance)
    if len(found) == 1:
        return found[0]
    ends = [f"({x:.4g}, {y:.4g})" for line in found[:3] for x, y in (line.coords[0], line.coords[-1])]
    raise ConfigError(
        roles.drawing.file,
        roles.where(role),
        f"{len(found)} lines that do not join into one (ends at {', '.join(ends)} mm)" if found else "no line of any length",
        f"one {role} without branches, ends no further apart than the tolerance of {tolerance:g} mm",
        f"delete all but one, put it on a layer of its own (--map {role}=NAME), or close gaps (--tolerance {10 * tolerance:g})",
    )


def _without_valve(roles: Roles, outline: LineString, first: np.ndarray, last: np.ndarray, tolerance: float) -> np.ndarray:
    """The outline as an open line; of a closed one the part along the valve edge goes."""
    points = points_of(outline)
    if not outline.is_closed:
        return points
    stations = sorted(outline.project(Point(end)) for end in (first, last))
    inner = shapely.ops.substring(outline, *stations)
    rest = [shapely.ops.substring(outline, stations[1], outline.length), shapely.ops.substring(outline, 0.0, stations[0])]
    outer = np.vstack([points_of(part) for part in rest if part.length > GRID])
    edge = LineString([first, last])
    for part, other in ((points_of(inner), outer), (outer, points_of(inner))):
        if len(part) > 1 and len(other) > 1 and shapely.distance(shapely.points(densified(part, 1.0)), edge).max() <= tolerance:
            return other
    raise ConfigError(
        roles.drawing.file,
        roles.where("outline"),
        "a closed line of which no part lies on the valve edge",
        "an outline from one end of the valve edge to the other, closed by the valve edge or open",
        "draw the outline from end to end of the valve edge",
    )


def _frame(roles: Roles, outline: np.ndarray, first: np.ndarray, last: np.ndarray, tolerance: float):
    """The map from the drawing to the pattern's frame, whether only one half is drawn, and the outline in the frame.

    The outline then runs from the valve edge's right end, and in a drawing of one half ends on the axis.
    """
    ends = outline[[0, -1]]
    near = [[float(np.linalg.norm(end - corner)) <= 2.0 * tolerance for corner in (first, last)] for end in ends]
    edge = (last - first) / np.linalg.norm(last - first)
    normal = np.array([-edge[1], edge[0]])
    dense = densified(outline, 1.0)
    if ((dense - first) @ normal).mean() < 0:
        normal = -normal
    right = np.array([normal[1], -normal[0]])
    if any(near[0]) and any(near[1]) and near[0] != near[1]:
        origin = (first + last) / 2.0

        def frame(points: np.ndarray) -> np.ndarray:
            return (points - origin) @ np.column_stack([right, normal])

        line = frame(outline)
        return frame, False, line if line[0, 0] > line[-1, 0] else line[::-1]
    if any(near[0]) != any(near[1]):  # one half: the other end of the outline is on the axis through the other end of the edge
        at = 0 if any(near[0]) else 1
        corner, origin = (first, last) if near[at][0] else (last, first)
        right = (corner - origin) / np.linalg.norm(corner - origin)

        def frame(points: np.ndarray) -> np.ndarray:
            return (points - origin) @ np.column_stack([right, normal])

        line = frame(outline if at == 0 else outline[::-1])
        if abs(line[-1, 0]) <= tolerance:
            return frame, True, line
    raise ConfigError(
        roles.drawing.file,
        f"{roles.where('outline')}, {roles.where('valve')}",
        f"an outline from ({ends[0][0]:.5g}, {ends[0][1]:.5g}) to ({ends[1][0]:.5g}, {ends[1][1]:.5g}) mm and a valve edge from "
        f"({first[0]:.5g}, {first[1]:.5g}) to ({last[0]:.5g}, {last[1]:.5g}) mm",
        f"an outline that starts and ends at the ends of the valve edge (within {2 * tolerance:g} mm), or for one half at one of "
        "them and on the axis above the other",
        f"move the ends together, or --tolerance {10 * tolerance:g}",
    )


def _crossings(points: np.ndarray) -> list[tuple[int, np.ndarray]]:
    """Where a line (n, 2) crosses x = 0: the index of the last point before, and the point on the axis."""
    x = np.where(np.abs(points[:, 0]) <= 2.0 * GRID, 0.0, points[:, 0])
    found, side, before = [], 0.0, 0
    for k, value in enumerate(x):
        if value == 0.0:
            continue
        if side and np.sign(value) != side:
            if k > before + 1:  # points on the axis
                at = (before + 1 + k) // 2
                found.append((at - 1, np.array([0.0, points[at, 1]])))
            else:
                share = x[k - 1] / (x[k - 1] - value)
                found.append((k - 1, np.array([0.0, points[k - 1, 1] + share * (points[k, 1] - points[k - 1, 1])])))
        side, before = np.sign(value), k
    return found


def _outline_halves(roles: Roles, outline: np.ndarray, is_half: bool) -> tuple[np.ndarray, np.ndarray]:
    """The right half of the outline from the valve edge to the apex, and the left one mirrored."""
    if is_half:
        return outline, outline
    crossings = _crossings(outline)
    if len(crossings) != 1:
        raise ConfigError(
            roles.drawing.file,
            roles.where("outline"),
            f"{len(crossings)} points on the axis, the perpendicular to the middle of the valve edge",
            "an outline that crosses the axis once, at the apex",
            "draw the outline over the middle of the valve edge",
        )
    at, apex = crossings[0]
    right = np.vstack([outline[: at + 1], apex])
    left = np.vstack([apex, outline[at + 1 :]])[::-1]
    return _distinct(right), _distinct(_mirrored(left))


def _distinct(points: np.ndarray) -> np.ndarray:
    """Points without those that hardly differ from the one before; the last one stays."""
    moved = np.linalg.norm(np.diff(points, axis=0), axis=1) > GRID
    kept = np.concatenate([[True], moved])
    kept[-1] = True
    if len(points) > 2 and not moved[-1]:
        kept[-2] = False
    return points[kept]


# --------------------------------------------------------------------------------------------------------------------
# pouches


def _layout(roles: Roles, everything: dict[str, list[np.ndarray]], tolerance: float) -> tuple[np.ndarray, list[np.ndarray]]:
    """The border of the array (n, 2), anticlockwise and closed, and the seams in it from border to border, upwards."""
    file, where = roles.drawing.file, roles.where("array", "seams")
    pieces = noded([LineString(p) for p in (*everything["array"], *everything["seams"])], tolerance)
    polygons, cuts, dangles, _ = shapely.polygonize_full(pieces)
    loose = [line for line in (*cuts.geoms, *dangles.geoms) if line.length > 2.0 * tolerance]
    pouches = list(polygons.geoms)
    if not pouches or loose:
        longest = max(loose, key=lambda line: line.length, default=None)
        raise ConfigError(
            file,
            where,
            f"{len(pouches)} closed pouches, {len(loose)} lines that end nowhere"
            + (f", the longest at {_at(*longest.coords[0])}" if loose else ""),
            f"seams that close every pouch, gaps no wider than the tolerance of {tolerance:g} mm",
            f"join the ends, or --tolerance {10 * tolerance:g}",
        )
    for pouch in pouches:
        if pouch.buffer(-tolerance).is_empty:
            raise ConfigError(
                file,
                where,
                f"two lines closer than {2 * tolerance:g} mm at {_at(*pouch.representative_point().coords[0])}",
                "each seam drawn once, or twice exactly alike",
                "delete one of them",
            )
    whole = shapely.union_all(pouches, grid_size=GRID)
    if whole.geom_type != "Polygon" or whole.interiors:
        groups = len(getattr(whole, "geoms", [whole]))
        found = f"{len(pouches)} pouches in {groups} groups that do not touch" if groups > 1 else "an array with a hole in it"
        if groups == len(pouches) > 1:
            gap = min(a.distance(b) for k, a in enumerate(pouches) for b in pouches[:k])
            found = f"{groups} pouches that share no seam, {gap:.3g} mm apart"
        if _in_rows(list(getattr(whole, "geoms", []))):
            _refuse(roles, f"{found}, in rows along the axis", "keep one row, with seams from its lower border to its upper one")
        _refuse(roles, found, "draw the seam between two pouches once, for both")
    border = whole.exterior if whole.exterior.is_ccw else whole.exterior.reverse()
    inner = [piece for piece in pieces if border.distance(piece.interpolate(0.5, normalized=True)) > 2.0 * GRID]
    inner = [piece for piece in inner if whole.contains(piece.interpolate(0.5, normalized=True))]
    merged = shapely.line_merge(shapely.MultiLineString(inner)) if inner else None
    seams = [points_of(line) for line in getattr(merged, "geoms", [merged])] if merged is not None else []
    for seam in seams:
        _check_seam(roles, seam, border, len(pouches), tolerance)
    if len(pouches) != len(seams) + 1:
        _refuse(roles, f"{len(pouches)} pouches and {len(seams)} seams between them", "draw seams from border to border")
    return points_of(border), [seam if seam[0, 1] <= seam[-1, 1] else seam[::-1] for seam in seams]


def _in_rows(groups: Sequence[Polygon]) -> bool:
    """Whether one of some groups of pouches lies above another, nearer to the apex."""
    boxes = [group.bounds for group in groups]
    return any(a[3] <= b[1] and a[0] < b[2] and b[0] < a[2] for a in boxes for b in boxes)


def _at(x: float, y: float) -> str:
    return f"x = {x:.4g}, y = {y:.4g} mm from the middle of the valve edge"


def _refuse(roles: Roles, found: str, remedy: str) -> None:
    """Raise the message of what the layout model cannot carry."""
    raise ConfigError(roles.drawing.file, roles.where("array", "seams"), found, MODEL, remedy)


def _check_seam(roles: Roles, seam: np.ndarray, border: LineString, n_pouches: int, tolerance: float) -> None:
    """Raise for a seam that the layout model cannot carry."""
    middle = seam[len(seam) // 2]
    ends = [border.distance(Point(end)) for end in seam[[0, -1]]]
    if (seam[0] == seam[-1]).all():
        _refuse(roles, f"a pouch inside a pouch, at {_at(*middle)}", "draw seams from border to border")
    if max(ends) > 2.0 * GRID:
        end = seam[0] if ends[0] > ends[1] else seam[-1]
        found = f"{n_pouches} pouches in rows along the axis or otherwise, with seams that meet each other at {_at(*end)}"
        _refuse(roles, found, "keep the seams from the lower border to the upper one")
    low, high = seam[:, 0].min(), seam[:, 0].max()
    if low < -tolerance and high > tolerance:
        found = f"{n_pouches} pouches in rows along the axis, with a seam across the axis near y = {np.median(seam[:, 1]):.4g} mm"
        _refuse(roles, found, "keep the seams from the lower border to the upper one")


def _side(seams: Sequence[np.ndarray], sign: float, tolerance: float) -> list[np.ndarray]:
    """The seams on one side of the axis, mirrored onto the right, from the axis outwards."""
    mirrored = (seam * [sign, 1.0] for seam in seams if np.abs(seam[:, 0]).max() > tolerance)
    return sorted((seam for seam in mirrored if seam[:, 0].mean() > 0), key=lambda seam: seam[:, 0].mean())


def _cut_at_axis(roles: Roles, border: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The right half of the array's border, from the axis below to the axis above, and the left one mirrored."""
    start = int(border[:, 0].argmin())
    ring = np.vstack([border[start:-1], border[: start + 1]])  # anticlockwise, from the leftmost point
    crossings = _crossings(ring)
    if len(crossings) != 2:
        beside = border[:, 0].min() > 0 or border[:, 0].max() < 0 or not crossings
        found = "an array on one side of the axis" if beside else f"an array that crosses the axis {len(crossings)} times"
        _refuse(roles, found, "draw both halves, or outline, valve edge and pouches of one half up to the axis")
    (low_at, low), (high_at, high) = crossings
    right = np.vstack([low, ring[low_at + 1 : high_at + 1], high])
    left = np.vstack([high, ring[high_at + 1 :], ring[1 : low_at + 1], low])
    return _distinct(right), _distinct(_mirrored(left)[::-1])


def _compare(roles: Roles, right: tuple, left: tuple, tolerance: float) -> float:
    """How far the left half is from the mirrored right one, in mm; raises where that is more than the tolerance."""
    file = roles.drawing.file
    remedy = "draw one half and mirror it, or take one half for both: --half right, --half left; or --tolerance MM"
    if len(right[2]) != len(left[2]):
        found = f"{len(right[2])} seams on the right and {len(left[2])} on the left of the axis"
        raise ConfigError(file, roles.where("array", "seams"), found, "left and right halves that are alike", remedy)
    pairs = [("outline", right[0], left[0]), ("array", right[1], left[1])]
    pairs += [("seams", a, b) for a, b in zip(right[2], left[2], strict=True)]
    worst = 0.0
    for role, a, b in pairs:
        distance, where = apart(a, b)
        if distance > tolerance:
            layers = roles.where("outline") if role == "outline" else roles.where("array", "seams")
            found = f"halves that differ by {distance:.3g} mm ({'seam' if role == 'seams' else role}, at {_at(*where)})"
            raise ConfigError(file, layers, found, f"left and right alike within the tolerance of {tolerance:g} mm", remedy)
        worst = max(worst, distance)
    return worst


# --------------------------------------------------------------------------------------------------------------------
# the pattern


def make_pattern(drawn: Drawn, roles: Roles, tolerance: float) -> Imported:
    """The pattern of a drawing with all its curves within ``tolerance`` mm.

    Raises ``ConfigError`` where the seams are no multiples in x of one of them, and for a layout that cannot be sealed.
    """
    file = roles.drawing.file
    outline, border = (curves_of(points, _FIT * tolerance) for points in (drawn.outline, drawn.array))
    candidates = []
    for reference in drawn.seams or [None]:
        data = _data(drawn, outline, border, reference, tolerance)
        try:
            flat = flat_pattern(parse(Pattern, data, file), drawn.n_pouches, file)
        except ConfigError as error:
            candidates.append((math.inf, error, None))
            continue
        deviations = deviations_from(drawn, flat)
        candidates.append((max(deviations.values()), None, Imported(data, drawn, flat, deviations)))
        if candidates[-1][0] <= tolerance:
            break
    worst, error, best = min(candidates, key=lambda candidate: candidate[0])
    if best is None:
        layers = roles.where("outline") if error.key == "outline" else roles.where("array", "seams")
        raise ConfigError(
            file, layers, "lines that cannot be sealed", error.expected, "move the lines, see the picture of limo pattern"
        )
    if worst > tolerance:
        part = max(best.deviations, key=best.deviations.get)
        raise ConfigError(
            file,
            roles.where("array", "seams"),
            f"{part} that the pattern follows within {worst:.3g} mm only",
            f"seams that are multiples in x of one another, as the layout model has them, within {tolerance:g} mm",
            f"--tolerance {_rounded_up(worst):g}, if that is near enough, or seams of one shape",
        )
    return best


def _rounded_up(value: float) -> float:
    step = 10.0 ** (math.floor(math.log10(value)) - 1)
    return math.ceil(value / step) * step


def _data(
    drawn: Drawn, outline: list[np.ndarray], border: list[np.ndarray], reference: np.ndarray | None, tolerance: float
) -> dict[str, Any]:
    """The keys of a pattern, lengths as fractions of L; ``reference`` is the seam whose multiples the others are."""
    length = round(drawn.length, 4)

    def fractions(points: np.ndarray) -> list[list[float]]:
        return [[round(float(v) / length, DIGITS) + 0.0 for v in point] for point in points]

    multiples = [0.0] if drawn.axis_is_seam else []
    if reference is not None:
        multiples += [_multiple(reference, seam) for seam in drawn.seams]
        points, exponent = spline_points(reference, _FIT * tolerance), _exponent(drawn)
    else:
        points, exponent = _halfway(drawn.array, border), None
    seams = {"reference": fractions(points), "reference_position": _position(drawn.array, points)}
    if exponent is not None:
        seams["spacing_exponent"] = exponent
    seams["fractions"] = {drawn.n_pouches: multiples}
    return {
        "length": length,
        "valve": {"flat_half_width_over_length": round(drawn.half_width / length, DIGITS)},
        "outline": [fractions(curve) for curve in outline],
        "pouch_array": [fractions(curve) for curve in border],
        "seams": seams,
    }


def _multiple(reference: np.ndarray, seam: np.ndarray) -> float:
    """The factor in x that takes a reference seam nearest to another one."""
    if seam is reference:
        return 1.0
    guess = seam[:, 0].mean() / reference[:, 0].mean()
    of, to = shapely.points(densified(seam, 1.0)), densified(reference, 1.0)

    def distance(factor: float) -> float:
        return float((shapely.distance(of, LineString(to * [factor, 1.0])) ** 2).sum())

    found = minimize_scalar(distance, bracket=(0.9 * guess, guess), options={"xtol": 1e-10})
    return round(float(found.x), DIGITS)


def _width(array: np.ndarray, y: float) -> float:
    """Half width of the array at a height."""
    hit = LineString(array).intersection(LineString([(-1.0, y), (1e6, y)]))
    return float(hit.bounds[2]) if not hit.is_empty else float(array[:, 0].max())


def _position(array: np.ndarray, seam: np.ndarray) -> float:
    """Where a seam lies at mid-height of the array, over the half width there."""
    middle = float(array[[0, -1], 1].mean())
    hit = LineString(seam).intersection(LineString([(-1.0, middle), (1e6, middle)]))
    x = float(hit.bounds[2]) if not hit.is_empty else float(seam[:, 0].mean())
    return round(min(max(x / _width(array, middle), 0.001), 0.999), 5)


def _exponent(drawn: Drawn) -> float | None:
    """p of 1 - (1 - u)^p that places the drawn seams, for other numbers of pouches; None where it is out of its range."""
    per_face = drawn.n_pouches // 2
    first = 2 if per_face % 2 == 0 else 1
    found = []
    for u, seam in zip(np.arange(first, per_face, 2) / per_face, drawn.seams, strict=True):
        position = _position(drawn.array, seam)
        found.append(math.log(1.0 - position) / math.log(1.0 - u))
    exponent = round(float(np.mean(found)), 2)
    return exponent if 1.0 <= exponent <= 3.0 else None


def _halfway(array: np.ndarray, border: list[np.ndarray]) -> np.ndarray:
    """A seam for other numbers of pouches where the drawing has none off the axis: half as far out as the array's side.

    Where the array has no flat bottom and top that is a straight line over half of the width.
    """
    flat = [len(curve) == 2 and abs(curve[0, 1] - curve[1, 1]) < 0.1 for curve in (border[0], border[-1])]
    if all(flat) and len(border) > 2:
        side = np.vstack([border[1][:1], *(curve[1:] for curve in border[1:-1])])
        return side * [0.5, 1.0]
    x = 0.5 * _width(array, float(array[[0, -1], 1].mean()))
    hit = LineString(array).intersection(LineString([(x, -1e6), (x, 1e6)]))
    low, high = hit.bounds[1], hit.bounds[3]
    return np.array([[x, low], [x, high]])


def deviations_from(drawn: Drawn, flat: FlatPattern) -> dict[str, float]:
    """How far outline, array and seams of a flat pattern are from the drawn ones (mm), the largest distance of each."""
    named = {curve.name: curve.points for curve in flat.curves}
    below = [named[name] for name in sorted((n for n in named if n.startswith("array_low")), key=_number)]
    above = [named[name] for name in sorted((n for n in named if n.startswith("array_top")), key=_number, reverse=True)]
    border = np.vstack([*below, named["array_side"], *above])
    found = {"outline": apart(named["outer"], drawn.outline)[0], "array": apart(border, drawn.array)[0]}
    if drawn.seams:
        made = [named[f"seam{k}"] for k in range(len(drawn.seams))]
        found["seams"] = max(apart(a, b)[0] for a, b in zip(made, drawn.seams, strict=True))
    return found


def _number(name: str) -> int:
    return int(name.lstrip("abcdefghijklmnopqrstuvwxyz_"))
