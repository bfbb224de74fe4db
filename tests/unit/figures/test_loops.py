"""The figure of the legs of a cycle."""

import numpy as np
import pytest
import xarray as xr

from limo.figures import loops, style


@pytest.fixture
def cycled() -> xr.Dataset:
    """Two devices, up, down, up, down; on the way down 5 ml more."""
    pressure = np.linspace(0.0, 60.0, 7)
    dims, shape = ("n_pouches", "ventricular_pressure"), (2, 1)
    volume = 300 - pressure + 5 * (np.arange(4) % 2)[:, None] + np.zeros((*shape, 4, 7))
    ends = np.broadcast_to([60.0, 0.0, 60.0, 0.0], (*shape, 4))
    return xr.Dataset(
        {
            "leg_ventricle_volume": ((*dims, "leg", "actuation_pressure"), volume),
            "leg_actuation_volume": ((*dims, "leg", "actuation_pressure"), 300 - volume),
            "leg_actuation_pressure": ((*dims, "leg"), ends),
            "case_status": (dims, np.full(shape, "converged")),
            "case_reason": (dims, np.full(shape, "")),
            "case_id": (dims, np.full(shape, "a")),
            "actuation_pressure_reached": (dims, np.full(shape, 60.0)),
        },
        {"n_pouches": [6, 8], "ventricular_pressure": [3.8], "leg": np.arange(4), "actuation_pressure": pressure},
    )


def test_every_leg_is_drawn_by_the_way_that_it_goes(cycled):
    figure = loops.draw(cycled)
    ventricle, pouches = figure.axes
    lines = ventricle.get_lines()
    assert [line.get_linestyle() for line in lines] == ["-", "--", "-", "--"] * 2
    assert len({line.get_color() for line in lines if line.get_linewidth() > 1}) == 2
    np.testing.assert_allclose(lines[1].get_ydata(), 305 - cycled.actuation_pressure)
    np.testing.assert_allclose(pouches.get_lines()[0].get_ydata(), cycled.actuation_pressure)
    style.close(figure)


def test_a_syringe_has_pressure_over_volume(cycled):
    volume = np.linspace(0.0, 80.0, 9)
    driven = cycled.isel(leg=slice(0, 3)).assign_coords(given_volume=volume)
    driven["leg_actuation_pressure"] = ("leg", [0.0, 30.0, 0.0])
    dims = ("n_pouches", "ventricular_pressure", "leg", "given_volume")
    legs = np.array([np.nan, 1.0, 0.5])[:, None] * volume
    driven["leg_pressure_of_volume"] = (dims, np.broadcast_to(legs, (2, 1, 3, 9)))
    driven["leg_ventricle_of_volume"] = (dims, np.broadcast_to(300 - legs, (2, 1, 3, 9)))
    driven["leg_actuation_pressure"] = driven.leg_actuation_pressure.expand_dims(n_pouches=2, ventricular_pressure=1)
    figure = loops.draw(driven)
    ventricle, pressure = figure.axes
    assert [line.get_linestyle() for line in ventricle.get_lines()] == ["-", "--"] * 2
    np.testing.assert_allclose(pressure.get_lines()[1].get_ydata(), 0.5 * volume)
    assert pressure.get_xlabel() == "$V_a$ [ml]"
    style.close(figure)


def test_a_leg_that_was_not_reached_is_not_drawn(cycled):
    cycled.leg_ventricle_volume[:, :, 2:] = np.nan
    figure = loops.draw(cycled)
    assert len(figure.axes[0].get_lines()) == 4
    style.close(figure)
