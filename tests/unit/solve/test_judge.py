"""The judge on curves and states whose right answer is known on paper."""

import numpy as np
import pytest
import xarray as xr

from limo.schema.solver import Limits
from limo.solve.judge import Checks, energy_created, gave_way, largest_jump, unbelievable, verdict

GOOD = {
    "largest_displacement": 0.3, "smallest_volume_ratio": 0.9, "smallest_thickness": 0.95, "residual": 1e-3,
    "residual_floor": 0.0, "viscous_share": 1e-3,
    "dissipated_fraction": 0.1, "energy_created": 1e-3, "largest_jump": 0.02, "smallest_ventricle": 0.4,
}  # fmt: skip


def ramp(pressure, actuation, ventricle, energy):
    """A ramp with volumes in ml and energies in mJ."""
    columns = {
        "ventricle_volume": ventricle, "ventricle_volume_conjugate": ventricle, "actuation_volume": actuation,
        "actuation_volume_conjugate": actuation, "strain_energy": energy,
    }  # fmt: skip
    return xr.Dataset(
        {n: ("increment", np.asarray(v, float)) for n, v in columns.items()},
        coords={"actuation_pressure": ("increment", np.asarray(pressure, float))},
    )


def spring(n=61, compliance=2.0, ventricular=4.0):
    """A device whose pouches give way by ``compliance`` ml a kPa, which pushes as much out of the ventricle."""
    p = np.linspace(0, 60, n)
    v = compliance * p
    stored = compliance * p**2 / 2 - ventricular * v
    return p, v, 300 - v, stored


# --------------------------------------------------------------------------------------------------------------------
# energy


def test_an_elastic_device_creates_and_dissipates_nothing():
    p, actuation, ventricle, energy = spring()
    assert energy_created(ramp(p, actuation, ventricle, energy), 4.0) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(("released", "created"), [(200.0, 0.0), (-200.0, 200.0)])
def test_a_jump_that_releases_energy_is_a_snap_and_one_that_takes_it_is_wrong(released, created):
    p, actuation, ventricle, energy = spring()
    energy = energy - released * (p > 30)
    total = np.trapezoid(p, actuation)
    assert energy_created(ramp(p, actuation, ventricle, energy), 4.0) == pytest.approx(created / total, abs=1e-9)


def test_energy_is_watched_along_the_ramp_and_not_at_its_end():
    """What a path creates in its middle and loses again later is found, though the balance from end to end is closed."""
    p, actuation, ventricle, energy = spring()
    energy = energy + 300.0 * ((p > 20) & (p < 40))
    assert energy_created(ramp(p, actuation, ventricle, energy), 4.0) == pytest.approx(300 / np.trapezoid(p, actuation))


# --------------------------------------------------------------------------------------------------------------------
# continuity


def test_smooth_volumes_have_the_jumps_of_their_increments():
    p, actuation, ventricle, energy = spring()
    assert largest_jump(ramp(p, actuation, ventricle, energy)) == pytest.approx(2.0 / 300)


def test_a_buckling_event_is_no_discontinuity():
    p, actuation, ventricle, energy = spring()
    snapped = ramp(p, actuation + 90.0 * (p > 30), ventricle - 90.0 * (p > 30), energy)
    assert largest_jump(snapped) == pytest.approx(2.0 / 300)


def test_a_volume_that_leaps_everywhere_has_no_usual_slope_and_is_found():
    """Back and forth by a third of the ventricle: there is no event in it, because nothing in it is usual."""
    p, actuation, ventricle, energy = spring()
    leaping = ventricle + 100.0 * (np.arange(len(p)) % 2)
    assert largest_jump(ramp(p, actuation, leaping, energy)) > 0.3


# --------------------------------------------------------------------------------------------------------------------
# states and verdicts


@pytest.mark.parametrize(
    ("u", "ratio", "reason"),
    [
        (np.zeros((4, 3)), 1.0, ""),
        (np.full((4, 3), 419.0), 0.5, ""),
        (np.full((4, 3), 421.0), 1.0, "beyond 3 L"),
        (np.full((4, 3), np.nan), 1.0, "beyond 3 L"),
        (np.full((4, 3), -np.inf), 1.0, "beyond 3 L"),
        (np.full((4, 3), 1e11), np.nan, "beyond 3 L"),
        (np.zeros((4, 3)), 0.0, "inside out"),
        (np.zeros((4, 3)), -2.0, "inside out"),
        (np.zeros((4, 3)), np.nan, ""),
    ],
)
def test_states_that_no_device_can_be_in(u, ratio, reason):
    found = unbelievable(u, ratio, 140.0)
    assert (reason in found) if reason else (found == "")


@pytest.mark.parametrize(
    ("changes", "status", "reason"),
    [
        ({}, "converged", ""),
        ({"residual": 0.03}, "degraded", "residual 0.03 of the load (limit 0.02)"),
        ({"residual": 0.03, "residual_floor": 0.015}, "converged", ""),
        ({"residual": 0.3}, "diverged", "forces out of equilibrium by 0.3"),
        ({"residual": 0.3, "residual_floor": 0.29}, "converged", ""),
        ({"viscous_share": 0.2}, "degraded", "damping carries 0.2"),
        ({"dissipated_fraction": 0.7}, "degraded", "0.7 of the actuation work dissipated"),
        ({"energy_created": 0.2}, "degraded", "came from nowhere"),
        ({"largest_jump": 0.4}, "degraded", "without an event"),
        ({"smallest_volume_ratio": 0.4}, "degraded", "fabric keeps 0.4 of its volume somewhere (limit 0.5)"),
        ({"rested": False}, "degraded", "not come to rest"),
        ({"smallest_ventricle": -0.1}, "degraded", "front and back pass through each other"),
        ({"rested": False, "viscous_share": 0.2}, "degraded", "not come to rest at the end of the hold; damping"),
        ({"error": "2 elements turned inside out"}, "diverged", "inside out"),
        (dict.fromkeys(GOOD), "converged", ""),
    ],
)
def test_verdict_on_what_an_engine_calls_converged(changes, status, reason):
    found = verdict("converged", "", Checks(**(GOOD | changes)), Limits())
    assert found[0] == status
    assert reason in found[1]
    assert (found[1] == "") == (status == "converged")


@pytest.mark.parametrize("status", ["diverged", "timed_out", "crashed"])
def test_what_an_engine_calls_a_failure_stays_one(status):
    assert verdict(status, "why", Checks(**GOOD), Limits()) == (status, "why")


@pytest.mark.parametrize(
    ("status", "thickness", "said"), [("diverged", 0.3, True), ("diverged", 0.6, False), ("crashed", 0.3, False)]
)
def test_a_path_that_ended_with_its_fabric_says_so(status, thickness, said):
    """C_33 = 1 - 2 nu / (1 - nu) (E_11 + E_22): no step size gets past its zero."""
    assert gave_way(status, thickness) == said
    found = verdict(status, "why", Checks(**(GOOD | {"smallest_thickness": thickness})), Limits())
    assert found[0] == status
    assert found[1] == ("the fabric has thinned to 0.3 of its thickness, where its law gives way (why)" if said else "why")


def test_limits_are_the_configurations():
    assert verdict("converged", "", Checks(**GOOD), Limits(viscous_share=1e-4))[0] == "degraded"
    assert verdict("converged", "", Checks(**(GOOD | {"viscous_share": 0.9})), Limits(viscous_share=1.0))[0] == "converged"
