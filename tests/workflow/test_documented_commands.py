"""Every command of README.md and the documents is run: as it stands, or as the table of replacements says, or planned.

What solves for long is planned by a dry run of Snakemake, which knows whether its targets can be made. YAML blocks that begin
with the name of a file are written to it as they are reached, as a reader of a tutorial would.
"""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import xarray as xr

from limo.terminal.cli import main, make_parser
from tests.helpers.snakemake import run_snakemake

from .conftest import ROOT

DOCUMENTS = (
    ROOT / "README.md",
    ROOT / "CONTRIBUTING.md",
    ROOT / "config" / "README.md",
    ROOT / "results" / "README.md",
    *sorted((ROOT / "docs").glob("*.md")),
)
PROGRAMS = ("limo", "snakemake", "make", "source", "eval", "sed", ".venv/bin/pytest", ".venv/bin/pre-commit")
BIN = Path(sys.executable).parent


def in_bin(name: str) -> str:
    """A program of the environment as a word for a shell."""
    return shlex.quote(str(BIN / name))


#: what is run instead of a command: shorter, without an end, or about cases that the tests have (N_p = 2 and 4 up to 10 kPa)
REPLACEMENTS = {
    "source .venv/bin/activate": f"source {in_bin('activate')}",
    ".venv/bin/pytest tests/unit": f"{in_bin('pytest')} --version",
    ".venv/bin/pre-commit install --hook-type pre-commit --hook-type pre-push": f"{in_bin('pre-commit')} install --help",
    "limo check --draw": "limo check --draw svg",
    "limo check pressure_volume --draw svg --mesh": "limo check kinematics --draw svg --mesh",
    "limo status --watch": "limo status pressure_volume",
    "limo jobs": "limo status pressure_volume",
    "limo show np6": "limo show np4",
    "limo show np6 --picture": "limo show np4 --picture",
    "limo show np6 pv3.8 --at 10 20 30 --picture": "limo show np4 pv3.8 --at 5 10 --picture",
    "limo compare np4 np6": "limo compare np2 np4",
    "limo infer --data results/studies --table docs/data/inference.csv": f"{in_bin('limo')} infer --help",
    "limo measured bag": "limo measured pressure_volume --data config/measured/curves_synthetic.csv",
    "limo table results/studies/thick/study.nc": "limo table results/studies/pressure_volume/study.nc",
}
#: what stands for something that a reader puts there
PLACEHOLDER = re.compile(r"\b[A-Z]{2,}\b|\.\.\.|<|\[")


def blocks(file: Path) -> list[tuple[str, list[str]]]:
    """Language and lines of the fenced blocks of a document."""
    found, inside = [], False
    for line in file.read_text(encoding="utf-8").splitlines():
        if line.startswith("```"):
            inside = not inside
            if inside:
                found.append((line[3:].strip(), []))
        elif inside:
            found[-1][1].append(line)
    assert not inside, f"{file.name}: a block without an end"
    return found


def commands(lines: list[str]) -> list[str]:
    """The commands of a shell block, without comments."""
    return [stripped for line in lines if (stripped := re.sub(r"(^|\s)#.*", "", line).strip())]


def mentioned(file: Path) -> list[str]:
    """Commands between backticks in the text and its tables."""
    text = re.sub(r"^```.*?^```", "", file.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
    spans = [" ".join(span.split()) for span in re.findall(r"`([^`]+)`", text)]
    return [span for span in spans if re.match(r"(limo|snakemake|make) [\w-]", span)]


@pytest.fixture(scope="module")
def reader(solved, tmp_path_factory):
    """A folder such as a reader has after a first sweep: the project's configuration and documents, and solved cases."""
    folder = tmp_path_factory.mktemp("reader")
    shutil.copytree(ROOT / "config", folder / "config")
    shutil.copytree(ROOT / "docs", folder / "docs")
    shutil.copytree(ROOT / "workflow/profiles", folder / "workflow/profiles")
    shutil.copytree(solved.folder / "results", folder / "results")
    (folder / "results/studies/tiny").rename(folder / "results/studies/pressure_volume")
    with xr.open_dataset(ROOT / "docs/gallery/data/surface.nc") as surface:  # of four devices, and a reader's of one
        for name, devices in (("surface", surface), ("my_heart", surface.sel(n_pouches=[6]))):
            (folder / "results/studies" / name).mkdir()
            devices.load().drop_encoding().to_netcdf(folder / "results/studies" / name / "study.nc")
    return folder


@pytest.fixture
def run(reader, monkeypatch, capfd):
    """``run(command)`` in the reader's folder; what it plans for Snakemake is returned."""
    monkeypatch.chdir(reader)
    environment = os.environ | {"PATH": f"{BIN}{os.pathsep}{os.environ['PATH']}"}

    def one(command: str) -> list[str]:
        command = REPLACEMENTS.get(command, command)
        program, *words = shlex.split(command, comments=True)
        if program == "snakemake":
            return words
        if program == "limo" and words[0] == "sweep":
            own = words[1 : words.index("--")] if "--" in words else words[1:]
            chosen = make_parser().parse_args(["sweep", *own])
            return [*chosen.studies, *(words[words.index("--") + 1 :] if "--" in words else [])]
        if program == "limo" and ">" not in words:
            assert main(words) == 0, f"{command}: {capfd.readouterr().err}"
        elif program == "make":
            done = subprocess.run(["make", "-n", *words], cwd=ROOT, capture_output=True, text=True, check=False)
            assert done.returncode == 0, f"{command}: {done.stderr}"
        else:
            done = subprocess.run(["bash", "-c", command], env=environment, capture_output=True, text=True, check=False)
            assert done.returncode == 0, f"{command}: {done.stderr}"
        return []

    return one


def planned(folder: Path, *words: str) -> None:
    """A dry run of Snakemake; what only makes sense in a locked folder is run as it is."""
    options = [] if "--unlock" in words else ["--dry-run", "--quiet", "all"]
    if not {"--cores", "--dry-run", "-n"} & {*options, *words}:
        options = ["--cores", "1"]
    done = run_snakemake(*words, "--snakefile", ROOT / "Snakefile", "--directory", folder, *options, folder=folder)
    assert done.returncode == 0, f"snakemake {' '.join(words)}: {done.stdout[-2000:]}{done.stderr[-2000:]}"


def test_every_command_of_the_documents_runs_or_can_be_planned(run, reader):
    targets: dict[str, None] = {}
    others: dict[tuple[str, ...], None] = {}
    count = 0
    for document in DOCUMENTS:
        for language, lines in blocks(document):
            if language == "yaml" and (named := re.fullmatch(r"# (config/\w+/\w+\.yaml)", lines[0])):
                (reader / named[1]).write_text("\n".join([*lines, ""]), encoding="utf-8")
            for command in commands(lines) if language == "sh" else ():
                count += 1
                _sort(run(command), targets, others)
        for span in mentioned(document):
            if span.startswith("snakemake") and not PLACEHOLDER.search(span):
                _sort(shlex.split(span)[1:], targets, others)
    assert count > 40
    assert len(targets) > 20, "those of the paper's figures among them"
    planned(reader, *targets)
    for words in others:
        planned(reader, *words)
    assert {p.suffix for p in (reader / "cutting").iterdir()} == {".svg", ".dxf"}
    assert (reader / "results/patterns/small_devices.png").exists()


def _sort(words: list[str], targets: dict[str, None], others: dict[tuple[str, ...], None]) -> None:
    """Targets with no other options than cores are planned together, which takes one start of Snakemake.

    So are those of a report, which can only be made of what is solved.
    """
    plain = re.sub(r"--cores \d+|--report \S+|(^| )(-n|--dry-run|--keep-going)( |$)", " ", " ".join(words)).split()
    if all(re.fullmatch(r"\w+", word) for word in plain):
        targets.update(dict.fromkeys(plain))
    else:
        others[tuple(words)] = None


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda file: str(file.relative_to(ROOT)))
def test_commands_stand_in_shell_blocks_and_are_known(document):
    for language, lines in blocks(document):
        begins = [line.split()[0] for line in lines if line.split()]
        if language == "sh":
            unknown = [word for word in begins if word not in PROGRAMS and not word.startswith("#")]
            assert not unknown, f"{document.name}: no test knows how to run {unknown}"
        elif language != "yaml":
            assert not set(begins) & {"limo", "snakemake", "make"}, f"{document.name}: mark the block of {begins} as sh"


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda file: str(file.relative_to(ROOT)))
def test_commands_in_the_text_exist(document):
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), flags=re.MULTILINE))
    actions = make_parser()._actions
    names = {*next(a for a in actions if a.choices).choices, *(option for a in actions for option in a.option_strings)}
    for span in mentioned(document):
        program, word, *_ = span.split()
        if program == "make":
            assert word in targets, span
        if program == "limo":
            assert word in names, span


def test_every_replacement_is_of_a_command_that_stands_somewhere():
    found = [lines for document in DOCUMENTS for language, lines in blocks(document) if language == "sh"]
    assert set(REPLACEMENTS) <= {command for lines in found for command in commands(lines)}
