"""``docs/tutorial_bench.md`` as a reader follows it: from a tensile test and a drawing to a curve beside a measured one.

Its commands are run as they stand, with a real solve.
"""

from __future__ import annotations

import os
import re
import runpy
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import xarray as xr

from .conftest import ROOT
from .test_documented_commands import blocks, commands

DOCUMENT = ROOT / "docs/tutorial_bench.md"


@pytest.fixture(scope="module")
def followed(tmp_path_factory) -> tuple[Path, dict[str, str]]:
    """A checkout in which the tutorial was followed, and what each command said."""
    folder = tmp_path_factory.mktemp("tutorial")
    shutil.copytree(ROOT / "config", folder / "config")
    shutil.copytree(ROOT / "docs/bench", folder / "docs/bench")
    for part in ("Snakefile", "workflow", "scripts", "profiles", ".local"):
        if (ROOT / part).exists():
            (folder / part).symlink_to(ROOT / part)
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    environment = os.environ | {"PATH": path, "OMP_NUM_THREADS": "1", "PYTHONPATH": str(ROOT / "scripts")}
    said = {}
    for language, lines in blocks(DOCUMENT):
        if language == "yaml":
            (folder / lines[0].removeprefix("# ")).write_text("\n".join([*lines, ""]), encoding="utf-8")
        for command in commands(lines) if language == "sh" else ():
            program, *words = shlex.split(command)
            assert program == "limo"
            done = subprocess.run(
                [sys.executable, "-m", "limo.terminal.cli", *words],
                cwd=folder, env=environment, capture_output=True, text=True, timeout=1800, check=False,
            )  # fmt: skip
            assert done.returncode == 0, f"{command}: {done.stdout}{done.stderr}"
            said[command] = done.stdout
    return folder, said


def test_the_modulus_of_the_strips_is_that_of_the_device(followed):
    folder, said = followed
    truth = runpy.run_path(str(ROOT / "docs/bench/make.py"))["STRIPS"]
    mean = sum(modulus for modulus, _ in truth.values()) / len(truth)
    text = (folder / "config/devices/bag.yaml").read_text()
    assert float(re.search(r"youngs_modulus: ([\d.]+)", text)[1]) == pytest.approx(mean, rel=0.003)
    assert "synthetic tensile test strips.csv" in text
    assert "N_p = 6" in said["limo import-pattern docs/bench/drawing.dxf --name bag"]


def test_the_simulated_curve_stands_beside_the_measured_one_with_its_error(followed):
    folder, said = followed
    study = folder / "results/studies/bag"
    with xr.open_dataset(study / "study.nc") as dataset:
        case = dataset.squeeze()
        assert str(case.case_status.values) == "converged"
        assert case.measured_stroke_volume.notnull().any()
        errors = {
            name: float(case[f"measured_error_{name}"]) for name in ("io_ratio", "stroke_volume", "actuation_volume_change")
        }
    assert all(0.01 < error < 0.5 for error in errors.values()), errors
    row = next(line for line in said["limo measured bag"].splitlines() if line.split()[:1] == ["6"])
    assert [word for word in row.split() if "%" in word] == [f"{error:.1%}" for error in errors.values()]
    assert (study / "figures/pressure_volume.png").stat().st_size > 0


def test_the_page_shows_what_the_commands_say(followed):
    """Words and layout as printed; digits, which differ a little from machine to machine, do not count."""
    _, said = followed

    def bare(line: str) -> str:
        return " ".join(re.sub(r"[\d.]+", "0", line).split())

    printed = {bare(line) for text in said.values() for line in text.splitlines()}
    shown = [line for language, lines in blocks(DOCUMENT) if not language for line in lines if line.strip()]
    assert len(shown) > 15
    missing = [line for line in shown if bare(line) not in printed]
    assert not missing


def test_the_files_are_written_by_the_script_beside_them_and_are_small(tmp_path):
    write, folder = runpy.run_path(str(ROOT / "docs/bench/make.py"))["write"], ROOT / "docs/bench"
    write(tmp_path)
    for file in ("strips.csv", "curves.csv", "drawing.dxf"):
        assert (tmp_path / file).read_bytes() == (folder / file).read_bytes(), f"run docs/bench/make.py: {file}"
    assert all("SYNTHETIC" in (folder / file).read_text().splitlines()[0] for file in ("strips.csv", "curves.csv"))
    assert sum(file.stat().st_size for file in folder.iterdir()) < 300_000
