"""Engine calculix, as ``limo.engines.engine`` describes one."""

from __future__ import annotations

from typing import TYPE_CHECKING

from limo.engines.engine import Build, EngineSettings, Place, Sample
from limo.errors import SolverNotFoundError
from limo.schema.solver import Solver

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    import numpy as np

    from limo.engines.load_path import LoadPath
    from limo.mechanics.model import Model
    from limo.schema.element import Element
    from limo.schema.numerics import Numerics

NAME = "calculix"
LARGE_FILES = ("*.frd", "*.dat", "*.12d", "*.eig", "spooles.out")
CONTACT = False
WITHOUT_RAMP = False
SYRINGE = False
LATE = ("limo.engines.calculix.run",)
#: increments of a sample, of some iterations each
SAMPLED = 1


def takes(element: Element) -> bool:
    """It takes bricks, and shells that it expands itself; it knows none with directors."""
    return not element.plane_stress


def build(solver: Solver, config_file: str) -> Build:
    """The build that ``solver`` names or prefers. Raises ``ConfigError`` or ``SolverNotFoundError`` where there is none."""
    from limo.engines.calculix.build import build_id, find_ccx

    command = find_ccx(solver, config_file)
    return Build(build_id(command), command)


def builds() -> dict[str, Build]:
    """The tuned build of this machine and the stock one, as far as they are there."""
    builds = {}
    for name in ("tuned", "stock"):
        try:
            builds[name] = build(Solver(build=name), "")
        except SolverNotFoundError:
            continue
    return builds


def solve(
    model: Model, folder: Path, settings: EngineSettings, after: LoadPath | None = None, start: np.ndarray | None = None
) -> LoadPath:
    """The load path of a model, begun anew: CalculiX carries on from nothing. Its files stay in ``folder``."""
    from limo.engines.calculix import run

    return run.solve(model, folder, settings.solver, settings.command)


def inflate(model: Model, levels: Sequence[float], folder: Path, settings: EngineSettings) -> LoadPath:
    """One overdamped dynamic step through all levels."""
    from limo.engines.calculix import inflation

    return inflation.inflate(model, levels, folder, settings.solver, settings.command)


def sample(model: Model, folder: Path, settings: EngineSettings) -> Sample:
    """The first ``SAMPLED`` increments."""
    from limo.engines.calculix import run
    from limo.engines.calculix.build import build_id
    from limo.engines.calculix.deck import write_deck

    times = write_deck(model, folder / f"{run.JOB}.inp", SAMPLED)
    outcome = run.run(folder, settings.command, settings.solver, times[-1].end)
    reason = f"{outcome.status}: {outcome.reason}"
    return Sample(build_id(settings.command), outcome.iterations, outcome.cpu_seconds, outcome.memory, reason)


def progress(folder: Path, numerics: Numerics, actuation_pressure_max: float) -> Place | None:
    """How far the last run in the folder of a case came, by its .sta and .cvg; None while there is no deck."""
    from limo.engines.calculix.progress import place

    return place(folder / "run", numerics, actuation_pressure_max)


def share_done(numerics: Numerics, actuation_pressure_max: float, clock: np.ndarray, actuation_pressure: np.ndarray) -> float:
    """Share of the solver's clock."""
    from limo.engines.calculix.deck import stage_times

    return float(clock[-1]) / stage_times(numerics, actuation_pressure_max)[-1].end
