"""Surfaces of a device from the legs of a study."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from limo.beat.surface import JOINED, Surface, surface_of
from limo.errors import ResultError

P_V, P_A = np.array([0.0, 2.0, 5.0, 10.0, 20.0]), np.arange(0.0, 61.0, 1.0)


def study(apart: float = 0.0) -> xr.Dataset:
    """V_v = 100 + 60 sqrt(P_v) - P_a, V_a = 2 P_a - P_v; on the way down V_v is ``apart`` ml less between 20 and 40 kPa."""
    p_v, p_a = np.meshgrid(P_V, P_A, indexing="ij")
    ventricle, actuation = 100 + 60 * np.sqrt(p_v) - p_a, 2 * p_a - p_v
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


def test_volumes_of_the_study_are_met_and_none_lies_beyond_them():
    surface = surface_of(study())
    places = [np.flatnonzero(np.isclose(surface.places[0], p))[0] for p in P_V]
    np.testing.assert_allclose(surface.table[0, 0][places][:, ::2], surface.volumes[0, 0], atol=1e-9)
    assert (np.diff(surface.table[:, 0], axis=1) > 0).all(), "V_v rises with P_v"
    assert (np.diff(surface.table[:, 0], axis=2) < 0).all(), "and falls with P_a"


def test_leaving_a_pressure_out_tells_the_error_between_pressures():
    surface = surface_of(study())
    errors = surface.left_out()
    assert (errors["ventricle_loading"] > 1).all(), "a root of so few places is not met"
    np.testing.assert_allclose(errors["actuation_loading"], 0, atol=1e-9)
    middle = surface.table[0, 0][np.flatnonzero(np.isclose(surface.places[0], 7.5))[0], 0]
    assert abs(middle - (100 + 60 * np.sqrt(7.5))) < errors["ventricle_loading"].max()


def test_sheets_are_joined_where_they_are_apart_by_less_than_their_share():
    low, high = surface_of(study(apart=20.0)).joined
    assert (np.abs(low - 20) <= 1).all()
    assert (np.abs(high - 40) <= 1).all()
    one = surface_of(study(apart=0.5 * JOINED * 100))
    assert (one.joined == P_A[-1]).all()


def test_gradients_are_those_of_the_volumes():
    dataset = surface_of(study()).dataset()
    slope = dataset.actuation_volume_by_actuation_pressure
    np.testing.assert_allclose(slope, 2, atol=1e-9)
    np.testing.assert_allclose(dataset.actuation_volume_by_ventricular_pressure, -1, atol=1e-9)
    assert slope.attrs["units"] == "ml/kPa"


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


def test_a_surface_keeps_what_it_is_of():
    surface = surface_of(study())
    assert isinstance(surface, Surface)
    assert surface.device == "N_p = 8"
    assert surface.range == pytest.approx(60 * np.sqrt(20) + 60)
