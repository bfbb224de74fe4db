"""Surfaces of a device from the legs of a study."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from limo.beat.surface import Surface, read_surfaces, surface_of, write_surfaces
from limo.errors import ResultError

P_V, P_A = np.array([0.0, 2.0, 5.0, 10.0, 20.0]), np.arange(0.0, 61.0, 1.0)


def study(apart: float = 0.0) -> xr.Dataset:
    """V_v = 100 + 60 sqrt(P_v) - P_a, V_a = 3 P_a - P_v, which have a potential; on the way down V_v is ``apart`` ml less between
    20 and 40 kPa."""
    p_v, p_a = np.meshgrid(P_V, P_A, indexing="ij")
    ventricle, actuation = 100 + 60 * np.sqrt(p_v) - p_a, 3 * p_a - p_v
    back = ventricle - apart * ((p_a > 20) & (p_a < 40))
    dims = ("n_pouches", "ventricular_pressure", "leg", "actuation_pressure")
    return xr.Dataset(
        {
            "leg_ventricle_volume": (dims, np.stack([ventricle, back], axis=1)[None]),
            "leg_actuation_volume": (dims, np.stack([actuation, actuation], axis=1)[None]),
            "case_status": (dims[:2], np.full((1, len(P_V)), "converged")),
        },
        {"n_pouches": [8], "ventricular_pressure": P_V, "leg": [0, 1], "actuation_pressure": P_A},
    )


@pytest.fixture(scope="module")
def smooth() -> Surface:
    return surface_of(study())


def test_volumes_of_a_device_with_a_potential_are_met_and_monotone(smooth):
    assert np.abs(smooth.misfit()).max() < 1.0
    assert (np.diff(smooth.table[:, 0], axis=1) > 0).all(), "V_v rises with P_v"
    assert (np.diff(smooth.table[:, 0], axis=2) < 0).all(), "and falls with P_a"
    assert (np.diff(smooth.table[:, 1], axis=2) > 0).all(), "V_a rises with P_a"


def test_volumes_without_a_potential_are_missed_and_one_is_given():
    """V_v that P_a does not change, beside V_a that P_v changes: no device is so."""
    dataset = study()
    dataset["leg_ventricle_volume"] = dataset.leg_ventricle_volume + dataset.actuation_pressure
    surface = surface_of(dataset)
    assert np.abs(surface.misfit()).max() > 3
    first, *_ = surface.potentials
    v, a = first.volumes(np.array([4.0, 4.001]), np.array([30.0, 30.001]))
    by_actuation, by_ventricular = (v[0, 1] - v[0, 0]) / 1e-3, (a[1, 0] - a[0, 0]) / 1e-3
    assert by_actuation == pytest.approx(by_ventricular, rel=1e-3)


def test_leaving_a_pressure_out_tells_the_error_between_pressures(smooth):
    errors = smooth.left_out()
    assert (errors["ventricle_loading"] > 1).all(), "a root of so few places is not met"
    np.testing.assert_allclose(errors["actuation_loading"], 0, atol=1e-9)
    middle = smooth.table[0, 0][np.flatnonzero(np.isclose(smooth.places[0], 7.5))[0], 0]
    assert abs(middle - (100 + 60 * np.sqrt(7.5))) < errors["ventricle_loading"].max()


def test_sheets_are_joined_where_they_are_apart_by_less_than_their_share(smooth):
    low, high = surface_of(study(apart=20.0)).joined
    assert (low <= 20).all()
    assert (high >= 40).all()
    assert (smooth.joined == P_A[-1]).all()


def test_the_device_is_stable_at_every_place_of_the_table(smooth):
    slopes = smooth.slopes()
    a, b, d = (
        slopes[n].values
        for n in (
            "ventricle_volume_by_ventricular_pressure",
            "ventricle_volume_by_actuation_pressure",
            "actuation_volume_by_actuation_pressure",
        )
    )
    assert (a * d - b * b > 0).all()


def test_full_pouches_are_not_filled_further(smooth):
    """V_a that gives way by no more than 0.12 ml/kPa at high P_a, as of a device, is met: a floor above that would add air."""
    dataset = study()
    shape = 60 * (1 - np.exp(-P_A / 12)) + 0.12 * P_A
    dataset["leg_actuation_volume"] = dataset.leg_actuation_volume * 0 + xr.DataArray(shape, dims="actuation_pressure")
    dataset["leg_ventricle_volume"] = dataset.leg_ventricle_volume.isel(actuation_pressure=0) - 0 * dataset.leg_actuation_volume
    missed = surface_of(dataset).misfit()[0, 1]
    assert np.abs(missed[:, P_A > 40]).max() < 0.7


def test_kept_surfaces_are_the_same(smooth, tmp_path):
    write_surfaces({8: smooth}, tmp_path / "surfaces.nc")
    again = read_surfaces(tmp_path / "surfaces.nc")[8]
    write_surfaces({8: smooth}, tmp_path / "kept.nc", kept=True)
    kept = read_surfaces(tmp_path / "kept.nc")[8]
    for k in range(1, len(P_V) - 1):
        np.testing.assert_allclose(kept.without(k).table, smooth.without(k).table, atol=1e-9)
        assert kept.without(k).known is not None
    np.testing.assert_allclose(again.table, smooth.table, atol=1e-9)
    np.testing.assert_allclose(again.volumes, smooth.volumes, rtol=1e-6)
    with pytest.raises(ResultError, match="no surfaces"):
        read_surfaces(tmp_path / "other.nc")


def test_slopes_are_those_of_the_volumes(smooth):
    slopes = smooth.slopes()
    np.testing.assert_allclose(slopes.actuation_volume_by_actuation_pressure, 3, atol=0.1)
    np.testing.assert_allclose(slopes.actuation_volume_by_ventricular_pressure, -1, atol=0.3)
    assert slopes.actuation_volume_by_actuation_pressure.attrs["units"] == "ml/kPa"


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (lambda d: d.isel(leg=[0]), "actuation:"),
        (lambda d: d.isel(ventricular_pressure=slice(3)), "needs 4"),
        (lambda d: d.assign(case_status=d.case_status.where(d.ventricular_pressure != 5, "failed")), "P_v = 5 kPa"),
        (lambda d: d.assign(leg_ventricle_volume=d.leg_ventricle_volume.where(d.ventricular_pressure != 2)), "P_v = 2 kPa"),
        (lambda d: d.assign_coords(n_pouches=[6]), "one of 6"),
    ],
    ids=["no way back", "few", "failed", "broken off", "another device"],
)
def test_a_study_that_gives_no_surface_says_what_it_lacks(change, expected):
    with pytest.raises(ResultError, match=expected):
        surface_of(change(study()), 8)


def test_a_surface_keeps_what_it_is_of(smooth):
    assert smooth.device == "N_p = 8"
    assert smooth.range == pytest.approx(60 * np.sqrt(20) + 60)
