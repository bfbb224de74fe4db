"""`limo import-pattern`: a device from a drawing, as the YAML file of `config/devices`, with a picture of both."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from limo.config.yaml_file import parse, read_yaml
from limo.drawings.pattern import Half, Imported, find_pattern, make_pattern
from limo.drawings.read import read_drawing
from limo.drawings.roles import Roles, find_roles
from limo.errors import ConfigError
from limo.schema.device import Device, Material
from limo.schema.section import NAME
from limo.store.files import write_whole

TOLERANCE = 0.05  # mm
SMALLEST_TOLERANCE, LARGEST_TOLERANCE = 0.002, 2.0  # mm
_LINE = 120  # characters


@dataclass(frozen=True)
class Request:
    """What `limo import-pattern` is asked for: the file, and what settles what a file leaves open.

    ``tolerance`` in mm: of the curves, of gaps between ends, and of left against right. ``mapping``: words such as
    ``seams=#ff0000``. ``units``: a name or mm a unit. ``fabric``: the device whose material is taken.
    """

    file: Path
    name: str | None = None
    mapping: tuple[str, ...] = ()
    units: str | None = None
    tolerance: float = TOLERANCE
    half: Half | None = None
    fabric: str = "limo"


def import_pattern(request: Request, config_file: str, folder: Path, *, replace: bool = False) -> list[str]:
    """Write the device of a drawing beside a configuration and a picture of it into a folder; returns lines that say so.

    Raises ``ConfigError`` for a drawing that is no pattern of the model and for a name that is taken; then nothing is written.
    """
    devices = Path(config_file).parent / "devices"
    name, target = _target(request, devices, replace)
    if not SMALLEST_TOLERANCE <= request.tolerance <= LARGEST_TOLERANCE:
        expected = f"millimetres from {SMALLEST_TOLERANCE:g} to {LARGEST_TOLERANCE:g}"
        raise ConfigError("limo import-pattern", "--tolerance", request.tolerance, expected, f"--tolerance {TOLERANCE:g}")
    material = _fabric(request.fabric, devices)
    roles, found = read_pattern(request)
    text = device_text(found, roles, request, material)
    write_whole(target, lambda path: _write_checked(path, text))
    picture = folder / f"{name}_import.png"
    _draw(found, request, name, picture)
    return [f"{target}", *_summary(found, roles, request), f"{picture}"]


def read_pattern(request: Request) -> tuple[Roles, Imported]:
    """The lines of a drawing by role, and the pattern made of them. Raises ``ConfigError`` as ``import_pattern`` does."""
    roles = find_roles(read_drawing(request.file), request.mapping, request.units, request.tolerance)
    drawn = find_pattern(roles, request.tolerance, request.half)
    return roles, make_pattern(drawn, roles, request.tolerance)


def _target(request: Request, devices: Path, replace: bool) -> tuple[str, Path]:
    """Name and file of the device; raises for a name that cannot be and for one that is taken."""
    name = request.name if request.name is not None else re.sub(r"\W+", "_", request.file.stem)
    if not re.match(NAME, name):
        expected = "letters, digits and _, a letter first"
        raise ConfigError("limo import-pattern", "--name", name, expected, "--name my_device")
    target = devices / f"{name}.yaml"
    taken = [file for file in (target, devices / f"{name}.yml") if file.exists()]
    if taken and not (replace and taken == [target]):
        expected = "a name that no device has, or --replace"
        raise ConfigError("limo import-pattern", "--name", str(taken[0]), expected, f"--name {name}_2")
    return name, target


def _fabric(name: str, devices: Path) -> Material:
    """The material of a device."""
    for file in (devices / f"{name}.yaml", devices / f"{name}.yml"):
        if file.is_file():
            return parse(Device, read_yaml(file), file).material
    known = ", ".join(sorted(file.stem for file in devices.glob("*.y*ml"))) or f"none in {devices}"
    raise ConfigError("limo import-pattern", "--fabric", name, f"one of: {known}", "--fabric limo")


def _write_checked(path: Path, text: str) -> None:
    """Write the text of a device, and read it back as what a study will see."""
    path.write_text(text, encoding="utf-8")
    parse(Device, read_yaml(path), path)


# --------------------------------------------------------------------------------------------------------------------
# the file


def device_text(found: Imported, roles: Roles, request: Request, material: Material) -> str:
    """The YAML of a device with where each part of it comes from."""
    digest = hashlib.sha256(request.file.read_bytes()).hexdigest()[:12]
    lines = [f"# Imported from {request.file.name} (sha256 {digest}) by limo import-pattern."]
    lines += [f"# {line[:1].upper()}{line[1:]}." for line in _summary(found, roles, request)]
    data = found.data
    lines += ["pattern:", f"  length: {_number(data['length'])} # mm", "  valve:"]
    lines += [f"    flat_half_width_over_length: {_number(data['valve']['flat_half_width_over_length'])}"]
    for key in ("outline", "pouch_array"):
        lines.append(f"  {key}:")
        for curve in data[key]:
            lines += _points(curve, "    - ", "      ")
    seams = data["seams"]
    lines += ["  seams:"]
    if not found.drawn.seams:
        lines += ["    # the drawing has no seam off the axis: this one is for other numbers of pouches only"]
    lines += _points(seams["reference"], "    reference: ", "      ")
    lines += [f"    reference_position: {_number(seams['reference_position'])}"]
    if "spacing_exponent" in seams:
        lines += [f"    spacing_exponent: {_number(seams['spacing_exponent'])} # for other numbers of pouches"]
    lines += ["    fractions:"]
    lines += [f"      {n}: [{', '.join(map(_number, multiples))}]" for n, multiples in seams["fractions"].items()]
    lines += [f"material: # of {request.fabric}; a drawing does not say it"]
    lines += [f"  {key}: {_number(value)}" for key, value in material.model_dump(mode="json").items()]
    return "\n".join([*lines, ""])


def _number(value: float) -> str:
    text = f"{value:.6f}".rstrip("0")
    return f"{text}0" if text.endswith(".") else text


def _points(points: Sequence[Sequence[float]], first: str, indent: str) -> list[str]:
    """A list of points on lines that are not too long: the text before it, and before the lines that go on."""
    words = [f"[{', '.join(map(_number, point))}]" for point in points]
    lines, line = [], f"{first}[{words[0]}"
    for word in words[1:]:
        if len(line) + len(word) + 3 > _LINE:
            lines.append(f"{line},")
            line = f"{indent}{word}"
        else:
            line += f", {word}"
    return [*lines, f"{line}]"]


def _summary(found: Imported, roles: Roles, request: Request) -> list[str]:
    """What was read and how well it is kept, one line each."""
    drawn = found.drawn
    named = [f"{role} from {layers}" for role, layers in roles.layers.items() if layers and role != "scale"]
    if drawn.asymmetry is not None:
        halves = f"left and right are apart by at most {_millimetres(drawn.asymmetry)}"
    elif request.half:
        halves = f"the {request.half} half was taken for both, with the valve edge below"
    else:
        halves = "one half is drawn, and was taken for both"
    worst = ", ".join(f"{part} {_millimetres(value)}" for part, value in found.deviations.items())
    summary = [
        f"N_p = {drawn.n_pouches}, L = {found.data['length']:g} mm, valve edge {2 * drawn.half_width:.4g} mm, unit {roles.unit}",
        f"{'; '.join(named)}" + (f"; not used: {', '.join(roles.unused)}" if roles.unused else ""),
        halves,
        f"off the drawing by at most: {worst} (tolerance {request.tolerance:g} mm)",
    ]
    if roles.drawing.left_out:
        summary.insert(2, "no lines: " + ", ".join(f"{count} {kind}" for kind, count in sorted(roles.drawing.left_out.items())))
    return summary


def _millimetres(value: float) -> str:
    return f"{max(value, 0.001):.3f} mm"


# --------------------------------------------------------------------------------------------------------------------
# the picture


def _draw(found: Imported, request: Request, name: str, picture: Path) -> None:
    """The drawing in grey with the pattern on it, and the points of its curves."""
    from matplotlib.collections import LineCollection

    from limo.figures import style
    from limo.figures.flat_pattern import LINES, draw_pattern

    style.plt.rcParams.update(style.SETTINGS)
    figure, axis = style.plt.subplots(figsize=(5.2, 6.0), layout="constrained")
    drawn = [points for lines in found.drawn.everything.values() for points in lines]
    axis.add_collection(LineCollection(drawn, colors="0.75", linewidths=4.0, capstyle="round", zorder=1))
    axis.plot([], [], color="0.75", lw=4.0, label=f"as drawn in {request.file.name}")
    draw_pattern(axis, found.flat)
    length, seams = found.data["length"], found.data["seams"]
    knots = [point for key in ("outline", "pouch_array") for curve in found.data[key] for point in curve]
    if found.drawn.seams:
        knots += [[f * x, y] for f in seams["fractions"][found.drawn.n_pouches] if f for x, y in seams["reference"]]
    x, y = ([length * point[k] for point in knots] for k in (0, 1))
    axis.plot(x, y, ".", color="k", ms=3.5, label="points of the curves", zorder=4)
    for said, color, width in LINES.values():
        axis.plot([], [], color=color, lw=width, label=said)
    axis.set_xlabel("x [mm]")
    axis.set_ylabel("y [mm]")
    worst = max(found.deviations.values())
    figure.suptitle(f"{name}: $N_p$ = {found.drawn.n_pouches}, L = {length:g} mm", fontsize=9)
    axis.set_title(f"curves off the drawing by at most {_millimetres(worst)}", loc="left")
    figure.legend(loc="outside lower center", ncols=3)
    write_whole(picture, lambda path: style.save(figure, path))
    style.close(figure)
