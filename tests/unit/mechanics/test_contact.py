"""Contact of layers: pairs, closed forms, and forces and tangent as slopes of one energy."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from limo.mechanics.contact import Contact, Touching, contact_of
from limo.mesh.elements import QUAD8
from limo.mesh.layers import LAYERS

PENALTY, REACH, SPAN = 2.0, 0.02, 1.0  # MPa / mm, mm, mm
STEP = 1e-5  # mm


@pytest.fixture(params=["quarter", "front_back", "full"])
def mesh(request, device_mesh):
    return device_mesh(symmetry=request.param)


@pytest.fixture
def touching(mesh) -> Touching:
    return Touching(contact_of(mesh, front_back=True, endo_epi=True, penalty=PENALTY, reach=REACH, span=SPAN), mesh.nodes)


def pressed(touching: Touching, mesh, size: float = 0.3, seed: int = 1) -> np.ndarray:
    """Places (n, 3) of layers that were bent, stretched and pushed through each other here and there."""
    x, y, z = mesh.nodes.T
    bent = np.column_stack([1.02 * x, 0.99 * y, z + 3 * np.sin(x / 20) * np.cos(y / 30)])
    return bent + size * np.random.default_rng(seed).normal(size=bent.shape)


def test_pairs_lie_on_each_other_in_the_flat_state_and_all_pouches_have_theirs(mesh, touching):
    contact = touching.contact
    assert np.abs(mesh.nodes[contact.lower] - mesh.nodes[contact.upper]).max() < 1e-12
    endo = (mesh.layer == LAYERS.index("endo")).sum()
    inner = (mesh.layer != LAYERS.index("epi")).sum()
    if mesh.symmetry == "full":
        assert len(contact.plane) == 0
        assert len(contact.lower) == endo + inner // 2
    else:
        assert len(contact.plane) == inner
        assert len(contact.lower) == endo


def test_layers_that_part_store_nothing(mesh, touching):
    assert touching.energy(mesh.nodes) == pytest.approx(
        PENALTY * REACH**2 / 12 * (touching.plane_area.sum() + (touching.pair_area * touching.weights).sum())
    )
    blown = mesh.nodes.copy()
    for sign, face in ((1.0, 0), (-1.0, 1)):
        for layer, height in (("endo", 1.0), ("wall", 1.0), ("epi", 2.0)):
            quads = mesh.quads[(mesh.layer == LAYERS.index(layer)) & (mesh.face == face)]
            free = np.setdiff1d(quads, np.flatnonzero(mesh.on_seam | mesh.on_outer))
            blown[free, 2] = sign * height
    assert np.median(touching.gaps(blown)[1]) > 0.9
    assert touching.energy(blown) < 0.5 * touching.energy(mesh.nodes)


def test_pressure_and_stiffness_are_slopes_without_a_jump():
    contact = Contact(np.empty((0, 8), int), np.empty((0, 8), int), np.empty((0, 8), int), PENALTY, REACH, SPAN)
    gap = np.linspace(-3 * REACH, 2 * REACH, 2001)
    np.testing.assert_allclose(-np.gradient(contact.energy(gap), gap)[1:-1], contact.pressure(gap)[1:-1], atol=1e-6)
    np.testing.assert_allclose(-np.gradient(contact.pressure(gap), gap)[1:-1], contact.stiffness(gap)[1:-1], atol=1e-2)
    assert contact.pressure(np.array(-2 * REACH)) == pytest.approx(2 * PENALTY * REACH)
    assert contact.pressure(np.array(REACH)) == 0.0


def test_two_flat_layers_pressed_into_each_other_push_with_k_g(device_mesh):
    """Beyond the reach; whatever direction they face and however far they have slid; the gap is that along the normal."""
    mesh = device_mesh(symmetry="quarter")
    touching = Touching(contact_of(mesh, front_back=False, endo_epi=True, penalty=PENALTY, reach=REACH, span=SPAN), mesh.nodes)
    contact = touching.contact
    area = touching.pair_area.sum()
    places, gap, slid = mesh.nodes.copy(), 0.03, np.array([0.4, -0.2, 0.0])
    # layers that share no node: the epicardium as nodes of its own
    count = len(places)
    apart = type(contact)(contact.plane, contact.lower, contact.upper + count, PENALTY, REACH, SPAN)
    both = np.vstack([places, places])
    alone = Touching(apart, both)
    turn = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    both[count:] += slid - (0, 0, gap)
    assert alone.energy(both @ turn.T) == pytest.approx(PENALTY * (0.5 * gap**2 + REACH**2 / 6) * area, rel=1e-9)
    forces = alone.forces(both @ turn.T) @ turn
    assert forces[:count, 2].sum() == pytest.approx(PENALTY * gap * area, rel=1e-9)
    assert np.abs(forces[:count].sum(axis=0) + forces[count:].sum(axis=0)).max() < 1e-9 * PENALTY * gap * area


@pytest.mark.parametrize("angle", [100.0, 150.0, 180.0, 200.0, 260.0])
def test_layers_that_are_wide_open_do_not_touch(angle):
    """Beside a seam, where the mean of their tangents vanishes or turns round."""
    flat = np.column_stack([2.5 * (QUAD8 + 1), np.zeros(8)])
    turned = flat @ Rotation.from_euler("y", -angle, degrees=True).as_matrix().T
    quad = np.arange(8)[None]
    touching = Touching(Contact(np.empty((0, 8), int), quad, quad + 8, PENALTY, REACH, SPAN), np.vstack([flat, flat]))
    open_pair = np.vstack([flat, turned])
    assert touching.energy(open_pair) == 0.0
    assert not touching.forces(open_pair).any()
    assert touching.energy(np.vstack([flat, flat])) > 0


def test_forces_are_the_slope_of_the_energy(mesh, touching):
    x = pressed(touching, mesh)
    forces = touching.forces(x)
    assert np.abs(forces).max() > 0
    for direction in np.random.default_rng(2).normal(size=(3, *x.shape)):
        slope = (touching.energy(x + STEP * direction) - touching.energy(x - STEP * direction)) / (2 * STEP)
        assert (forces * direction).sum() == pytest.approx(slope, rel=1e-5)


def test_a_rigid_motion_changes_nothing(device_mesh):
    mesh = device_mesh(symmetry="full")
    touching = Touching(contact_of(mesh, front_back=True, endo_epi=True, penalty=PENALTY, reach=REACH, span=SPAN), mesh.nodes)
    x = pressed(touching, mesh)
    turn = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    assert touching.energy(x @ turn.T + (3.0, -5.0, 1.0)) == pytest.approx(touching.energy(x), rel=1e-9)
    np.testing.assert_allclose(touching.forces(x @ turn.T), touching.forces(x) @ turn.T, rtol=0, atol=1e-9)


@pytest.mark.parametrize("mirror", [(-1, 1, 1), (1, 1, -1)])
def test_a_mirror_image_stores_the_same_and_pushes_the_mirrored_way(device_mesh, mirror):
    """In a mirror normals point the other way round their quadrilaterals, so the lower layer is the upper one."""
    mesh = device_mesh(symmetry="full")
    touching = Touching(contact_of(mesh, front_back=True, endo_epi=True, penalty=PENALTY, reach=REACH, span=SPAN), mesh.nodes)
    pairs = touching.contact
    mirrored = Touching(replace(pairs, lower=pairs.upper, upper=pairs.lower), mesh.nodes * mirror)
    x = pressed(touching, mesh)
    assert mirrored.energy(x * mirror) == pytest.approx(touching.energy(x), rel=1e-12)
    np.testing.assert_allclose(mirrored.forces(x * mirror), touching.forces(x) * mirror, rtol=0, atol=1e-12)
    assert touching.energy(x * mirror) != pytest.approx(touching.energy(x), rel=0.1), "layers that are not swapped have passed"


def test_without_contact_there_is_none(mesh):
    assert contact_of(mesh, front_back=False, endo_epi=False, penalty=PENALTY, reach=REACH, span=SPAN) is None
