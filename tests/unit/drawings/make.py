"""Drawings for tests: plain lines on layers, as DXF files of several kinds and as SVG, and a simple pattern to change."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from itertools import pairwise
from pathlib import Path

import ezdxf
import numpy as np

from limo.drawings.lines import apart
from limo.geometry.pattern import FlatPattern

#: layer, points (n, 2), closed
Line = tuple[str, np.ndarray, bool]
Move = Callable[[np.ndarray], np.ndarray]


def moved(angle: float = 0.0, shift: tuple[float, float] = (0.0, 0.0), scale: float = 1.0, mirror: bool = False) -> Move:
    """A map of points: mirrored at x = 0, turned by an angle in degrees, scaled, shifted."""
    c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))

    def move(points: np.ndarray) -> np.ndarray:
        points = np.asarray(points, float) * ([-1.0, 1.0] if mirror else [1.0, 1.0])
        return scale * (points @ np.array([[c, s], [-s, c]])) + shift

    return move


def plain(lines: Iterable) -> list[Line]:
    """The lines of a cutting pattern as layer, points, closed."""
    return [(line.layer, line.points, line.closed) for line in lines]


def write_dxf(
    path: Path,
    lines: Iterable[Line],
    *,
    version: str = "R2010",
    code: int = 4,
    exploded: bool = False,
    move: Move = lambda points: points,
    colors: Mapping[str, int] | None = None,
) -> Path:
    """Lines as a DXF file: polylines, or every segment a LINE of its own; ``colors``: all on layer 0, told apart by colour."""
    document = ezdxf.new(version)
    document.units = code
    space = document.modelspace()
    for layer, points, closed in lines:
        look = {"layer": layer} if colors is None else {"layer": "0", "color": colors[layer]}
        points = move(points)
        if exploded:
            ring = np.vstack([points, points[:1]]) if closed else points
            for a, b in pairwise(ring):
                space.add_line(a, b, dxfattribs=look)
        elif version == "R12":
            space.add_polyline2d(points.tolist(), close=closed, dxfattribs=look)
        else:
            space.add_lwpolyline(points.tolist(), close=closed, dxfattribs=look)
    document.saveas(path)
    return path


def write_svg(path: Path, body: str, root: str = 'width="200mm" height="200mm" viewBox="0 0 200 200"') -> Path:
    """An SVG file of some elements."""
    names = 'xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink"'
    names += ' xmlns:inkscape="http://www.inkscape.org/namespaces/inkscape"'
    path.write_text(f"<svg {names} {root}>{body}</svg>", encoding="utf-8")
    return path


def svg_lines(lines: Iterable[Line], move: Move = lambda points: points) -> str:
    """Lines as SVG paths in a group a layer, y downwards."""
    parts = []
    for layer, points, closed in lines:
        path = " ".join(f"{x:.5f},{-y:.5f}" for x, y in move(points))
        parts.append(f'<g id="{layer}"><path fill="none" stroke="black" d="M {path}{" Z" if closed else ""}"/></g>')
    return "".join(parts)


def mirrored(points: np.ndarray) -> np.ndarray:
    return np.asarray(points, float) * [-1.0, 1.0]


def box(x0: float, y0: float, x1: float, y1: float) -> np.ndarray:
    return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]], float)


def simple(*seams: np.ndarray, array: np.ndarray | None = None) -> list[Line]:
    """A face of 100 mm by 120 mm, its array from (-40, 20) to (40, 95), and seams in it on both sides (default: at x = 15)."""
    array = box(-40, 20, 40, 95) if array is None else array
    lines: list[Line] = [
        ("VALVE", np.array([[-50.0, 0.0], [50.0, 0.0]]), False),
        ("EDGE", np.array([[50.0, 0.0], [50.0, 90.0], [20.0, 120.0], [-20.0, 120.0], [-50.0, 90.0], [-50.0, 0.0]]), False),
        ("SEAMS", array, True),
    ]
    for seam in seams or (np.array([[15.0, 20.0], [15.0, 95.0]]),):
        lines += [("SEAMS", np.asarray(seam, float), False), ("SEAMS", mirrored(seam), False)]
    return lines


def difference(first: FlatPattern, second: FlatPattern) -> float:
    """How far two flat patterns are apart in mm, the largest of all their curves; they must have the same ones."""
    assert first.n_pouches == second.n_pouches
    assert first.axis_is_seam == second.axis_is_seam
    curves = [{curve.name: curve for curve in pattern.curves} for pattern in (first, second)]
    assert curves[0].keys() == curves[1].keys()
    assert all(curves[0][name].kind == curves[1][name].kind for name in curves[0])
    return max(apart(curves[0][name].points, curves[1][name].points)[0] for name in curves[0])
