"""Legs and closed cycles of a load, their energies, and what a cycle does to a fabric."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import xarray as xr

from limo.measure.cycles import closed_cycles, cycles_of_syringe, distance, leg_curves, leg_energies, legs_of, syringe_curves
from limo.measure.fatigue import cycles_to_failure, strain_amplitude, strain_cycle
from limo.schema.fatigue import Fatigue, Parameter

P_V, STIFFNESS = 10.0, 0.5  # kPa; kPa/ml of a spring that P_a presses on


def sprung(pressures: list[float], jump: float = 0.0) -> xr.Dataset:
    """History of a spring V_a = P_a / k that P_a presses on, beside P_v on a volume that stays; on the way down V_a is more by
    ``jump`` ml between 20 and 40 kPa, as after a snap."""
    legs, rows = np.concatenate([[0], np.repeat(np.arange(len(pressures) - 1), 101)]), [0.0]
    for a, b in itertools.pairwise(pressures):
        rows.extend(np.linspace(a, b, 101))
    p = np.array(rows)
    down = np.r_[0, np.diff(p)] < 0
    volume = p / STIFFNESS + jump * (down & (p > 20) & (p < 40))
    stored = 0.5 * p**2 / STIFFNESS
    names = ("ventricle_volume", "ventricle_volume_conjugate")
    return xr.Dataset(
        {n: ("increment", 300.0 - 0 * p) for n in names}
        | {n: ("increment", volume) for n in ("actuation_volume", "actuation_volume_conjugate")}
        | {
            "strain_energy": ("increment", stored),
            "leg": ("increment", legs),
            "ventricular_pressure": ("increment", P_V + 0 * p),
        },
        coords={
            "actuation_pressure": ("increment", p),
            "stage": ("increment", np.r_[1, np.where(legs[1:] == 0, 2, 3)]),
        },
    )


def test_a_spring_takes_no_energy_and_comes_back():
    legs = legs_of(sprung([0.0, 60.0, 0.0]))
    energies = np.array([leg_energies(leg, P_V) for leg in legs])
    work = 0.5 * 60**2 / STIFFNESS
    np.testing.assert_allclose(energies[:, 0], [work, -work])
    np.testing.assert_allclose(energies[:, 2], 0, atol=1e-9 * work)
    pressures = np.array([0.0, 30.0, 60.0])
    for leg in legs:
        np.testing.assert_allclose(leg_curves(leg, pressures)[1], pressures / STIFFNESS)


def test_a_leg_by_volume_has_its_pressure_where_that_falls():
    """On the way there P_a falls by 20 kPa in a snap; beyond V_a of the leg there is nothing."""
    held = np.linspace(2.0, 82.0, 41)
    pressure = held - 20.0 * (held > 41)
    leg = xr.Dataset(
        {"actuation_volume_conjugate": ("increment", held), "ventricle_volume": ("increment", 300 - held)},
        coords={"actuation_pressure": ("increment", pressure)},
    )
    for one in (leg, leg.isel(increment=slice(None, None, -1))):
        found, ventricle = syringe_curves(one, np.array([0.0, 10.0, 70.0, 90.0]))
        np.testing.assert_allclose(found, [np.nan, 10.0, 50.0, np.nan])
        np.testing.assert_allclose(ventricle, [np.nan, 290.0, 230.0, np.nan])


def test_cycles_of_a_syringe_begin_behind_the_ramp():
    assert cycles_of_syringe((80.0, None, 80.0, None)) == [(1, 2), (3, 4)]
    assert cycles_of_syringe((80.0, 40.0)) == []


def test_the_loop_of_a_snap_has_the_area_that_is_taken():
    legs = legs_of(sprung([0.0, 60.0, 0.0], jump=7.0))
    total = np.sum([leg_energies(leg, P_V) for leg in legs], axis=0)
    # at the ends of a leg, half a step of 0.6 kPa belongs to the jump
    assert total[0] == pytest.approx(7.0 * 20.0, rel=0.05)
    assert total[2] == pytest.approx(total[0])


def test_cycles_that_close_are_found_from_the_points_of_the_load():
    pv = 5.0
    assert closed_cycles([(pv, 0), (pv, 60), (pv, 0), (pv, 60), (pv, 0)]) == [(0, 1), (2, 3)]
    assert closed_cycles([(pv, 0), (pv, 60), (9.0, 60), (9.0, 0), (pv, 0)]) == [(0, 3)]
    assert closed_cycles([(pv, 0), (pv, 60)]) == []


def test_curves_are_compared_where_both_are():
    nan = float("nan")
    assert distance(np.array([1.1, nan, 3.0]), np.array([1.0, 2.0, nan])) == pytest.approx(0.1)
    assert np.isnan(distance(np.array([nan]), np.array([1.0])))


# --------------------------------------------------------------------------------------------------------------------
# strain


@pytest.mark.parametrize("angle", [0.0, 20.0, -65.0])
def test_a_pull_back_and_forth_is_found_in_its_direction(angle):
    c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    along = np.array([c * c, s * s, c * s])
    found = strain_cycle(np.outer([0.0, 0.03, 0.01], along)[:, None], 200.0 * np.outer([0.0, 0.03, 0.01], along)[:, None])
    assert found.angle[0] == pytest.approx(angle)
    np.testing.assert_allclose([found.amplitude[0], found.mean[0]], [0.015, 0.015])
    np.testing.assert_allclose([found.mean_stress[0], found.largest_stress[0]], [3.0, 6.0])


def test_between_the_directions_that_are_looked_at_an_amplitude_is_hardly_less():
    angle = np.radians(22.5)
    c, s = np.cos(angle), np.sin(angle)
    found = strain_cycle(np.outer([-0.01, 0.03], [c * c, s * s, c * s])[:, None], np.zeros((2, 1, 3)))
    assert 0.996 * 0.02 < found.amplitude[0] < 0.02


def test_a_strain_that_turns_has_a_range_where_its_largest_has_none():
    """The largest principal strain stays; every direction is stretched and released."""
    angle = np.radians(np.arange(0, 180, 5.0))
    c, s = np.cos(angle), np.sin(angle)
    found = strain_cycle((0.02 * np.array([c * c, s * s, c * s]).T)[:, None], np.zeros((len(angle), 1, 3)))
    assert found.amplitude[0] == pytest.approx(0.01)


# --------------------------------------------------------------------------------------------------------------------
# life


@pytest.mark.parametrize("life", [3.0, 200.0, 1e5])
def test_without_a_mean_all_corrections_say_the_same(life):
    """Fully reversed, the largest stress is that of the elastic branch: sigma_f' (2 N)^b."""
    fatigue = Fatigue()
    amplitude = sum(strain_amplitude(np.array([life]), fatigue))
    stress = fatigue.strength_coefficient.value * (2 * np.array([life])) ** fatigue.strength_exponent.value
    for correction in ("none", "morrow", "smith_watson_topper"):
        cycles, flags = cycles_to_failure(amplitude, fatigue, correction, 0 * stress, stress)
        assert flags[0] == 0
        assert cycles[0] == pytest.approx(life, rel=1e-8)


def test_morrow_takes_the_mean_from_the_strength():
    fatigue, mean, life = Fatigue(), 20.0, np.array([50.0, 5000.0])
    left = fatigue.strength_coefficient.value - mean
    weaker = fatigue.model_copy(update={"strength_coefficient": Parameter(value=left, origin="what is left")})
    amplitude = sum(strain_amplitude(life, weaker))
    cycles, _ = cycles_to_failure(amplitude, fatigue, "morrow", np.full(2, mean))
    np.testing.assert_allclose(cycles, life, rtol=1e-8)
    pressed, _ = cycles_to_failure(amplitude, fatigue, "morrow", np.full(2, -mean))
    np.testing.assert_allclose(pressed, cycles_to_failure(amplitude, fatigue)[0])


def test_a_mean_beyond_the_strength_and_a_cycle_in_compression_are_ends():
    fatigue = Fatigue()
    cycles, flags = cycles_to_failure(np.array([2.0]), fatigue, "morrow", np.array([1e4]))
    assert (cycles[0], flags[0]) == (1.0, 2)
    cycles, flags = cycles_to_failure(np.array([0.02]), fatigue, "smith_watson_topper", np.array([-9.0]), np.array([-1.0]))
    assert np.isnan(cycles[0])
    assert flags[0] == 3
