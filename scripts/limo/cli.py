"""``limo``: the few commands a person types beside snakemake."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from limo.errors import LimoError

DONE, MISTAKE, USAGE, FAILED, INTERRUPTED = 0, 1, 2, 3, 130
EXIT_CODES = """exit codes:
  0    done
  1    a mistake in the configuration, or a file that cannot be used: one message says which
  2    no such command or option
  3    status and sweep: a case failed or was broken off, or snakemake failed
  130  ended by Ctrl-C"""


def main(arguments: list[str] | None = None) -> int:
    """Run one command; returns the exit code (see ``EXIT_CODES``)."""
    arguments = sys.argv[1:] if arguments is None else arguments
    own, options = _split(arguments)
    chosen = make_parser().parse_args(own)
    chosen.options = options
    try:
        return chosen.run(chosen) or DONE
    except LimoError as error:
        print(error, file=sys.stderr)
        return MISTAKE
    except KeyboardInterrupt:
        return INTERRUPTED
    except BrokenPipeError:  # such as `limo status | head`
        sys.stderr.close()
        return DONE


def _split(arguments: list[str]) -> tuple[list[str], list[str]]:
    """What is before and behind ``--`` of a sweep: limo's own arguments, and options of snakemake."""
    at = arguments.index("--") if arguments[:1] == ["sweep"] and "--" in arguments else len(arguments)
    return arguments[:at], arguments[at + 1 :]


def make_parser() -> argparse.ArgumentParser:
    """The parser of all commands."""
    parser = argparse.ArgumentParser(
        prog="limo",
        description=__doc__.replace("``", ""),
        epilog=EXIT_CODES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")

    @contextmanager
    def command(run: Callable, name: str, says: str, *examples: str) -> Iterator[argparse.ArgumentParser]:
        epilog = "examples:\n" + "\n".join(f"  limo {name}{' ' * bool(e)}{e}" for e in examples) if examples else None
        made = commands.add_parser(
            name, help=says, description=says, epilog=epilog, formatter_class=argparse.RawDescriptionHelpFormatter
        )
        made.set_defaults(run=run)
        yield made

    says = "validate the configuration, say what is solved and how long the rest will take, run nothing"
    with command(_check, "check", says, "", "pressure_volume afterload --cores 8") as made:
        _studies(made)
        _config(made)
        _results(made)
        _cores(made)
    says = "show where the cases of a running or finished sweep are"
    with command(_status, "status", says, "", "--watch", "afterload --json", "--watch 10 > sweep.txt") as made:
        _studies(made, "those that the configuration runs; cases of others while they are solved")
        made.add_argument(
            "--watch", nargs="?", type=float, const=2.0, metavar="SECONDS", help="show it again every so many seconds (2)"
        )
        made.add_argument("--json", action="store_true", help="print JSON for machines")
        _config(made)
        _results(made)
        _cores(made)
    says = "run snakemake on studies and show their cases meanwhile"
    with command(_sweep, "sweep", says, "pressure_volume", "afterload compliance --cores 8 -- --rerun-incomplete") as made:
        _studies(made, "those that the configuration runs")
        _config(made)
        _cores(made)
        made.set_defaults(results=Path("results"))
    with command(_table, "table", "print the results of a study", "results/studies/pressure_volume/study.nc") as made:
        made.add_argument("dataset", type=Path, help="study.nc of a study")
    with command(_benchmark, "benchmark", "print where the time of the solved cases went") as made:
        _results(made)
    says = "keep measured costs in a table, and write the report of it"
    with command(_performance, "performance", says, "record 'grid preview newton'", "report > docs/performance.md") as made:
        doing = made.add_subparsers(dest="doing", required=True)
        recorded = doing.add_parser("record", help="put the costs of a configuration's solved cases into the table")
        recorded.add_argument("batch", help="name of the runs that were measured together, for example 'grid preview newton'")
        _studies(recorded, "those the configuration runs")
        _config(recorded)
        _results(recorded)
        for part in (recorded, doing.add_parser("report", help="print the report")):
            part.add_argument(
                "--table", type=Path, default=Path("docs/data/performance.csv"), help="the table (default: %(default)s)"
            )
    return parser


def _studies(parser: argparse.ArgumentParser, default: str = "all") -> None:
    parser.add_argument("studies", nargs="*", metavar="STUDY", help=f"studies by name (default: {default})")


def _config(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--config", default="config/config.yaml", help="configuration file (default: %(default)s)")


def _results(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--results", type=Path, default=Path("results"), help="folder of results (default: %(default)s)")


def _cores(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--cores", type=int, default=2, help="cores for the sweep (default: %(default)s)")


# --------------------------------------------------------------------------------------------------------------------
# one function a command; each imports what it needs, so that the others start at once


def _check(chosen: argparse.Namespace) -> None:
    from limo.tables import plan_table

    print(plan_table(chosen.config, chosen.studies, chosen.results, chosen.cores))


def _status(chosen: argparse.Namespace) -> int:
    import json

    from limo import monitor
    from limo.status import open_sweep, to_plain

    sweep = open_sweep(chosen.config, chosen.studies, chosen.results, chosen.cores)
    if chosen.json:
        statuses = sweep.look()
        print(json.dumps(to_plain(sweep, statuses), indent=2))
    elif chosen.watch is not None:
        statuses = monitor.watch(sweep, monitor.console(), max(chosen.watch, 0.1))
    else:
        statuses = monitor.show(sweep, monitor.console())
    return FAILED if monitor.failed(statuses) else DONE


def _sweep(chosen: argparse.Namespace) -> int:
    from limo import monitor
    from limo.status import open_sweep

    sweep = open_sweep(chosen.config, chosen.studies, chosen.results, chosen.cores)
    options = (chosen.config, chosen.studies, chosen.cores, chosen.options)
    return DONE if monitor.run_sweep(sweep, *options, monitor.console()) else FAILED


def _table(chosen: argparse.Namespace) -> None:
    from limo.tables import study_table

    print(study_table(chosen.dataset))


def _benchmark(chosen: argparse.Namespace) -> None:
    from limo.performance import benchmark_table

    print(benchmark_table(chosen.results))


def _performance(chosen: argparse.Namespace) -> None:
    from limo.performance import read_measurements, record_batch, report

    if chosen.doing == "record":
        print(record_batch(chosen.config, chosen.batch, chosen.studies, chosen.results, chosen.table))
    else:
        print(report(read_measurements(chosen.table)), end="")


if __name__ == "__main__":
    sys.exit(main())
