"""Crossing surfaces."""

from __future__ import annotations

import numpy as np
import pytest

from limo.measure.contact import crossings, endo_through_epi, first_contact, front_through_back, outer_through_outer
from tests.helpers.patches import grid


def sheet(height):
    points, quads = grid(4, 4)
    return np.column_stack([points, height(points)]), quads


@pytest.mark.parametrize(("height", "crosses"), [(lambda p: 0.2 + 0 * p[:, 0], False), (lambda p: 0.5 * p[:, 0] + 0.01, True)])
def test_two_sheets(height, crosses):
    from limo.measure.contact import triangles

    first, quads = sheet(lambda p: 0 * p[:, 0])
    second, _ = sheet(height)
    points = np.vstack([first, second])
    found = crossings(points, triangles(quads), triangles(quads + len(first)))
    assert (len(found) > 0) == crosses
    if crosses:
        np.testing.assert_allclose(found[:, 0], -0.02, atol=1e-12)  # where 0.5 x + 0.01 = 0
        np.testing.assert_allclose(found[:, 2], 0, atol=1e-12)


def bulge(mesh, endo, epi, wall=5.0):
    """Positions with the layers at given heights inside the pouches, where they are not sealed."""
    points = mesh.nodes.copy()
    side = np.where(np.isin(np.arange(len(points)), mesh.quads[mesh.face == 1]) & ~mesh.on_outer, -1.0, 1.0)
    points[~mesh.on_outer, 2] = wall
    for layer, height in ((1, endo), (2, epi)):
        nodes = np.unique(mesh.quads[mesh.layer == layer])
        points[nodes[~mesh.on_seam[nodes]], 2] = height
    points[:, 2] *= side
    return points


@pytest.mark.parametrize("symmetry", ["quarter", "full"])
def test_the_device_touches_where_it_should(device_mesh, symmetry):
    mesh = device_mesh("limo", 8, symmetry)
    apart = bulge(mesh, 3.0, 8.0)
    assert len(endo_through_epi(mesh, apart, 0.2)) == 0
    assert len(front_through_back(mesh, apart, 0.2)) == 0
    pushed = bulge(mesh, -2.0, 8.0)
    assert len(front_through_back(mesh, pushed, 0.2)) > 0
    assert len(front_through_back(mesh, bulge(mesh, -0.15, 8.0), 0.2)) == 0, "no deeper than the fabric is thick"
    assert len(front_through_back(mesh, bulge(mesh, -0.25, 8.0), 0.2)) > 0
    assert len(endo_through_epi(mesh, pushed, 0.2)) == 0
    assert len(endo_through_epi(mesh, bulge(mesh, 5.0, 4.9), 0.2)) == 0, "no deeper than the fabric is thick"
    passed = endo_through_epi(mesh, bulge(mesh, 5.0, 4.0), 0.2)
    assert len(passed) > 0
    assert np.abs(passed[:, 2]).max() <= 5.0 + 1e-9


@pytest.mark.parametrize("symmetry", ["quarter", "full"])
def test_outer_surfaces_touch_where_they_should(device_mesh, symmetry):
    mesh = device_mesh("limo", 8, symmetry)
    apart = bulge(mesh, 3.0, 8.0)
    assert len(outer_through_outer(mesh, apart, 0.2)) == 0
    # the epicardium of the outermost pouch leans over to its neighbour, and further
    epi = mesh.quads[(mesh.layer == 2) & (mesh.pouch == mesh.pouch[(mesh.layer == 2) & (mesh.face == 0)].max())]
    nodes = np.unique(epi)
    nodes = nodes[~mesh.on_seam[nodes]]
    leaning = apart.copy()
    leaning[nodes, 0] -= 15.0
    assert len(outer_through_outer(mesh, leaning, 0.2)) > 0
    # a fold of the wall: its upper part is laid on the lower one, and through it
    wall = np.unique(mesh.quads[mesh.layer == 0])
    folded = apart.copy()
    folded[wall, 2] += 3.0 * np.sin(folded[wall, 0])
    folded[wall, 0] += 4.0 * np.sin(2.0 * folded[wall, 0])
    assert len(outer_through_outer(mesh, folded, 0.2)) > 0
    if symmetry == "quarter":
        beyond = apart.copy()
        beyond[beyond[:, 0] == 0, 0] = -0.3
        assert len(outer_through_outer(mesh, beyond, 0.2)) > 0


def test_first_contact_is_between_two_frames():
    assert first_contact([0, 10, 20], [False, False, True]) == (10.0, 20.0)
    clear, first = first_contact([0, 10], [True, False])
    assert np.isnan(clear)
    assert first == 0.0
    clear, first = first_contact([0, 10], [False, False])
    assert clear == 10.0
    assert np.isnan(first)
