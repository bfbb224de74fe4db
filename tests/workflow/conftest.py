"""A tiny sweep on the real solver, solved once for all tests that look at its results."""

from __future__ import annotations

import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parents[2]
STUDY = {
    "description": "two coarse devices up to a low pressure",
    "axes": {"n_pouches": [4, 8], "ventricular_pressure": [3.8]},
    "actuation_pressure_max": 10.0,
    "figures": ["pressure_volume"],
}


@dataclass
class Project:
    """A folder with a configuration of its own, in which the project's workflow runs."""

    folder: Path

    @property
    def config_file(self) -> Path:
        return self.folder / "config" / "config.yaml"

    def edit(self, file: str, change) -> None:
        """Apply ``change`` to the data of a YAML file below config/."""
        path = self.folder / "config" / file
        data = yaml.safe_load(path.read_text())
        change(data)
        path.write_text(yaml.safe_dump(data))

    def snakemake(self, *arguments: str, cores: int = 2) -> subprocess.CompletedProcess[str]:
        """Run the workflow in the folder."""
        command = [
            sys.executable,
            "-m",
            "snakemake",
            "--snakefile",
            str(ROOT / "Snakefile"),
            "--directory",
            str(self.folder),
            "--cores",
            str(cores),
            *arguments,
            "--config",
            f"file={self.config_file}",
        ]
        return subprocess.run(command, cwd=self.folder, capture_output=True, text=True, timeout=1800, check=False)

    def planned(self, *arguments: str) -> dict[str, int]:
        """Jobs of a dry run by rule."""
        done = self.snakemake(*arguments, "-n", "--quiet", "rules")
        assert done.returncode == 0, done.stdout + done.stderr
        jobs, inside = {}, False
        for line in (done.stdout + done.stderr).splitlines():
            words = line.split()
            if words[:2] == ["job", "count"]:
                jobs, inside = {}, True  # the table is printed at the start and at the end
            elif inside and len(words) == 2 and words[1].isdigit():
                rule = words[0].replace("solve_long_case", "solve_case")  # the same rule at another priority
                jobs[rule] = jobs.get(rule, 0) + int(words[1])
        return jobs


def make_project(folder: Path) -> Project:
    """The project's own configuration with one tiny study and a very coarse mesh level."""
    shutil.copytree(ROOT / "config", folder / "config")
    for study in (folder / "config" / "studies").iterdir():
        study.unlink()
    project = Project(folder)
    (folder / "config" / "studies" / "tiny.yaml").write_text(yaml.safe_dump(STUDY))

    def coarser(config):
        config["studies"] = ["tiny"]
        config["mesh"]["level"] = "tiny"
        config["mesh_levels"]["tiny"] = {"degrees_of_freedom": 3000, "grading": 1.0}

    project.edit("config.yaml", coarser)
    return project


@pytest.fixture
def project(tmp_path: Path) -> Project:
    """An unsolved project."""
    return make_project(tmp_path)


@pytest.fixture(scope="session")
def solved(tmp_path_factory: pytest.TempPathFactory) -> Project:
    """The tiny study, solved by CalculiX."""
    project = make_project(tmp_path_factory.mktemp("solved"))
    done = project.snakemake()
    assert done.returncode == 0, done.stdout + done.stderr
    return project
