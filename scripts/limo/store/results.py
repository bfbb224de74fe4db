"""Where results lie: the one place that knows the names of their files, for Python and for the rules alike.

``Results(Path("results")).case("{case}").frames`` is the pattern of a rule, with a name in the place of ``{case}`` it is a file.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

#: names of what is known by its name alone, such as in the stamps of ``status.json``
DESCRIBED, STATUS, VOLUMES, FRAMES, OWN_MESH = "case.json", "status.json", "volumes.nc", "frames.nc", "mesh.vtu"
NUMERICS = "numerics.json"


@dataclass(frozen=True)
class CaseFiles:
    """The files of one case, in its folder."""

    folder: Path

    @property
    def described(self) -> Path:
        """The case, the code that solved it, and the mesh that it was solved on where that is not its own."""
        return self.folder / DESCRIBED

    @property
    def status(self) -> Path:
        """How the solve ended (``store.statuses.SolveStatus``)."""
        return self.folder / STATUS

    @property
    def volumes(self) -> Path:
        """Volumes at every increment."""
        return self.folder / VOLUMES

    @property
    def frames(self) -> Path:
        """Displacements at chosen pressures."""
        return self.folder / FRAMES

    @property
    def solved(self) -> tuple[Path, Path, Path, Path]:
        """What a solve writes."""
        return self.described, self.status, self.volumes, self.frames

    @property
    def own_mesh(self) -> Path:
        """The mesh of a case that its recovery ladder put on another one."""
        return self.folder / OWN_MESH

    @property
    def measures(self) -> Path:
        """What studies have measured of the case."""
        return self.folder / "measures.nc"

    @property
    def fields(self) -> Path:
        """The folder of fields for ParaView."""
        return self.folder / "fields"

    @property
    def picture(self) -> Path:
        """The curves of the case, where someone drew them."""
        return self.folder / "case.png"

    @property
    def run(self) -> Path:
        """The folder in which an engine runs."""
        return self.folder / "run"

    @property
    def progress(self) -> Path:
        """How far a run has come (``store.progress``)."""
        return self.run / "progress.json"

    @property
    def numerics(self) -> Path:
        """The numerics of a run that a recovery ladder has changed."""
        return self.run / NUMERICS

    @property
    def lock(self) -> Path:
        """The file that a process locks while it solves the case."""
        return self.folder / "lock"

    @property
    def seen(self) -> CaseFiles:
        """The folder of what is copied of a run on another disk (``store.scratch``)."""
        return CaseFiles(self.folder / ".seen")

    @property
    def kept(self) -> CaseFiles:
        """The folder of second names of what a solve wrote."""
        return CaseFiles(self.folder / ".kept")


@dataclass(frozen=True)
class StudyFiles:
    """The files of one study, in its folder."""

    folder: Path

    @property
    def dataset(self) -> Path:
        """The study's dataset."""
        return self.folder / "study.nc"

    @property
    def table(self) -> Path:
        """The dataset as a table."""
        return self.folder / "study.csv"

    @property
    def shapes(self) -> Path:
        """The surfaces that its figures draw."""
        return self.folder / "shapes.nc"

    def figure(self, name: str, kind: str) -> Path:
        """A figure as ``png`` or ``pdf``."""
        return self.folder / "figures" / f"{name}.{kind}"


@dataclass(frozen=True)
class AirbagFiles:
    """The files of one airbag, in its folder."""

    folder: Path

    @property
    def dataset(self) -> Path:
        """All runs of the airbag."""
        return self.folder / "airbag.nc"

    def run(self, name: str) -> Path:
        """One run."""
        return self.folder / "runs" / f"{name}.nc"

    def figure(self, name: str, kind: str) -> Path:
        """A figure as ``pdf``."""
        return self.folder / "figures" / f"{name}.{kind}"


@dataclass(frozen=True)
class ExplorationFiles:
    """The files of one exploration, in its folder."""

    folder: Path

    def round(self, number: int | str) -> Path:
        """The designs of a round."""
        return self.folder / f"round_{number}.json"

    def told(self, number: int | str) -> Path:
        """What came of the designs of a round."""
        return self.folder / f"told_{number}.json"

    @property
    def dataset(self) -> Path:
        """All designs, surrogates and indices."""
        return self.folder / "exploration.nc"

    @property
    def page(self) -> Path:
        """What is recommended, and why."""
        return self.folder / "README.md"

    def figure(self, name: str) -> Path:
        """A figure as ``png``."""
        return self.folder / f"{name}.png"


@dataclass(frozen=True)
class Results:
    """A folder of results, ``root``."""

    root: Path

    @cached_property
    def cases(self) -> Path:
        """The folder of all cases."""
        return self.root / "cases"

    @cached_property
    def meshes(self) -> Path:
        """The folder of all meshes."""
        return self.root / "meshes"

    @cached_property
    def studies(self) -> Path:
        """The folder of all studies."""
        return self.root / "studies"

    def case(self, case_id: str) -> CaseFiles:
        """The files of a case."""
        return CaseFiles(self.cases / case_id)

    def case_ids(self) -> list[str]:
        """Names of the cases that have a folder, in their order; none without results."""
        return sorted(p.name for p in self.cases.iterdir() if p.is_dir()) if self.cases.is_dir() else []

    def mesh(self, mesh_id: str) -> Path:
        """The file of a mesh."""
        return self.meshes / f"{mesh_id}.vtu"

    def study(self, name: str) -> StudyFiles:
        """The files of a study."""
        return StudyFiles(self.studies / name)

    def airbag(self, name: str) -> AirbagFiles:
        """The files of an airbag."""
        return AirbagFiles(self.root / "airbags" / name)

    @property
    def explorations(self) -> Path:
        """The folder of all explorations."""
        return self.root / "explorations"

    def exploration(self, name: str) -> ExplorationFiles:
        """The files of an exploration."""
        return ExplorationFiles(self.explorations / name)

    def times(self, case_id: str) -> Path:
        """CPU times of further solves of a case."""
        return self.root / "times" / f"{case_id}.json"

    @property
    def scalings(self) -> Path:
        """The folder of what ever larger models take."""
        return self.root / "scaling"

    def scaling(self, engine: str) -> Path:
        """What ever larger models take by an engine."""
        return self.scalings / f"{engine}.csv"

    def kept_names(self, study: str) -> Path:
        """Names of a study's runs that are kept beside the documentation."""
        return self.root / "kept" / f"{study}.txt"

    @property
    def accuracy(self) -> Path:
        """Measured errors of the settings of the device."""
        return self.root / "accuracy" / "accuracy.nc"

    @property
    def stress_test(self) -> Path:
        """The table of the stress test."""
        return self.root / "stress_test" / "cases.csv"

    def material(self, kind: str) -> Path:
        """The tensile test with its fit as ``nc``, its specimens as ``csv``, or its figure as ``png`` or ``pdf``."""
        return self.root / "material" / f"tensile_test.{kind}"

    def log(self, rule: str, name: str) -> Path:
        """The log of a rule's job."""
        return self.root / "logs" / rule / f"{name}.log"

    @property
    def slurm_logs(self) -> Path:
        """The folder of the logs that Slurm writes of jobs."""
        return self.root / "logs" / "slurm"

    def benchmark(self, rule: str, name: str) -> Path:
        """What a rule's job took."""
        return self.root / "benchmarks" / rule / f"{name}.tsv"

    def about(self, case_id: str) -> Iterator[Path]:
        """Logs and benchmarks of a case."""
        for rule in ("solve_case", "measure_case", "write_fields"):
            yield self.log(rule, case_id)
            yield self.benchmark(rule, case_id)
