"""A figure of a thousand cases draws what can be told apart, and says what it leaves out."""

import numpy as np
import pytest
import xarray as xr

from limo.figures import pressure_volume, style


def study_of(count: int) -> xr.Dataset:
    """A dataset of so many cases with straight curves."""
    pressure = np.linspace(0.0, 60.0, 7)
    dims = ("n_pouches", "ventricular_pressure")
    curve = np.broadcast_to(pressure, (1, count, len(pressure)))
    names = ("actuation_volume_change", "stroke_volume", "io_ratio")
    return xr.Dataset(
        {name: ((*dims, "actuation_pressure"), curve) for name in names}
        | {
            "case_status": (dims, np.full((1, count), "converged")),
            "actuation_pressure_reached": (dims, np.full((1, count), 60.0)),
        },
        {"n_pouches": [8], "ventricular_pressure": np.linspace(1.0, 20.0, count), "actuation_pressure": pressure},
    )


@pytest.mark.parametrize(("count", "drawn"), [(3, 3), (40, 40), (1000, 40)])
def test_at_most_forty_cases_are_drawn_and_the_rest_is_said(count, drawn):
    figure = pressure_volume.draw(study_of(count))
    stroke = figure.axes[1]
    labelled = stroke.get_legend_handles_labels()[1]
    assert len(labelled) == drawn
    assert stroke.get_title() == ("" if count == drawn else f"{drawn} of {count} cases are shown")
    style.close(figure)
