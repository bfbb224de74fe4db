"""The command on hearts that beat: beat."""

from __future__ import annotations

import argparse
from pathlib import Path

from limo.terminal.commands import arguments


def add_beat(commands: arguments.Commands) -> None:
    """``limo beat``."""
    made = commands.add(
        _beat,
        "beat",
        "let a device beat in a circulation: pressures, flows, work and air of its periodic state, and a picture",
        "surface --device 8",
        "surface --device 8 --in hypertension --set 'driver.source_pressure=90 kPa'",
        "surface --device 8 --band",
        "surface --device 8 --over driver.rate=40:120:9 --over driver.source_pressure=40:100:7",
    )
    made.add_argument("surface", metavar="SURFACE", help="a study with loading and unloading over P_v, or its study.nc")
    made.add_argument("--device", type=int, metavar="N_P", help="which device of the study (default: its only one)")
    made.add_argument("--in", dest="circulation", default="healthy", metavar="NAME", help="a file of config/beats (%(default)s)")
    made.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="another number, with its unit")
    made.add_argument("--over", action="append", default=[], metavar="KEY=LOW:HIGH:COUNT", help="a sweep, in kPa, ml, s, 1/min")
    made.add_argument("--keep", type=Path, metavar="FILE", help="keep the surfaces of all devices in a file, too")
    made.add_argument("--band", action="store_true", help="tell how far numbers depend on the P_v of the study; takes seconds")
    arguments.config(made)
    arguments.results(made)


def _beat(chosen: argparse.Namespace) -> None:
    from limo.terminal.beating import beat_of, read_surface, run_beat, run_sweep, values_of

    keys = values_of(chosen.over)
    beat = beat_of(Path(chosen.config).parent / "beats", chosen.circulation, chosen.set)
    surface, name = read_surface(chosen.surface, chosen.results, chosen.device, chosen.keep)
    folder = chosen.results / "beats" / f"{name}_{Path(chosen.circulation).stem}"
    print(run_sweep(surface, beat, keys, folder) if keys else run_beat(surface, beat, folder, band=chosen.band))
