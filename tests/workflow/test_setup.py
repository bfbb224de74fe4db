"""The lock file covers what pyproject.toml asks for and can be installed anywhere."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest
from packaging.markers import default_environment
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[2]
LOCK = ROOT / "requirements.lock"
PYTHONS = ("3.11", "3.12", "3.13")


def locked() -> dict[str, list[Requirement]]:
    """Pins of the lock by canonical name; one name may have a pin for each of several markers."""
    pins: dict[str, list[Requirement]] = {}
    for line in LOCK.read_text().splitlines():
        if re.match(r"[A-Za-z0-9]", line):
            pin = Requirement(line.removesuffix("\\"))
            pins.setdefault(canonicalize_name(pin.name), []).append(pin)
    return pins


def asked() -> list[Requirement]:
    """Dependencies of the project and of its ``dev`` extra."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    return [Requirement(line) for line in project["dependencies"] + project["optional-dependencies"]["dev"]]


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
    text = LOCK.read_text()
    for entry in re.findall(r"^[A-Za-z0-9].*(?:\n +.*)*", text, flags=re.MULTILINE):
        assert "--hash=sha256:" in entry, entry


def test_lock_names_no_server_and_no_folder():
    for line in LOCK.read_text().splitlines():
        assert not re.search(r"/|--(extra-)?index-url|--find-links|file:", line), line
