"""Inflate one airbag with one element, engine and mesh (rule solve_airbag). A run that fails writes its status."""

from pathlib import Path

from limo.airbag.model import runs_of
from limo.airbag.solve import solve_run
from limo.config.load import load_config
from limo.door import logged
from limo.engines.engine import EngineSettings
from limo.engines.find import find_engine
from limo.schema.solver import Solver
from limo.store.files import write_whole

with logged(snakemake.log[0]) as log:  # noqa: F821
    file = snakemake.config["file"]  # noqa: F821
    airbag = load_config(file).airbags[snakemake.wildcards.airbag]  # noqa: F821
    run = runs_of(airbag)[snakemake.wildcards.run]  # noqa: F821
    solver = Solver.model_validate(snakemake.config["solving"]["solver"])  # noqa: F821
    settings = EngineSettings(solver, find_engine(run.engine).build(solver, file).command)
    dataset = solve_run(airbag, run, settings)
    log.info("%s %s after %.1f s of CPU time", *(dataset[name].item() for name in ("status", "reason", "cpu_seconds")))
    write_whole(Path(snakemake.output[0]), dataset.to_netcdf)  # noqa: F821
