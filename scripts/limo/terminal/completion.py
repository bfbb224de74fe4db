"""Completion of ``limo``'s words on the Tab key by argcomplete: commands, options, and names of studies, devices and cases.

The shell runs ``limo`` itself on every Tab, with the line in its environment (see argcomplete). So nothing heavy may be imported
on the way here.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from pathlib import Path

import argcomplete
from argcomplete.completers import FilesCompleter

#: where the names are that arguments of these kinds (metavar) have; cases are in the folder of results
FOLDERS = {"STUDY": Path("config/studies"), "DEVICE": Path("config/devices"), "CASE": Path("cases")}


def script(shell: str) -> str:
    """What a shell (bash or zsh) has to read to complete ``limo``: ``eval "$(limo completion bash)"``."""
    return argcomplete.shellcode(["limo"], shell=shell)


def complete(parser: argparse.ArgumentParser) -> None:
    """Answer a shell that asks for completions by its environment, and end the process; do nothing for any other caller."""
    argcomplete.autocomplete(parser, always_complete_options=False, default_completer=values)


def values(prefix: str, action: argparse.Action, parsed_args: argparse.Namespace, **_: object) -> Iterable[str]:
    """What an argument without choices may be: names that are not in the line yet, files where it is one, else nothing."""
    kind = str(action.metavar)
    if kind not in FOLDERS:
        return FilesCompleter()(prefix) if action.type is Path or action.dest == "config" else []
    folder = FOLDERS[kind] if kind != "CASE" else getattr(parsed_args, "results", Path("results")) / FOLDERS[kind]
    if not folder.is_dir():
        return []
    names = {p.name if p.is_dir() else p.stem for p in folder.iterdir() if p.is_dir() or p.suffix in (".yaml", ".yml")}
    given = getattr(parsed_args, action.dest, None)
    return sorted(names.difference(given if isinstance(given, list) else ()))
