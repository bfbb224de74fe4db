"""Meshes that stand for the same device: what must not change does not."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from limo.engines.newton.assembly import Assembly
from limo.mechanics.build import build_model
from limo.mechanics.volumes import volumes
from limo.mesh.flat import smallest_jacobian
from limo.reliability.perturbation import KEPT, MASKS, jittered, mirrored, renumbered, rotated
from limo.schema.numerics import Mesh


@pytest.fixture
def mesh(device_mesh):
    return device_mesh("limo", 8, "quarter")


def bulged(mesh):
    """Middle-surface points of a smooth state that depends on places only."""
    x, y, z = mesh.nodes.T
    return np.column_stack([x * (1 - 1e-3 * y), y, z + 20 * np.sin(y / 45) * np.cos(x / 40)])


def test_renumbering_and_mirroring_change_no_volume(mesh):
    expected = volumes(mesh, bulged(mesh))
    for other in (renumbered(mesh, 3), mirrored(mesh), mirrored(renumbered(mesh, 4))):
        np.testing.assert_allclose(volumes(other, bulged(other)), expected, rtol=1e-12, atol=1e-6)
        assert {n: int(getattr(other, n).sum()) for n in MASKS} == {n: int(getattr(mesh, n).sum()) for n in MASKS}


def test_mirroring_twice_is_nothing(mesh):
    again = mirrored(mirrored(mesh))
    np.testing.assert_array_equal(again.nodes, mesh.nodes)
    np.testing.assert_array_equal(again.quads, mesh.quads)


def test_jitter_moves_what_is_free_and_leaves_elements_whole(mesh):
    shaken = jittered(mesh, 1, 0.15)
    moved = np.linalg.norm(shaken.nodes - mesh.nodes, axis=1)
    held = np.any([getattr(mesh, m) for m in MASKS], axis=0)
    assert moved[held].max() == 0
    assert (moved[~held & mesh.is_corner & (mesh.nodes[:, 0] > 1e-9)] > 0).mean() > 0.9
    assert (shaken.nodes[:, 2] == 0).all()
    quality = [smallest_jacobian(m.nodes[:, :2], m.quads) for m in (mesh, shaken)]
    assert (quality[1] >= KEPT * quality[0]).all()
    assert jittered(mesh, 1, 0.0).nodes.tobytes() == mesh.nodes.tobytes()


def test_a_rotated_model_has_rotated_forces(device_mesh, make_case):
    mesh = device_mesh("limo", 8, "full")
    model = build_model(make_case(mesh=Mesh(symmetry="full")), mesh)
    turn = Rotation.from_rotvec([0.4, -1.1, 0.7]).as_matrix()
    other = rotated(model, turn)
    u = np.random.default_rng(2).normal(0, 0.05, model.nodes.shape)
    expected = Assembly(model).forces(u, 3.8, 10.0)
    found = Assembly(other).forces(u @ turn.T, 3.8, 10.0)
    for a, b in zip(expected, found, strict=True):
        np.testing.assert_allclose(b, a @ turn.T, atol=1e-9 * np.abs(a).max())
    with pytest.raises(ValueError, match="only the full device"):
        rotated(replace(model, mesh=replace(mesh, symmetry="quarter")), turn)
