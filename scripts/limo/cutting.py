"""The cutting pattern of a face to scale, for making the device: polylines on named layers, as SVG and as DXF.

DXF is the plain R12 that every cutter reads: layers and polylines. It knows no unit; lengths are mm, and a bar of 100 mm
is drawn beside the pattern to check that.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from shapely import Polygon
from shapely.ops import unary_union

from limo.geometry import FlatPattern

#: layers with their colour in SVG and its number in DXF, and what is on them
LAYERS = {
    "CUT_WALL": ("#000000", 7, "cut line of the wall sheet, two a device"),
    "CUT_POUCHES": ("#009E73", 3, "cut line of the pouch sheet, two a device"),
    "SEAMS": ("#D55E00", 1, "seals the pouch sheet to the wall"),
    "SEAMS_CLOSED": ("#E69F00", 30, "the same as one closed contour a pouch"),
    "EDGE": ("#0072B2", 5, "seals front and back together"),
    "VALVE": ("#CC79A7", 6, "edge that the valve support takes"),
    "SCALE": ("#777777", 8, "100 mm"),
}
BAR = 100.0  # mm
_MARGIN = 10.0  # mm
_TEXT = 3.0  # mm


@dataclass(frozen=True)
class Line:
    """A polyline on a layer: ``points`` (n, 2) in mm, without the first one again where it is closed."""

    layer: str
    points: np.ndarray
    closed: bool = False


def mirrored(points: np.ndarray) -> np.ndarray:
    """The same curve on the other side of the axis x = 0, in the other direction."""
    return (points * [-1.0, 1.0])[::-1]


def both_halves(polygon: Polygon) -> Polygon:
    """A polygon of the right half and its mirror image as one (mm)."""
    left = Polygon(mirrored(np.array(polygon.exterior.coords)))
    return unary_union([polygon.buffer(1e-9), left.buffer(1e-9)]).simplify(1e-6)


def pouch_contours(pattern: FlatPattern) -> list[Line]:
    """One closed line around each pouch of a face, from the axis outwards; two pouches side by side both have their seam."""
    contours = []
    for region in pattern.regions[1:]:
        sealed = [(pattern.curves[i], d) for i, d in region.loop if pattern.curves[i].kind == "seam"]
        crosses = len(sealed) < len(region.loop)  # the axis, where it has no seam
        if crosses:  # begin behind the axis, so that what is sealed is one line from axis to axis
            at = next(k for k, (i, _) in enumerate(region.loop) if pattern.curves[i].kind == "axis")
            sealed = [(pattern.curves[i], d) for i, d in (*region.loop[at + 1 :], *region.loop[:at])]
        half = np.vstack([curve.points[::d][:-1] for curve, d in sealed])
        if crosses:
            curve, d = sealed[-1]
            end = curve.points[::d][-1:]
            contours.append(Line("SEAMS_CLOSED", np.vstack([half, end, mirrored(half)[:-1]]), closed=True))
        else:
            contours += [Line("SEAMS_CLOSED", points, closed=True) for points in (half, mirrored(half))]
    return contours


def cutting_lines(pattern: FlatPattern, allowance: float = 0.0, seams: str = "lines") -> list[Line]:
    """The lines of one face. Cut lines run ``allowance`` mm outside of the sealed edges and seams.

    ``seams``: ``lines``, each drawn once; ``closed``, one closed contour a pouch; or ``both``, on a layer each.
    """
    regions = [pattern.polygon(region) for region in pattern.regions]
    array = unary_union([region.buffer(1e-9) for region in regions[1:]]).simplify(1e-6)
    wall = unary_union([array, regions[0].buffer(1e-9)]).simplify(1e-6)
    lines = []
    for layer, half in (("CUT_WALL", wall), ("CUT_POUCHES", array)):
        sheet = Polygon(both_halves(half).exterior)
        outside = sheet.buffer(allowance, join_style="mitre", mitre_limit=2.0) if allowance else sheet
        lines.append(Line(layer, np.array(outside.exterior.coords)[:-1], closed=True))
    layers = {"seam": "SEAMS", "outer": "EDGE", "valve": "VALVE"}
    for curve in pattern.curves:
        if (layer := layers.get(curve.kind)) and (layer != "SEAMS" or seams != "closed"):
            on_axis = np.abs(curve.points[:, 0]).max() < 1e-9
            lines += [Line(layer, curve.points), *([] if on_axis else [Line(layer, mirrored(curve.points))])]
    if seams != "lines":
        lines += pouch_contours(pattern)
    low = min(line.points[:, 1].min() for line in lines) - _MARGIN
    return [*lines, Line("SCALE", np.array([[-BAR / 2, low], [BAR / 2, low]]))]


def svg(lines: list[Line], title: str) -> str:
    """A drawing at true size, one group a layer (a layer in Inkscape too), with the layers named below."""
    points = np.vstack([line.points for line in lines])
    (left, low), (right, high) = points.min(axis=0) - _MARGIN, points.max(axis=0) + _MARGIN
    drawn = {line.layer for line in lines}
    layers = {name: look for name, look in LAYERS.items() if name in drawn}
    notes = [title, *(f"{name}: {says}" for name, (_, _, says) in layers.items())]
    width, height = right - left, high - low + 1.5 * _TEXT * len(notes)
    parts = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        '<svg xmlns="http://www.w3.org/2000/svg" xmlns:inkscape="http://www.inkscape.org/namespaces/inkscape" '
        f'width="{width:.3f}mm" height="{height:.3f}mm" viewBox="{left:.3f} {-high:.3f} {width:.3f} {height:.3f}">',
        f"<title>{title}</title>",
    ]
    for name, (color, _, _) in layers.items():
        parts.append(
            f'<g id="{name}" inkscape:groupmode="layer" inkscape:label="{name}" fill="none" stroke="{color}" stroke-width="0.2">'
        )
        for line in (line for line in lines if line.layer == name):
            path = " L ".join(f"{x:.4f},{-y:.4f}" for x, y in line.points)
            parts.append(f'<path d="M {path}{" Z" if line.closed else ""}"/>')
        parts.append("</g>")
    parts.append(f'<g id="NOTES" inkscape:groupmode="layer" inkscape:label="NOTES" font-family="sans-serif" font-size="{_TEXT}">')
    colors = ["#000000", *(color for color, _, _ in layers.values())]
    for k, (note, color) in enumerate(zip(notes, colors, strict=True)):
        parts.append(f'<text x="{left + _MARGIN:.3f}" y="{-low + 1.5 * _TEXT * k:.3f}" fill="{color}">{note}</text>')
    return "\n".join([*parts, "</g>", "</svg>", ""])


def dxf(lines: list[Line]) -> str:
    """The same as DXF R12 in mm."""
    points = np.vstack([line.points for line in lines])
    low, high = points.min(axis=0), points.max(axis=0)
    tags: list[tuple[int, object]] = [(0, "SECTION"), (2, "HEADER"), (9, "$ACADVER"), (1, "AC1009")]
    for name, corner in (("$EXTMIN", low), ("$EXTMAX", high)):
        tags += [(9, name), (10, corner[0]), (20, corner[1]), (30, 0.0)]
    tags += [(0, "ENDSEC"), (0, "SECTION"), (2, "TABLES")]
    tags += [(0, "TABLE"), (2, "LTYPE"), (70, 1), (0, "LTYPE"), (2, "CONTINUOUS"), (70, 0), (3, "Solid line"), (72, 65), (73, 0)]
    tags += [(40, 0.0), (0, "ENDTAB"), (0, "TABLE"), (2, "LAYER"), (70, len(LAYERS))]
    for name, (_, color, _) in LAYERS.items():
        tags += [(0, "LAYER"), (2, name), (70, 0), (62, color), (6, "CONTINUOUS")]
    tags += [(0, "ENDTAB"), (0, "ENDSEC"), (0, "SECTION"), (2, "ENTITIES")]
    for line in lines:
        tags += [(0, "POLYLINE"), (8, line.layer), (66, 1), (10, 0.0), (20, 0.0), (30, 0.0), (70, int(line.closed))]
        for x, y in line.points:
            tags += [(0, "VERTEX"), (8, line.layer), (10, x), (20, y), (30, 0.0)]
        tags += [(0, "SEQEND"), (8, line.layer)]
    tags += [(0, "ENDSEC"), (0, "EOF")]
    return "".join(f"{code:>3}\n{value:.4f}\n" if isinstance(value, float) else f"{code:>3}\n{value}\n" for code, value in tags)
