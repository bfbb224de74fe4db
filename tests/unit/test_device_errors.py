"""Errors of runs against an ensemble: clouds on surfaces, distances, and what is made of curves."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from limo.device_errors import CLOUD, ERRORS, Run, Surface, chamfer, errors_of, sampled, scatter_of

from .patches import grid

PRESSURE = np.linspace(0.0, 60.0, 121)


def flat(nx, ny):
    nodes, quads = grid(nx, ny)
    return np.column_stack([nodes, np.zeros(len(nodes))]), quads


def test_points_on_a_surface_are_as_dense_everywhere():
    nodes, quads = flat(6, 4)
    stretched = nodes * (2.0 * (nodes[:, :1] > 0)) * (1.0, 0.0, 0.0)  # one half three times as long
    points = sampled(nodes, quads, stretched, 4000)
    assert points.shape == (4000, 3)
    assert np.ptp(points[:, 2]) == 0
    counts, _ = np.histogram(points[:, 0], bins=[-1.0, 0.0, 1.0, 2.0, 3.0])
    assert counts == pytest.approx(np.full(4, 1000), rel=0.03)
    again = sampled(nodes, quads, stretched, 4000)
    assert np.array_equal(points, again)


def test_points_follow_curved_sides():
    nodes, quads = flat(1, 1)
    points = sampled(nodes, quads, nodes[:, :1] ** 2 * (0.0, 0.0, 1.0), 200)
    np.testing.assert_allclose(points[:, 2], points[:, 0] ** 2, atol=1e-12)


def test_chamfer_distance_is_that_of_the_paper():
    first, second = np.array([[0.0, 0, 0], [1.0, 0, 0]]), np.array([[0.0, 0, 0], [1.0, 0, 0.3], [1.0, 0, 0.5]])
    # from the first: 0 and 0.3; from the second: 0, 0.3 and 0.5
    assert chamfer(first, second) == pytest.approx(0.3 / 4 + 0.8 / 6)
    assert chamfer(first, second) == chamfer(second, first)
    assert chamfer(first, first) == 0


@pytest.fixture
def make_run(make_case):
    """A run whose volumes are ``factor`` times those of a straight ramp and whose surface lies ``shift`` mm higher."""

    def make(factor=1.0, shift=0.0, part="accuracy", status="converged", until=60.0, **changed):
        stroke = np.where(until >= PRESSURE, 2.0 * factor * PRESSURE, np.nan)
        values = {
            "ventricle_volume": ("actuation_pressure", 300.0 - stroke), "stroke_volume": ("actuation_pressure", stroke),
            "actuation_volume_change": ("actuation_pressure", 0.5 * stroke), "pressure_90ml": 45.0 / factor,
            "efficiency_90ml": 0.5 * factor, "von_mises_peak": ("frame", [0.1, 10.0 * factor]),
            "fatigue_cycles_min": 1e6 * factor, "case_status": status,
        }  # fmt: skip
        values = xr.Dataset(values | changed, coords={"actuation_pressure": PRESSURE, "frame": ["0", "max"]})
        points = np.stack(np.meshgrid(np.arange(40.0), np.arange(40.0), [shift]), axis=-1).reshape(-1, 3)
        return Run(part, "", "", 0, make_case(), values, Surface(np.array([0.0, 60.0]), np.array([0.0, 0.1 * factor]), points))

    return make


def test_errors_are_relative_to_the_mean_of_the_reference(make_run):
    reference = [make_run(0.9), make_run(1.1)]
    found = errors_of(make_run(1.2, shift=0.1), reference)
    assert list(found) == list(ERRORS)
    assert found["stroke"] == pytest.approx(0.2)
    assert found["actuation_volume"] == pytest.approx(0.2)
    volume = 300.0 - 2.0 * PRESSURE
    assert found["ventricle_volume"] == pytest.approx(np.linalg.norm(0.4 * PRESSURE) / np.linalg.norm(volume))
    assert found["stress"] == pytest.approx(0.2)
    assert found["height"] == pytest.approx(0.2)
    assert found["cycles"] == pytest.approx(np.log10(1.2) - 0.5 * np.log10(0.99))
    length = make_run().case.device.pattern.length
    assert found["chamfer"] == pytest.approx(0.1 / length)
    assert errors_of(make_run(), [make_run()]) == dict.fromkeys(ERRORS, 0.0)


def test_what_a_run_lacks_is_no_number(make_run):
    reference = [make_run(), make_run()]
    short = errors_of(make_run(until=30.0), reference)
    assert np.isnan([short["stroke"], short["ventricle_volume"]]).all()
    bare = make_run()
    shell = Run("shells", "s8", "", 0, bare.case, bare.values.drop_vars(["von_mises_peak", "fatigue_cycles_min"]), None)
    found = errors_of(shell, reference)
    assert np.isnan([found[n] for n in ("stress", "cycles", "height", "chamfer")]).all()
    assert found["stroke"] == 0


def test_scatter_is_what_members_differ_among_themselves(make_run):
    found = scatter_of([make_run(0.9), make_run(1.0), make_run(1.1)])
    assert found["stroke"] == pytest.approx((0.15 / 1.05 + 0.0 + 0.15 / 0.95) / 3)
    assert CLOUD % 4 == 0, "the same number of points for all symmetries"
