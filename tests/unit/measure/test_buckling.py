"""Jumps of a curve, however the increments are chosen."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import expit

from limo.measure.buckling import Event, displacement_difference, events, largest_events


def curve(p, jumps=()):
    """A saturating stroke volume with steps of given height (ml) at given pressures."""
    return 120 * (1 - np.exp(-p / 15)) + sum(h * expit((p - at) / 0.01) for at, h in jumps)


@pytest.mark.parametrize("seed", range(5))
def test_a_smooth_curve_has_no_event_whatever_its_increments(seed):
    rng = np.random.default_rng(seed)
    p = np.cumsum(np.append(0.0, rng.choice([0.01, 0.2, 2.0], 200)))
    assert events(p, curve(p)) == []


@pytest.mark.parametrize("seed", range(5))
def test_jumps_are_found_with_their_pressure_and_size(seed):
    rng = np.random.default_rng(seed)
    jumps = [(22.0, 8.0), (41.0, -3.0)]
    # the solver cuts its increments back where it jumps
    p = np.cumsum(np.append(0.0, rng.uniform(0.2, 1.5, 90)))
    p = np.unique(np.concatenate([p, *(at + np.linspace(-0.1, 0.1, 9) for at, _ in jumps)]))
    found = events(p, curve(p, jumps))
    assert len(found) == 2
    for event, (at, height) in zip(found, jumps, strict=True):
        assert event.before < at < event.after
        assert event.after - event.before < 0.3
        assert event.jump == pytest.approx(height, rel=0.1)


def test_small_jumps_are_left_out():
    p = np.linspace(0, 60, 300)
    assert events(p, curve(p, [(30.0, 0.5)])) == []


@pytest.mark.parametrize("count", [0, 1, 2])
def test_too_short_a_curve_has_no_events(count):
    assert events(np.arange(float(count)), np.arange(float(count))) == []


def test_nan_and_repeated_pressures_are_passed_over():
    p = np.array([0.0, 0.0, 1.0, 2.0, np.nan, 3.0, 4.0])
    assert events(p, p.copy()) == []


def test_the_largest_events_come_in_the_order_of_pressure():
    found = [Event(float(k), k + 0.1, jump) for k, jump in enumerate([5.0, *[1.0] * 12, -9.0])]
    largest = largest_events(found)
    assert len(largest) == 10
    assert {largest[0].jump, largest[-1].jump} == {5.0, -9.0}
    assert [e.before for e in largest] == sorted(e.before for e in largest)


def test_displacement_difference_is_over_the_length():
    assert displacement_difference(np.zeros((2, 3)), np.array([[3.0, 0, 4.0], [0, 0, 0]]), 100.0).tolist() == [0.05, 0.0]
