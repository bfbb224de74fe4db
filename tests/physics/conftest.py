"""Small cases and runs of the real solver."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from limo.cases.case import Case
from limo.cases.grid import study_cases
from limo.config.load import load_config
from limo.engines.calculix import build as ccx_build
from limo.engines.calculix import run as calculix
from limo.engines.calculix.deck import write_deck
from limo.engines.calculix.frd import FrdFile
from limo.mechanics.model import Model
from limo.schema.solver import Solver

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="session")
def case() -> Case:
    """The N_p = 8 device of the default study."""
    loaded = load_config(ROOT / "config/config.yaml")
    return next(c for c in study_cases(loaded, "pressure_volume").values() if c.n_pouches == 8)


@pytest.fixture(scope="session")
def run_start() -> Callable[[Model, Path, float, int], np.ndarray]:
    """Run the first ``increments`` equal increments of ``seconds`` of a model; displacements (n, 3) in mm of its nodes."""
    command = ccx_build.find_ccx(Solver())

    def run(model: Model, folder: Path, seconds: float, increments: int) -> np.ndarray:
        folder.mkdir(parents=True, exist_ok=True)
        deck = folder / "deck.inp"
        write_deck(model, deck)
        direct = f"\\g<1>, DIRECT\n{seconds / increments:g}, {seconds:g}\n"
        text, count = re.subn(r"(\*DYNAMIC, ALPHA=\S+)\n.*\n", direct, deck.read_text())
        assert count == 1
        deck.write_text(text)
        outcome = calculix.run(folder, command, Solver(), seconds)
        assert outcome.status == "converged", outcome.reason
        with FrdFile(folder / "deck.frd") as frd:
            return frd.displacements(frd.frames[-1], len(model.nodes))

    return run
