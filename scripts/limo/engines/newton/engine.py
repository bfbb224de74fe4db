"""Engine newton, as ``limo.engines.engine`` describes one: its iteration, and MKL with it, is imported when it is to solve."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from limo.engines.engine import Build, EngineSettings, Place, Sample

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    import numpy as np

    from limo.engines.load_path import LoadPath
    from limo.mechanics.model import Model
    from limo.schema.element import Element
    from limo.schema.numerics import Numerics
    from limo.schema.solver import Solver

NAME = "newton"
LARGE_FILES = ()
CONTACT = True
WITHOUT_RAMP = True
SYRINGE = True
LATE = ("limo.engines.newton.iteration",)
#: iterations of a sample
SAMPLED = 5


def takes(element: Element) -> bool:
    """It takes bricks and its own shells; no one makes bricks of other shells for it."""
    return not element.is_shell


def build(solver: Solver, config_file: str) -> Build:
    """The build, named by its MKL. Raises ``ConfigError`` where a package is lacking."""
    from limo.engines.newton.build import find_build

    return find_build(solver, config_file)


def builds() -> dict[str, Build]:
    """None beside each other: a machine has one MKL."""
    return {}


def solve(
    model: Model, folder: Path, settings: EngineSettings, after: LoadPath | None = None, start: np.ndarray | None = None
) -> LoadPath:
    """The load path of a model of bricks or shells, carried on from ``after`` or from the state ``start``.

    Nothing is written into ``folder``.
    """
    from limo.engines.newton.build import require_packages

    require_packages()
    from limo.engines.newton import iteration

    return iteration.solve(model, settings.solver, start, after)


def inflate(model: Model, levels: Sequence[float], folder: Path, settings: EngineSettings) -> LoadPath:
    """Equilibria at all levels, each found from the one before. Nothing is written into ``folder``."""
    from limo.engines.newton.build import require_packages

    require_packages()
    from limo.engines.newton import inflation

    return inflation.inflate(model, levels, settings.solver)


def sample(model: Model, folder: Path, settings: EngineSettings) -> Sample:
    """``SAMPLED`` iterations of the fit, without the analysis of the matrix that precedes them."""
    numerics = model.numerics
    few = numerics.model_copy(update={"newton": numerics.newton.model_copy(update={"iterations": SAMPLED})})
    path = solve(replace(model, numerics=few), folder, settings)
    iterations, cpu_seconds = sum(path.iterations.values()), path.cpu_seconds - path.details["setup_seconds"]
    return Sample(path.build["version"], iterations, cpu_seconds, path.memory, f"{path.status}: {path.reason}")


def progress(folder: Path, numerics: Numerics, actuation_pressure_max: float) -> Place | None:
    """How far the last run in the folder of a case came, by what it reported; None while it has reported nothing."""
    from limo.engines.newton.progress import place

    return place(folder, actuation_pressure_max)


def share_done(numerics: Numerics, actuation_pressure_max: float, clock: np.ndarray, actuation_pressure: np.ndarray) -> float:
    """Share of the ramp: there is no time. All of it where there is no ramp."""
    return float(actuation_pressure[-1]) / actuation_pressure_max if actuation_pressure_max else 1.0
