"""What contact adds to a tangent, on layers and on unknowns."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp

from limo.engines.newton.contact import CompiledTouching, tangent_of
from limo.engines.newton.iteration import _discrete
from limo.mechanics.contact import Touching, contact_of

PENALTY, REACH, SPAN = 2.0, 0.02, 1.0  # MPa / mm, mm, mm
VENTRICULAR, ACTUATION = 13.8, 40.0


def touched(model):
    """A model whose layers touch, front and back too."""
    contact = contact_of(model.mesh, front_back=True, endo_epi=True, penalty=PENALTY, reach=REACH, span=SPAN)
    return replace(model, contact=contact)


def pressed(nodes: np.ndarray, size: float = 0.3, seed: int = 1) -> np.ndarray:
    """Places (n, 3) of layers that were bent, stretched and pushed through each other here and there."""
    x, y, z = nodes.T
    bent = np.column_stack([1.02 * x, 0.99 * y, z + 3 * np.sin(x / 20) * np.cos(y / 30)])
    return bent + size * np.random.default_rng(seed).normal(size=bent.shape)


@pytest.mark.parametrize("symmetry", ["quarter", "full"])
def test_the_tangent_is_the_slope_of_the_forces(device_mesh, symmetry):
    mesh = device_mesh(symmetry=symmetry)
    contact = contact_of(mesh, front_back=True, endo_epi=True, penalty=PENALTY, reach=REACH, span=SPAN)
    touching = Touching(contact, mesh.nodes)
    x = pressed(mesh.nodes)
    plane, pairs = tangent_of(touching, x)
    first, second = np.array([0, 1, 2, 0, 0, 1]), np.array([0, 1, 2, 1, 2, 2])
    whole = np.zeros((len(pairs), 16, 3, 16, 3))
    for part, (i, j) in enumerate(zip(first, second, strict=True)):
        whole[:, :, i, :, j] = pairs[:, :, part]
        whole[:, :, j, :, i] = pairs[:, :, part].transpose(0, 2, 1)
    nodes = np.hstack([contact.lower, contact.upper])
    for direction in np.random.default_rng(4).normal(size=(3, *x.shape)):
        found = np.zeros(x.shape)
        np.add.at(found, nodes, np.einsum("mnipj,mpj->mni", whole, direction[nodes]))
        np.add.at(found[:, 2], contact.plane, np.einsum("mnp,mp->mn", plane, direction[contact.plane, 2]))
        step = 1e-7
        expected = (touching.forces(x + step * direction) - touching.forces(x - step * direction)) / (2 * step)
        assert np.linalg.norm(found - expected) < 1e-6 * np.linalg.norm(expected)


@pytest.mark.parametrize("single", [False, True], ids=["displacements", "means"])
@pytest.mark.parametrize("element", ["C3D20R", "SHELL8R"])
@pytest.mark.parametrize("symmetry", ["quarter", "full"])
def test_what_contact_adds_to_a_tangent_is_the_slope_of_what_it_adds_to_forces(make_model, element, symmetry, single):
    """Layers share the nodes of seams, and an entry that a node brings twice onto the diagonal counts twice."""
    model = make_model(element, symmetry)
    plain, both = (_discrete(each, single) for each in (model, touched(model)))
    assembly, unknowns, _ = both
    rng = np.random.default_rng(3)
    free = assembly.retracted(0.05 * unknowns.expand(rng.normal(size=unknowns.size)))
    u = assembly.expand(free) + assembly.prescribed

    def matrix(parts) -> sp.csr_array:
        upper = sp.csr_array((parts[2].assemble(u, VENTRICULAR, ACTUATION), parts[2].indices, parts[2].indptr))
        return upper + upper.T - sp.diags_array(upper.diagonal())

    added = matrix(both) - matrix(plain)
    assert added.nnz
    for _ in range(2):
        y = rng.normal(size=unknowns.size)
        step = 1e-6 * unknowns.expand(y)
        ends = [assembly.contact_forces(assembly.expand(free + sign * step) + assembly.prescribed) for sign in (1, -1)]
        ends = [unknowns.reduce(assembly.reduce(forces, u)) for forces in ends]
        expected = (ends[0] - ends[1]) / 2e-6
        assert np.linalg.norm(added @ y - expected) < 1e-5 * np.linalg.norm(expected)


@pytest.mark.parametrize("symmetry", ["quarter", "full"])
def test_compiled_loops_give_the_forces_and_say_what_is_near(device_mesh, symmetry):
    mesh = device_mesh(symmetry=symmetry)
    contact = contact_of(mesh, front_back=True, endo_epi=True, penalty=PENALTY, reach=REACH, span=SPAN)
    plain, compiled = Touching(contact, mesh.nodes), CompiledTouching(contact, mesh.nodes)
    x = pressed(mesh.nodes)
    x[:, 2] += np.where(np.isin(np.arange(len(x)), contact.upper) & (mesh.nodes[:, 1] > mesh.nodes[:, 1].mean()), 0.7 * SPAN, 0.0)
    expected = plain.forces(x)
    assert np.abs(compiled.forces(x) - expected).max() < 1e-12 * np.abs(expected).max()
    for beyond in (0.0, REACH, SPAN):
        near = plain.near(x, beyond)
        assert near.any()
        np.testing.assert_array_equal(compiled.near(x, beyond), near)
    assert plain.near(x).sum() < plain.near(x, SPAN).sum() <= len(near)


@pytest.mark.parametrize("single", [False, True], ids=["displacements", "means"])
@pytest.mark.parametrize("element", ["C3D20R", "SHELL8R"])
def test_a_pattern_of_those_that_touch_is_the_same_matrix(make_model, element, single):
    """Layers of one pouch are pulled apart: without their entries the tangent is what it was, with fewer of them."""
    model = touched(make_model(element, "quarter"))
    assembly, _, tangent = _discrete(model, single)
    contact, mesh = assembly.touching.contact, model.mesh
    u = assembly.expand(np.zeros(assembly.size))
    apart = np.isin(np.arange(len(mesh.nodes)), contact.upper) & ~np.isin(np.arange(len(mesh.nodes)), contact.lower)
    apart &= mesh.nodes[:, 0] < np.median(mesh.nodes[contact.upper.ravel(), 0])
    shell = model.expansion
    for nodes in (shell.bottom, shell.top, np.where(shell.middle >= 0, shell.middle, shell.bottom)):
        u[nodes[apart], 2] += 3.0
    near = assembly.touching.near(model.middle(u))
    assert 0 < near.sum() < len(near)

    def matrix() -> sp.csr_array:
        values = tangent.assemble(u, VENTRICULAR, ACTUATION, 1e5)
        return sp.csr_array((values, tangent.indices, tangent.indptr), shape=2 * (tangent.size,))

    whole, entries, mass = matrix(), len(tangent.indices), tangent.mass.sum()
    tangent.touch(near)
    assert len(tangent.indices) < entries
    assert np.abs(matrix() - whole).max() <= 1e-14 * np.abs(whole).max()
    assert tangent.mass.sum() == pytest.approx(mass, rel=1e-14)
    tangent.touch()
    assert (tangent.indptr[-1], len(tangent.indices)) == (entries, entries)
    assert np.abs(matrix() - whole).max() == 0.0
