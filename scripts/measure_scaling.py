"""Measure what an iteration takes on ever larger models (rule measure_scaling)."""

from pathlib import Path

from limo.accuracy.scaling import measure_scaling
from limo.config.load import load_config
from limo.door import logged
from limo.engines.engine import EngineSettings
from limo.engines.find import find_engine
from limo.schema.solver import Solver
from limo.store.files import write_whole

if __name__ == "__main__":  # each size has a process of its own, which reads this file again
    with logged(snakemake.log[0]):  # noqa: F821
        file, engine = snakemake.config["file"], snakemake.wildcards.engine  # noqa: F821
        solver = Solver.model_validate(snakemake.config["solving"]["solver"])  # noqa: F821
        settings = EngineSettings(solver, find_engine(engine).build(solver, file).command)
        rows = measure_scaling(load_config(file), engine, settings)
        write_whole(Path(snakemake.output[0]), lambda path: rows.to_csv(path, index=False))  # noqa: F821
