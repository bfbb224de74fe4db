"""A machine without MKL and pymetis, which are not made for all processors: everything but the engine newton works there."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from .conftest import ROOT, Project

#: of what an interpreter that starts with it cannot find, and what it has loaded when it ends
HIDING = """
import atexit, importlib.metadata, os, sys
from importlib.abc import MetaPathFinder

HIDDEN = ("mkl", "pymetis")


class Hiding(MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in HIDDEN:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)


sys.meta_path.insert(0, Hiding())
found = importlib.metadata.Distribution.from_name.__func__


def from_name(cls, name):
    if name in HIDDEN:
        raise importlib.metadata.PackageNotFoundError(name)
    return found(cls, name)


importlib.metadata.Distribution.from_name = classmethod(from_name)


@atexit.register
def note():
    with open(os.environ["LIMO_LOADED"], "a") as file:
        file.write(" ".join({name.partition(".")[0] for name in sys.modules}) + "\\n")
"""


@pytest.fixture
def bare(project: Project, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Project:
    """An unsolved project, whose processes find neither package."""
    (tmp_path / "hiding").mkdir()
    (tmp_path / "hiding/sitecustomize.py").write_text(HIDING)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(tmp_path / "hiding"), str(ROOT / "scripts")]))
    monkeypatch.setenv("LIMO_LOADED", str(tmp_path / "loaded.txt"))
    project.fresh = True  # what has its imports already would find them
    return project


def limo(project: Project, *words: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "limo.terminal.cli", *words]
    return subprocess.run(command, cwd=project.folder, capture_output=True, text=True, timeout=300, check=False)


def loaded(tmp_path: Path) -> set[str]:
    """Packages that any of the processes has loaded."""
    return set((tmp_path / "loaded.txt").read_text().split())


def says_what_is_lacking(text: str) -> bool:
    """Whether a text is the message, once: file, key, value, what is lacking and an example."""
    (line,) = [line for line in text.splitlines() if "newton" in line and "mkl" in line]
    parts = (
        "config.yaml: engine = 'newton'",
        "expected calculix",
        "the packages mkl and pymetis",
        "for example engine: calculix",
    )
    return all(part in line for part in parts)


def test_the_packages_are_hidden_for_real(bare):
    script = "import pymetis"
    done = subprocess.run([sys.executable, "-c", script], cwd=bare.folder, capture_output=True, text=True, check=False)
    assert "No module named 'pymetis'" in done.stderr


def test_studies_of_calculix_are_checked_and_planned_beside_others(bare, tmp_path):
    """The stress test and a second study ask for newton; the study that runs by default does not."""
    bare.study("other", engine="newton")
    checked = limo(bare, "check", "--config", "config/config.yaml")
    assert checked.returncode == 0, checked.stderr
    assert "calculix 2." in checked.stdout
    (other,) = [line for line in checked.stdout.splitlines() if line.strip().startswith("other:")]
    assert "(no newton here)" in other
    assert bare.planned()["solve_case"] == 2
    assert bare.planned("tiny")["solve_case"] == 2
    assert not loaded(tmp_path) & {"numba", "vtkmodules", "pyvista", "mkl", "pymetis"}


def test_who_asks_for_newton_gets_one_message(bare):
    bare.study("other", engine="newton")
    for words in (("check", "other"), ("status", "other")):
        asked = limo(bare, *words, "--config", "config/config.yaml")
        assert asked.returncode == 1
        assert says_what_is_lacking(asked.stderr)
        assert "Traceback" not in asked.stderr
    done = bare.snakemake("other", "-n")
    assert done.returncode != 0
    assert says_what_is_lacking(done.stdout + done.stderr)
    bare.edit("config.yaml", lambda config: config.update(engine="newton"))
    done = bare.snakemake("-n")
    assert done.returncode != 0
    assert says_what_is_lacking(done.stdout + done.stderr)


def test_a_case_is_solved_and_measured_by_calculix(bare, tmp_path):
    axes = {"n_pouches": [4], "ventricular_pressure": [3.8]}
    bare.study("tiny", axes=axes, actuation_pressure_max=4.0, outputs=["volumes", "stress"], frames=[0, "max"])
    done = bare.snakemake("results/studies/tiny/study.nc")
    assert done.returncode == 0, done.stdout + done.stderr
    assert (bare.folder / "results/studies/tiny/study.nc").exists()
    assert not loaded(tmp_path) & {"numba", "mkl", "pymetis"}
