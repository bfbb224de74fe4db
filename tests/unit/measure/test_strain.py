"""Principal strains, their directions and streamlines."""

from __future__ import annotations

import numpy as np
import pytest

from limo.measure.strain import (
    angle_between,
    directions,
    facing_pairs,
    inplane_angle,
    membrane_principal,
    on_side,
    side_values,
    streamlines,
)
from limo.mechanics.layer import flat_points


def inplane(angle, largest, smallest):
    """A plane strain tensor with its largest principal direction at ``angle`` degrees to x."""
    a = np.radians(angle)
    v, w = np.stack([np.cos(a), np.sin(a)], -1), np.stack([-np.sin(a), np.cos(a)], -1)
    tensor = np.zeros((*np.shape(angle), 3, 3))
    tensor[..., :2, :2] = largest * v[..., :, None] * v[..., None, :] + smallest * w[..., :, None] * w[..., None, :]
    return tensor


@pytest.mark.parametrize("angle", [-89.0, -30.0, 0.0, 45.0, 80.0])
def test_direction_and_value_of_a_known_strain(angle):
    tensor = inplane(np.array(angle), 0.05, -0.02)
    tensor[..., 2, 2] = 0.3  # across the fabric: not in its plane
    assert membrane_principal(tensor) == pytest.approx(0.05)
    assert inplane_angle(tensor) == pytest.approx(angle)


def test_angles_between_lines_know_no_sign():
    first, second = np.array([0.0, -89.0, 10.0]), np.array([180.0, 89.0, 100.0])
    assert angle_between(first, second) == pytest.approx([0.0, 2.0, 90.0])


@pytest.mark.parametrize("symmetry", ["quarter", "full"])
def test_pouches_have_an_endocardium_below_every_epicardium(device_mesh, symmetry):
    mesh = device_mesh("limo", 8, symmetry)
    endo, epi = facing_pairs(mesh)
    assert len(endo) == len(epi) == (mesh.layer == 2).sum()
    np.testing.assert_array_equal(mesh.pouch[endo], mesh.pouch[epi])
    np.testing.assert_array_equal(mesh.face[endo], mesh.face[epi])
    np.testing.assert_allclose(flat_points(mesh)[endo], flat_points(mesh)[epi], atol=1e-9)


def test_surfaces_of_the_device(device_mesh):
    mesh = device_mesh()
    assert set(mesh.layer[on_side(mesh, "endocardial")]) == {0, 1}
    assert set(mesh.layer[on_side(mesh, "epicardial")]) == {0, 2}
    values = np.arange(3.0)[None, :, None] + np.zeros((len(mesh.quads), 3, 4))
    assert (side_values(mesh, values, "endocardial") == 0).all()
    assert (side_values(mesh, values, "epicardial") == 2).all()


def test_orthogonal_directions_are_found_on_the_pouches(device_mesh):
    """Around the device outside, along it inside, and aligned where marked as a seam."""
    mesh = device_mesh()
    strain = np.zeros((len(mesh.quads), 3, 4, 3, 3))
    strain[:, 0] = inplane(np.array(90.0), 0.03, 0.0)
    strain[:, 2] = inplane(np.array(0.0), 0.03, 0.0)
    seam = np.zeros((len(mesh.quads), 4), bool)
    seam[:, 0] = True
    strain[:, 0, 0] = strain[:, 2, 0]
    found = directions(mesh, strain, seam)
    assert found.angle["epicardial"] == pytest.approx(0)
    assert found.around["epicardial"] == pytest.approx(1)
    assert found.angle["endocardial"] == pytest.approx(90)
    assert found.around["endocardial"] == pytest.approx(0.25, abs=0.1)
    assert found.between == pytest.approx(90)
    assert found.between_at_seams == pytest.approx(0)


def test_streamlines_of_a_strain_around_a_point_are_circles(device_mesh):
    """v_1 tangential to circles about the centre (0, -30): the radius along every line stays the same."""
    mesh = device_mesh()
    where = flat_points(mesh)[..., :2] - [0.0, -30.0]
    tangent = np.degrees(np.arctan2(where[..., 1], where[..., 0])) + 90.0
    strain = np.repeat(inplane(tangent, 0.04, 0.01)[:, None], 3, axis=1)
    lines = streamlines(mesh, strain, mesh.nodes + np.array([0, 0, 5.0]), "endocardial", spacing=20.0)
    assert len(lines) > 5
    for line in lines:
        radius = np.linalg.norm(line.flat - [0.0, -30.0], axis=1)
        assert np.ptp(radius) < 0.02 * radius.mean()
        np.testing.assert_allclose(line.deformed, np.column_stack([line.flat, np.full(len(line.flat), 5.0)]), atol=1e-6)
        np.testing.assert_allclose(line.strain, 0.04, rtol=0.05)
    assert max(len(line.flat) for line in lines) > 20
