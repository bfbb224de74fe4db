"""Which lines of a drawing are what: outline, valve edge, pouch array and seams, by layer or colour; and how long its unit is."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from shapely import LineString

from limo.drawings.lines import as_line
from limo.drawings.read import LARGEST_COORDINATE, UNITS, Drawing, Shape, parse_unit
from limo.errors import ConfigError
from limo.geometry.cutting import BAR

#: the layers of the project's own cutting pattern, by what is on them
LAYERS: dict[str, tuple[str, ...]] = {
    "outline": ("EDGE",),
    "valve": ("VALVE",),
    "array": (),
    "seams": ("SEAMS", "SEAMS_CLOSED"),
    "scale": ("SCALE",),
}
FLATTENING = 0.02  # of the tolerance, by which a polyline may be off the curve of the drawing that it stands for
_COLOR = re.compile(r"^#[0-9a-f]{6}$")
_EXAMPLE = "--map outline=EDGE valve=VALVE seams=SEAMS, with layers or colours such as #d55e00"


@dataclass(frozen=True)
class Roles:
    """The lines of a drawing in mm by what they are, y upwards.

    ``unit`` says where the unit comes from, ``layers`` which layers each role has, for messages; ``unused`` the other layers.
    """

    drawing: Drawing
    lines: dict[str, list[LineString]]
    unit: str
    layers: dict[str, str]
    unused: tuple[str, ...]

    def where(self, *roles: str) -> str:
        """Names of the layers of some roles, for messages."""
        return "layer " + ", ".join(dict.fromkeys(self.layers[role] for role in roles if self.layers[role]))


def parse_map(words: Sequence[str]) -> dict[str, tuple[str, ...]]:
    """Layers and colours by role, from words such as ``outline=WALL`` and ``seams=#ff0000``; the others have those of ``LAYERS``.

    Raises ``ConfigError`` for a word of another form and for a name that has two roles.
    """
    found: dict[str, list[str]] = {}
    for word in words:
        role, sign, name = word.partition("=")
        if role not in LAYERS or not sign or not name.strip():
            raise ConfigError(
                "limo import-pattern", "--map", word, f"ROLE=LAYER or ROLE=#RRGGBB, ROLE of {', '.join(LAYERS)}", _EXAMPLE
            )
        name = name.strip()
        if name.startswith("#") and not _COLOR.match(name.casefold()):
            raise ConfigError(
                "limo import-pattern", "--map", word, "a colour as # and six hexadecimal digits", "--map seams=#ff0000"
            )
        found.setdefault(role, []).append(name)
    layers = {role: tuple(found.get(role, names)) for role, names in LAYERS.items()}
    stated = {name.casefold() for names in found.values() for name in names}
    for role in LAYERS.keys() - found.keys():  # a name that is stated for one role is no longer another's by default
        layers[role] = tuple(name for name in layers[role] if name.casefold() not in stated)
    roles_of: dict[str, set[str]] = {}
    for role, names in layers.items():
        for name in names:
            roles_of.setdefault(name.casefold(), set()).add(role)
    for name, roles in roles_of.items():
        if len(roles - {"array"}) > 1 or ("array" in roles and roles - {"array", "seams"}):
            expected = "one role for a layer or colour (array and seams may share theirs)"
            raise ConfigError("limo import-pattern", "--map", f"{name} is {' and '.join(sorted(roles))}", expected, _EXAMPLE)
    return layers


def find_roles(drawing: Drawing, mapping: Sequence[str], units: str | None, tolerance: float) -> Roles:
    """The lines of a drawing by role, in mm, no further than ``FLATTENING`` times ``tolerance`` (mm) from its curves.

    Raises ``ConfigError`` where a role has no lines, and where the unit is not known or two statements of it differ.
    """
    names = parse_map(mapping)
    shapes: dict[str, list[Shape]] = {role: [] for role in LAYERS}
    unused: dict[str, int] = {}
    for shape in drawing.shapes:
        if role := _role_of(shape, names):
            shapes[role].append(shape)
        else:
            unused[shape.layer] = unused.get(shape.layer, 0) + 1
    _check_found(drawing, names, shapes)
    factor, unit = _unit(drawing, units, shapes["scale"])
    lines: dict[str, list[LineString]] = {}
    layers: dict[str, str] = {}
    for role, chosen in shapes.items():
        flat = [part for shape in chosen for part in drawing.lines(shape, FLATTENING * tolerance / factor)]
        lines[role] = [as_line(points * factor, closed) for points, closed in flat]
        layers[role] = ", ".join(dict.fromkeys(shape.layer for shape in chosen))
        if any(np.abs(line.bounds).max() > LARGEST_COORDINATE for line in lines[role]):
            raise ConfigError(drawing.file, "(units)", unit, "a drawing in millimetres of this world", "--units mm")
    return Roles(drawing, lines, unit, layers, tuple(f"{layer} ({count})" for layer, count in unused.items()))


def _role_of(shape: Shape, names: dict[str, tuple[str, ...]]) -> str | None:
    """The role of the innermost name that has one, else of the colour."""
    for name in (*shape.names, *shape.colors):
        for role in ("outline", "valve", "seams", "array", "scale"):
            if name.casefold() in map(str.casefold, names[role]):
                return role
    return None


def _check_found(drawing: Drawing, names: dict[str, tuple[str, ...]], shapes: dict[str, list[Shape]]) -> None:
    """Every role must have lines, and every name that the mapping states."""
    needed = {"outline": ("outline",), "valve": ("valve",), "seams": ("seams", "array")}
    missing = [role for role, any_of in needed.items() if not any(shapes[r] for r in any_of)]
    if missing:
        wanted = [name for role in missing for r in needed[role] for name in names[r]]
        raise ConfigError(
            drawing.file,
            f"lines of {', '.join(missing)}",
            f"none on {', '.join(wanted)}",
            f"layers or colours of the file: {drawing.layers()}",
            f"--map {' '.join(f'{role}=NAME' for role in missing)}, or {missing[0]}=#RRGGBB by colour",
        )
    for role, wanted in names.items():
        if set(wanted) <= set(LAYERS[role]):
            continue
        for name in wanted:
            if not any(name.casefold() in map(str.casefold, (*s.names, *s.colors)) for s in shapes[role]):
                expected = f"a layer or colour of the file: {drawing.layers()}"
                raise ConfigError(drawing.file, f"--map {role}", name, expected, f"--map {role}=NAME or --map {role}=#RRGGBB")


def _unit(drawing: Drawing, given: str | None, bars: list[Shape]) -> tuple[float, str]:
    """Millimetres of the drawing's unit, and where that comes from: the option, the file, or the bar of 100 mm."""
    lengths = [
        float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum()) for bar in bars for points, _ in drawing.lines(bar, 1e-3)
    ]
    bar = lengths[0] if len(lengths) == 1 else None
    if given is not None:
        factor = parse_unit(given)
        return factor, f"{given if given in UNITS else f'{factor:g} mm'} (--units; the file states {drawing.unit})"
    if drawing.mm_per_unit is not None:
        drawn = None if bar is None else bar * drawing.mm_per_unit
        if drawn is not None and abs(drawn / BAR - 1.0) > 0.01:
            raise ConfigError(
                drawing.file,
                "(units)",
                f"{drawing.unit}, with which the bar on layer {bars[0].layer} is {drawn:.4g} mm long",
                f"one unit by both: the bar stands for {BAR:g} mm",
                f"--units {_nearest(BAR / bar)}, or delete the bar",
            )
        return drawing.mm_per_unit, drawing.unit
    if bar:
        return BAR / bar, f"{_nearest(BAR / bar)}, by the bar of {BAR:g} mm on layer {bars[0].layer}"
    stated = "$INSUNITS in a DXF file, width and height in mm beside a viewBox in SVG"
    expected = f"a unit: {stated}, or --units ({', '.join(UNITS)}, or mm a unit)"
    raise ConfigError(drawing.file, "(units)", drawing.unit, expected, "--units mm")


def _nearest(factor: float) -> str:
    """The name of a unit of so many mm, or the number."""
    for name, value in UNITS.items():
        if abs(factor / value - 1.0) < 1e-4:
            return name
    return f"{factor:.6g}"
