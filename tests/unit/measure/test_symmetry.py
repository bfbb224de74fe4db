"""Halves and quarters are measured like the full device that they stand for."""

from __future__ import annotations

import numpy as np
import pytest

from limo.measure.strain import directions
from limo.measure.stress import summarise, von_mises_map
from limo.measure.zones import distance_to, distances, edge_segments, zone_of
from limo.mechanics.build import build_model
from limo.mechanics.equilibrium import residual
from limo.mechanics.layer import flat_points, inside_out, layer_state, surface_points
from limo.schema.numerics import Mesh

#: on the coarse mesh of ``limo`` the top 5 % of the area end amid equal copies of one point, which rounding tells apart
DEVICE = "limo_2025"


def symmetric_state(model):
    """Displacements (n, 3) that are mirror images in x = 0 and z = 0 and zero in z at the outer edge."""
    mesh, shell = model.mesh, model.expansion
    back = np.zeros(len(mesh.nodes), bool)
    back[mesh.quads[mesh.face == 1]] = True
    back &= ~mesh.on_outer
    inside = distance_to(mesh.nodes[:, :2], edge_segments(mesh, mesh.on_outer))
    epi = np.zeros(len(mesh.nodes))
    epi[mesh.quads[mesh.layer == 2]] = 1.0
    epi[mesh.on_seam] = 0.0
    u = np.zeros_like(model.nodes)
    for numbers in (shell.bottom, shell.top, shell.middle):
        has = numbers >= 0
        x, y, z = model.nodes[numbers[has]].T
        side = np.where(back, -1.0, 1.0)[has]
        height = 0.15 * inside[has] * (1 + 0.3 * epi[has] * np.cos(x / 40) * np.sin(y / 60))
        # away from the middle on its own side; the part across the layer is odd in z and so serves both faces
        u[numbers[has]] = np.stack(
            [0.02 * x + 0.01 * side * z * inside[has] * np.sin(x / 10), 0.01 * y, side * height - 0.02 * z], 1
        )
    return u


@pytest.fixture(scope="module")
def quarter(make_case, device_mesh):
    return build_model(make_case(), device_mesh(DEVICE))


@pytest.mark.parametrize("symmetry", ["front_back", "full"])
def test_a_part_is_measured_like_the_whole(make_case, device_mesh, quarter, symmetry):
    mesh = Mesh(level="preview", symmetry=symmetry, element="C3D20R")
    whole = build_model(make_case(mesh=mesh), device_mesh(DEVICE, 8, symmetry))
    found = []
    for model in (quarter, whole):
        u = symmetric_state(model)
        stress = von_mises_map(model, u)
        zone = zone_of(model.mesh, distances(model.mesh, flat_points(model.mesh)), 4.0)
        strain = inside_out(model.mesh, layer_state(model, u, surface_points()).strain)
        summary = summarise(model, stress, zone)
        turned = directions(model.mesh, strain, zone == 0)
        peak = [summary.top, summary.top_middle, summary.largest, summary.p99, *summary.share]
        lines = [turned.between, turned.between_at_seams, *turned.around.values(), *turned.angle.values()]
        found.append([*peak, *lines, residual(model, u, 30.0).full])
        assert stress.max() > 1.0
    np.testing.assert_allclose(found[1][:-1], found[0][:-1], rtol=1e-6, atol=1e-6)
    # forces on the symmetry planes are taken in the part and balanced in the whole; a node there counts once in each
    assert found[1][-1] == pytest.approx(found[0][-1], rel=0.05)
