"""Stroke, lever and efficiency of curves that are known in closed form."""

import numpy as np
import pytest

from limo.measure.efficiency import efficiency_at_stroke, first_crossing, io_ratio, io_ratio_of_change, works

PRESSURE = np.linspace(0.0, 60.0, 61)  # kPa
VENTRICULAR = 3.8


def line(slope):
    return slope * PRESSURE  # ml


def test_lever_of_proportional_volumes_is_their_ratio():
    ratio = io_ratio(line(3.0), line(2.0))
    np.testing.assert_allclose(ratio[1:], 1.5)
    assert np.isnan(ratio[0]), "two zero volumes have no ratio"


def test_lever_of_volumes_that_were_not_measured_is_nan():
    change = line(2.0)
    change[40:] = np.nan
    ratio = io_ratio(line(3.0), change)
    assert np.isnan(ratio[40:]).all()
    np.testing.assert_allclose(ratio[1:40], 1.5)
    assert np.isnan(io_ratio(np.full(3, np.nan), np.full(3, np.nan))).all()
    assert len(io_ratio(np.array([]), np.array([]))) == 0


def test_lever_is_that_over_all_that_pouches_hold_and_not_over_its_change():
    """Layers through each other at rest: V_a begins at -10 ml, so 100 ml of change are 90 ml of air."""
    stroke, volume = line(3.0), line(100 / 60) - 10.0
    np.testing.assert_allclose(io_ratio(stroke, volume)[-1], 180 / 90)
    np.testing.assert_allclose(io_ratio_of_change(stroke, volume - volume[0])[-1], 180 / 100)
    empty = volume <= 0.9
    assert np.isnan(io_ratio(stroke, volume)[empty]).all(), "pouches without air have no ratio"
    assert np.isfinite(io_ratio(stroke, volume)[~empty]).all()
    assert np.isnan(io_ratio(stroke, -volume - 100)).all(), "nor have pouches that never hold any"


def test_works_of_straight_curves_are_areas_under_them():
    """W_out = P_v V_v, W_in = c P_a^2 / 2 (kPa ml = mJ)."""
    out, put_in = works(PRESSURE, VENTRICULAR, line(3.0), line(2.0))
    np.testing.assert_allclose(out, VENTRICULAR * 3.0 * PRESSURE)
    np.testing.assert_allclose(put_in, 2.0 * PRESSURE**2 / 2)


@pytest.mark.parametrize("slope", [1.6, 3.0, 7.0])
def test_efficiency_of_straight_curves(slope):
    """The stroke of 90 ml comes at P = 90 / slope, between increments: eta = 2 P_v slope / (c P)."""
    eta, pressure = efficiency_at_stroke(PRESSURE, VENTRICULAR, line(slope), line(2.0))
    assert pressure == pytest.approx(90.0 / slope)
    assert eta == pytest.approx(2 * VENTRICULAR * slope / (2.0 * pressure), rel=2e-3)


def test_efficiency_converges_with_the_increments():
    """W_in between two increments is taken as a straight line: the error falls with the square of their length."""
    errors = []
    for count in (50, 100, 200):
        pressure = np.linspace(0, 60, count + 1)
        eta, at = efficiency_at_stroke(pressure, VENTRICULAR, 90 * (pressure / 47.3) ** 2, 2.0 * pressure)
        errors.append(abs(at - 47.3))
    assert errors[2] < errors[0] / 4
    assert eta == pytest.approx(VENTRICULAR * 90 / 47.3**2, rel=1e-3)


def test_the_first_of_several_crossings_counts():
    stroke = np.interp(PRESSURE, [0, 20, 30, 60], [0, 100, 50, 120])
    assert efficiency_at_stroke(PRESSURE, VENTRICULAR, stroke, line(2.0))[1] == pytest.approx(18.0)


def test_stroke_that_is_never_reached_has_no_efficiency():
    assert np.isnan(efficiency_at_stroke(PRESSURE, VENTRICULAR, line(1.4), line(2.0))).all()


@pytest.mark.parametrize(
    ("values", "index"),
    [([0, 45, 90, 100], 2.0), ([0, 80, 100], 1.5), ([90, 100], 0.0), ([0, 10], None), ([], None)],
)
def test_first_crossing_is_interpolated(values, index):
    assert first_crossing(np.array(values, float), 90.0) == index
