"""The lock file covers what pyproject.toml asks for and can be installed anywhere; set-up goes on without the tuned solver."""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from packaging.markers import default_environment
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[2]
LOCK, CLUSTER = ROOT / "requirements.lock", ROOT / "requirements-cluster.lock"
PYTHONS = ("3.11", "3.12", "3.13")


def locked() -> dict[str, list[Requirement]]:
    """Pins of both locks by canonical name; one name may have a pin for each of several markers."""
    pins: dict[str, list[Requirement]] = {}
    for line in (LOCK.read_text() + CLUSTER.read_text()).splitlines():
        if re.match(r"[A-Za-z0-9]", line):
            pin = Requirement(line.removesuffix("\\"))
            pins.setdefault(canonicalize_name(pin.name), []).append(pin)
    return pins


def asked() -> list[Requirement]:
    """Dependencies of the project and of its extras."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = [line for lines in project["optional-dependencies"].values() for line in lines]
    return [Requirement(line) for line in project["dependencies"] + extras]


@pytest.mark.parametrize("python", PYTHONS)
def test_lock_pins_every_dependency_once(python):
    environment = default_environment() | {
        "python_version": python,
        "python_full_version": f"{python}.1",
        "sys_platform": "linux",
        "platform_machine": "x86_64",
    }
    pins = locked()
    for requirement in asked():
        applying = [
            p for p in pins.get(canonicalize_name(requirement.name), []) if p.marker is None or p.marker.evaluate(environment)
        ]
        assert len(applying) == 1, f"{requirement.name} on Python {python}: {len(applying)} pins; renew the lock with `make lock`"
        (pin,) = applying[0].specifier
        assert pin.operator == "=="
        assert requirement.specifier.contains(pin.version), f"{requirement}, but {applying[0]}: call `make lock`"


def test_every_pin_has_a_hash():
    text = LOCK.read_text() + CLUSTER.read_text()
    for entry in re.findall(r"^[A-Za-z0-9].*(?:\n +.*)*", text, flags=re.MULTILINE):
        assert "--hash=sha256:" in entry, entry


def test_lock_names_no_server_and_no_folder():
    for line in (LOCK.read_text() + CLUSTER.read_text()).splitlines():
        assert not re.search(r"/|--(extra-)?index-url|--find-links|file:", line), line


@pytest.mark.parametrize(
    ("apt", "said"),
    [("exit 100", "the source package calculix-ccx=2.20-1 cannot be had here"), ("exit 0", "is not the one that is pinned")],
    ids=["no source", "another source"],
)
def test_tuned_solver_that_cannot_be_built_leaves_one_line_and_nothing_else(tmp_path, apt, said):
    """A copy of the project whose apt-get brings nothing: set-up goes on with the stock solver."""
    shutil.copytree(ROOT / "scripts", tmp_path / "scripts")
    (tmp_path / ".venv/bin").mkdir(parents=True)
    (tmp_path / "bin").mkdir()
    for path, lines in ((".venv/bin/python", f'exec {shlex.quote(sys.executable)} "$@"'), ("bin/apt-get", apt)):
        (tmp_path / path).write_text(f"#!/bin/sh\n{lines}\n")
        (tmp_path / path).chmod(0o755)
    environment = {**os.environ, "PATH": f"{tmp_path}/bin:{os.environ['PATH']}"}
    command = ["bash", tmp_path / "scripts/ccx/build.sh"]
    run = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=60, check=False)
    assert run.returncode == 1
    assert run.stdout == "ccx-tuned: fetching the source package\n"
    assert said in run.stderr
    assert run.stderr.count("\n") == 1
    assert not list((tmp_path / ".local").glob("*ccx-tuned*/*"))
