"""The tuned CalculiX: its patches fit, it gives the stock solver's answers, and each patch does what it is for."""

from __future__ import annotations

import os
import re
import resource
import runpy
import subprocess
from pathlib import Path

import pytest

from limo.engines.calculix import build as ccx_build
from limo.schema.solver import Solver

ROOT = Path(__file__).parents[2]
PATCHES = sorted((ROOT / "scripts/ccx/patches").glob("*.patch"))
SOURCE = ROOT / ".local/ccx-source/calculix-ccx_2.20.orig.tar.bz2"
VERIFY = runpy.run_path(str(ROOT / "scripts/ccx/verify/verify.py"))
DECKS = {deck.stem: deck for deck in VERIFY["DECKS"]}

CUBE = """*NODE
1, 0, 0, 0
2, 1, 0, 0
3, 1, 1, 0
4, 0, 1, 0
5, 0, 0, 1
6, 1, 0, 1
7, 1, 1, 1
8, 0, 1, 1
*ELEMENT, TYPE=C3D8, ELSET=CUBE
1, 1, 2, 3, 4, 5, 6, 7, 8
*MATERIAL, NAME=M
*ELASTIC
{modulus}, 0.3
*DENSITY
1
*SOLID SECTION, ELSET=CUBE, MATERIAL=M
*BOUNDARY
1, 1, 3
2, 1, 3
3, 1, 3
4, 1, 3
*STEP
{analysis}
*DLOAD
CUBE, P2, 0.1
*END STEP
"""


@pytest.fixture(scope="module")
def tuned() -> Path:
    if not ccx_build.tuned_build_runs():
        pytest.skip("there is no tuned build here; `make ccx-tuned` says why")
    return ccx_build.TUNED


def run_cube(command: Path, folder: Path, modulus: str = "1", analysis: str = "*STATIC") -> subprocess.CompletedProcess:
    """Run a cube on a fixed floor under pressure."""
    (folder / "deck.inp").write_text(CUBE.format(modulus=modulus, analysis=analysis))
    return subprocess.run([command, "deck"], cwd=folder, capture_output=True, text=True, timeout=60, check=False)


def solve(name: str, command: Path, folder: Path):
    """Displacements, iterations and log of a stored deck."""
    return VERIFY["solve"](DECKS[name], command, folder)


@pytest.mark.parametrize("patch", PATCHES, ids=lambda p: p.stem)
def test_patch_is_small_and_says_why_and_under_which_licence(patch):
    text = patch.read_text(encoding="latin-1")
    why, change = text.split("\ndiff --git", 1)
    assert why.startswith("SPDX-License-Identifier: GPL-2.0-or-later\n\n")
    assert len(why.splitlines()) >= 5
    assert len(re.findall(r"^[+-]", change, re.MULTILINE)) < 100


def test_patches_fit_the_pinned_source(tmp_path):
    if not SOURCE.exists():
        pytest.skip("the source was not fetched here")
    subprocess.run(["tar", "-xf", SOURCE, "-C", tmp_path], check=True)
    environment = {**os.environ, "GIT_CEILING_DIRECTORIES": str(tmp_path)}
    subprocess.run(["git", "apply", *PATCHES], cwd=tmp_path / "CalculiX", env=environment, check=True)
    assert "mallopt" in (tmp_path / "CalculiX/ccx_2.20/src/ccx_2.20.c").read_text(encoding="latin-1")


@pytest.mark.parametrize("name", DECKS)
def test_answers_are_those_of_the_stock_solver(tuned, name):
    error, iterations, usual = VERIFY["difference"](DECKS[name], tuned)
    assert error <= 1e-6
    assert iterations == usual


@pytest.mark.parametrize("name", DECKS)
def test_stored_answers_are_those_of_the_stock_solver_of_this_machine(name):
    error, _, _ = VERIFY["difference"](DECKS[name], ccx_build.find_ccx(Solver(build="stock")))
    assert error <= 1e-6


def test_one_thread_repeats_to_the_bit(tuned, tmp_path):
    frames = []
    for name in ("first", "second"):
        (tmp_path / name).mkdir()
        solve("device", tuned, tmp_path / name)
        content = (tmp_path / name / "deck.frd").read_bytes()
        frames.append(content[content.index(b" -4  DISP") :])
    assert frames[0] == frames[1]


def test_eigenvalues_are_refused_with_a_reason_without_arpack(tuned, tmp_path):
    said = run_cube(tuned, tmp_path, analysis="*FREQUENCY\n1").stdout
    assert "*ERROR" in said
    assert "ARPACK library is not linked" in said


def test_solution_that_is_no_number_is_an_error(tuned, tmp_path):
    assert run_cube(tuned, tmp_path).returncode == 0
    bad = run_cube(tuned, tmp_path, modulus="nan")
    assert bad.returncode == 201
    assert "*ERROR in pardiso" in bad.stdout


def test_analysis_is_kept_while_the_pattern_stays_and_only_then(tuned, tmp_path):
    """Points that touch and let go, released boundary conditions, and an element that is removed change the pattern."""
    analysed = {}
    for name in ("device", "contact"):
        (tmp_path / name).mkdir()
        _, iterations, log = solve(name, tuned, tmp_path / name)
        analysed[name] = log.count("analysing the pattern")
        assert log.count("pardiso solver") >= iterations
    assert analysed["device"] == 1
    assert 5 <= analysed["contact"] < 30


def test_freed_memory_is_kept(tuned, tmp_path):
    """Pages are mapped once, not in every iteration: in all no more than the solve's memory, which is 149 MiB at its peak."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_minflt
    solve("device", tuned, tmp_path)
    faults = resource.getrusage(resource.RUSAGE_CHILDREN).ru_minflt - before
    assert faults * resource.getpagesize() < 200 * 2**20
