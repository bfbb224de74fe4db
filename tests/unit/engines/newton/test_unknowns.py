"""Means and half differences of bottom and top nodes: exact changes of unknowns, whatever the constraints."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from limo.engines.newton.assembly import Assembly
from limo.engines.newton.tangent import Tangent
from limo.engines.newton.unknowns import Unknowns, displacements, means
from limo.mechanics.model import Equation, Model
from tests.helpers.cases import shaken
from tests.helpers.matrices import deformed, directions, stiffness, whole

PRESSURES = 3.8, 20.0  # kPa
SHIFT = 1e8  # 1/s^2
SYMMETRIES = ("quarter", "front_back", "full")


def relative(found: np.ndarray, expected: np.ndarray) -> float:
    return np.abs(found - expected).max() / np.abs(expected).max()


def changed(unknowns: Unknowns, matrix, y: np.ndarray) -> np.ndarray:
    """Q^T K_q Q y."""
    return unknowns.reduce(matrix @ unknowns.expand(y))


def nodes_of(unknowns: Unknowns, y: np.ndarray) -> np.ndarray:
    """Displacements (n, 3) of the nodes by their slots."""
    slots = np.where(unknowns.free >= 0, unknowns.factor * y[unknowns.free], 0.0).reshape(-1, 3)
    return slots[unknowns.first] + unknowns.sign[:, None] * slots[unknowns.second]


@pytest.mark.parametrize("symmetry", SYMMETRIES)
@pytest.mark.parametrize("element", ["C3D20R", "C3D20"])
def test_the_tangent_and_the_mass_are_those_of_the_displacements(make_model, element, symmetry):
    """With valve edge, planes of symmetry and sealed edges; all of the layer has means."""
    model = make_model(element, symmetry)
    assembly = Assembly(model)
    unknowns = means(assembly)
    plain, other = Tangent(assembly), Tangent(assembly, unknowns)
    assert (unknowns.sign[np.unique(assembly.bricks)] != 0).all()
    u = deformed(assembly)
    for y in directions(assembly):
        expected = changed(unknowns, stiffness(plain, u, *PRESSURES, SHIFT), y)
        assert relative(stiffness(other, u, *PRESSURES, SHIFT) @ y, expected) < 1e-12
        assert relative(whole(other, other.mass) @ y, changed(unknowns, whole(plain, plain.mass), y)) < 1e-12


def test_the_tangent_of_the_pressures_alone_is_that_of_the_displacements(make_model):
    """Pressures so large that they count beside the fabric."""
    assembly, pressures = Assembly(make_model()), (3.8e4, 2e5)
    unknowns, u = means(assembly), deformed(assembly)
    plain, other = (stiffness(t, u, *pressures) - stiffness(t, u) for t in (Tangent(assembly), Tangent(assembly, unknowns)))
    for y in directions(assembly):
        assert relative(other @ y, changed(unknowns, plain, y)) < 1e-9


@pytest.mark.parametrize("symmetry", SYMMETRIES)
def test_nodes_move_as_their_means_and_differences_say(make_model, symmetry):
    assembly = Assembly(make_model(symmetry=symmetry))
    unknowns, shell = means(assembly), assembly.model.expansion
    for y in directions(assembly):
        u = assembly.expand(unknowns.expand(y))
        assert np.abs(nodes_of(unknowns, y) - u)[: assembly.model.reference_start].max() < 1e-12
    mean = unknowns.free.reshape(-1, 3)[shell.bottom]
    moved = mean[:, 1] >= 0
    y = np.zeros(assembly.size)
    y[mean[moved, 1]] = 1.0
    u = assembly.expand(unknowns.expand(y))[:, 1]
    for nodes in (shell.bottom, shell.top):
        np.testing.assert_allclose(np.abs(u[nodes][moved]), 1.0)


def test_without_means_nothing_changes(make_model):
    assembly = Assembly(make_model())
    unknowns, y = displacements(assembly), directions(assembly)[0]
    assert unknowns.expand(y) is y
    assert unknowns.reduce(y) is y
    assert unknowns.of_elements(assembly.gradient, assembly.bricks) is assembly.gradient


def tied(patch: Model, kind: str) -> tuple[Model, list[int]]:
    """The patch with constraints at some nodes of its mesh, and those that can have no means."""
    shell = patch.expansion
    inner = [int(n) for n in np.flatnonzero(shell.middle >= 0)[:3]]
    low, mid, high = (x[inner].tolist() for x in (shell.bottom, shell.middle, shell.top))
    if kind == "across nodes":
        return replace(patch, equations=(Equation(((low[0], 2, 2.0), (low[1], 0, 0.5))),)), inner[:2]
    if kind == "across directions":  # as on an inclined plane of symmetry
        slope = np.cos(0.3), np.sin(0.3)
        return replace(
            patch, equations=tuple(Equation(((n, 0, slope[0]), (n, 2, slope[1]))) for n in (low[0], mid[0], high[0]))
        ), [inner[0]]
    if kind == "unequal halves":  # the mean of 3 u_top and u_top
        return replace(patch, equations=(Equation(((low[0], 1, 1.0), (high[0], 1, -3.0))),)), []
    if kind == "held":
        fixed = [(high[0], 0), (low[1], 2), (mid[1], 2), (mid[2], 0), (low[2], 1), (mid[2], 1), (high[2], 1)]
        return replace(patch, fixed=tuple(fixed)), []
    # middle equal to top: m and d are free, c = d
    return replace(patch, equations=(Equation(((mid[0], 2, 1.0), (high[0], 2, -1.0))),)), []


@pytest.mark.parametrize("kind", ["across nodes", "across directions", "unequal halves", "held", "middle"])
def test_any_constraints_have_exact_unknowns(patch, kind):
    model, without = tied(patch, kind)
    assembly = Assembly(model)
    unknowns, u = means(assembly), shaken(model)
    plain, other = Tangent(assembly), Tangent(assembly, unknowns)
    own = np.flatnonzero(unknowns.sign[model.expansion.bottom] == 0)
    assert own.tolist() == without
    assert np.linalg.matrix_rank(unknowns.transform.toarray()) == assembly.size
    for y in directions(assembly):
        assert np.abs(nodes_of(unknowns, y) - assembly.expand(unknowns.expand(y))).max() < 1e-12
        expected = changed(unknowns, stiffness(plain, u, *PRESSURES, SHIFT), y)
        assert relative(stiffness(other, u, *PRESSURES, SHIFT) @ y, expected) < 1e-12
        assert relative(whole(other, other.mass) @ y, changed(unknowns, whole(plain, plain.mass), y)) < 1e-12
