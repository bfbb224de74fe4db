"""Time a solved case again where that is short, so that its CPU time is a median (rule time_case)."""

from pathlib import Path

from limo.cases.case import Case
from limo.door import logged
from limo.engines.engine import EngineSettings
from limo.reliability.repeatability import cpu_times
from limo.schema.solver import Solver
from limo.store.files import read_json, write_json

with logged(snakemake.log[0]):  # noqa: F821
    case, chosen = Case.from_dict(snakemake.params.case), snakemake.config["solving"]  # noqa: F821
    status = read_json(Path(snakemake.input.status))  # noqa: F821
    settings = EngineSettings(Solver.model_validate(chosen["solver"]), Path(chosen["command"]))
    times = cpu_times(case, Path(snakemake.input.mesh), status, settings, [*map(Path, snakemake.input.fit)])  # noqa: F821
    write_json(Path(snakemake.output[0]), {"cpu_seconds": times})  # noqa: F821
