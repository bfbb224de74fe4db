"""Small cases and runs of the real solver."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from limo.case import Case, study_cases
from limo.config import Mesh, MeshLevel, Solver, load_config
from limo.deck import write_deck
from limo.engines import calculix
from limo.frd import FrdFile
from limo.geometry import flat_pattern
from limo.mesh import DeviceMesh, layered, mesh_to_target
from limo.model import Model

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="session")
def case() -> Case:
    """The N_p = 8 device of the default study."""
    loaded = load_config(ROOT / "config/config.yaml")
    return next(c for c in study_cases(loaded, "pressure_volume").values() if c.n_pouches == 8)


def with_(case: Case, **changes) -> Case:
    """A case with other values; ``symmetry`` and ``element`` reach into its mesh."""
    mesh = {k: changes.pop(k) for k in ("symmetry", "element") if k in changes}
    values = {**case.__dict__, **changes}
    values["mesh"] = Mesh(**{**case.mesh.model_dump(), **mesh})
    return Case(**values)


def small_mesh(case: Case, degrees_of_freedom: int, symmetry: str) -> DeviceMesh:
    """A very coarse mesh of the case's device."""
    level = MeshLevel(degrees_of_freedom=degrees_of_freedom)
    pattern = flat_pattern(case.device.pattern, case.n_pouches)
    return layered(mesh_to_target(pattern, level.degrees_of_freedom, level.grading), pattern, symmetry)


@pytest.fixture(scope="session")
def run_start() -> Callable[[Model, Path, float, int], np.ndarray]:
    """Run the first ``increments`` equal increments of ``seconds`` of a model; displacements (n, 3) in mm of its nodes."""
    command = calculix.find_ccx(Solver())

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
