"""Commands that stand in the documentation are commands that there are; tests/workflow/test_documented_commands.py runs them."""

import shlex
from pathlib import Path

import pytest

from limo.terminal.cli import make_parser, split

ROOT = Path(__file__).parents[3]


def commands() -> list[str]:
    """Lines of code blocks that begin with ``limo``."""
    found = []
    for file in (
        ROOT / "README.md",
        ROOT / "CONTRIBUTING.md",
        *sorted(ROOT.glob("docs/*.md")),
        *sorted(ROOT.glob("*/README.md")),
    ):
        inside = False
        for line in file.read_text(encoding="utf-8").splitlines():
            inside ^= line.startswith("```")
            if inside and line.startswith("limo "):
                found.append(line.split(" #")[0].strip())
    return list(dict.fromkeys(found))


@pytest.mark.parametrize("line", commands())
def test_documented_commands_are_understood(line):
    own, _ = split(shlex.split(line.split(">")[0])[1:])
    assert make_parser().parse_args(own).command


def test_every_command_is_documented():
    described = {line.split()[1] for line in commands()}
    names = next(a for a in make_parser()._actions if a.choices).choices
    table = (ROOT / "docs/cli.md").read_text(encoding="utf-8")
    assert {"check", "status", "show", "sweep"} <= described
    assert all(f"`limo {name}" in table for name in names)
