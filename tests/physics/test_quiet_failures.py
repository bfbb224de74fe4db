"""Runs of the real CalculiX that end as if nothing were wrong, or leave a result that is none; each is caught."""

from __future__ import annotations

import subprocess

import numpy as np
import pytest

from limo.engines.calculix import build as ccx_build
from limo.engines.calculix import run as calculix
from limo.engines.calculix.deck import write_deck
from limo.engines.calculix.frd import FrdFile
from limo.mechanics.build import build_model
from limo.mesh.elements import HEX20_BOTTOM, HEX20_TOP
from limo.schema.numerics import Controls
from limo.schema.solver import Solver
from limo.solve.judge import unbelievable
from tests.helpers.cases import small_mesh, with_

#: a brick that nothing holds, pulled at its corners; of its stiffness six eigenvalues are zero
LOOSE_BRICK = """*NODE, NSET=ALL
{nodes}
*ELEMENT, TYPE=C3D20R, ELSET=E
1, {first}
{second}
*MATERIAL, NAME=M
*ELASTIC
267, 0.33
*SOLID SECTION, ELSET=E, MATERIAL=M
*STEP
*STATIC
1, 1
*CLOAD
{loads}
*NODE OUTPUT
U
*END STEP
"""


@pytest.fixture(scope="module")
def command():
    """CalculiX as a machine has it without the tuned build, whose patch 02 ends a run with such a solution, or else that."""
    try:
        return ccx_build.find_ccx(Solver(build="stock"))
    except Exception:
        return ccx_build.find_ccx(Solver())


@pytest.fixture(scope="module")
def tiny(case):
    """The start of a very coarse device."""
    return with_(case, actuation_pressure_max=4.0), small_mesh(case, 3000, "quarter")


def test_a_missing_deck_ends_with_exit_code_0_and_is_no_result(command, tmp_path):
    alone = subprocess.run([command, "deck"], cwd=tmp_path, capture_output=True, text=True, timeout=60, check=False)
    assert alone.returncode == 0, "CalculiX has learned to say so: this trap is gone"
    outcome = calculix.run(tmp_path, command, Solver(), 1.0)
    assert (outcome.exit_code, outcome.status, outcome.interrupted) == (0, "crashed", False)
    assert "cannot open file" in outcome.reason


def test_a_singular_model_ends_with_exit_code_0_and_absurd_displacements(command, tmp_path):
    corners = np.array([[x, y, z] for z in (-1, 1) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))], float)
    edges = [(k, (k + 1) % 4) for k in range(4)] + [(4 + k, 4 + (k + 1) % 4) for k in range(4)] + [(k, 4 + k) for k in range(4)]
    nodes = np.vstack([corners, [(corners[a] + corners[b]) / 2 for a, b in edges]])
    assert len(HEX20_BOTTOM) == len(HEX20_TOP) == 8
    text = LOOSE_BRICK.format(
        nodes="\n".join(f"{k}, {x:g}, {y:g}, {z:g}" for k, (x, y, z) in enumerate(nodes, 1)),
        first=", ".join(map(str, range(1, 11))) + ",",
        second=", ".join(map(str, range(11, 21))),
        loads="\n".join(f"{k}, 3, {1 + 0.1 * k:g}" for k in range(1, 9)),
    )
    (tmp_path / "deck.inp").write_text(text)
    outcome = calculix.run(tmp_path, command, Solver(), 1.0)
    assert outcome.exit_code == 0
    assert outcome.status == "converged", "this is what an engine that trusts its solver says"
    with FrdFile(tmp_path / "deck.frd") as frd:
        u = frd.displacements(frd.frames[-1], 20)
    assert np.abs(u).max() > 1e6 or not np.isfinite(u).all()
    assert "beyond 3 L" in unbelievable(u, np.nan, 140.0)


def test_the_last_frame_of_a_failed_increment_is_written_and_never_read(command, tiny, tmp_path):
    case, mesh = tiny
    harsh = case.numerics.model_copy(
        update={
            "first_increment": 0.02, "smallest_increment": 0.01, "largest_increment": 100.0,
            "controls": Controls(residual=1e-6, correction=1e-6, growth=10, cutbacks=1, cutback=0.9),
            "fit": case.numerics.fit.model_copy(update={"damping": 1e3}),
            "hold": case.numerics.hold.model_copy(update={"damping": 1e3}),
            "ramp": case.numerics.ramp.model_copy(update={"damping": 1e3}),
        }
    )  # fmt: skip
    model = build_model(with_(case, numerics=harsh), mesh)
    with calculix.solve(model, tmp_path, Solver(), command) as path:
        assert path.status == "diverged"
        assert path.ended_in == "fit"
        with FrdFile(tmp_path / "deck.frd") as frd:
            assert len(frd.frames) > len(path.stage), "CalculiX wrote the state that it gave up"
    assert write_deck(model, tmp_path / "again.inp")[0].name == "fit"
