"""Commands on devices: cutting patterns out, drawings in."""

from __future__ import annotations

import argparse
from pathlib import Path

from limo.terminal.commands import arguments


def add_pattern(commands: arguments.Commands) -> None:
    """``limo pattern``."""
    made = commands.add(
        _pattern,
        "pattern",
        "write the cutting pattern of a device to scale, as SVG and DXF with seams on their own layer",
        "limo 6",
        "mini_limo 6 --allowance 5 --dxf-version R12 --to cutting",
    )
    made.add_argument("device", metavar="DEVICE", help="a file in config/devices")
    made.add_argument("n_pouches", metavar="N_P", type=int, help="number of pouches on both faces together")
    made.add_argument("--allowance", type=float, default=0.0, metavar="MM", help="of the cut lines beyond the seals (0)")
    made.add_argument(
        "--seams", choices=("lines", "closed", "both"), default="lines",
        help="each seam as a line, or a closed contour for each pouch, for heat sealers (default: %(default)s)",
    )  # fmt: skip
    made.add_argument("--width-scale", type=float, metavar="FACTOR", help="instead of the device's own")
    made.add_argument(
        "--dxf-version", choices=("R2010", "R12"), default="R2010", help="R12 for cutters that need it (default: %(default)s)"
    )
    made.add_argument("--to", type=Path, default=Path("results/patterns"), metavar="FOLDER", help="default: %(default)s")
    arguments.config(made)


def _pattern(chosen: argparse.Namespace) -> None:
    from limo.terminal.drawing import write_pattern

    arguments = (chosen.config, chosen.device, chosen.n_pouches, chosen.to, chosen.width_scale, chosen.allowance)
    for file in write_pattern(*arguments, chosen.dxf_version, chosen.seams):
        print(file)


def add_import_pattern(commands: arguments.Commands) -> None:
    """``limo import-pattern``."""
    examples = "drawing.dxf --units mm", "pattern.svg --map outline=WALL valve=#cc79a7 seams=#d55e00 --name mine"
    made = commands.add(
        _import_pattern,
        "import-pattern",
        "make a device of a drawing: outline, pouches, seams and valve edge of a DXF or SVG file by layer or colour",
        *examples,
    )
    made.add_argument("file", metavar="FILE", type=Path, help="a drawing of one face, .dxf or .svg")
    made.add_argument("--name", metavar="NAME", help="of the device and its file in config/devices (that of the drawing)")
    made.add_argument(
        "--map", nargs="+", default=[], action="extend", metavar="ROLE=NAME",
        help="outline, valve, array, seams, scale: a layer or a colour #RRGGBB (default: the layers of limo pattern)",
    )  # fmt: skip
    made.add_argument("--units", metavar="UNIT", help="mm, cm, m, in, ft, pt, px, or mm a unit (default: the file's)")
    made.add_argument("--tolerance", type=float, default=0.05, metavar="MM", help="of curves and gaps (default: %(default)g)")
    made.add_argument("--half", choices=("right", "left"), help="take this half for both, with the valve edge below")
    made.add_argument("--fabric", default="limo", metavar="DEVICE", help="whose material to take (default: %(default)s)")
    made.add_argument("--replace", action="store_true", help="write over a device of this name")
    made.add_argument("--to", type=Path, default=Path("results/patterns"), metavar="DIR", help="of the picture (%(default)s)")
    arguments.config(made)


def _import_pattern(chosen: argparse.Namespace) -> None:
    from limo.drawings.write import Request, import_pattern

    settled = chosen.name, tuple(chosen.map), chosen.units, chosen.tolerance, chosen.half, chosen.fabric
    made, *says, picture = import_pattern(Request(chosen.file, *settled), chosen.config, chosen.to, replace=chosen.replace)
    print(made, *(f"  {line}" for line in says), picture, sep="\n")


def add_derive_outline(commands: arguments.Commands) -> None:
    """``limo derive-outline``."""
    made = commands.add(
        _derive_outline,
        "derive-outline",
        "derive the flat pattern of limo from the counts of its authors' mesh: residuals, and what remains free",
        "--starts 2 --meshes 100",
        "--table docs/data/outline.csv",
    )
    made.add_argument("--starts", type=int, default=8, metavar="N", help="random starts (default: %(default)s)")
    made.add_argument("--meshes", type=int, default=300, metavar="N", help="meshes of a start (default: %(default)s)")
    made.add_argument("--table", type=Path, default=Path("results/outline.csv"), help="its table (default: %(default)s)")


def _derive_outline(chosen: argparse.Namespace) -> None:
    from limo.errors import ConfigError
    from limo.mesh.derivation import write_derivation

    for key in ("starts", "meshes"):
        if getattr(chosen, key) < 1:
            example = "limo derive-outline --starts 8 --meshes 300"
            raise ConfigError("limo derive-outline", f"--{key}", getattr(chosen, key), "1 or more", example)
    print(write_derivation(chosen.table, chosen.starts, chosen.meshes))
    print(chosen.table)
