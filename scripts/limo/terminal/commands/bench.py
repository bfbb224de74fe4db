"""Commands on files from a laboratory: tensile, measured."""

from __future__ import annotations

import argparse
from pathlib import Path

from limo.terminal.commands import arguments


def add_tensile(commands: arguments.Commands) -> None:
    """``limo tensile``."""
    made = commands.add(
        _tensile,
        "tensile",
        "fit Young's modulus to tensile tests: a table of specimens, the fit with its window and errors, a picture",
        "config/measured/uniaxial_synthetic.csv --length 200 --width 50 --thickness 0.19",
        "a.csv b.csv --length 100 --width 15 --thickness 0.06 --set units.force=kN --json",
        "--into limo",
    )
    made.add_argument("files", nargs="*", type=Path, metavar="FILE", help="(default: tensile_test of the configuration)")
    for size in ("length", "width", "thickness"):
        made.add_argument(f"--{size}", type=float, metavar="MM", help="of the coupon")
    made.add_argument("--method", choices=("found", "window", "paper"), help="of the fit (default: found)")
    made.add_argument("--window", nargs=2, type=float, metavar="STRAIN", help="lowest and highest strain of the fit")
    _settings(made, "any other key of docs/bench.md, such as units.force=kN")
    made.add_argument("--json", action="store_true", help="print JSON for machines; youngs_modulus is in MPa")
    made.add_argument("--picture", type=Path, metavar="FILE", help="default: results/tensile/FILE.png")
    made.add_argument("--into", metavar="DEVICE", help="write the modulus into a file in config/devices, with its origin")
    arguments.config(made)
    arguments.results(made)


def _tensile(chosen: argparse.Namespace) -> None:
    from limo.terminal.bench import put_into, run_tensile, tensile_text, test_of

    if chosen.files:
        keys = {key: getattr(chosen, key) for key in ("length", "width", "thickness", "method", "window")}
        test = test_of(chosen.files, keys, chosen.set)
    else:
        from limo.config.load import load_config

        test = load_config(chosen.config).config.tensile_test
    fit, picture = run_tensile(test, chosen.results / "tensile", picture=chosen.picture, stated=bool(chosen.files))
    device = put_into(fit, chosen.config, chosen.into) if chosen.into else None
    print(tensile_text(fit, picture, device, as_json=chosen.json))


def add_measured(commands: arguments.Commands) -> None:
    """``limo measured``."""
    made = commands.add(
        _measured,
        "measured",
        "compare a study with measured curves: what was understood of them, relative errors by N_p, efficiencies",
        "mine",
        "pressure_volume --data mine.csv --set units.actuation_pressure=mmHg",
    )
    made.add_argument("study", metavar="STUDY", help="a study by name")
    made.add_argument("--data", type=Path, metavar="FILE", help="other curves than those the study names")
    _settings(made, "a key of docs/bench.md, with --data")
    arguments.config(made)
    arguments.results(made)


def _measured(chosen: argparse.Namespace) -> None:
    from limo.config.load import load_config
    from limo.terminal.bench import curves_of, measured_table

    project = load_config(chosen.config)
    project.require([chosen.study], chosen.config, "limo measured pressure_volume")
    print(measured_table(project, chosen.study, chosen.results, curves_of(chosen.data, chosen.set)))


def _settings(made: argparse.ArgumentParser, text: str) -> None:
    """Keys of a file's layout, each with its value."""
    made.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help=text)
