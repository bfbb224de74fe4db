"""A load path from the engine that a case names."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from limo.engines import Path as EnginePath
from limo.engines.calculix import run as calculix
from limo.mechanics.model import Model
from limo.schema.solver import Solver


@contextmanager
def path_of(
    model: Model, run_folder: Path, solver: Solver, command: Path | None, before: EnginePath | None
) -> Iterator[EnginePath]:
    """The load path of a model by the engine of its case. CalculiX cannot carry on from ``before``."""
    if model.case.engine == "newton":
        from limo.engines.newton import iteration as newton  # brings MKL, which the other engine does not need

        yield newton.solve(model, solver, after=before)
    else:
        with calculix.solve(model, run_folder, solver, command) as path:
            yield path
