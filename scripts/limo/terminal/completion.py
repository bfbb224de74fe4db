"""Completion of ``limo``'s words on the Tab key, in bash and zsh: commands, options, and names of studies, devices and cases."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

SCRIPTS = {
    "bash": """\
_limo() {{
    mapfile -t COMPREPLY < <(limo completion words -- "${{COMP_WORDS[@]:1:COMP_CWORD}}" 2>/dev/null)
}}
complete -o default -F _limo limo
""",
    "zsh": """\
#compdef limo
_limo() {{
    local -a found
    found=("${{(@f)$(limo completion words -- "${{(@)words[2,CURRENT]}}" 2>/dev/null)}}")
    compadd -a found || _files
}}
compdef _limo limo
""",
}


def script(shell: str) -> str:
    """What a shell has to read to complete ``limo``: ``eval "$(limo completion bash)"``."""
    return SCRIPTS[shell].format()


def candidates(parser: argparse.ArgumentParser, words: Sequence[str]) -> list[str]:
    """What the last of some words behind ``limo`` may become; the words before it are complete."""
    *before, last = words or [""]
    expects: argparse.Action | None = None  # the option whose value comes next
    for word in before:
        commands = _commands(parser)
        if expects is not None:
            expects = None
        elif word in commands:
            parser = commands[word]
        else:
            expects = next((a for a in parser._actions if word in a.option_strings and a.nargs != 0), None)
    if expects is not None:
        found = _values(expects)
    elif last.startswith("-"):
        found = [option for action in parser._actions for option in action.option_strings]
    else:
        found = [value for a in parser._actions if not a.option_strings for value in _values(a)]
    return sorted({word for word in found if word.startswith(last)} - set(before))


def _commands(parser: argparse.ArgumentParser) -> dict[str, argparse.ArgumentParser]:
    actions = (a for a in parser._actions if isinstance(a, argparse._SubParsersAction))
    return {name: command for action in actions for name, command in action.choices.items()}


def _values(action: argparse.Action) -> list[str]:
    """The values an argument may have; those of files are left to the shell."""
    if action.choices:
        return [str(choice) for choice in action.choices]
    places = {"STUDY": Path("config/studies"), "DEVICE": Path("config/devices"), "CASE": Path("results/cases")}
    folder = places.get(str(action.metavar))
    if folder is None or not folder.is_dir():
        return []
    return [p.name if p.is_dir() else p.stem for p in folder.iterdir() if p.is_dir() or p.suffix in (".yaml", ".yml")]
