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
    performance = commands.add_parser("performance", help="keep measured costs in a table, and write the report of it")
    doing = performance.add_subparsers(dest="doing", required=True)
    recorded = doing.add_parser("record", help="put the costs of a configuration's solved cases into the table")
    recorded.add_argument("batch", help="name of the runs that were measured together, for example levers")
    recorded.add_argument("studies", nargs="*", metavar="STUDY", help="studies (default: those the configuration runs)")
    recorded.add_argument("--config", default="config/config.yaml", help="configuration file (default: %(default)s)")
    recorded.add_argument("--results", type=Path, default=Path("results"), help="folder of results (default: %(default)s)")
    reported = doing.add_parser("report", help="print the report", epilog="limo performance report > docs/performance.md")
    for part in (recorded, reported):
        part.add_argument(
            "--table", type=Path, default=Path("docs/data/performance.csv"), help="the table (default: %(default)s)"
        )
    chosen = parser.parse_args(arguments)
    try:
        if chosen.command == "check":
            from limo.tables import plan_table

            print(plan_table(chosen.config, chosen.studies, chosen.results, chosen.cores))
        elif chosen.command == "table":
            from limo.tables import study_table

            print(study_table(chosen.dataset))
        elif chosen.command == "benchmark":
            from limo.performance import benchmark_table

            print(benchmark_table(chosen.results))
        elif chosen.doing == "record":
            print(_record(chosen))
        else:
            from limo.performance import read_measurements, report

            print(report(read_measurements(chosen.table)), end="")
    except LimoError as error:
        print(error, file=sys.stderr)
        return 1
    return 0


def _record(chosen: argparse.Namespace) -> str:
    from limo.config import load_config
    from limo.engines.find import find_engines
    from limo.performance import measurements, record
    from limo.plan import make_plan

    loaded = load_config(chosen.config)
    find_engines(loaded, chosen.config)
    plan = make_plan(loaded, chosen.results)
    rows = measurements(loaded, plan, chosen.batch, chosen.studies or loaded.config.studies, chosen.results)
    if rows.empty:
        raise LimoError(f"{chosen.results}: none of the cases is solved; run the studies first")
    record(rows, chosen.table)
    return f"{len(rows)} cases into {chosen.table}"


if __name__ == "__main__":
    sys.exit(main())
