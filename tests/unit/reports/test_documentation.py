"""Commands that stand in the documentation are commands that there are; tests/workflow/test_documented_commands.py runs them."""

import re
import shlex
from pathlib import Path

import pytest

from limo.terminal.cli import _split, make_parser

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
    own, _ = _split(shlex.split(line.split(">")[0])[1:])
    assert make_parser().parse_args(own).command


def test_every_command_is_documented():
    described = {line.split()[1] for line in commands()}
    names = next(a for a in make_parser()._actions if a.choices).choices
    table = (ROOT / "docs/cli.md").read_text(encoding="utf-8")
    assert {"check", "status", "show", "sweep"} <= described
    assert all(f"`limo {name}" in table for name in names)


def cells(document: str, *begins: str) -> list[str]:
    """The cells of the first row of a table in a document whose first cells are ``begins``."""
    for line in (ROOT / "docs" / document).read_text(encoding="utf-8").splitlines():
        row = [cell.strip() for cell in line.strip("|").split("|")]
        if line.startswith("|") and row[: len(begins)] == list(begins):
            return row
    raise AssertionError(f"{document}: no row {begins}")


def test_numbers_of_the_readme_are_those_of_the_measured_tables():
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    tuned, stock = (cells("performance.md", "calculix", build, "fast")[6] for build in ("tuned", "stock"))
    newton = next(
        row[6]
        for row in (line.strip("| ").split(" | ") for line in (ROOT / "docs/performance.md").read_text().splitlines())
        if row[0] == "newton" and row[1].startswith("mkl")
    )
    assert f"{tuned} s of CPU with the tuned CalculiX, {stock} s with the stock one, {newton} s with newton" in readme
    batches = ("grid_preview_calculix", "calculix"), ("grid_preview_newton", "newton"), ("grid_paper_density_newton", "newton")
    first, second, dense = (float(cells("performance.md", *batch)[9]) for batch in batches)
    said = f"{first:.0f} minutes on two cores with CalculiX, `preview`; newton {second:.0f} minutes, and {dense:.0f} on meshes"
    assert said in readme
    height, edge = cells("accuracy.md", "C3D20R (newton, symmetric, via 100, 10 p)", "24")[2:4]
    height, edge = (re.match(r"[+-]([\d.]+)%", cell)[1] for cell in (height, edge))
    assert f"height within {height} % of the published, draw-in of the wrinkled edge off by {edge} %" in readme
    for preset in ("preview", "standard"):
        seconds, _, volumes, stroke, stress = (cell.removesuffix(" ~") for cell in cells("accuracy.md", "np8", preset)[6:11])
        assert f"`{preset}` {seconds} s of CPU, volumes {volumes}, stroke {stroke}, stress {stress}" in readme
    scatter = [float(re.search(r"\(([\d.]+) %\)", cell)[1]) for cell in cells("reliability.md", "newton", "12")[4:]]
    assert f"{scatter[0]:.0f} % at 10 kPa, about {max(scatter[2:]):.0f} % from 40 kPa on" in readme
