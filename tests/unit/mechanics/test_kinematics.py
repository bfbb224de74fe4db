"""Deformation, strain and energy of bricks, and the energy balance of a ramp."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from limo.mechanics.build import build_model
from limo.mechanics.energy import conjugate_volumes, ramp_balance, stored_energy
from limo.mechanics.kinematics import deformation_gradient, energy_and_extremes, energy_density, green_lagrange, lame
from limo.mechanics.volumes import volumes
from limo.mesh.elements import HEX20, gauss
from limo.schema.numerics import Mesh

POINTS = gauss(3, 3)[0]
MODULUS, POISSON = 267.0, 0.33


def strain_energy(*arguments) -> float:
    return energy_and_extremes(*arguments)[0]


@pytest.fixture(scope="module")
def bricks():
    """Three distorted bricks with curved edges: nodes (60, 3) and their numbers (3, 20)."""
    rng = np.random.default_rng(7)
    nodes = np.vstack([HEX20 * [3, 2, 0.5] + [10 * k, 0, 0] + 0.12 * rng.uniform(-1, 1, HEX20.shape) for k in range(3)])
    return nodes, np.arange(60).reshape(3, 20)


def volume(bricks):
    nodes, numbers = bricks
    local, weights = gauss(4, 3)
    return float((deformation_gradient(nodes, numbers, np.zeros_like(nodes), local)[1] @ weights).sum())


def energy(bricks, u, points=2):
    return strain_energy(*bricks, u, np.full(3, MODULUS), POISSON, points)


# --------------------------------------------------------------------------------------------------------------------
# kinematics


def test_homogeneous_deformation_is_exact_at_every_point_of_distorted_bricks(bricks):
    nodes, numbers = bricks
    gradient = np.eye(3) + 0.3 * np.random.default_rng(8).normal(size=(3, 3))
    u = nodes @ (gradient - np.eye(3)).T + np.array([5.0, -1.0, 2.0])
    deformation, jacobian = deformation_gradient(nodes, numbers, u, POINTS)
    np.testing.assert_allclose(deformation, np.broadcast_to(gradient, deformation.shape), atol=1e-12)
    expected = 0.5 * (gradient.T @ gradient - np.eye(3))
    np.testing.assert_allclose(green_lagrange(deformation), np.broadcast_to(expected, deformation.shape), atol=1e-12)
    assert jacobian.min() > 0


def test_quadratic_field_is_exact_on_a_straight_brick():
    """u = (x^2, x y, y z): du/dX in closed form."""
    nodes = HEX20 * [2.0, 1.0, 0.5]
    x, y, z = nodes.T
    deformation, _ = deformation_gradient(nodes, np.arange(20)[None], np.stack([x**2, x * y, y * z], axis=1), POINTS)
    x, y, z = (POINTS * [2.0, 1.0, 0.5]).T
    o = np.zeros_like(x)
    expected = np.eye(3) + np.moveaxis(np.array([[2 * x, o, o], [y, x, o], [o, z, y]]), -1, 0)
    np.testing.assert_allclose(deformation[0], expected, atol=1e-12)


def test_jacobian_integrates_to_the_volume_of_a_sheared_brick():
    shear = np.array([[2.0, 0.5, 0.1], [0.0, 1.5, 0.3], [0.0, 0.2, 0.25]])
    assert volume((HEX20 @ shear.T, np.arange(20)[None])) == pytest.approx(8 * np.linalg.det(shear))


# --------------------------------------------------------------------------------------------------------------------
# energy


def test_lame_constants_are_those_of_the_paper():
    assert lame(0.267, 0.33) == pytest.approx((0.195, 0.101), abs=1e-3)


@pytest.mark.parametrize("stretch", [0.9, 1.1, 1.5])
def test_uniaxial_strain_stores_its_closed_form(stretch):
    """F = diag(s, 1, 1): psi = (lambda / 2 + mu) E^2 with E = (s^2 - 1) / 2, times the volume."""
    brick = (HEX20 * [2.0, 1.0, 0.5] @ Rotation.random(random_state=9).as_matrix().T, np.arange(20)[None])
    axis = Rotation.random(random_state=9).as_matrix()[:, 0]
    u = np.outer(brick[0] @ axis, (stretch - 1) * axis)
    lam, mu = lame(MODULUS, POISSON)
    expected = (lam / 2 + mu) * ((stretch**2 - 1) / 2) ** 2 * 8.0
    assert strain_energy(*brick, u, np.array([MODULUS]), POISSON) == pytest.approx(expected, rel=1e-12)


def test_simple_shear_stores_its_closed_form():
    """F = 1 + g e1 e2: E12 = g / 2, E22 = g^2 / 2."""
    g = 0.2
    deformation = np.eye(3)
    deformation[0, 1] = g
    lam, mu = lame(MODULUS, POISSON)
    expected = lam / 2 * (g**2 / 2) ** 2 + mu * (2 * (g / 2) ** 2 + (g**2 / 2) ** 2)
    assert energy_density(green_lagrange(deformation), lam, mu) == pytest.approx(expected)


def test_rigid_motion_stores_nothing(bricks):
    nodes, _ = bricks
    turned = Rotation.from_rotvec([0.7, -1.9, 0.4]).apply(nodes) + np.array([3.0, 2.0, 1.0])
    assert energy(bricks, turned - nodes) < 1e-20 * MODULUS * volume(bricks)


@pytest.mark.parametrize("points", [2, 3])
def test_energy_does_not_change_when_the_deformed_body_is_turned(bricks, points):
    nodes, _ = bricks
    u = 0.05 * np.random.default_rng(10).normal(size=nodes.shape)
    turned = Rotation.random(random_state=11).apply(nodes + u) - nodes
    assert energy(bricks, turned, points) == pytest.approx(energy(bricks, u, points), rel=1e-10)
    assert energy(bricks, u, points) > 0


def test_energy_is_the_sum_over_bricks_of_their_own_moduli(bricks):
    nodes, numbers = bricks
    u = 0.05 * np.random.default_rng(12).normal(size=nodes.shape)
    moduli = np.array([100.0, 200.0, 400.0])
    one_by_one = [strain_energy(nodes, numbers[k : k + 1], u, moduli[k : k + 1], POISSON) for k in range(3)]
    assert strain_energy(nodes, numbers, u, moduli, POISSON) == pytest.approx(sum(one_by_one))
    assert strain_energy(nodes, numbers[:1], u, np.array([2.0]), POISSON) == pytest.approx(one_by_one[0] * 2.0 / 100.0)


@pytest.mark.parametrize("symmetry", ["full", "quarter"])
def test_stored_energy_weighs_the_endocardium_by_its_stiffness_ratio(device_mesh, make_case, quad_areas, symmetry):
    """A uniform stretch of the whole device: psi times thickness times (fabric area + E_hat endocardial area)."""
    mesh = device_mesh("limo", 8, symmetry)
    model = build_model(make_case(mesh=Mesh(symmetry=symmetry), stiffness_ratio=0.25), mesh)
    u = model.nodes * [0.02, -0.01, 0.0]
    strain = green_lagrange(np.diag([1.02, 0.99, 1.0]))
    areas = quad_areas(mesh.nodes, mesh.quads)
    weighted = areas[mesh.layer != 1].sum() + 0.25 * areas[mesh.layer == 1].sum()
    expected = energy_density(strain, *lame(MODULUS, POISSON)) * 0.19 * weighted * mesh.copies
    assert stored_energy(model, u) == pytest.approx(expected, rel=1e-9)


# --------------------------------------------------------------------------------------------------------------------
# the balance of a ramp


def ramp(increments=200, loss=0.0):
    """Pouches that fill like V_a = c P_a (1 + loss) while a spring stores P_a^2 c / 2; the ventricle gives work back."""
    pressure = np.linspace(0.0, 60.0, increments + 1)  # kPa
    compliance, lever, ventricular = 2.0e3, -1.4, 3.8  # mm^3 / kPa
    actuation = compliance * pressure * (1 + loss)
    ventricle = 4e5 + lever * actuation
    stored = (compliance * 60.0**2 / 2 + ventricular * lever * actuation[-1]) * 1e-3
    return pressure, ventricular, np.stack([ventricle, actuation], axis=1), stored


def test_lossless_ramp_closes_exactly():
    balance = ramp_balance(*ramp())
    assert balance.actuation_work == pytest.approx(2.0e3 * 60**2 / 2 * 1e-3)
    assert balance.ventricular_work == pytest.approx(-3.8 * 1.4 * 2.0e3 * 60 * 1e-3)
    assert balance.dissipated == pytest.approx(0.0, abs=1e-9)


def test_lost_work_is_dissipated():
    balance = ramp_balance(*ramp(loss=0.1))
    assert balance.dissipated == pytest.approx(0.1 * 2.0e3 * 60**2 / 2 * 1e-3)
    assert balance.dissipated_fraction == pytest.approx(0.1 / 1.1)


def test_work_does_not_depend_on_the_reference_of_the_volumes():
    pressure, ventricular, conjugate, stored = ramp(loss=0.3)
    shifted = ramp_balance(pressure, ventricular, np.add(conjugate, [1e6, -1e6]), stored)
    assert shifted.dissipated == pytest.approx(ramp_balance(pressure, ventricular, conjugate, stored).dissipated)


def test_ramp_without_work_has_no_fraction():
    pressure, ventricular, conjugate, _ = ramp()
    assert np.isnan(ramp_balance(pressure * 0, ventricular, conjugate, 0.0).dissipated_fraction)


def test_conjugate_volumes_approach_those_of_the_middle_surface_with_the_thickness(device_mesh, make_case):
    """They differ by half a thickness times a change of area: first order in the thickness."""
    mesh = device_mesh("limo", 8, "quarter")
    differences = []
    for thickness in (0.4, 0.2, 0.1):
        case = make_case()
        material = case.device.material.model_copy(update={"thickness": thickness})
        model = build_model(make_case(device=case.device.model_copy(update={"material": material})), mesh)
        middle = mesh.nodes / [60, 140, 1]
        curvature = 20 * (1 - middle[:, 0] ** 2)
        epi = np.zeros(len(mesh.nodes))
        epi[np.setdiff1d(mesh.quads[mesh.layer == 2], mesh.quads[mesh.layer == 1])] = 5.0
        lift = np.zeros(len(model.nodes))
        for nodes in (model.expansion.bottom, model.expansion.top):
            lift[nodes] = curvature + epi
        u = np.column_stack([0.1 * model.nodes[:, 0], 0 * lift, lift])
        surface = mesh.nodes + model.expansion.midsurface(u)
        differences.append(np.subtract(conjugate_volumes(model, u), volumes(mesh, surface)))
    ventricle, actuation = np.abs(differences).T
    np.testing.assert_allclose(np.log2(ventricle[:-1] / ventricle[1:]), 1.0, atol=0.02)
    assert actuation.max() < ventricle.min(), "both layers of a pouch are loaded on the same side"
