"""Stress and strain of the layer: closed forms, invariances, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from limo.errors import ResultError
from limo.mechanics.constitutive import cauchy, principal, second_piola_kirchhoff, von_mises
from limo.mechanics.kinematics import green_lagrange, lame
from limo.mechanics.layer import HEIGHTS, SURFACES, flat_areas, flat_points, inside_out, layer_state, nodal, surface_points
from limo.mesh.elements import gauss
from tests.helpers.patches import curved_patch, grid, patch_mesh, patch_model

E, NU = 267.0, 0.33
LAM, MU = lame(E, NU)


def split(values):
    """(m, 12, ...) -> (m, 3, 4, ...): bottom, middle, top."""
    return values.reshape(len(values), 3, 4, *values.shape[2:])


def in_one(deformation):
    s = second_piola_kirchhoff(green_lagrange(deformation), LAM, MU)
    return s, cauchy(deformation, s)


@pytest.mark.parametrize("stretch", [0.9, 1.05, 1.3])
def test_uniaxial_stress(stretch):
    """S_11 = E E_11 when the sides are free, sigma_11 = F_11^2 S_11 / J, and von Mises is sigma_11."""
    strain = 0.5 * (stretch**2 - 1)
    side = np.sqrt(1 - 2 * NU * strain)
    s, sigma = in_one(np.diag([stretch, side, side]))
    np.testing.assert_allclose(s, np.diag([E * strain, 0, 0]), atol=1e-12 * E)
    expected = stretch * E * strain / side**2
    np.testing.assert_allclose(sigma, np.diag([expected, 0, 0]), atol=1e-12 * E)
    assert von_mises(sigma) == pytest.approx(abs(expected), rel=1e-12)


@pytest.mark.parametrize("stretch", [0.95, 1.05, 1.2])
def test_equibiaxial_stress(stretch):
    """S = E / (1 - nu) e in the plane, none across; von Mises is the in-plane Cauchy stress."""
    strain = 0.5 * (stretch**2 - 1)
    across = np.sqrt(1 - 4 * NU / (1 - NU) * strain)
    s, sigma = in_one(np.diag([stretch, stretch, across]))
    inplane = E / (1 - NU) * strain
    np.testing.assert_allclose(s, np.diag([inplane, inplane, 0]), atol=1e-12 * E)
    assert sigma[0, 0] == pytest.approx(inplane / across, rel=1e-12)
    assert von_mises(sigma) == pytest.approx(abs(inplane / across), rel=1e-12)


def test_von_mises_of_shear_and_of_pressure():
    shear = np.zeros((3, 3))
    shear[0, 1] = shear[1, 0] = 2.0
    assert von_mises(shear) == pytest.approx(2 * np.sqrt(3))
    assert von_mises(5 * np.eye(3)) == pytest.approx(0, abs=1e-12)
    assert von_mises(shear - 7 * np.eye(3)) == pytest.approx(2 * np.sqrt(3))


def test_principal_values_come_largest_first_with_their_directions():
    turn = Rotation.random(random_state=3).as_matrix()
    values, directions = principal(np.stack([turn @ np.diag([1.0, 3.0, -2.0]) @ turn.T] * 2))
    np.testing.assert_allclose(values[1], [3, 1, -2], atol=1e-12)
    for i, column in enumerate((1, 0, 2)):
        assert abs(directions[1, i] @ turn[:, column]) == pytest.approx(1)


@pytest.fixture
def flat(make_case):
    points, quads = grid(3, 2)
    points = points + 0.05 * np.random.default_rng(1).uniform(-1, 1, points.shape)
    return patch_model(make_case(stiffness_ratio=0.5), patch_mesh(np.column_stack([20 * points, 0 * points[:, 0]]), quads))


def test_homogeneous_deformation_is_exact_at_every_point(flat):
    gradient = np.eye(3) + 0.2 * np.random.default_rng(2).normal(size=(3, 3))
    u = flat.nodes @ (gradient - np.eye(3)).T
    for local in (gauss(2, 3)[0], surface_points()):
        state = layer_state(flat, u, local)
        np.testing.assert_allclose(state.deformation, np.broadcast_to(gradient, state.deformation.shape), atol=1e-11)
        np.testing.assert_allclose(state.cauchy, np.broadcast_to(in_one(gradient)[1], state.cauchy.shape), atol=1e-8)


def test_rigid_motion_strains_nothing_and_turns_stresses(flat):
    rng = np.random.default_rng(4)
    turn = Rotation.random(random_state=4).as_matrix()
    u = 0.02 * rng.normal(size=flat.nodes.shape) * [1, 1, 0.1]
    turned = (flat.nodes + u) @ turn.T + [30.0, -5.0, 2.0] - flat.nodes
    before, after = (layer_state(flat, v, surface_points()) for v in (u, turned))
    np.testing.assert_allclose(after.strain, before.strain, atol=1e-11)
    np.testing.assert_allclose(after.cauchy, turn @ before.cauchy @ turn.T, atol=1e-8)
    np.testing.assert_allclose(after.von_mises, before.von_mises, atol=1e-8)
    rigid = flat.nodes @ turn.T + [1.0, 2.0, 3.0] - flat.nodes
    assert np.abs(layer_state(flat, rigid, gauss(2, 3)[0]).cauchy).max() < 1e-8


def test_endocardium_is_softer_by_the_stiffness_ratio(make_case):
    points, quads = grid(1, 1)
    case = make_case(stiffness_ratio=0.5)
    stresses = []
    for layer in (1, 2):
        model = patch_model(case, patch_mesh(np.column_stack([points, 0 * points[:, 0]]), quads, layer))
        stresses.append(layer_state(model, 0.01 * model.nodes, surface_points()).von_mises.max())
    deviating = [layer_state(model, model.nodes * [0.01, 0, 0], surface_points()).von_mises.max()]
    assert deviating[0] > 0
    assert stresses[0] == pytest.approx(0.5 * stresses[1], abs=1e-9)


def test_bending_is_tension_on_top_and_compression_below(make_case):
    """A flat strip rolled to a radius R without stretching its middle: E_11 = +-t / (2 R) on the surfaces, 0 in the middle."""
    case, radius = make_case(), 20.0
    points, quads = grid(8, 1)
    base = np.column_stack([4 * points[:, 0], points[:, 1], 0 * points[:, 0]])
    model = patch_model(case, patch_mesh(base, quads))
    x, y, z = model.nodes.T
    rolled = np.stack([(radius + z) * np.sin(x / radius), y, (radius + z) * np.cos(x / radius) - radius], axis=1)
    strain = split(layer_state(model, rolled - model.nodes, surface_points()).strain)[..., 0, 0]
    t = case.device.material.thickness
    for k, surface in enumerate(SURFACES):
        stretch = 1 + HEIGHTS[surface] * t / 2 / radius
        np.testing.assert_allclose(strain[:, k], 0.5 * (stretch**2 - 1), atol=2e-5)


@pytest.mark.parametrize("kind", ["cylinder", "sphere"])
def test_inflated_patches_carry_the_stress_of_their_closed_form(make_case, kind):
    errors = []
    for elements in (2, 4):
        model, moved, hoop, other, _ = curved_patch(make_case(), kind, 15.0, 1.04, elements)
        middle = split(layer_state(model, moved, surface_points()).cauchy)[:, 1]
        values = np.linalg.eigvalsh(middle)
        expected = sorted([hoop, other, 0.0])
        errors.append(np.abs(values - expected).max() / hoop)
        mises = np.sqrt(hoop**2 - hoop * other + other**2)
        assert np.abs(von_mises(middle) - mises).max() < 5e-3 * mises
    assert errors[1] < 2e-3
    assert errors[1] < 0.5 * errors[0] or errors[1] < 1e-5


def test_areas_and_points_of_a_distorted_mesh(flat):
    assert flat_areas(flat.mesh).sum() > 0
    corners = flat.mesh.nodes[flat.mesh.quads]
    where = flat_points(flat.mesh)
    assert (where.min(axis=1) > corners.min(axis=1)).all(where=[True, True, False])
    square, quads = grid(4, 3)
    mesh = patch_mesh(np.column_stack([square * [3, 5], 0 * square[:, 0]]), quads)
    assert flat_areas(mesh).sum() == pytest.approx(60)


def test_values_carried_to_nodes_are_exact_for_a_linear_field_and_keep_layers_apart(device_mesh):
    mesh = device_mesh()
    linear = flat_points(mesh)[..., 0] * 2 + flat_points(mesh)[..., 1] + 100 * mesh.layer[:, None]
    values, node, quads = nodal(mesh, linear)
    layer = np.zeros(len(values), int)
    layer[quads.ravel()] = np.repeat(mesh.layer, 8)
    expected = 2 * mesh.nodes[node, 0] + mesh.nodes[node, 1] + 100 * layer
    assert np.abs(values - expected).max() < 1.0  # straight where the mapping of the quadrilaterals is
    assert np.median(np.abs(values - expected)) < 0.05
    assert len(values) > len(mesh.nodes)


def test_the_inner_surface_is_below_on_the_front_and_above_on_the_back(device_mesh):
    mesh = device_mesh("limo", 8, "full")
    heights = np.broadcast_to(surface_points()[:, 2], (len(mesh.quads), 12))
    ordered = inside_out(mesh, heights)
    assert (ordered[mesh.face == 0] == np.array([-1.0, 0.0, 1.0])[:, None]).all()
    assert (ordered[mesh.face == 1] == np.array([1.0, 0.0, -1.0])[:, None]).all()


@pytest.mark.parametrize(
    ("damage", "says"),
    [
        (lambda u, b: u.__setitem__((b[4, 0], 1), np.nan), ("no numbers", "element 1 ")),
        (lambda u, b: u.__setitem__((b[2, 4:8], 2), -0.3), ("inside out", "det F")),
    ],
)
def test_damaged_displacements_are_one_error_with_file_and_element(flat, damage, says):
    u = np.zeros_like(flat.nodes)
    damage(u, flat.expansion.bricks)
    with pytest.raises(ResultError) as caught:
        layer_state(flat, u, surface_points(), "results/cases/x/frames.nc, frame 3")
    for word in ("frames.nc, frame 3", *says):
        assert word in str(caught.value)


def test_a_frame_of_another_mesh_is_refused(flat):
    with pytest.raises(ResultError, match="the mesh has"):
        layer_state(flat, np.zeros((5, 3)), surface_points(), "frames.nc")
