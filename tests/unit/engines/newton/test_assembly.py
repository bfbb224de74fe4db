"""Forces, tangent, mass and constraints of the assembled layer, against an independent assembly and finite differences."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from limo.engines.newton.assembly import Assembly
from limo.engines.newton.tangent import Tangent
from limo.mechanics.energy import stored_energy
from limo.mechanics.equilibrium import internal_forces, mass_forces, pressure_forces
from limo.mechanics.model import Equation, Model
from tests.helpers.cases import shaken
from tests.helpers.matrices import deformed, directions, stiffness, whole

ACTUATION = 20.0  # kPa
ELEMENTS = ("C3D20R", "C3D20")
FABRICS = ("isotropic", "woven")
SYMMETRIES = ("quarter", "front_back", "full")
STEP = 1e-3  # mm; the layer is 0.19 mm thick


def slope(function, u: np.ndarray, direction: np.ndarray):
    """Slope of ``function`` at displacements u along a direction (n, 3): five points, exact for forces and for energies.

    St. Venant-Kirchhoff forces are cubic in the displacements, so that only rounding remains.
    """
    near, far = (function(u + k * STEP * direction) - function(u - k * STEP * direction) for k in (1, 2))
    return (8 * near - far) / (12 * STEP)


# --- forces ---------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("fabric", FABRICS)
@pytest.mark.parametrize("symmetry", SYMMETRIES)
@pytest.mark.parametrize("element", ELEMENTS)
def test_forces_are_those_of_the_equilibrium_check(make_model, element, symmetry, fabric):
    model = make_model(element, symmetry, fabric)
    assembly = Assembly(model)
    u = deformed(assembly)
    expected = internal_forces(model, u), pressure_forces(model, u, ACTUATION)
    for forces, reference in zip(assembly.forces(u, model.loading.ventricular_pressure, ACTUATION), expected, strict=True):
        assert np.abs(forces - reference).max() < 1e-12 * np.abs(reference).max()


def test_what_is_kept_of_one_state_is_not_taken_for_another(make_model):
    model = make_model()
    assembly = Assembly(model)
    states = [share * deformed(assembly) for share in (1.0, 0.5)]
    expected = [internal_forces(model, u) for u in states]
    for k in (0, 1, 1, 0):
        assembly.smallest_volume(states[1 - k])
        inside, _ = assembly.forces(states[k], 0.0, 0.0)
        assert np.abs(inside - expected[k]).max() < 1e-12 * np.abs(expected[k]).max()


def test_a_model_without_pressures_has_none(patch):
    bare = Model(**{**patch.__dict__, "pressures": ()})
    u = shaken(bare)
    inside, pressed = Assembly(bare).forces(u, 3.8, ACTUATION)
    assert not pressed.any()
    assert np.abs(inside - internal_forces(bare, u)).max() < 1e-12 * np.abs(inside).max()
    values = [Tangent(Assembly(model)).assemble(u, *p) for model, p in ((bare, (3.8, ACTUATION)), (patch, (0.0, 0.0)))]
    assert np.array_equal(*values)


@pytest.mark.parametrize("fabric", FABRICS)
@pytest.mark.parametrize("element", ELEMENTS)
def test_internal_forces_are_the_slope_of_the_strain_energy(make_model, element, fabric):
    model = make_model(element, fabric=fabric)
    assembly = Assembly(model)
    u = deformed(assembly)
    inside, _ = assembly.forces(u, 0.0, 0.0)
    for free in directions(assembly):
        direction = assembly.expand(free)
        assert (inside * direction).sum() == pytest.approx(
            slope(lambda v: stored_energy(model, v) / model.mesh.copies, u, direction), rel=1e-6
        )


# --- tangent --------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("fabric", FABRICS)
@pytest.mark.parametrize("symmetry", SYMMETRIES)
@pytest.mark.parametrize("element", ELEMENTS)
def test_the_tangent_of_the_fabric_is_the_slope_of_its_forces(make_model, element, symmetry, fabric):
    """On the free displacements: with everything that *EQUATIONs hand over."""
    assembly = Assembly(make_model(element, symmetry, fabric))
    u = deformed(assembly)
    matrix = stiffness(Tangent(assembly), u)
    for free in directions(assembly):
        expected = assembly.reduce(slope(lambda v: assembly.forces(v, 0.0, 0.0)[0], u, assembly.expand(free)))
        assert np.linalg.norm(matrix @ free - expected) < 1e-7 * np.linalg.norm(expected)


@pytest.mark.parametrize("element", ELEMENTS)
def test_the_tangent_of_the_pressures_is_the_symmetric_part_of_the_slope_of_their_forces(make_model, element):
    """x . K y = (x . F'(y) + y . F'(x)) / 2, whatever x and y."""
    model = make_model(element)
    assembly, p_v = Assembly(model), model.loading.ventricular_pressure
    u = deformed(assembly)
    tangent = Tangent(assembly)
    matrix = stiffness(tangent, u, p_v, ACTUATION) - stiffness(tangent, u)
    free = directions(assembly)
    slopes = [assembly.reduce(slope(lambda v: -assembly.forces(v, p_v, ACTUATION)[1], u, assembly.expand(q))) for q in free]
    scale = np.linalg.norm(slopes[0]) * np.linalg.norm(free[0]) / np.sqrt(assembly.size)
    for i, j in ((0, 0), (0, 1), (1, 2)):
        expected = 0.5 * (free[i] @ slopes[j] + free[j] @ slopes[i])
        assert abs(free[i] @ (matrix @ free[j]) - expected) < 1e-7 * scale


@pytest.mark.parametrize(("element", "inner"), [("C3D20", 1e-7), ("C3D20R", 0.3)])
def test_what_the_pressures_lack_of_symmetry_comes_from_single_edges(make_model, element, inner):
    """Where no edge of the model moves, the tangent is the slope itself: exactly with 3 x 3 points, nearly with 2 x 2."""
    model = make_model(element)
    assembly, p_v = Assembly(model), model.loading.ventricular_pressure
    u = deformed(assembly)
    tangent = Tangent(assembly)
    matrix = stiffness(tangent, u, p_v, ACTUATION) - stiffness(tangent, u)
    mesh, shell = model.mesh, model.expansion
    edge = np.zeros(len(model.nodes), bool)
    for numbers in (shell.bottom, shell.top):
        edge[numbers[mesh.on_valve | mesh.on_outer | mesh.on_axis]] = True
    errors = []
    for still in (True, False):
        direction = assembly.expand(directions(assembly)[0])
        direction[edge & still] = 0.0
        free = assembly.gather_free(direction + assembly.prescribed)
        expected = assembly.reduce(slope(lambda v: -assembly.forces(v, p_v, ACTUATION)[1], u, assembly.expand(free)))
        errors.append(np.linalg.norm(matrix @ free - expected) / np.linalg.norm(expected))
    assert errors[0] < inner
    assert errors[1] > errors[0]
    assert errors[1] > 1e-3


def test_the_pattern_is_an_upper_triangle_with_its_diagonal(make_model):
    tangent = Tangent(Assembly(make_model()))
    rows = np.repeat(np.arange(tangent.size), np.diff(tangent.indptr))
    assert (rows <= tangent.indices).all()
    assert np.array_equal(tangent.indices[tangent.indptr[:-1]], np.arange(tangent.size))
    same_row = np.diff(rows) == 0
    assert (np.diff(tangent.indices)[same_row] > 0).all()


@pytest.mark.parametrize("fabric", FABRICS)
def test_what_moving_edges_drag_along_is_the_slope_of_the_internal_forces(make_model, fabric):
    model = make_model(fabric=fabric)
    assembly = Assembly(model)
    u = deformed(assembly)
    moved = 0.1 * assembly.prescribed
    dragged = assembly.drag(u, moved)
    expected = slope(lambda v: assembly.forces(v, 0.0, 0.0)[0], u, moved)
    assert np.linalg.norm(dragged - expected) < 1e-7 * np.linalg.norm(expected)


@pytest.mark.parametrize("fabric", FABRICS)
def test_mass_is_that_of_the_equilibrium_check(make_model, fabric):
    model = make_model(fabric=fabric)
    assembly = Assembly(model)
    tangent = Tangent(assembly)
    matrix = whole(tangent, tangent.mass)
    for free in directions(assembly):
        expected = assembly.reduce(mass_forces(model, assembly.expand(free)))
        assert np.abs(matrix @ free - expected).max() < 1e-12 * np.abs(expected).max()
    assert np.linalg.eigvalsh(matrix.toarray()[:200, :200]).min() > 0


# --- constraints ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("symmetry", SYMMETRIES)
def test_displacements_meet_every_constraint(make_model, symmetry):
    model = make_model(symmetry=symmetry)
    assembly = Assembly(model)
    free = directions(assembly)[0]
    u = assembly.expand(free) + assembly.prescribed
    for (n, d), value in model.prescribed.items():
        assert u[n, d] == value
    for n, d in model.fixed:
        assert u[n, d] == 0
    for equation in model.equations:
        assert abs(sum(c * u[n, d] for n, d, c in equation.terms)) < 1e-12
    np.testing.assert_allclose(assembly.gather_free(u), free, rtol=0, atol=1e-12)


def test_equations_may_have_any_factors(patch):
    """As those of an inclined plane of symmetry."""
    a, b = (int(n) for n in patch.expansion.bottom[:2])
    model = Model(**{**patch.__dict__, "equations": (Equation(((b, 2, 2.0), (a, 0, 0.5))),)})
    assembly = Assembly(model)
    free = directions(assembly)[0]
    u = assembly.expand(free)
    assert 2.0 * u[b, 2] + 0.5 * u[a, 0] == pytest.approx(0, abs=1e-12)
    np.testing.assert_allclose(assembly.gather_free(u), free, rtol=0, atol=1e-12)
    matrix = stiffness(Tangent(assembly), 0.01 * u)
    expected = assembly.reduce(slope(lambda v: assembly.forces(v, 0.0, 0.0)[0], 0.01 * u, u))
    assert np.linalg.norm(matrix @ free - expected) < 1e-7 * np.linalg.norm(expected)


def test_forces_and_displacements_are_reduced_alike(make_model):
    """Virtual work: T^T f . q = f . T q."""
    assembly = Assembly(make_model())
    free = directions(assembly)[0]
    forces = np.random.default_rng(12).normal(size=assembly.model.nodes.shape)
    assert assembly.reduce(forces) @ free == pytest.approx((forces * assembly.expand(free)).sum())


# --- rigid motion and turned elements -------------------------------------------------------------------------------------


def turned(model: Model, u: np.ndarray, rotation: np.ndarray, offset=(10.0, -20.0, 5.0)) -> np.ndarray:
    return (model.nodes + u) @ rotation.T + offset - model.nodes


def test_a_rigid_motion_needs_no_forces_and_neither_do_small_ones_from_there(patch):
    assembly, rotation = Assembly(patch), Rotation.random(random_state=3).as_matrix()
    u = turned(patch, np.zeros_like(patch.nodes), rotation)
    inside, _ = assembly.forces(u, 0.0, 0.0)
    modulus = patch.fabric.youngs_modulus * patch.fabric.thickness  # N for a strain of one over 1 mm
    assert np.abs(inside).max() < 1e-10 * modulus
    assert stored_energy(patch, u) < 1e-20 * modulus
    matrix = stiffness(Tangent(assembly), u)
    for axis in np.eye(3):
        for motion in (np.tile(axis, (len(u), 1)), np.cross(axis, patch.nodes + u)):
            forces = matrix @ assembly.gather_free(motion)
            assert np.abs(forces).max() < 1e-9 * abs(matrix).max() * np.abs(motion).max()
    assert (np.linalg.eigvalsh(matrix.toarray()) > 1e-9 * abs(matrix).max()).sum() >= assembly.size - 6 - 6 * len(
        patch.mesh.quads
    )


def test_forces_and_tangent_turn_with_the_layer(patch):
    assembly, rotation = Assembly(patch), Rotation.random(random_state=4).as_matrix()
    u = shaken(patch)
    there = turned(patch, u, rotation)
    for f, g in zip(assembly.forces(u, 3.8, ACTUATION), assembly.forces(there, 3.8, ACTUATION), strict=True):
        assert np.abs(g - f @ rotation.T).max() < 1e-9 * np.abs(f).max()
    here, then = (stiffness(Tangent(assembly), v, 3.8, ACTUATION) for v in (u, there))
    for free in directions(assembly):
        motion = assembly.expand(free)
        expected = (assembly.expand(here @ free) @ rotation.T)[assembly.model.expansion.bottom]
        found = assembly.expand(then @ assembly.gather_free(motion @ rotation.T))[assembly.model.expansion.bottom]
        assert np.abs(found - expected).max() < 1e-8 * np.abs(expected).max()


def test_the_smallest_volume_tells_elements_turned_inside_out(patch):
    assembly = Assembly(patch)
    assert assembly.smallest_volume(np.zeros_like(patch.nodes)) == pytest.approx(1.0)
    assert assembly.smallest_volume(patch.nodes * (0.1, 0.0, 0.0)) == pytest.approx(1.1)
    # mirrored through its middle: no strain across, and yet impossible
    assert assembly.smallest_volume(patch.nodes * (0.1, 0.0, -2.0)) == pytest.approx(-1.1)
