"""Where a checkout may lie: blanks, apostrophes, links and read-only folders work; what cannot work is refused in one message."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import sysconfig
from contextlib import contextmanager
from pathlib import Path

import pytest
import yaml

from limo.checkout import REFUSED, check_folder, check_results
from limo.errors import LimoError
from limo.store.files import read_json

from .conftest import ROOT, make_project

ODD = "my heart's work & (more) #1, ü"
#: the refused of ``limo.checkout`` and two that it finds otherwise, in names of folders
NAMES = [f"a{text}b" for text in REFUSED] + ["a\nb", "a\udcffb"]
FILES = ("Makefile", "Snakefile", "pyproject.toml", "requirements.lock", "README.md", "LICENSE")
FOLDERS = ("scripts", "workflow", "profiles")


def copy_project(folder: Path) -> Path:
    """What set-up and the workflow need of this project, without its environment; with what is compiled, which takes long."""
    folder.mkdir(parents=True, exist_ok=True)
    for part in FOLDERS:
        shutil.copytree(ROOT / part, folder / part, ignore=shutil.ignore_patterns("*.egg-info"))
    for part in FILES:
        shutil.copy2(ROOT / part, folder / part)
    return folder


def run(*command: str | Path, cwd: Path, **variables: str) -> subprocess.CompletedProcess[str]:
    """Run a command as a user would, who has no PYTHONPATH."""
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"} | {"OMP_NUM_THREADS": "1"} | variables
    return subprocess.run(command, cwd=cwd, env=environment, capture_output=True, text=True, timeout=1800, check=False)


def passed(done: subprocess.CompletedProcess[str]) -> str:
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout + done.stderr


def tiny_study(folder: Path, name: str, **changes) -> None:
    """A configuration whose study ``name`` takes seconds."""
    project = make_project(folder)
    axes = {"n_pouches": [4], "ventricular_pressure": [3.8]}
    project.study(name, axes=axes, actuation_pressure_max=5.0, frames=[0, "max"], engine="newton", **changes)
    project.edit("config.yaml", lambda d: d.update(studies=[name]))


@pytest.fixture(scope="module")
def checkout(tmp_path_factory) -> Path:
    """A checkout in an odd path, with a .venv that has its own ``limo``, installed by pip, and borrows the rest."""
    folder = copy_project(tmp_path_factory.mktemp("paths") / ODD / "limo")
    tiny_study(folder, "pressure_volume", cross_check=1)
    passed(run(sys.executable, "-m", "venv", "--without-pip", ".venv", cwd=folder))
    (packages,) = (folder / ".venv" / "lib").glob("python*/site-packages")
    (packages / "borrowed.pth").write_text(sysconfig.get_path("purelib") + "\n")
    options = ("--quiet", "--no-index", "--no-deps", "--no-build-isolation", "--editable", ".")
    passed(run(".venv/bin/python", "-m", "pip", "install", *options, cwd=folder))
    said = passed(run(".venv/bin/python", "-c", "import limo; print(limo.__file__)", cwd=folder))
    assert said.strip() == str(folder / "scripts/limo/__init__.py")
    local = folder / ".local"
    local.mkdir()
    for part in ("bin", "ccx"):  # CalculiX where it was unpacked, not installed
        if (ROOT / ".local" / part).exists():
            (local / part).symlink_to(ROOT / ".local" / part)
    (local / "setup.done").touch()
    return folder


@pytest.fixture(scope="module")
def swept(checkout) -> str:
    """What ``make sweep`` said there, where both engines solved the same case."""
    return passed(run("make", "sweep", "CORES=1", cwd=checkout))


def test_make_sweep_in_a_path_with_blanks_and_apostrophe(checkout, swept):
    folders = list((checkout / "results" / "cases").iterdir())
    assert {read_json(f / "status.json")["status"] for f in folders} == {"converged"}
    assert {read_json(f / "case.json")["case"]["engine"] for f in folders} == {"newton", "calculix"}
    assert (checkout / "results/studies/pressure_volume/figures/pressure_volume.png").stat().st_size > 0
    assert (checkout / "results/index.html").stat().st_size > 0
    assert "figure: results/studies/pressure_volume/figures/pressure_volume.png" in swept


@pytest.mark.parametrize(
    "command",
    [
        "source .venv/bin/activate; limo check",
        ".venv/bin/limo status",
        "make benchmark",
        ".venv/bin/python -m snakemake --report 'my report.html' pressure_volume",
    ],
)
def test_commands_in_a_path_with_blanks_and_apostrophe(checkout, swept, command):
    passed(run("bash", "-ec", command, cwd=checkout))


def test_a_checkout_behind_a_link(checkout, swept, tmp_path):
    """Nothing is to do there; and what is asked for runs, by the interpreter that lies behind the link."""
    link = tmp_path / "link"
    link.symlink_to(checkout)
    snakemake = (link / ".venv/bin/python", "-m", "snakemake", "--cores", "1", "pressure_volume")
    assert "Nothing to be done" in passed(run(*snakemake, cwd=link, PWD=str(link)))
    said = passed(run(*snakemake, "--forcerun", "export_study", cwd=link, PWD=str(link)))
    assert "2 of 2 steps (100%) done" in said
    passed(run(link / ".venv/bin/limo", "check", cwd=link, PWD=str(link)))


@contextmanager
def read_only(folder: Path):
    """``folder`` as nobody may write to it, root neither."""
    if os.geteuid():
        modes = {path: path.stat().st_mode for path in [folder, *folder.rglob("*")]}
        for path, mode in modes.items():
            path.chmod(mode & ~0o222)
        try:
            yield
        finally:
            for path, mode in modes.items():
                path.chmod(mode)
        return
    if subprocess.run(["mount", "--bind", folder, folder], capture_output=True).returncode:
        pytest.skip("this machine lets nobody mount")
    try:
        subprocess.run(["mount", "-o", "remount,bind,ro", folder], check=True)
        yield
    finally:
        subprocess.run(["umount", "-l", folder], check=True)


def test_a_checkout_that_is_read_only(tmp_path):
    """Its workflow runs in another folder."""
    project, here = copy_project(tmp_path / "read only"), tmp_path / "here"
    tiny_study(here, "tiny")
    command = (sys.executable, "-m", "snakemake", "--snakefile", project / "Snakefile", "--cores", "1", "tiny")
    with read_only(project):
        with pytest.raises(OSError, match=r"Read-only|Permission"):
            (project / "new").touch()
        passed(run(*command, cwd=here, PYTHONPATH=str(project / "scripts")))
    assert [read_json(f)["status"] for f in here.glob("results/cases/*/status.json")] == ["converged"]
    assert (here / "results/studies/tiny/study.nc").exists()


# --------------------------------------------------------------------------------------------------------------------
# what is refused


@pytest.mark.parametrize("name", NAMES, ids=ascii)
def test_set_up_refuses_what_cannot_work(tmp_path, name):
    folder = tmp_path / name / "limo"
    shutil.copytree(ROOT / "scripts", folder / "scripts", ignore=shutil.ignore_patterns("__pycache__"))
    done = run("bash", "scripts/setup.sh", cwd=folder)
    assert done.returncode == 1
    assert not done.stdout
    assert done.stderr.count("\n") == 1
    character = name[1:-1]
    shown = (str(folder), character) if name.isprintable() else (ascii(str(folder)), ascii(character))
    assert done.stderr.startswith(f"setup: {shown[0]}: ")
    assert f"its path has {shown[1]} (" in done.stderr
    assert "make clean-setup" in done.stderr
    assert sorted(path.name for path in folder.iterdir()) == ["scripts"]


def test_set_up_passes_blanks_and_apostrophes(tmp_path):
    """It goes on to the next thing that is wrong here: nothing is installed."""
    folder = tmp_path / ODD / "limo"
    shutil.copytree(ROOT / "scripts", folder / "scripts", ignore=shutil.ignore_patterns("__pycache__"))
    python, uname = tmp_path / "a python", tmp_path / "bin" / "uname"
    python.symlink_to(sys.executable)
    uname.parent.mkdir()
    uname.write_text("#!/bin/sh\necho elsewhere\n")
    uname.chmod(0o755)
    done = run("bash", "scripts/setup.sh", cwd=folder, PYTHON=str(python), PATH=f"{uname.parent}:{os.environ['PATH']}")
    assert (done.returncode, done.stderr.strip()) == (1, "setup: Linux on x86_64 is needed: gmsh has no other package for Linux")


@pytest.mark.parametrize("name", ["a:b", "a{b}"])
def test_a_checkout_that_was_moved_to_such_a_folder_is_refused(tmp_path, name):
    folder = copy_project(tmp_path / name)
    shutil.copytree(ROOT / "config", folder / "config")
    for command in (["snakemake", "-n"], ["limo.terminal.cli", "check"]):
        done = run(sys.executable, "-m", *command, cwd=folder, PYTHONPATH="scripts")
        said = done.stdout + done.stderr
        assert done.returncode != 0
        assert f"{folder}: the project cannot work in this folder" in said
        assert "Traceback" not in said
    assert not (folder / "results").exists()


def test_a_link_does_not_hide_what_cannot_work(tmp_path):
    (tmp_path / "a$b").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "a$b")
    with pytest.raises(LimoError, match=r"a\$b: the project cannot work"):
        check_folder(tmp_path / "link")
    check_folder(tmp_path / ODD)


def test_results_are_refused_where_no_dataset_can_be_written(project, tmp_path):
    check_results(tmp_path / "a:b$c{d}")
    shutil.move(project.folder / "config", tmp_path / "a\\b" / "config")
    command = (sys.executable, "-m", "snakemake", "--snakefile", ROOT / "Snakefile", "-n")
    done = run(*command, cwd=tmp_path / "a\\b", PYTHONPATH=str(ROOT / "scripts"))
    assert done.returncode != 0
    assert "no dataset can be written here" in done.stdout + done.stderr


def test_a_configuration_whose_name_yaml_would_cut_off(tmp_path):
    """`` #`` begins a comment there."""
    tiny_study(tmp_path, "tiny")
    shutil.copy(tmp_path / "config/config.yaml", tmp_path / "config/heart #1: mine.yaml")
    (tmp_path / "config/config.yaml").write_text(yaml.safe_dump({"studies": ["none"]}))
    options = ("--config", "config/heart #1: mine.yaml", "--", "-n", "--snakefile", ROOT / "Snakefile")
    passed(
        run(sys.executable, "-m", "limo.terminal.cli", "sweep", "tiny", *options, cwd=tmp_path, PYTHONPATH=str(ROOT / "scripts"))
    )
