"""The strain-life curve and its inversion."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from limo.measure.fatigue import ENDURANCE, FINITE, IMMEDIATE, NO_STRAIN, cycles_to_failure, largest_amplitude, strain_amplitude
from limo.schema.fatigue import Fatigue, Parameter

FAR = Fatigue(endurance_cycles=Parameter(value=1e12, origin="as far as the root find is specified"))


def total(cycles, fatigue=FAR):
    return sum(strain_amplitude(cycles, fatigue))


def test_elastic_and_plastic_branch_at_half_a_cycle_are_their_coefficients():
    elastic, plastic = strain_amplitude(np.array(0.5), FAR)
    assert elastic == pytest.approx(FAR.strength_coefficient.value / FAR.youngs_modulus.value)
    assert plastic == pytest.approx(FAR.ductility_coefficient.value)


def test_plastic_branch_lies_below_the_elastic_one_as_the_paper_asks():
    elastic, plastic = strain_amplitude(np.logspace(0, 2, 50), Fatigue())
    assert (plastic < elastic).all()


def test_elastic_branch_alone_inverts_in_closed_form():
    """With a vanishing plastic branch N = (eps E / sigma_f')^(1/b) / 2."""
    fatigue = FAR.model_copy(update={"ductility_coefficient": Parameter(value=1e-30, origin="none")})
    strain = np.array([0.3, 0.1, 0.01])
    ratio = strain * fatigue.youngs_modulus.value / fatigue.strength_coefficient.value
    cycles, flags = cycles_to_failure(strain, fatigue)
    np.testing.assert_allclose(np.log(cycles), np.log(0.5 * ratio ** (1 / fatigue.strength_exponent.value)), atol=1e-10)
    assert (flags == FINITE).all()


def test_round_trip_over_twelve_decades():
    log_cycles = np.linspace(np.log(1.000001), np.log(0.999999e12), 20001)
    cycles, flags = cycles_to_failure(total(np.exp(log_cycles)), FAR)
    assert (flags == FINITE).all()
    assert np.abs(np.log(cycles) - log_cycles).max() < 1e-10


@settings(max_examples=60, deadline=None)
@given(
    log_cycles=st.floats(0.01, 27.6),
    ratio=st.floats(0.05, 5.0),
    b=st.floats(-0.5, -0.03),
    ductility=st.floats(0.01, 5.0),
    c=st.floats(-1.5, -0.2),
)
def test_round_trip_for_other_materials(log_cycles, ratio, b, ductility, c):
    def p(value):
        return Parameter(value=value, origin="test")

    fatigue = FAR.model_copy(
        update={
            "youngs_modulus": p(100.0), "strength_coefficient": p(100.0 * ratio), "strength_exponent": p(b),
            "ductility_coefficient": p(ductility), "ductility_exponent": p(c),
        }
    )  # fmt: skip
    cycles, _ = cycles_to_failure(total(np.exp(log_cycles), fatigue)[None], fatigue)
    assert np.log(cycles[0]) == pytest.approx(log_cycles, abs=1e-10)


def test_more_strain_is_fewer_cycles():
    cycles, _ = cycles_to_failure(np.linspace(0.005, 0.4, 200), FAR)
    assert (np.diff(cycles[np.isfinite(cycles)]) < 0).all()


def test_what_is_beyond_the_curve_is_flagged_and_not_invented():
    fatigue = Fatigue()
    limit, first = total(fatigue.endurance_cycles.value, fatigue), total(1.0, fatigue)
    cycles, flags = cycles_to_failure(np.array([[limit * 0.999, limit, first * 1.001], [0.0, -0.1, np.nan]]), fatigue)
    assert flags.tolist() == [[ENDURANCE, ENDURANCE, IMMEDIATE], [NO_STRAIN] * 3]
    assert cycles[0, 2] == 1.0
    assert np.isnan(np.delete(cycles.ravel(), 2)).all()


def test_amplitude_is_the_largest_reached():
    assert largest_amplitude(np.array([[0.1, 0.3], [0.2, -0.1]])).tolist() == [0.2, 0.3]


@pytest.mark.parametrize(
    ("key", "value"),
    [("youngs_modulus", 0.0), ("strength_exponent", 0.1), ("ductility_exponent", -3.0), ("endurance_cycles", 1e13)],
)
def test_parameters_out_of_range_are_refused(key, value):
    with pytest.raises(ValidationError, match="value"):
        Fatigue.model_validate({key: {"value": value, "origin": "test"}})


def test_a_parameter_without_an_origin_is_refused():
    with pytest.raises(ValidationError, match="origin"):
        Fatigue.model_validate({"youngs_modulus": {"value": 100.0}})
