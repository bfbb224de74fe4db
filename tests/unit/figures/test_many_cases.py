"""A figure of a thousand cases draws what can be told apart, and says what it leaves out."""

import numpy as np
import pytest
import xarray as xr

from limo.figures import pictures, pressure_volume, style
from limo.schema.figures import MOST_CASES, shown_places


def study_of(count: int, branches: int = 1) -> xr.Dataset:
    """A dataset of so many cases with straight curves."""
    pressure = np.linspace(0.0, 60.0, 7)
    dims = ("n_pouches", "ventricular_pressure", "branch")
    shape = (4, count // 4, branches)
    curve = np.broadcast_to(pressure, (*shape, len(pressure)))
    names = ("actuation_volume_change", "stroke_volume", "io_ratio")
    return xr.Dataset(
        {name: ((*dims, "actuation_pressure"), curve) for name in names}
        | {
            "case_status": (dims, np.full(shape, "converged")),
            "case_id": (dims, np.full(shape, "one")),
            "case_reason": (dims, np.full(shape, "")),
            "actuation_pressure_reached": (dims, np.full(shape, 60.0)),
        },
        {
            "n_pouches": [4, 6, 8, 10],
            "ventricular_pressure": np.linspace(1.0, 20.0, count // 4),
            "branch": range(branches),
            "actuation_pressure": pressure,
        },
    )


@pytest.mark.parametrize(("count", "branches", "drawn"), [(4, 1, 4), (40, 5, 40), (1000, 1, 40), (1000, 3, 40)])
def test_at_most_forty_cases_are_drawn_and_the_rest_is_said(count, branches, drawn):
    shown, note = style.shown_cases(study_of(count, branches))
    figure = pressure_volume.draw(shown)
    style.note_above(figure, note)
    assert len(figure.axes[1].get_legend_handles_labels()[1]) == drawn
    title = figure.get_suptitle()
    assert title == ("" if count == drawn else f"{drawn} of {count} cases are shown, evenly chosen")
    style.close(figure)


@pytest.mark.parametrize(
    "sizes", [{"a": 4, "b": 250}, {"a": 41}, {"a": 7, "b": 7, "c": 7, "branch": 9}, {"a": 1, "b": 40}, {"a": 11, "b": 11}, {}]
)
def test_evenly_spread_places_with_both_ends(sizes):
    found = shown_places(sizes)
    count = int(np.prod([len(places) for name, places in found.items() if name != "branch"]))
    whole = int(np.prod([n for name, n in sizes.items() if name != "branch"]))
    assert min(whole, MOST_CASES) * 0.6 <= count <= MOST_CASES
    for name, places in found.items():
        assert places[0] == 0
        assert places[-1] == sizes[name] - 1
        steps = np.diff(places)
        assert not len(steps) or max(steps) - min(steps) <= 1
    assert len(found.get("branch", [])) == sizes.get("branch", 0)


def test_a_note_above_pictures_covers_none_of_them():
    figure, axes = pictures.picture_figure(2, 3, pictures.Grid())
    before = [axis.get_window_extent().bounds for axis in axes.flat]
    style.note_above(figure, "40 of 1000 cases are shown")
    for axis, (x, y, wide, tall) in zip(axes.flat, before, strict=True):
        assert axis.get_window_extent().bounds == pytest.approx((x, y, wide, tall))
    (note,) = figure.texts
    assert note.get_window_extent().y0 > max(y + tall for _, y, _, tall in before)
    style.close(figure)
