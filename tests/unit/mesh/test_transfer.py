"""Values and states of one mesh on another of the same pattern."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from limo.errors import ResultError
from limo.mechanics.build import build_model
from limo.mechanics.kinematics import deformation_gradient
from limo.mechanics.transfer import CRUSHED, carried
from limo.mesh.device import mesh_device
from limo.mesh.elements import gauss
from limo.mesh.transfer import interpolation
from limo.schema.numerics import Mesh, MeshLevel

FINER = MeshLevel(degrees_of_freedom=30000, grading=0.7)


@pytest.fixture(scope="module", params=["quarter", "full"])
def cases(request, make_case):
    """A case on a coarse and on a finer mesh."""
    mesh = Mesh(level="preview", symmetry=request.param)
    size = {"quarter": FINER, "full": replace_size(FINER, 18000)}[request.param]
    return make_case(mesh=mesh), make_case(mesh=mesh, mesh_level=size)


def replace_size(level, size):
    return level.model_copy(update={"degrees_of_freedom": size})


@pytest.fixture(scope="module")
def meshes(cases):
    return [mesh_device(case.mesh_content()) for case in cases]


def test_what_is_linear_in_the_flat_pattern_is_carried_exactly(meshes):
    coarse, fine = meshes
    matrix = interpolation(coarse, fine)
    assert matrix.shape == (len(fine.nodes), len(coarse.nodes))
    np.testing.assert_allclose(matrix @ np.ones(len(coarse.nodes)), 1.0, atol=1e-9)
    size = np.ptp(coarse.nodes[:, 1])
    # but for the sliver between the curved edge and the chords of elements on it
    assert np.abs(matrix @ coarse.nodes - fine.nodes).max() < 1e-3 * size


def test_a_mesh_takes_its_own_values_as_they_are(meshes):
    coarse, _ = meshes
    values = np.random.default_rng(1).normal(size=len(coarse.nodes))
    np.testing.assert_allclose(interpolation(coarse, coarse) @ values, values, atol=1e-8)


def test_layers_and_pouches_stay_apart(meshes):
    """Each layer of each pouch takes its own values; nodes that layers share take either."""
    coarse, fine = meshes
    part = np.zeros((2, max(len(coarse.nodes), len(fine.nodes))))
    shared = [np.zeros(len(mesh.nodes), bool) for mesh in meshes]
    for k, mesh in enumerate(meshes):
        label = 10 * mesh.pouch + mesh.layer + 100 * mesh.face
        seen = np.full(len(mesh.nodes), np.nan)
        for quad, value in zip(mesh.quads, label, strict=True):
            shared[k][quad[np.isfinite(seen[quad]) & (seen[quad] != value)]] = True
            seen[quad] = value
        part[k, : len(seen)] = seen
    rows = interpolation(coarse, fine).tocoo()
    taken = ~shared[1][rows.row] & ~shared[0][rows.col] & (np.abs(rows.data) > 1e-9)
    assert taken.sum() > 1000
    assert (part[1, rows.row[taken]] == part[0, rows.col[taken]]).all()


def test_a_mesh_of_another_pattern_is_refused(meshes, make_case):
    for other in ({"n_pouches": 10}, {"n_pouches": 4}):
        mesh = mesh_device(make_case(**other, mesh=Mesh(level="preview", symmetry=meshes[0].symmetry)).mesh_content())
        with pytest.raises(ResultError, match="of another pattern"):
            interpolation(meshes[0], mesh)


@pytest.mark.parametrize("element", ["C3D20R", "SHELL8R"])
def test_a_rigid_motion_is_carried_whole_and_the_layer_keeps_its_thickness(cases, meshes, element):
    turn = Rotation.from_rotvec([0.3, -0.2, 0.9]).as_matrix()
    coarse, fine = (
        build_model(replace(case, mesh=case.mesh.model_copy(update={"element": element})), mesh)
        for case, mesh in zip(cases, meshes, strict=True)
    )
    nodes = coarse.expansion.nodes
    found = carried(coarse, nodes @ turn.T + [1.0, 2.0, 3.0] - nodes, fine)
    expected = fine.expansion.nodes @ turn.T + [1.0, 2.0, 3.0] - fine.expansion.nodes
    assert np.abs(found - expected).max() < 1e-3 * fine.length
    shell = fine.expansion
    placed = shell.nodes + found
    thickness = np.linalg.norm(placed[shell.top] - placed[shell.bottom], axis=1)
    np.testing.assert_allclose(thickness, fine.fabric.thickness, rtol=1e-12)


def test_an_edge_that_is_inside_out_turns_no_brick_inside_out_on_another_mesh(cases, meshes):
    """An edge of a coarse mesh whose directors point the other way."""
    coarse, fine = (build_model(case, mesh) for case, mesh in zip(cases, meshes, strict=True))
    flat, local = coarse.expansion, gauss(2, 3)[0]
    edge = np.abs(coarse.mesh.nodes[:, 1]) < 1e-6
    state = np.zeros(flat.nodes.shape)
    state[flat.top[edge], 2] = -1.1 * coarse.fabric.thickness

    def smallest(model, displacements):
        gradients = deformation_gradient(model.expansion.nodes, model.expansion.bricks, displacements, local)[0]
        return np.linalg.det(gradients).min()

    assert smallest(coarse, state) < 0
    assert smallest(fine, carried(coarse, state, fine)) > CRUSHED
