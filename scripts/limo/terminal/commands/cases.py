"""Commands on solved cases: show, compare, benchmark, clean."""

from __future__ import annotations

import argparse
from pathlib import Path

from limo.errors import LimoError
from limo.terminal.commands import arguments


def add_show(commands: arguments.Commands) -> None:
    """``limo show``."""
    made = commands.add(
        _show,
        "show",
        "show one case: what it is, its volumes, buckling events, costs and files",
        "np6 pv13.8",
        "limo_np4_pv3.8 --at 10 20 --picture",
        epilog=arguments.ABBREVIATED,
    )
    made.add_argument("case", nargs="+", metavar="CASE", help="words of its name")
    made.add_argument("--at", nargs="+", type=float, default=[], metavar="KPA", help="P_a of the volumes (those of its frames)")
    made.add_argument("--picture", nargs="?", type=Path, const=Path(), metavar="FILE", help="draw its curves (case.png)")
    arguments.results(made)


def _show(chosen: argparse.Namespace) -> None:
    from limo.terminal.inspection import draw_case, show_case

    if chosen.picture is not None:
        draw_case(chosen.results, chosen.case, chosen.picture if chosen.picture.name else None)
    print(show_case(chosen.results, chosen.case, chosen.at))
    if chosen.picture is not None and chosen.picture.name:
        print(f"  {chosen.picture}")


def add_compare(commands: arguments.Commands) -> None:
    """``limo compare``."""
    made = commands.add(
        _compare,
        "compare",
        "compare two cases: parameters that differ, curves, costs",
        "np4,pv3.8 np6,pv3.8",
        "'np6 95201436ca' 'np6 6d9cb32527'",
        epilog=arguments.ABBREVIATED,
    )
    made.add_argument("first", metavar="CASE", help="words of its name, with commas between them")
    made.add_argument("second", metavar="CASE", help="the other one, likewise")
    arguments.results(made)


def _compare(chosen: argparse.Namespace) -> None:
    from limo.terminal.inspection import compare_cases

    print(compare_cases(chosen.results, chosen.first, chosen.second))


def add_benchmark(commands: arguments.Commands) -> None:
    """``limo benchmark``."""
    made = commands.add(_benchmark, "benchmark", "print where the time of the solved cases went")
    arguments.results(made)


def _benchmark(chosen: argparse.Namespace) -> None:
    from limo.reports.performance import benchmark_table

    print(benchmark_table(chosen.results))


def add_clean(commands: arguments.Commands) -> None:
    """``limo clean``."""
    made = commands.add(
        _clean,
        "clean",
        "delete what no study uses and what killed solvers left; without --yes only say what and how much that is",
        "",
        "leftovers --yes",
        "cases --config config/config.yaml config/levers/config.yaml",
    )
    made.add_argument(
        "kinds",
        nargs="*",
        metavar="KIND",
        help="leftovers (of solvers), cases (and meshes that no study uses); default: both",
    )
    made.add_argument("--yes", action="store_true", help="delete it")
    made.add_argument(
        "--config",
        nargs="+",
        default=["config/config.yaml"],
        metavar="FILE",
        help="configurations whose studies' cases stay (default: config/config.yaml)",
    )
    arguments.results(made)


def _clean(chosen: argparse.Namespace) -> None:
    from limo.terminal.cleaning import KINDS, delete, describe_rubbish, find_rubbish

    for kind in chosen.kinds:
        if kind not in KINDS:
            raise LimoError(f"{kind}: expected one of: {', '.join(KINDS)}; for example: limo clean leftovers")
    rubbish = find_rubbish(chosen.config, chosen.results, chosen.kinds or KINDS)
    print(describe_rubbish(rubbish, chosen.results))
    if rubbish and chosen.yes:
        delete(rubbish)
        print("deleted")
    elif rubbish:
        print("nothing was deleted: the same with --yes deletes it")
