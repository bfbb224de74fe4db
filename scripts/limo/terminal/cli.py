"""``limo``: the few commands a person types beside snakemake."""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

from limo.checkout import check_folder
from limo.errors import LimoError
from limo.terminal.commands import beats, bench, cases, devices, documents, shell, studies
from limo.terminal.commands.arguments import DONE, EXIT_CODES, INTERRUPTED, MISTAKE, Commands

#: what adds each command, in the order of the help
COMMANDS = (
    bench.add_tensile,
    bench.add_measured,
    studies.add_check,
    studies.add_new_study,
    devices.add_pattern,
    devices.add_import_pattern,
    devices.add_derive_outline,
    studies.add_status,
    studies.add_sweep,
    studies.add_jobs,
    cases.add_show,
    cases.add_compare,
    studies.add_table,
    documents.add_page,
    beats.add_beat,
    cases.add_benchmark,
    documents.add_performance,
    documents.add_paper_check,
    documents.add_infer,
    documents.add_gallery,
    documents.add_reliability,
    documents.add_accuracy,
    documents.add_docs,
    cases.add_clean,
    shell.add_completion,
)


def main(arguments: list[str] | None = None) -> int:
    """Run one command; returns the exit code (see ``EXIT_CODES``)."""
    arguments = sys.argv[1:] if arguments is None else arguments
    words, options = split(arguments)
    parser = make_parser()
    if "_ARGCOMPLETE" in os.environ:  # the Tab key
        from limo.terminal.completion import complete

        complete(parser)
    chosen = parser.parse_args(words)
    chosen.options = options
    try:
        check_folder(Path(__file__).parents[3])
        return chosen.run(chosen) or DONE
    except LimoError as error:
        print(error, file=sys.stderr)
        return MISTAKE
    except KeyboardInterrupt:
        return INTERRUPTED
    except BrokenPipeError:  # such as `limo status | head`
        sys.stderr.close()
        return DONE


def split(arguments: list[str]) -> tuple[list[str], list[str]]:
    """What is before and behind ``--``: limo's own arguments, and others, such as options of snakemake."""
    end = arguments.index("--") if "--" in arguments else len(arguments)
    return arguments[:end], arguments[end + 1 :]


def make_parser() -> argparse.ArgumentParser:
    """The parser of all commands."""
    layout = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(
        prog="limo", description=__doc__.replace("``", ""), epilog=EXIT_CODES, formatter_class=layout
    )
    commands = Commands(parser)
    for add in COMMANDS:
        add(commands)
    return parser


if __name__ == "__main__":
    sys.exit(main())
