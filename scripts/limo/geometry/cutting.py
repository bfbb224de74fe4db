"""The cutting pattern of a face to scale, for making the device: polylines on named layers, as SVG and as DXF.

DXF has layers and plain polylines, no splines: Inkscape and LibreCAD lose some of those without a word. R2010 says that
lengths are mm; R12, for cutters that read nothing newer, knows no unit. A bar of 100 mm beside the pattern is to check that.
SVG is written here, because no dependency writes the layers of Inkscape.
"""

from __future__ import annotations

import io
import logging
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import ezdxf
import numpy as np
from ezdxf import units
from shapely import Polygon
from shapely.ops import unary_union

from limo.geometry.pattern import FlatPattern

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
#: of DXF, the first by default
DXF_VERSIONS = ("R2010", "R12")
BAR = 100.0  # mm
_MARGIN = 10.0  # mm
_TEXT = 3.0  # mm
logging.getLogger("ezdxf").addHandler(logging.NullHandler())  # it warns on standard error that R12 knows no unit


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
    notes = [title, *(f"{name}: {meaning}" for name, (_, _, meaning) in layers.items())]
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


def dxf(lines: list[Line], version: str = DXF_VERSIONS[0]) -> str:
    """The same as DXF in mm, a polyline a line: LWPOLYLINE in R2010, POLYLINE in R12. Equal lines give equal texts.

    Coordinates are rounded to 1e-6 mm.
    """
    curves = [np.round(line.points, 6) + 0.0 for line in lines]
    low, high = (bound(np.vstack(curves), axis=0) for bound in (np.min, np.max))
    with _without_stamps():
        document = ezdxf.new(version, units=units.MM)
        for name, (_, color, _) in LAYERS.items():
            document.layers.add(name, color=color)
        space = document.modelspace()
        add = space.add_polyline2d if version == "R12" else space.add_lwpolyline
        for line, curve in zip(lines, curves, strict=True):
            add(curve.tolist(), close=line.closed, dxfattribs={"layer": line.layer})
        space.reset_extents((*low, 0.0), (*high, 0.0))
        document.set_modelspace_vport(height=1.1 * (high - low).max(), center=(low + high) / 2)
        for kind in sorted(document.entitydb.dxf_types_in_use()):  # ezdxf takes them in the order of a set
            document.classes.add_class(kind)
        text = io.StringIO()
        document.write(text)
    return text.getvalue()


@contextmanager
def _without_stamps() -> Iterator[None]:
    """ezdxf writes constants in place of times, GUIDs and its own version."""
    before = ezdxf.options.write_fixed_meta_data_for_testing
    ezdxf.options.write_fixed_meta_data_for_testing = True
    try:
        yield
    finally:
        ezdxf.options.write_fixed_meta_data_for_testing = before
