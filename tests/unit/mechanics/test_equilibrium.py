"""Internal forces, pressure forces and what remains of them: closed forms and invariances."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from limo.mechanics.build import build_model
from limo.mechanics.energy import stored_energy
from limo.mechanics.equilibrium import internal_forces, mass_forces, pressure_forces, residual, rounding_noise, through_thickness
from limo.mechanics.model import reduction
from limo.schema.numerics import Mesh
from tests.helpers.cases import shaken
from tests.helpers.patches import curved_patch, grid, patch_mesh, patch_model


@pytest.fixture
def device(make_case, device_mesh):
    return build_model(make_case(), device_mesh())


def test_internal_forces_are_the_slope_of_the_stored_energy(device):
    """f_int . d = d/ds W(u + s d) for any direction d (per model, W is of the full device)."""
    u, step = shaken(device), 1e-6
    direction = np.random.default_rng(2).normal(size=u.shape)
    direction[device.reference_start :] = 0
    slope = (stored_energy(device, u + step * direction) - stored_energy(device, u - step * direction)) / (2 * step)
    force = (internal_forces(device, u) * direction).sum() * device.mesh.copies
    assert force == pytest.approx(slope, rel=1e-6)


@pytest.mark.parametrize(("element", "error"), [("C3D20", 1e-6), ("C3D20R", 1e-2)])
def test_pressure_forces_are_the_slope_of_pressure_times_volume(make_case, device_mesh, element, error):
    """On a mesh whose loaded faces all close over planes through the origin the follower load has a potential.

    The 2 x 2 points of C3D20R do not integrate it exactly.
    """
    from limo.mechanics.energy import conjugate_volumes

    device = build_model(make_case(mesh=Mesh(level="preview", symmetry="quarter", element=element)), device_mesh())
    u = shaken(device, 0.0)
    # a direction that keeps the edges where they are: then no boundary term remains
    rng, fixed = np.random.default_rng(3), np.zeros(len(device.nodes), bool)
    mesh, shell = device.mesh, device.expansion
    edge = mesh.on_valve | mesh.on_outer | mesh.on_axis | (np.abs(mesh.nodes[:, 0]) < 1e-9)
    for numbers in (shell.bottom, shell.top):
        fixed[numbers[edge]] = True
    direction = rng.normal(size=u.shape) * ~fixed[:, None]
    direction[device.reference_start :] = 0
    step, p_a = 1e-4, 20.0
    ahead, behind = (np.array(conjugate_volumes(device, u + s * step * direction)) for s in (1, -1))
    work = (ahead - behind) / (2 * step) @ [device.loading.ventricular_pressure, p_a] * 1e-3
    force = (pressure_forces(device, u, p_a) * direction).sum() * mesh.copies
    assert force == pytest.approx(work, rel=error)


def test_forces_turn_with_the_device_and_do_not_mind_where_it_is(device):
    u = shaken(device)
    turn = Rotation.random(random_state=5).as_matrix()
    turned = (device.nodes + u) @ turn.T + [10.0, 20.0, -5.0] - device.nodes
    for forces in (internal_forces, lambda m, v: pressure_forces(m, v, 30.0)):
        np.testing.assert_allclose(forces(device, turned), forces(device, u) @ turn.T, atol=1e-8)


def test_internal_forces_balance_themselves(device):
    u = shaken(device)
    force = internal_forces(device, u)
    x = device.nodes + u
    scale = np.abs(force).sum()
    assert np.abs(force.sum(axis=0)).max() < 1e-12 * scale
    assert np.abs(np.cross(x, force).sum(axis=0)).max() < 1e-10 * scale * np.abs(x).max()


def test_mass_of_the_fabric(make_case):
    """Forces of a unit acceleration add up to the mass: areal density times area (tonne)."""
    points, quads = grid(3, 2)
    model = patch_model(make_case(), patch_mesh(np.column_stack([10 * points, 0 * points[:, 0]]), quads))
    force = mass_forces(model, np.ones_like(model.nodes))
    assert force.sum(axis=0) == pytest.approx(np.full(3, 170e-12 * 400.0))


@pytest.mark.parametrize("kind", ["cylinder", "sphere"])
def test_pressurised_patches_are_in_equilibrium(make_case, kind):
    """p = sigma t / r (twice that for a sphere): what remains at inner nodes vanishes with the element and t / r."""
    remains = []
    for elements in (3, 6):
        model, moved, _, _, pressure = curved_patch(make_case(), kind, 40.0, 1.03, elements, angle=0.4)
        inside = through_thickness(model, internal_forces(model, moved))
        loaded = through_thickness(model, pressure_forces(model, moved, pressure))
        flat, _ = grid(elements, elements)
        inner = (np.abs(flat) < 1 - 1e-9).all(axis=1)
        remains.append(np.linalg.norm((inside - loaded)[inner]) / np.linalg.norm(loaded[inner]))
    assert remains[1] < 2e-3
    assert remains[1] < remains[0]


def test_reduction_hands_forces_over_and_drops_what_is_held(device):
    """Virtual work: any motion that obeys the constraints does the same work with the reduced forces."""
    project = reduction(device)
    free = np.random.default_rng(6).normal(size=project.shape[0])
    motion = (project.T @ free).reshape(-1, 3)
    for n, d in (*device.prescribed, *device.fixed):
        assert motion[n, d] == 0
    held = {(n, d) for n, d in (*device.prescribed, *device.fixed)}
    for equation in device.equations:
        total = sum(c * motion[n, d] for n, d, c in equation.terms if (n, d) not in held)
        assert total == pytest.approx(0, abs=1e-12)
    forces = np.random.default_rng(7).normal(size=device.nodes.shape)
    forces[device.reference_start :] = 0
    assert (project @ forces.ravel()) @ free == pytest.approx((forces * motion).sum())


def test_residual_of_a_frame_out_of_equilibrium_is_of_the_order_of_its_load(device):
    found = residual(device, np.zeros_like(device.nodes), 0.0)
    assert found.full == pytest.approx(1.0)
    assert found.resultant == pytest.approx(1.0)
    assert np.isnan(found.viscous)


def test_viscous_forces_are_counted_and_inertia_when_the_motion_is_known(device):
    u = np.zeros_like(device.nodes)
    found = residual(device, u, 0.0, motion=np.stack([1.5 * np.ones_like(u), np.zeros_like(u)]), damping=1e6)
    twice = residual(device, u, 0.0, motion=np.stack([np.ones_like(u), 2e6 * np.ones_like(u)]), damping=1e6)
    assert found.viscous > 0
    assert twice.viscous == pytest.approx(2 * found.viscous)


def test_rounding_noise_is_that_of_single_precision():
    u = np.random.default_rng(8).uniform(1, 100, (1000, 3))
    noise = np.abs(rounding_noise(u))
    actual = np.abs(u.astype(np.float32) - u)
    assert noise.max() <= np.spacing(np.float32(100)) / 2
    assert noise.mean() == pytest.approx(actual.mean(), rel=0.1)
