"""The flat pattern of one face on an axis; no figure of a study."""

from __future__ import annotations

from limo.figures import style
from limo.geometry.cutting import both_halves, mirrored
from limo.geometry.pattern import FlatPattern

#: lines of a pattern by the kind of their curves: what they are, colour and width
LINES = {
    "outer": ("sealed edge", "k", 1.4),
    "valve": ("valve edge", style.COLORS[3], 2.4),
    "seam": ("seam", style.COLORS[1], 1.2),
}


def draw_pattern(axis, pattern: FlatPattern) -> None:
    """Draw one face: pouches filled, then seams, sealed edge and valve edge."""
    for region in pattern.regions[1:]:
        half = pattern.polygon(region)
        whole = both_halves(half)
        for part in getattr(whole, "geoms", [whole]):
            axis.fill(*part.exterior.xy, color=style.COLORS[5], alpha=0.25, lw=0)
    for kind, (_, color, width) in LINES.items():
        for curve in (c for c in pattern.curves if c.kind == kind):
            for points in (curve.points, mirrored(curve.points)):
                axis.plot(*points.T, color=color, lw=width, solid_capstyle="butt")
    axis.set_aspect("equal")
