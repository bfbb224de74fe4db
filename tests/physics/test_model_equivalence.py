"""The same device in different clothes: written-out bricks against CalculiX's own shells, and symmetric parts of it."""

from __future__ import annotations

import numpy as np
import pytest

from limo.mechanics.build import build_model
from limo.schema.numerics import Controls
from tests.helpers.cases import small_mesh, with_

SECONDS, INCREMENTS = 0.006, 3  # early in the fit: before the first instability can choose a branch


def tight(case):
    """The case with tight Newton limits, and so light and little damped that stiffness decides.

    CalculiX integrates the mass of its shells and of bricks by different rules: at 170 g/m^2 the first moments of the fit
    differ by 1 % for that reason alone, at 10 g/m^2 by less than 0.1 %.
    """
    stages = {s: getattr(case.numerics, s).model_copy(update={"damping": 100.0}) for s in ("fit", "hold", "ramp")}
    numerics = case.numerics.model_copy(update={"controls": Controls(residual=1e-4, correction=1e-4), **stages})
    light = case.device.material.model_copy(update={"areal_density": 10.0})
    return with_(case, numerics=numerics, device=case.device.model_copy(update={"material": light}))


@pytest.mark.parametrize(("shell", "brick"), [("S8R", "C3D20R"), ("S8", "C3D20")])
def test_written_out_bricks_move_like_the_shells_of_calculix(case, tmp_path, run_start, shell, brick):
    mesh = small_mesh(case, 3000, "full")
    shells = build_model(with_(tight(case), symmetry="full", element=shell), mesh)
    bricks = build_model(with_(tight(case), symmetry="full", element=brick), mesh, like_shells=True)
    u_shell = run_start(shells, tmp_path / "shell", SECONDS, INCREMENTS)
    u_brick = bricks.expansion.midsurface(run_start(bricks, tmp_path / "brick", SECONDS, INCREMENTS))
    largest = np.abs(u_shell).max()
    assert largest > 0.1
    assert np.abs(u_brick - u_shell).max() < 1e-3 * largest


@pytest.fixture(scope="module")
def device(case):
    """A device of few pouches, whose coarsest mesh is small."""
    return with_(case, n_pouches=4)


@pytest.mark.parametrize("symmetry", ["front_back", "quarter"])
def test_a_symmetric_part_moves_like_the_full_device(device, tmp_path, run_start, symmetry):
    whole = small_mesh(device, 3000, "full")
    part = small_mesh(device, 3000, symmetry)
    full = build_model(with_(tight(device), symmetry="full"), whole)
    model = build_model(with_(tight(device), symmetry=symmetry), part)
    u_full = run_start(full, tmp_path / "full", SECONDS, INCREMENTS)[full.expansion.bottom]
    u_part = run_start(model, tmp_path / "part", SECONDS, INCREMENTS)[model.expansion.bottom]
    # the nodes of a part come first in the full mesh, in the same order
    assert np.array_equal(whole.nodes[: len(part.nodes)], part.nodes)
    assert np.abs(u_full[: len(part.nodes)] - u_part).max() < 1e-4 * np.abs(u_full).max()
