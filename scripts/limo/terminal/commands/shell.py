"""The command that completes the others."""

from __future__ import annotations

import argparse

from limo.terminal.commands import arguments


def add_completion(commands: arguments.Commands) -> None:
    """``limo completion``."""
    made = commands.add(
        _completion,
        "completion",
        "print what a shell has to read to complete limo's words on the Tab key",
        "bash >> ~/.bashrc",
        "zsh > ~/.zfunc/_limo",
    )
    made.add_argument("shell", choices=("bash", "zsh"), help="which shell is to read it")


def _completion(chosen: argparse.Namespace) -> None:
    from limo.terminal.completion import script

    print(script(chosen.shell), end="")
