"""A figure of numbers over the axis that a study varies."""

import numpy as np
import pytest
import xarray as xr

from limo.figures import style, trends


def study_of(along: str, values: list[float]) -> xr.Dataset:
    """Two branches of two devices; the second branch rests lower, and its stroke is 20 ml larger."""
    pressure = np.linspace(0.0, 60.0, 7)
    dims, shape = ("n_pouches", along, "branch"), (2, len(values), 2)
    stroke = 100.0 + np.arange(2)[:, None, None] * 10 + np.asarray(values)[None, :, None] + 20 * np.arange(2)
    curve = stroke[..., None] * pressure / 60
    rest = np.broadcast_to(-np.arange(2.0), shape)[..., None] + 0 * pressure
    return xr.Dataset(
        {
            "stroke_volume": ((*dims, "actuation_pressure"), curve),
            "ventricle_volume": ((*dims, "actuation_pressure"), 300 - curve),
            "io_ratio": ((*dims, "actuation_pressure"), 1 + 0 * curve),
            "potential_energy": ((*dims, "actuation_pressure"), rest),
            "efficiency_90ml": (dims, np.full(shape, 0.5)),
            "case_status": (dims, np.full(shape, "converged")),
            "case_reason": (dims, np.full(shape, "")),
            "case_id": (dims, np.full(shape, "a")),
            "actuation_pressure_reached": (dims, np.full(shape, 60.0)),
        },
        {"n_pouches": [6, 8], along: values, "branch": [0, 1], "actuation_pressure": pressure, "ventricular_pressure": 3.8},
    )


@pytest.mark.parametrize(("along", "scale"), [("fabric_angle", "linear"), ("bending_factor", "log")])
def test_the_lowest_solutions_are_drawn_over_what_is_varied_with_bars_of_the_others(along, scale):
    values = [0.1, 0.5, 1.0]
    figure = trends.draw(study_of(along, values).expand_dims(aspect_ratio=[2.0]))
    strokes = next(axis for axis in figure.axes if axis.get_ylabel().startswith("Stroke"))
    first, second = strokes.get_lines()
    np.testing.assert_allclose(first.get_xdata(), values)
    np.testing.assert_allclose(first.get_ydata(), 120.0 + np.asarray(values))
    np.testing.assert_allclose(second.get_ydata(), 130.0 + np.asarray(values))
    bars = strokes.collections[0].get_segments()
    np.testing.assert_allclose(bars[0][:, 1], [100.1, 120.1])
    assert strokes.get_xscale() == scale
    if scale == "log":
        assert [text.get_text() for text in strokes.get_xticklabels(which="both")] == ["0.1", "0.5", "1"]
    assert strokes.get_xlabel() == trends.ALONG[along]
    assert [line.get_label() for line in (first, second)] == ["$N_p$ = 6", "$N_p$ = 8"]
    style.close(figure)


def test_a_solution_that_ended_early_has_the_numbers_alone_that_it_passed():
    study = study_of("bending_factor", [0.1, 1.0])
    ended, beyond = {"n_pouches": 6, "bending_factor": 0.1, "branch": 1}, study.actuation_pressure > 30
    study["case_status"].loc[ended] = "diverged"
    for name in ("stroke_volume", "io_ratio"):
        study[name].loc[ended] = study[name].loc[ended].where(~beyond)
    numbers = trends.numbers_of(study)
    assert {text: bool(values.loc[ended].isnull()) for text, values in numbers.items()} == {
        "$V_v$ at rest [ml]": False,
        "Stroke at $P_{a,max}$ [ml]": True,
        "Ratio $\\Delta V_v / V_a$ at $P_{a,max}$ [-]": True,
        "Efficiency at 90 ml [%]": False,
    }
    assert sum(int(values.isnull().sum()) for values in numbers.values()) == 2


def test_what_is_not_measured_has_no_jump_and_yarns_are_drawn_where_there_are_some():
    study = study_of("bending_factor", [0.1, 1.0])
    dims = study.case_status.dims
    status = np.full(study.case_status.shape, "measured")
    status[0, 1] = "missing"
    jumps = np.full((*status.shape, 3), np.nan)
    jumps[1, :, :, 0] = -4.0
    plain = study.assign(measure_status=(dims, status), buckling_jump=((*dims, "event"), jumps))
    figure = trends.draw(plain)
    drawn = {axis.get_ylabel(): [line.get_ydata() for line in axis.get_lines()] for axis in figure.axes if axis.get_lines()}
    np.testing.assert_array_equal(drawn["Largest jump of the stroke [ml]"], [[0.0, np.nan], [4.0, 4.0]])
    assert "Load along yarns [%]" not in drawn
    style.close(figure)
    strain = np.stack([np.full((*status.shape, 2), 0.04), np.full((*status.shape, 2), 0.12)], axis=-1)
    cycles = (dims, np.full(status.shape, 1e3))
    plain = plain.assign(strain_peak=((*dims, "frame", "side"), strain), fatigue_cycles_min=cycles)
    plain["fatigue_cycles_p05"] = np.inf * plain.fatigue_cycles_min  # endures, and is not drawn
    woven = plain.assign(fibre_aligned_share=((*dims, "frame"), np.full((*status.shape, 2), 0.8)))
    figure = trends.draw(woven)
    (yarns,) = (axis for axis in figure.axes if axis.get_ylabel() == "Load along yarns [%]")
    np.testing.assert_allclose(yarns.get_lines()[0].get_ydata(), [80.0, 80.0])
    (strains,) = (axis for axis in figure.axes if axis.get_ylabel() == "Peak strain [%]")
    np.testing.assert_allclose(strains.get_lines()[0].get_ydata(), [12.0, 12.0], err_msg="of the side that has more")
    (cycles,) = (axis for axis in figure.axes if axis.get_ylabel().startswith("Cycles"))
    assert "worst point" in cycles.get_ylabel()
    np.testing.assert_allclose(cycles.get_lines()[0].get_ydata(), [3.0, 3.0])
    style.close(figure)
