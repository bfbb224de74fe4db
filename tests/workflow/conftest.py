"""A tiny sweep on the real solver, solved once for all tests that look at its results."""

from __future__ import annotations

import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

import pytest
import yaml

from limo.cases.case import describe
from limo.cases.plan import Plan, make_plan
from limo.config.builds import with_found_builds
from limo.config.load import load_config
from limo.store.files import write_json
from tests.helpers.cases import without_studies
from tests.helpers.shared import made_once
from tests.helpers.snakemake import run_snakemake

ROOT = Path(__file__).parents[2]
STUDY = {
    "description": "two coarse devices up to a low pressure",
    "axes": {"n_pouches": [2, 4], "ventricular_pressure": [3.8]},
    "actuation_pressure_max": 10.0,
    "outputs": ["volumes"],
    "figures": ["pressure_volume"],
}


@dataclass
class Project:
    """A folder with a configuration of its own, in which the workflow runs; ``fresh``: each time from its imports on."""

    folder: Path
    fresh: bool = False

    @property
    def config_file(self) -> Path:
        return self.folder / "config" / "config.yaml"

    def edit(self, file: str, change) -> None:
        """Apply ``change`` to the data of a YAML file below config/."""
        path = self.folder / "config" / file
        data = yaml.safe_load(path.read_text())
        change(data)
        path.write_text(yaml.safe_dump(data))

    def snakemake(
        self, *arguments: str, cores: int | None = 2, config: str = "", fresh: bool = False
    ) -> subprocess.CompletedProcess[str]:
        """Run the workflow in the folder; another checkout's always in a fresh process, as its modules are others."""
        words = ["--snakefile", ROOT / "Snakefile", "--directory", self.folder, *(["--cores", cores] if cores else [])]
        words += [*arguments, "--config", f"file={self.config_file}", *config.split()]
        return run_snakemake(*words, folder=self.folder, fresh=fresh or self.fresh or "--snakefile" in arguments)

    def planned(self, *arguments: str) -> dict[str, int]:
        """Jobs of a dry run by rule."""
        done = self.snakemake(*arguments, "-n", "--quiet", "rules")
        assert done.returncode == 0, done.stdout + done.stderr
        return jobs(done)

    def study(self, name: str, like: str = "tiny", **changes) -> None:
        """Write a study like another one with some keys changed."""
        path = self.folder / "config" / "studies"
        path.joinpath(f"{name}.yaml").write_text(yaml.safe_dump(yaml.safe_load((path / f"{like}.yaml").read_text()) | changes))

    def plan(self) -> Plan:
        """What the workflow decides about its cases."""
        project, _ = with_found_builds(load_config(self.config_file), "config/config.yaml")
        return make_plan(project, self.folder / "results")

    def pretend(self, *studies: str) -> None:
        """Results of studies without solving: files that say what they are, and Snakemake's record that it made them."""
        plan, results = self.plan(), self.folder / "results"
        empty = []
        for name in studies:
            for case_id in plan.of_study(name):
                folder = results / "cases" / case_id
                case = plan.cases[case_id]
                write_json(folder / "case.json", describe(case))
                write_json(folder / "status.json", {"status": "converged", "solver_cpu_seconds": 100.0})
                empty += [results / f"meshes/{case.mesh_id}.vtu", folder / "volumes.nc", folder / "frames.nc"]
                empty += [folder / "measures.nc"] * (case_id in plan.wanted)
            empty += [results / f"studies/{name}/{file}" for file in ("study.nc", "study.csv")]
            figures = yaml.safe_load((self.folder / f"config/studies/{name}.yaml").read_text()).get("figures", [])
            empty += [results / f"studies/{name}/figures/{f}.{kind}" for f in figures for kind in ("png", "pdf")]
        for file in empty:
            file.parent.mkdir(parents=True, exist_ok=True)
            file.touch()
        done = self.snakemake(*studies, "--touch", "--forceall")
        assert done.returncode == 0, done.stdout + done.stderr


def jobs(done: subprocess.CompletedProcess[str]) -> dict[str, int]:
    """Jobs by rule of the table that Snakemake prints; none where there is nothing to do."""
    found, inside = {}, False
    for line in (done.stdout + done.stderr).splitlines():
        words = line.split()
        if words[:2] == ["job", "count"]:
            found, inside = {}, True  # the table is printed at the start and at the end
        elif inside and len(words) == 2 and words[1].isdigit():
            found[words[0]] = int(words[1])
    return found


def make_project(folder: Path) -> Project:
    """The project's own configuration with one tiny study and a very coarse mesh level."""
    studies = without_studies(ROOT, folder)
    project = Project(folder)
    (studies / "tiny.yaml").write_text(yaml.safe_dump(STUDY))

    def coarser(config):
        config["studies"] = ["tiny"]
        config["mesh"]["level"] = "tiny"
        config["mesh_levels"]["tiny"] = {"degrees_of_freedom": 3000, "grading": 1.0}
        config["limits"] |= {"compression_share": 1.0, "actuation_volume": 1.0}  # on so coarse a mesh fabric does rest locked
        config["scaling"] = {"n_pouches": 2, "start": 3000, "minutes": 1e-3}  # one size

    project.edit("config.yaml", coarser)
    return project


@pytest.fixture
def project(tmp_path: Path) -> Project:
    """An unsolved project."""
    return make_project(tmp_path)


def run(project: Project, *targets: str, cores: int = 2) -> None:
    """Run targets of a project to their end."""
    done = project.snakemake(*targets, cores=cores)
    assert done.returncode == 0, done.stdout + done.stderr


def copied(folder: Path, to: Path) -> Project:
    """A copy of a project with its results, which Snakemake takes for what they are."""
    shutil.copytree(folder, to, symlinks=True)
    return Project(to)


@pytest.fixture
def pretended(pretended_once: Project, tmp_path: Path) -> Project:
    """A copy of a project with all results of three studies: fast and paper numerics up to 10 kPa, and stress up to 12."""
    return copied(pretended_once.folder, tmp_path / "copy")


@pytest.fixture(scope="session")
def pretended_once() -> Project:
    def make(folder: Path) -> None:
        project = make_project(folder)
        project.study("literal", numerics="paper")
        axes = {"n_pouches": [6], "ventricular_pressure": [3.8]}
        project.study("stress", axes=axes, actuation_pressure_max=12.0, outputs=["volumes", "stress"])
        project.edit("config.yaml", lambda d: d.update(studies=["tiny", "literal", "stress"]))
        project.pretend("tiny", "literal", "stress")
        assert project.planned() == {}

    return Project(made_once("pretended", make))


@pytest.fixture(scope="session")
def solved(tmp_path_factory: pytest.TempPathFactory) -> Project:
    """The tiny study, solved by CalculiX; each worker has a copy of its own."""
    return copied(made_once("solved", lambda folder: run(make_project(folder))), tmp_path_factory.mktemp("solved") / "copy")


@pytest.fixture(scope="session")
def everything(tmp_path_factory: pytest.TempPathFactory) -> Project:
    """Every kind of result that there is, from one tiny device by the engine newton, one square airbag and a tensile test."""

    def make(folder: Path) -> None:
        project = make_project(folder)
        axes = {"n_pouches": [4], "ventricular_pressure": [3.8], "width_scale": [0.9], "fabric_angle": [0], "bending_factor": [1]}
        shared = {
            "device": "limo_2025",  # its pattern has good elements on so coarse a mesh
            "axes": axes,
            "material": {"weave": {"warp_modulus": 280, "weft_modulus": 250, "poisson_ratio": 0.3, "shear_modulus": 90}},
            "engine": "newton",
            "variants": {"plain": {}},
        }
        filled = {"actuation_volume": ["rest", 3, "rest"], "frames": [0.0], "figures": ["loops"], "actuation_pressure_max": 0}
        project.study("filled", **shared, **filled)
        project.study(
            "tiny",
            **shared,
            branches=2,
            cross_check=1,
            outputs=["volumes", "contact", "stress", "strain", "fatigue", "fields"],
            frames=[0.0, 4.3, "max"],
            actuation=[0, "max", 0],
            figures=["pressure_volume", "von_mises", "cycles", "strain_paths", "buckling", "loops"],
            measured="config/measured/curves_synthetic.csv",
        )
        airbags = project.folder / "config" / "airbags"
        airbag = yaml.safe_load((airbags / "classical.yaml").read_text())
        shutil.rmtree(airbags)
        airbags.mkdir()
        series = [{"element": "C3D20R", "engine": "newton", "divisions": [4], "path": [100, 10]}]
        (airbags / "classical.yaml").write_text(yaml.safe_dump(airbag | {"series": series}))
        files = [f"results/studies/tiny/{file}" for file in ("study.nc", "study.csv", "shapes.nc", "figures/pressure_volume.png")]
        files += ["results/studies/filled/study.nc", "results/studies/filled/figures/loops.png"]
        files += [f"results/cases/{case_id}/fields" for case_id in project.plan().of_study("tiny")]
        run(project, *files, "material", "results/airbags/classical/airbag.nc")

    return copied(made_once("everything", make), tmp_path_factory.mktemp("everything") / "copy")
