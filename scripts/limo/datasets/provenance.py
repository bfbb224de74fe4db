"""Where a dataset comes from: conventions, resolved configuration, versions and commit."""

from __future__ import annotations

import json
import platform
import subprocess
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from limo import __version__
from limo.config.project import Project
from limo.datasets.variables import PAPER
from limo.store.files import CONVENTIONS


def study_attributes(project: Project, name: str) -> dict[str, str]:
    """The attributes of a study's dataset: what it is, and what it is made of."""
    study = project.studies[name]
    return {
        "title": f"{name}: {study.description}" if study.description else name,
        "Conventions": CONVENTIONS,
        "references": PAPER,
        "source": f"displacements of a Less In More Out device by the engine {' and '.join(project.engines_of(name))}",
        "study": name,
        "config": json.dumps(project.content(name), sort_keys=True),
        "versions": json.dumps(_versions(), sort_keys=True),
        "git_commit": git_commit(),
    }


def _versions() -> dict[str, str]:
    versions = {"limo": __version__, "python": platform.python_version()}
    for package in ("gmsh", "meshio", "netCDF4", "numpy", "scipy", "snakemake", "xarray"):
        try:
            versions[package] = version(package)
        except PackageNotFoundError:
            versions[package] = "absent"
    return versions


def git_commit() -> str:
    """The commit of the project, with ``+`` when files differ from it; ``unknown`` outside a checkout."""
    root = Path(__file__).parents[3]
    try:
        commit = subprocess.run(
            ["git", "-C", root, "rev-parse", "HEAD"], capture_output=True, text=True, check=True
        ).stdout.strip()
        changed = subprocess.run(["git", "-C", root, "status", "--porcelain"], capture_output=True, text=True, check=True).stdout
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
    return commit + ("+" if changed.strip() else "")
