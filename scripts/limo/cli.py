"""``limo``: the few commands a person types beside snakemake."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from limo.errors import LimoError


def main(arguments: list[str] | None = None) -> int:
    """Run one command; returns the exit code (0 done, 1 a user's mistake or unusable file)."""
    parser = argparse.ArgumentParser(prog="limo", description=__doc__.replace("``", ""))
    commands = parser.add_subparsers(dest="command", required=True)
    check = commands.add_parser(
        "check",
        help="validate the configuration, say what is solved and how long the rest will take, run nothing",
        epilog="called again while a sweep runs, it tells what remains",
    )
    check.add_argument("studies", nargs="*", metavar="STUDY", help="studies to count (default: all)")
    check.add_argument("--config", default="config/config.yaml", help="configuration file (default: %(default)s)")
    check.add_argument("--results", type=Path, default=Path("results"), help="folder of results (default: %(default)s)")
    check.add_argument("--cores", type=int, default=2, help="cores for the predicted time (default: %(default)s)")
    table = commands.add_parser(
        "table", help="print the results of a study", epilog="example: limo table results/studies/pressure_volume/study.nc"
    )
    table.add_argument("dataset", type=Path, help="study.nc of a study")
    benchmark = commands.add_parser("benchmark", help="print where the time of the solved cases went")
    benchmark.add_argument("--results", type=Path, default=Path("results"), help="folder of results (default: %(default)s)")
    chosen = parser.parse_args(arguments)
    try:
        if chosen.command == "check":
            from limo.tables import plan_table

            print(plan_table(chosen.config, chosen.studies, chosen.results, chosen.cores))
        elif chosen.command == "table":
            from limo.tables import study_table

            print(study_table(chosen.dataset))
        else:
            from limo.tables import benchmark_table

            print(benchmark_table(chosen.results))
    except LimoError as error:
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
