"""Peaks, quantiles and zones of a stress map."""

from __future__ import annotations

import numpy as np
import pytest
from shapely import LineString

from limo.measure.stress import area_quantile, summarise, top_average, top_share, von_mises_map
from limo.measure.zones import ZONES, distance_to, distances, edge_segments, zone_of
from limo.mechanics.build import build_model
from limo.mechanics.layer import flat_areas, flat_points


def test_top_average_of_a_ramp_is_its_mean_over_the_last_share():
    """Values x over equal areas on [0, 1]: the mean of the top 5 % is 0.975."""
    x = (np.arange(20000) + 0.5) / 20000
    assert top_average(x, np.ones_like(x)) == pytest.approx(0.975, abs=1e-4)
    assert top_average(x, np.ones_like(x), 1.0) == pytest.approx(0.5)


def test_top_average_counts_areas_and_a_part_of_the_last_value():
    """10 on 3 % of the area and 4 on 97 %: (3 * 10 + 2 * 4) / 5."""
    assert top_average(np.array([4.0, 10.0]), np.array([97.0, 3.0])) == pytest.approx(7.6)


def test_top_average_does_not_mind_order_or_refinement():
    rng = np.random.default_rng(1)
    value, area = rng.gamma(2.0, size=500), rng.uniform(1, 2, 500)
    expected = top_average(value, area)
    order = rng.permutation(500)
    assert top_average(value[order], area[order]) == pytest.approx(expected)
    assert top_average(np.repeat(value, 3), np.repeat(area / 3, 3)) == pytest.approx(expected)


def test_area_quantile():
    value, area = np.array([3.0, 1.0, 2.0]), np.array([10.0, 80.0, 10.0])
    assert area_quantile(value, area, 0.8) == 1.0
    assert area_quantile(value, area, 0.81) == 2.0
    assert area_quantile(value, area, 0.99) == 3.0
    assert area_quantile(value, area, 1.0) == 3.0


def test_top_share_adds_up_and_finds_the_zone():
    value, area = np.arange(100.0), np.ones(100)
    zone = np.where(value >= 95, ZONES.index("seam"), ZONES.index("wall"))
    share = top_share(value, area, zone)
    assert share.sum() == pytest.approx(1)
    assert share[ZONES.index("seam")] > 0.8


def test_distance_to_segments():
    segments = np.array([[[0.0, 0.0], [10.0, 0.0]]])
    points = np.array([[5.0, 3.0], [-3.0, 4.0], [13.0, 0.0], [2.0, 0.0]])
    np.testing.assert_allclose(distance_to(points, segments), [3, 5, 3, 0])
    assert np.isinf(distance_to(points, np.empty((0, 2, 2)))).all()


@pytest.mark.parametrize("symmetry", ["quarter", "full"])
def test_seams_of_a_mesh_are_those_of_its_pattern(device_mesh, coarse, symmetry):
    mesh = device_mesh("limo", 8, symmetry)
    lines = [LineString(c.points) for c in coarse("limo", 8).pattern.curves if c.kind == "seam"]
    length = np.linalg.norm(np.diff(edge_segments(mesh, mesh.on_seam), axis=1), axis=2).sum()
    off_axis = sum(line.length for line in lines if line.bounds[2] > 1e-6)
    on_axis = sum(line.length for line in lines) - off_axis
    sides = 1 if symmetry == "quarter" else 2
    assert length == pytest.approx(sides * off_axis + on_axis, rel=5e-3)


def test_zones_are_the_nearest_seam_or_edge_and_else_the_patch(device_mesh):
    mesh = device_mesh()
    away = distances(mesh, flat_points(mesh))
    zone = zone_of(mesh, away, 3.0)
    near = np.stack([away[n] for n in ZONES[:3]]).min(axis=0) <= 3.0
    assert (zone[near] <= 2).all()
    for k, name in enumerate(("wall", "pouch_endo", "pouch_epi")):
        assert set(zone[~near & (mesh.layer == k)[:, None]]) == {ZONES.index(name)}
    assert set(np.unique(zone)) == set(range(len(ZONES)))
    assert (zone_of(mesh, away, 0.0) >= 3).all()


def test_summary_of_a_map_finds_its_largest_value(make_case, device_mesh):
    model = build_model(make_case(), device_mesh())
    mesh = model.mesh
    zone = zone_of(mesh, distances(mesh, flat_points(mesh)), 3.0)
    stress = np.ones((len(mesh.quads), 3, 4))
    stress[17, 2, 3] = 50.0
    found = summarise(model, stress, zone)
    assert (found.largest, found.surface) == (50.0, "outer")
    assert (found.x, found.y) == pytest.approx(tuple(flat_points(mesh)[17, 3, :2]))
    assert found.zone == ZONES[zone[17, 3]]
    assert found.top_middle == pytest.approx(1.0)
    share = flat_areas(mesh)[17, 3] / flat_areas(mesh).sum()
    assert found.top == pytest.approx(1 + 49 * share / 0.05)
    assert found.share.sum() == pytest.approx(1)


def test_a_uniform_stretch_gives_a_uniform_map(make_case, device_mesh):
    model = build_model(make_case(), device_mesh())
    stress = von_mises_map(model, model.nodes * [0.02, 0.0, 0.0])
    assert stress.shape == (len(model.mesh.quads), 3, 4)
    np.testing.assert_allclose(stress, stress[0, 0, 0], rtol=1e-9)
