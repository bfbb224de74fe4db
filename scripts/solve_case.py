"""Solve one case (rule solve_case). A case that fails writes its status and lets the sweep go on."""

from limo.warm import warm

warm(f"limo.engines.{snakemake.params.case['engine']}.engine")  # noqa: F821

from pathlib import Path

from limo.cases.case import Case
from limo.cases.solved import keep, restore
from limo.door import logged
from limo.schema.solver import Limits, Recovery, Solver
from limo.solve.case import SolveSettings, solve_case
from limo.store.progress import solving

with logged(snakemake.log[0]) as log:  # noqa: F821
    case = Case.from_dict(snakemake.params.case)  # noqa: F821
    chosen = snakemake.config["solving"]  # noqa: F821
    solver, limits = Solver.model_validate(chosen["solver"]), Limits.model_validate(chosen["limits"])
    solver = solver.model_copy(update={"time_limit": snakemake.resources.attempt_seconds / 60})  # noqa: F821
    rungs = getattr(Recovery.model_validate(chosen["recovery"]), case.engine)
    recovery = snakemake.params.recovery  # noqa: F821
    settings = SolveSettings(solver, Path(chosen["command"]), limits, rungs, recovery)
    folder = Path(snakemake.output.status).parent  # noqa: F821
    log.info("predicted %s s of CPU time", snakemake.resources.predicted_seconds)  # noqa: F821
    with solving(folder):
        status = restore(case, folder, recovery)
        if status is None:
            status = solve_case(case, Path(snakemake.input.mesh), folder, settings, [*map(Path, snakemake.input.fit)])  # noqa: F821
            keep(folder)
    log.info("%s %s after %.0f s of CPU time", status["status"], status["reason"], status["solver_cpu_seconds"])
