"""What a DXF or SVG file draws: shapes by layer and colour, flattened to polylines in the file's own unit, y upwards.

ezdxf and svgelements read the files. Blocks are taken apart, transforms are applied, and the unit is what the file states.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np

from limo.errors import ConfigError

#: units by name, in mm
UNITS = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "in": 25.4, "ft": 304.8, "pt": 25.4 / 72, "px": 25.4 / 96}
LARGEST_FILE = 64_000_000  # bytes
LARGEST_COORDINATE = 1e9  # of a drawing, in its unit
MOST_POINTS = 1_000_000
_EXAMPLE = "limo import-pattern drawing.dxf"
_DEEPEST = 20  # blocks in blocks
#: what the readers raise at damaged files
BROKEN = (OSError, ArithmeticError, LookupError, TypeError, ValueError, AttributeError, RecursionError)

Flatten = Callable[[float], list[tuple[np.ndarray, bool]]]


@dataclass(frozen=True)
class Shape:
    """One entity of a drawing.

    ``names``: its layer; in SVG its own id and those of the groups around it, innermost first. ``layer`` is the one for people.
    ``colors``: ``#rrggbb``; black and white are one in DXF. ``flatten(distance)`` gives polylines (n, 2) that are nowhere
    further than ``distance`` from the curve, each with whether it is closed; both in the drawing's unit.
    """

    layer: str
    names: tuple[str, ...]
    colors: tuple[str, ...]
    kind: str
    flatten: Flatten = field(repr=False)


@dataclass(frozen=True)
class Drawing:
    """The shapes of a file, and the unit that it states: ``mm_per_unit`` is None where it states none.

    ``unit`` says in words what the file states. ``left_out`` counts what is no line, and what is not shown.
    """

    file: Path
    shapes: tuple[Shape, ...]
    unit: str
    mm_per_unit: float | None
    left_out: Counter[str]

    def lines(self, shape: Shape, distance: float) -> list[tuple[np.ndarray, bool]]:
        """Polylines of a shape and whether they are closed. Raises ``ConfigError`` for one that its reader cannot follow."""
        try:
            return shape.flatten(distance)
        except BROKEN as error:
            raise unreadable(self.file, error) from None

    def layers(self) -> str:
        """Layers with their numbers of shapes and their colours, for messages."""
        found: dict[str, Counter[str]] = {}
        for shape in self.shapes:
            found.setdefault(shape.layer, Counter())[shape.colors[0] if shape.colors else "no colour"] += 1
        listed = [f"{name} ({sum(c.values())} x {', '.join(list(c)[:3])})" for name, c in found.items()]
        return "; ".join(listed[:12]) + (f"; and {len(listed) - 12} more" if len(listed) > 12 else "") if listed else "none"


def read_drawing(file: Path) -> Drawing:
    """The shapes of a DXF or SVG file. Raises ``ConfigError`` for one that cannot be read or has no lines."""
    readers = {".dxf": _read_dxf, ".svg": _read_svg}
    if file.suffix.lower() not in readers:
        raise ConfigError("limo import-pattern", "FILE", str(file), "a file that ends in .dxf or .svg", _EXAMPLE)
    try:
        size = file.stat().st_size
        if not file.is_file():
            raise OSError("not a file")
    except OSError as error:
        reason = error.strerror or str(error)
        raise ConfigError("limo import-pattern", "FILE", str(file), f"a readable file ({reason})", _EXAMPLE) from None
    if size > LARGEST_FILE:
        expected = f"a drawing of at most {LARGEST_FILE // 1_000_000} MB"
        raise ConfigError(file, "(file)", f"{size / 1e6:.0f} MB", expected, "delete what is not the pattern")
    drawing = readers[file.suffix.lower()](file)
    if not drawing.shapes:
        found = ", ".join(f"{count} {kind}" for kind, count in drawing.left_out.items()) or "nothing"
        expected = "lines, arcs, splines or polylines that are shown"
        raise ConfigError(file, "(file)", found, expected, "draw the pattern in the model space, on layers that are on")
    return drawing


def parse_unit(text: str) -> float:
    """Millimetres of a unit: its name, or a number of mm. Raises ``ConfigError`` for anything else."""
    try:
        factor = UNITS[text] if text in UNITS else float(text)
    except ValueError:
        factor = math.nan
    if not 1e-6 <= factor <= 1e6:
        expected = f"one of {', '.join(UNITS)}, or mm a unit as a number"
        raise ConfigError("limo import-pattern", "--units", text, expected, "--units mm")
    return factor


def unreadable(file: Path, error: BaseException) -> ConfigError:
    """The message for a file that its reader does not take."""
    kind = file.suffix.lower()
    remedy = "save it again as DXF R2010 or R12" if kind == ".dxf" else "save it again as plain SVG"
    reason = f"{type(error).__name__}: {error}"[:200]
    return ConfigError(file, "(file)", reason, f"a {kind[1:].upper()} file that is whole", remedy)


def _checked(points: np.ndarray) -> np.ndarray:
    """Points (n, 2) without repetitions. Raises ``ValueError`` for coordinates that no drawing has."""
    points = np.asarray(points, float).reshape(-1, 2)
    if not np.isfinite(points).all() or np.abs(points).max(initial=0.0) > LARGEST_COORDINATE:
        raise ValueError(f"coordinates beyond {LARGEST_COORDINATE:g}")
    moved = np.concatenate([[True], np.any(np.diff(points, axis=0) != 0, axis=1)]) if len(points) else []
    return points[moved]


# --------------------------------------------------------------------------------------------------------------------
# DXF


def _read_dxf(file: Path) -> Drawing:
    import ezdxf
    from ezdxf import units

    try:
        document = ezdxf.readfile(file)
        # the reader gives a file without a header the units of a new one
        code = int(document.header.get("$INSUNITS", 0) or 0) if b"$INSUNITS" in file.read_bytes() else 0
        left_out: Counter[str] = Counter()
        shapes = tuple(_entities(document, document.modelspace(), left_out, "", (), 0))
    except (ezdxf.DXFError, *BROKEN) as error:
        raise unreadable(file, error) from None
    factor = None
    if code:
        try:
            factor = float(units.conversion_factor(code, units.MM))
        except (LookupError, TypeError, ValueError):
            code = 0
    unit = f"{units.unit_name(code)} ($INSUNITS = {code})" if code else "no unit ($INSUNITS)"
    return Drawing(file, shapes, unit, factor, left_out)


def _entities(document, entities, left_out: Counter[str], parent: str, inherited: tuple[str, ...], depth: int) -> Iterator[Shape]:
    """Shapes of entities; those of blocks take the layer and the colour of their insert where theirs is open."""
    if depth > _DEEPEST:
        raise ValueError(f"blocks in blocks, more than {_DEEPEST} deep")
    for entity in entities:
        kind, layer = entity.dxftype(), entity.dxf.get("layer", "0")
        layer = parent if layer == "0" and parent else layer
        colors = _dxf_colors(document, entity, layer, inherited)
        record = document.layers.get(layer) if layer in document.layers else None
        if entity.dxf.get("invisible", 0) or (record is not None and (record.is_off() or record.is_frozen())):
            left_out["hidden"] += 1
        elif kind == "INSERT":
            for copy in entity.multi_insert() if entity.mcount > 1 else [entity]:
                yield from _entities(document, copy.virtual_entities(), left_out, layer, colors, depth + 1)
        elif kind in _FLATTEN and not (kind == "POLYLINE" and (entity.is_polygon_mesh or entity.is_poly_face_mesh)):
            yield Shape(layer, (layer,), colors, kind, partial(_flatten_dxf, entity))
        else:
            left_out[kind] += 1


def _dxf_colors(document, entity, layer: str, inherited: tuple[str, ...]) -> tuple[str, ...]:
    """The colour that an entity is shown in; number 7 is black on white and white on black."""
    from ezdxf import colors

    def of(owner, number: int) -> tuple[str, ...]:
        if owner.dxf.hasattr("true_color"):
            return ("#{:02x}{:02x}{:02x}".format(*colors.int2rgb(owner.dxf.true_color)),)
        if number == 7:
            return ("#000000", "#ffffff")
        return ("#{:02x}{:02x}{:02x}".format(*colors.aci2rgb(number)),) if 0 < number < 256 else ()

    number = entity.dxf.get("color", 256)
    if number == 0 and not entity.dxf.hasattr("true_color"):
        return inherited
    if number == 256 and not entity.dxf.hasattr("true_color"):
        record = document.layers.get(layer) if layer in document.layers else None
        return of(entity, 7) if record is None else of(record, abs(record.dxf.get("color", 7)))
    return of(entity, number)


def _flatten_dxf(entity, distance: float) -> list[tuple[np.ndarray, bool]]:
    vertices, closed = _FLATTEN[entity.dxftype()](entity, distance)
    points = _checked(np.array([(v[0], v[1]) for v in vertices], float))
    return [_closed(points, closed)] if len(points) > 1 else []


def _closed(points: np.ndarray, closed: bool) -> tuple[np.ndarray, bool]:
    """A polyline without its first point again, and whether it is closed."""
    if len(points) > 2 and (points[0] == points[-1]).all():
        return points[:-1], True
    return points, closed and len(points) > 2


def _round(entity, distance: float, size: float):
    """Vertices of a curve, no finer than a millionth of its size; that of a full circle or ellipse ends where it begins."""
    vertices = list(entity.flattening(max(distance, 1e-6 * size)))
    full = len(vertices) > 3 and vertices[0].isclose(vertices[-1], rel_tol=0, abs_tol=1e-9 * max(size, 1e-9))
    return vertices[:-1] if full else vertices, full


def _circle(entity, distance: float):
    return _round(entity, distance, abs(entity.dxf.radius))


def _ellipse(entity, distance: float):
    return _round(entity, distance, entity.dxf.major_axis.magnitude)


def _spline(entity, distance: float):
    points = np.array([tuple(p)[:2] for p in (*entity.control_points, *entity.fit_points)], float)
    return _round(entity, distance, float(np.ptp(points, axis=0).max()) if len(points) else 0.0)


def _line(entity, _distance: float):
    return (entity.dxf.start, entity.dxf.end), False


def _polyline(entity, distance: float):
    """A light or old polyline, with its arcs; of one that CAD smoothed, the curve without the points that frame it."""
    if entity.dxftype() == "POLYLINE" and any(vertex.dxf.flags & 16 for vertex in entity.vertices):
        on_curve = (vertex for vertex in entity.vertices if not vertex.dxf.flags & 16)
        return [vertex.dxf.location for vertex in on_curve], entity.is_closed
    closed = entity.closed if entity.dxftype() == "LWPOLYLINE" else entity.is_closed
    if not entity.has_arc:
        points = entity.vertices_in_wcs() if entity.dxftype() == "LWPOLYLINE" else entity.points_in_wcs()
        return list(points), closed
    from ezdxf.path import make_path

    return list(make_path(entity, segments=36).flattening(distance)), closed


_FLATTEN = {
    "LINE": _line,
    "LWPOLYLINE": _polyline,
    "POLYLINE": _polyline,
    "ARC": _circle,
    "CIRCLE": _circle,
    "ELLIPSE": _ellipse,
    "SPLINE": _spline,
    "HELIX": _spline,
}

# --------------------------------------------------------------------------------------------------------------------
# SVG

_LENGTH = re.compile(r"^\s*\+?(\d*\.?\d+(?:[eE][-+]?\d+)?)\s*([a-zA-Z%]*)\s*$")
_PHYSICAL = {"mm": 1.0, "cm": 10.0, "in": 25.4, "pt": 25.4 / 72, "pc": 25.4 / 6, "q": 0.25}
_INKSCAPE = "{http://www.inkscape.org/namespaces/inkscape}"
_NO_LAYER = "(no layer)"


def _read_svg(file: Path) -> Drawing:
    from xml.etree.ElementTree import ParseError

    from svgelements import SVG, Matrix

    try:
        root = SVG.parse(str(file), reify=True)
        if not isinstance(root, SVG):
            raise ValueError("no svg element at the top")
        to_units = ~Matrix(root.viewbox_transform) if root.viewbox is not None else Matrix()
        left_out: Counter[str] = Counter()
        shapes = tuple(_elements(root, _Place(), to_units, left_out))
        unit, factor = _svg_unit(root)
    except (ParseError, *BROKEN) as error:
        raise unreadable(file, error) from None
    return Drawing(file, shapes, unit, factor, left_out)


def _svg_unit(root) -> tuple[str, float | None]:
    """What width, height and viewBox say of a unit's length: nothing where they are in pixels, which have no fixed size."""
    attributes = root.values.get("attributes", {})
    sizes = []
    for key in ("width", "height"):
        match = _LENGTH.match(attributes.get(key, ""))
        if match and match[2].lower() in _PHYSICAL:
            sizes.append(float(match[1]) * _PHYSICAL[match[2].lower()])
    stated = ", ".join(f'{key} "{attributes[key]}"' for key in ("width", "height", "viewBox") if key in attributes)
    if not sizes:
        return f"no unit ({stated or 'no width and height'})", None
    if root.viewbox is None:
        return f"mm by {stated}: 96 px an inch", UNITS["px"]
    box = [float(root.viewbox.width), float(root.viewbox.height)]
    if len(sizes) < 2:
        return f"no unit ({stated}: width or height is missing)", None
    scales = [size / extent for size, extent in zip(sizes, box, strict=True)]
    if abs(scales[0] / scales[1] - 1.0) > 1e-3:
        return f"no unit ({stated}: unlike scales in x and y)", None
    return f"mm by {stated}", min(scales)


@dataclass(frozen=True)
class _Place:
    """The groups around an element: names, innermost first, and the name for people, that of a layer of Inkscape's if any."""

    names: tuple[str, ...] = ()
    layer: str = _NO_LAYER
    is_layer: bool = False

    def inside(self, own: tuple[str, ...], is_layer: bool) -> _Place:
        named = bool(own) and (is_layer or not self.is_layer)
        return _Place(own + self.names, own[0] if named else self.layer, self.is_layer or is_layer)


def _elements(group, place: _Place, to_units, left_out: Counter[str]) -> Iterator[Shape]:
    """Shapes of a group and of the groups in it."""
    from svgelements import Group, Path, Use
    from svgelements import Shape as Drawn

    for element in group:
        attributes = element.values.get("attributes", {}) if hasattr(element, "values") else {}
        own = tuple(dict.fromkeys(attributes[key] for key in (f"{_INKSCAPE}label", "id") if attributes.get(key)))
        if isinstance(element, Group | Use):
            is_layer = attributes.get(f"{_INKSCAPE}groupmode") == "layer"
            yield from _elements(element, place.inside(own, is_layer), to_units, left_out)
        elif not isinstance(element, Drawn):
            if (tag := attributes.get("tag")) in ("text", "tspan", "image"):
                left_out[tag] += 1
        elif element.values.get("visibility") in ("hidden", "collapse"):
            left_out["hidden"] += 1
        else:
            path = (element if isinstance(element, Path) else Path(element)) * to_units
            path.reify()
            kind = attributes.get("tag", "path")
            yield Shape(place.layer, own + place.names, _svg_colors(element), kind, partial(_flatten_svg, path))


def _svg_colors(element) -> tuple[str, ...]:
    """The colour of the stroke, or where there is none of the area."""
    for paint in (element.stroke, element.fill):
        if paint is not None and paint.value is not None:
            return (f"#{paint.red:02x}{paint.green:02x}{paint.blue:02x}",)
    return ()


def _flatten_svg(path, distance: float) -> list[tuple[np.ndarray, bool]]:
    """Polylines of the parts of a path, y upwards."""
    from svgelements import Arc, Close, CubicBezier, Move, QuadraticBezier

    parts: list[tuple[list[np.ndarray], bool]] = []
    for segment in path:
        if segment.end is None:
            continue
        end = np.array([[segment.end.x, segment.end.y]])
        if isinstance(segment, Move):
            parts.append(([end], False))
            continue
        if not parts or parts[-1][1]:  # a path goes on where it was closed
            parts.append(([np.array([[segment.start.x, segment.start.y]])], False))
        points, _ = parts[-1]
        if isinstance(segment, Close):
            parts[-1] = (points, True)
        elif isinstance(segment, Arc | CubicBezier | QuadraticBezier):
            count = _pieces(segment, distance)
            points.append(np.asarray(segment.npoint(np.linspace(0.0, 1.0, count + 1)[1:-1]), float).reshape(-1, 2))
            points.append(end)
        else:
            points.append(end)
    found = []
    for points, closed in parts:
        line = _checked(np.vstack(points) * [1.0, -1.0])
        if len(line) > 1:
            found.append(_closed(line, closed))
    return found


def _pieces(segment, distance: float) -> int:
    """How many equal parts of the parameter keep chords within ``distance``: h^2 / 8 times the largest second derivative."""
    from svgelements import Arc

    if isinstance(segment, Arc):
        radius = max(abs(segment.rx), abs(segment.ry))
        half = math.acos(max(1.0 - distance / radius, -1.0)) if radius > distance else math.pi / 2
        return min(max(math.ceil(abs(segment.sweep) / (2.0 * half)), 2), MOST_POINTS)
    control = [complex(p.x, p.y) for p in segment if p is not None]
    bend = max(abs(a - 2 * b + c) for a, b, c in zip(control, control[1:], control[2:], strict=False))
    second = bend * (6.0 if len(control) == 4 else 2.0)
    return min(max(math.ceil(math.sqrt(second / (8.0 * distance))), 2), MOST_POINTS) if math.isfinite(second) else 2
