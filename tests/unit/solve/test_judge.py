"""The judge on curves and states whose right answer is known on paper."""

import numpy as np
import pytest
import xarray as xr

from limo.mechanics.build import build_model
from limo.mechanics.volumes import volumes
from limo.mesh.layers import LAYERS
from limo.schema.solver import Limits
from limo.solve.judge import (
    Checks,
    energy_created,
    gave_way,
    largest_jump,
    layers_passed,
    pouch_volumes,
    remarks,
    unbelievable,
    verdict,
)
from tests.helpers.cases import small_mesh

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


# --------------------------------------------------------------------------------------------------------------------
# states that lock, and what is not physical


@pytest.mark.parametrize(
    ("share", "elements", "status", "remarked"),
    [
        (0.52, 4.6, "degraded", False),
        (0.3, 4.6, "converged", True),
        (0.1, 4.6, "converged", False),
        (0.52, 6.4, "converged", False),
    ],
)
def test_a_state_that_locks_is_degraded_and_a_coarse_one_is_remarked(share, elements, status, remarked):
    """Shares of the device at N_p = 10 straight up and N_p = 4 on `preview`, of a fine mesh, and of fabric that is thick."""
    checks = Checks(**GOOD, compression_share=share, elements_a_wrinkle=elements)
    said, reason = verdict("converged", "", checks, Limits())
    assert said == status
    assert ("52%" in reason and "fit_via" in reason) == (status == "degraded")
    assert [text.split(":")[0] for text in remarks(checks, Limits())] == ["coarse for its wrinkles"] * remarked


@pytest.mark.parametrize(("below", "status"), [(0.037, "converged"), (0.19, "degraded")])
def test_a_pouch_sheet_on_the_wrong_side_is_named_and_degraded_where_that_is_gross(below, status):
    checks = Checks(**GOOD, actuation_at_rest=-33.1, actuation_below=below, actuation_below_range=0.08)
    said, reason = verdict("converged", "", checks, Limits())
    named = remarks(checks, Limits())
    assert said == status
    assert ("-33.1 ml" in reason, len(named)) == ((True, 0) if status == "degraded" else (False, 1))


def test_layers_that_pass_each_other_are_named_and_degraded_where_contact_should_keep_them_apart():
    passed = {"endo_epi_passed": 0.3, "front_back_passed": 0.005}
    free, held = Checks(**GOOD, **passed), Checks(**GOOD, **passed, in_contact=("front_back", "endo_epi"))
    assert verdict("converged", "", free, Limits())[0] == "converged"
    assert remarks(free, Limits()) == [
        "endocardium and epicardium pass each other: on 30% of their area, without contact between them"
    ]
    status, reason = verdict("converged", "", held, Limits())
    assert (status, remarks(held, Limits())) == ("degraded", [])
    assert "endocardium and epicardium pass each other in spite of contact" in reason
    assert "front and back" not in reason


@pytest.mark.parametrize(("smallest", "count"), [(0.2, 0), (0.03, 1), (-0.1, 0)])
def test_a_ventricle_that_is_nearly_empty_is_named(smallest, count):
    assert len(remarks(Checks(**GOOD | {"smallest_ventricle": smallest}), Limits())) == count


def test_the_states_of_a_device_are_measured(make_case):
    """A device whose epicardium is pressed through its endocardium, and as it should be: V_a and the layers say so."""
    case = make_case()
    model = build_model(case, small_mesh(case, 9000, "quarter"))
    mesh = model.mesh
    rest = mesh.nodes + [0.0, 0.0, 1.0] * np.where(mesh.on_outer, 0.0, 5.0)[:, None]
    epi = np.unique(mesh.quads[mesh.layer == LAYERS.index("epi")])
    epi = epi[~mesh.on_seam[epi]]
    found = {}
    for name, height in (("right", 3.0), ("wrong", -3.0)):
        places = rest.copy()
        places[epi, 2] += height
        vv, va = volumes(mesh, places)
        path = xr.Dataset(
            {"ventricle_volume": ("increment", [vv / 1e3] * 3), "actuation_volume": ("increment", [va / 1e3, va / 2e3, 5.0])},
            coords={"actuation_pressure": ("increment", [0.0, 5.0, 10.0])},
        )
        found[name] = pouch_volumes(model, path) | layers_passed(model, [places, rest])
    right, wrong = found["right"], found["wrong"]
    assert right["actuation_below"] == right["actuation_below_range"] == right["endo_epi_passed"] == 0.0
    assert wrong["actuation_below"] > 0.01
    assert wrong["actuation_below_range"] == 0.5
    assert wrong["endo_epi_passed"] > 0.3
    assert right["front_back_passed"] == wrong["front_back_passed"] == 0.0
    assert right["in_contact"] == ()
    sunk = layers_passed(model, [rest * [1, 1, -1]])
    assert sunk["front_back_passed"] > 0.8
