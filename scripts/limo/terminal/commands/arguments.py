"""Arguments that several commands share, how a command is added, and the exit codes."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path

DONE, MISTAKE, USAGE, FAILED, INTERRUPTED = 0, 1, 2, 3, 130
EXIT_CODES = """exit codes:
  0    done
  1    a mistake in the configuration, or a file that cannot be used: one message says which
  2    no such command or option
  3    status and sweep: a case failed or was broken off, or snakemake failed
  130  ended by Ctrl-C"""

ABBREVIATED = """A case is named by a beginning of its name, or by parts of it that no other case has together, such as
np6 pv13.8 ar2 eh1 preview fast, or the first letters of its hash."""


class Commands:
    """The commands of a parser."""

    def __init__(self, parser: argparse.ArgumentParser):
        self._commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")

    def add(self, run: Callable, name: str, help: str, *examples: str, epilog: str = "") -> argparse.ArgumentParser:
        """A command that ``run`` carries out; ``examples`` are what may stand behind its name."""
        lines = ["examples:", *(f"  limo {name} {e}".rstrip() for e in examples or [""])]
        epilog = "\n".join([*([epilog, ""] if epilog else []), *lines])
        layout = argparse.RawDescriptionHelpFormatter
        made = self._commands.add_parser(name, help=help, description=help, epilog=epilog, formatter_class=layout)
        made.set_defaults(run=run)
        return made


def named_path(text: str) -> tuple[str, Path]:
    """NAME=PATH; a path alone is its own name."""
    name, given, path = text.partition("=")
    return (name, Path(path)) if given else (text, Path(text))


def studies(parser: argparse.ArgumentParser, default: str = "all") -> None:
    """Names of studies."""
    parser.add_argument("studies", nargs="*", metavar="STUDY", help=f"studies by name (default: {default})")


def config(parser: argparse.ArgumentParser) -> None:
    """The configuration file."""
    parser.add_argument("--config", default="config/config.yaml", help="configuration file (default: %(default)s)")


def results(parser: argparse.ArgumentParser) -> None:
    """The folder of results."""
    parser.add_argument("--results", type=Path, default=Path("results"), help="folder of results (default: %(default)s)")


def cores(parser: argparse.ArgumentParser) -> None:
    """Cores of a sweep."""
    parser.add_argument("--cores", type=int, default=2, help="cores for the sweep (default: %(default)s)")


def cluster(parser: argparse.ArgumentParser, help: str) -> None:
    """The cluster of a sweep."""
    parser.add_argument("--on", metavar="CLUSTER", help=f"{help}: the name of a folder in workflow/profiles, such as slurm")
