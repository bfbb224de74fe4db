"""Write the files of docs/tutorial_bench.md anew. They are SYNTHETIC: the layouts are a laboratory's, the numbers are made up.

    python docs/bench/make.py

``strips.csv``: three strips in tension, 15 mm wide and 0.19 mm thick between clamps 100 mm apart, as a German machine writes it.
``curves.csv``: loading and unloading of two devices, pressures in mmHg. ``drawing.dxf``: one face of ``mini_limo`` with six
pouches, by ``limo pattern``.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np

FOLDER = Path(__file__).parent
SAID = "# SYNTHETIC: no measurement. Written by make.py beside it, for docs/tutorial_bench.md."
#: modulus (MPa) and slack (mm) of each strip; length, width and thickness of all in mm
STRIPS = {"warp 1": (305.0, 0.2), "warp 2": (311.0, 0.6), "warp 3": (318.0, 0.0)}
LENGTH, WIDTH, THICKNESS = 100.0, 15.0, 0.19
#: largest change of the actuation volume and largest stroke of each device, in ml; pressure of the ventricle in kPa
DEVICES = {"bag with 5": (74.0, 92.0), "bag with 7": (62.0, 74.0)}
VENTRICLE, MMHG = 3.8, 0.133322


def strips(rng: np.random.Generator) -> str:
    """Elongation in mm and force in kN of each strip up to its break at a strain of 6 % and a little further."""
    lines = [SAID, "Probe;Standardweg;Standardkraft", ";mm;kN"]
    for name, (modulus, slack) in STRIPS.items():
        elongation = np.arange(0.1, 7.0, 0.1)
        force = modulus * WIDTH * THICKNESS * np.maximum(elongation - slack, 0.0) / LENGTH
        force = np.where(elongation - slack > 6.0, 0.4, force) + rng.normal(0.0, 0.1, len(elongation))
        rows = zip(elongation, force / 1000, strict=True)
        lines += [f"{name};{a:.3f};{f:.6f}".replace(".", ",") for a, f in rows]
    return "\n".join([*lines, ""])


def curves(rng: np.random.Generator) -> str:
    """Two saturating loops over the pressure, unloading behind loading."""
    lines = [SAID, "label,pouch pressure (mmHg),delta V_a (ml),stroke volume (ml)"]
    up = np.linspace(0.0, 19.0, 20)
    for name, (air, stroke) in DEVICES.items():
        for pressure, lag in ((up, 0.0), (up[-2::-1], 1.2)):
            above = np.where(pressure > 0, np.maximum(np.minimum(pressure + lag, 19.0) - VENTRICLE, 0.0), 0.0)
            share = 1.0 - np.exp(-above / 8.0)
            volumes = [limit * share + rng.normal(0.0, 0.3, len(share)) for limit in (air, stroke)]
            rows = zip(pressure / MMHG, *volumes, strict=True)
            lines += [f"{name},{p:.2f},{a:.2f},{v:.2f}" for p, a, v in rows]
    return "\n".join([*lines, ""])


def drawing() -> bytes:
    """The face of a device of the project as ``limo pattern`` draws it, in mm."""
    from limo.terminal.cli import main

    with tempfile.TemporaryDirectory() as folder:
        if main(["pattern", "mini_limo", "6", "--to", folder]):
            sys.exit("limo pattern failed: run this in the root of the project")
        return Path(folder, "mini_limo_np6.dxf").read_bytes()


def write(folder: Path) -> None:
    """Write the three files into a folder."""
    rng = np.random.default_rng(2026)
    folder.joinpath("strips.csv").write_text(strips(rng), encoding="utf-8")
    folder.joinpath("curves.csv").write_text(curves(rng), encoding="utf-8")
    folder.joinpath("drawing.dxf").write_bytes(drawing())


if __name__ == "__main__":
    write(FOLDER)
