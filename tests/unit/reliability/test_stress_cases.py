"""The cases of a stress test: inside their boxes, spread over them, and the same for the same seed."""

import numpy as np
import pytest

from limo.geometry.pattern import flat_pattern
from limo.reliability.stress_cases import LOGARITHMIC, corners, sample, stress_cases
from limo.schema.reliability import BOX_AXES


@pytest.fixture
def test(loaded):
    return loaded.config.stress_test


def test_corners_are_sixteen_and_their_main_effects_are_clear():
    """Each axis is high as often as low, also among those where any other one, or any pair of others, is high."""
    signs = 2 * corners() - 1
    assert len(np.unique(signs, axis=0)) == 16
    np.testing.assert_array_equal(signs.T @ signs, 16 * np.eye(7))
    for i in range(7):
        for j in range(i + 1, 7):
            product = (signs[:, i] * signs[:, j])[:, None]
            assert (np.abs((product * signs).sum(axis=0)) == 0).all(), "resolution IV"


@pytest.mark.parametrize("box", ["paper", "whole"])
def test_samples_lie_in_their_box_and_fill_every_layer_of_it(test, box):
    ranges = test.boxes[box]
    points = sample(ranges, test.seed)
    assert len(points) == ranges.samples + ranges.corners
    assert points == sample(ranges, test.seed)
    assert points != sample(ranges, test.seed + 1)
    for name in BOX_AXES:
        low, high = getattr(ranges, name)
        values = np.array([p[name] for p in points[: ranges.samples]])
        assert (values >= low * 0.999).all()
        assert (values <= high * 1.001).all()
        if name != "n_pouches" and high > low:
            scaled = np.log(values / low) / np.log(high / low) if name in LOGARITHMIC else (values - low) / (high - low)
            layers = np.clip((scaled * ranges.samples).astype(int), 0, ranges.samples - 1)
            assert len(np.unique(layers)) > 0.9 * ranges.samples, name


def test_the_shipped_stress_test_is_what_it_should_be(test):
    whole = test.boxes["whole"]
    assert whole.samples >= 60
    assert (whole.n_pouches, whole.ventricular_pressure, whole.aspect_ratio) == ((2, 12), (0, 30), (1, 4))
    assert (whole.stiffness_ratio, whole.thickness) == ((0.1, 4), (0.05, 0.5))
    assert (whole.modulus_factor, whole.width_scale) == ((0.1, 10), (0.8, 1.2))


def test_every_case_can_be_cut_and_has_a_name_of_its_own(loaded):
    cases = stress_cases(loaded)
    assert len({c.case_id for c in cases.values()}) == len(cases)
    for case in cases.values():
        flat_pattern(case.device.pattern, case.n_pouches)
        density = case.device.material.areal_density / case.device.material.thickness
        assert density == pytest.approx(170.0 / 0.19)
        assert case.actuation_pressure_max > case.ventricular_pressure
