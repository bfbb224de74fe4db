"""Datasets of which every statement of the paper is true, and changes that each make one of them false."""

from __future__ import annotations

import json

import numpy as np
import pandas as pd
import pytest
import xarray as xr

from limo.errors import LimoError
from limo.measure.zones import ZONES
from limo.reports.paper_check import (
    STATEMENTS,
    VERDICTS,
    check,
    counted,
    graded,
    on_grid,
    onset_pressures,
    read_studies,
    write_check,
)
from limo.terminal.cli import main

PRESSURE = np.arange(0.0, 140.5, 0.5)


def curve_set(axes, most, ratio, eta, onset=None):
    """Curves that rise from an onset (P_v) within 10 kPa to 80 % of ``most`` ml of pouch volume and gradually to the rest."""
    coords = {k: np.asarray(v) for k, v in axes.items()} | {"actuation_pressure": PRESSURE}
    shape = tuple(len(v) for v in axes.values())
    dims = tuple(axes)
    full = xr.DataArray(np.broadcast_to(most, shape), dims=dims, coords={k: coords[k] for k in dims})
    p_v = xr.DataArray(axes["ventricular_pressure"], dims="ventricular_pressure")
    pressure = xr.DataArray(PRESSURE, dims="actuation_pressure")
    maximum = p_v * 2.2 + 52  # some P_a,max
    start = p_v if onset is None else onset
    change = full * (0.8 * ((pressure - start) / 10).clip(0, 1) + 0.2 * ((pressure - start) / (maximum - start)).clip(0, 1))
    change = change.where(pressure <= maximum).transpose(*dims, "actuation_pressure")
    lever = xr.DataArray(np.broadcast_to(ratio, shape), dims=dims)
    ratios = (1 + (lever - 1) * (change / full)).where(change > 0)
    dataset = xr.Dataset(
        {
            "actuation_volume": change,
            "actuation_volume_change": change,
            "io_ratio": ratios,
            "io_ratio_of_change": ratios,
            "stroke_volume": (change * ratios.fillna(1.0)).where(change.notnull()),
            "ventricle_volume": 300.0 - change,
            "efficiency_90ml": (dims, np.broadcast_to(eta, shape).copy()),
            "case_status": (dims, np.full(shape, "converged")),
        },
        coords=coords,
    )
    return dataset


def grid(**axes):
    return {"n_pouches": [6], "ventricular_pressure": [13.8], "aspect_ratio": [2.0], "stiffness_ratio": [1.0]} | axes


def with_stress(dataset, peak, **axes):
    """The dataset with stresses at two frames, of which the last is P_a,max."""
    dims = tuple(axes)
    shape = tuple(len(v) for v in axes.values())
    peak = np.broadcast_to(peak, shape)
    share = np.broadcast_to([0.5, 0.3, 0.1, 0.05, 0.05, 0.0], (*shape, 2, len(ZONES)))
    area = np.broadcast_to([0.15, 0.05, 0.1, 0.3, 0.2, 0.2], (*shape, len(ZONES)))
    return dataset.assign(
        von_mises_peak=((*dims, "frame"), np.stack([0.1 * peak, peak], axis=-1)),
        von_mises_peak_share=((*dims, "frame", "zone"), share),
        zone_share=((*dims, "zone"), area),
    ).assign_coords(frame=["0", "max"], zone=list(ZONES))


POUCHES, LOADS = [4, 6, 8, 10], [3.8, 13.8, 23.8]


@pytest.fixture
def data():
    """One dataset a study, with which every statement holds."""
    both = grid(n_pouches=POUCHES, ventricular_pressure=LOADS)
    column = np.array([1.0, 0.8, 0.7, 0.6])[:, None, None, None]
    row = np.array([0.0, 0.05, 0.1])[None, :, None, None]
    afterload = curve_set(both, 150 * column, 1 + 0.8 * column, 0.75 * column + row)
    one = grid(n_pouches=[6], ventricular_pressure=[3.8])
    events, jumps = (np.reshape(v, (1, 1, 1, 1, 4)) for v in ([12.0, 29.8, np.nan, np.nan], [-2.0, 5.0, np.nan, np.nan]))
    dims = (*one, "event")
    buckling = curve_set(one, 100.0, 1.5, 0.6).assign(
        buckling_before=(dims, events), buckling_after=(dims, events + 0.5), buckling_jump=(dims, jumps)
    )
    stress = with_stress(curve_set(both, 100.0, 1.5, 0.6), 10 * (1 + 1.25 * (column - 0.6) + row / 10), **both)
    paths = grid(n_pouches=POUCHES)
    strain = curve_set(paths, 100.0, 1.5, 0.6)
    per, shape = (*paths, "frame"), (4, 1, 1, 1, 2)
    strain = strain.assign(
        direction_around=((*per, "side"), np.broadcast_to([0.8, 0.2], (*shape, 2))),
        direction_between=(per, np.full(shape, 80.0)),
        direction_between_at_seams=(per, np.full(shape, 20.0)),
    ).assign_coords(frame=["0", "max"], side=["epicardial", "endocardial"])
    valves = grid(aspect_ratio=[1.0, 1.5, 2.0, 2.5, 3.0])
    along = (1, 1, 5, 1)
    valve = curve_set(valves, 100.0, 1.5, np.reshape([0.60, 0.61, 0.63, 0.66, 0.64], along))
    valve = with_stress(valve, np.reshape([9.2, 9.3, 9.4, 9.6, 10.0], along), **valves)
    ratios = grid(stiffness_ratio=[0.5, 0.75, 1.0, 1.25])
    soft = curve_set(
        ratios, np.reshape([105.0, 110.0, 100.0, 95.0], (1, 1, 1, 4)), 1.5, np.reshape([0.64, 0.66, 0.62, 0.6], (1, 1, 1, 4))
    )
    soft = with_stress(soft, np.reshape([8.9, 9.1, 10.0, 10.6], (1, 1, 1, 4)), **ratios)
    variants = grid() | {"variant": ["quarter", "half", "half_rate"]}
    symmetry = curve_set(variants, np.reshape([100.0, 102.0, 98.0], (1, 1, 1, 1, 3)), 1.5, 0.6)
    return {
        "afterload": afterload, "stress": stress, "strain_paths": strain, "valve_support": valve, "compliance": soft,
        "symmetry": symmetry, "buckling": buckling,
    }  # fmt: skip


def table(data):
    return check(data).set_index("statement")


def test_statements_that_hold_are_reproduced(data):
    rows = table(data)
    assert len(rows) == len(STATEMENTS) == 26
    assert dict(rows.verdict) == dict.fromkeys(rows.index, "reproduced")
    assert (rows["what is known"] == "").all()


def halved(name, **where):
    """A change of a dataset: a variable is halved at a place."""

    def change(dataset):
        dataset[name].loc[where] *= 0.5
        return dataset

    return change


def assigned(name, value):
    return lambda dataset: dataset.assign({name: 0 * dataset[name] + value})


FALSE = {
    "V_a starts to grow when P_a comes near P_v": ("afterload", None),
    "V_a rises sharply up to some 20 kPa, then gradually": ("afterload", None),
    "less in, more out: the ratio exceeds one for all devices": ("afterload", assigned("io_ratio", 0.9)),
    "the ratio starts close to one": ("afterload", assigned("io_ratio", 0.5)),
    "fewer pouches, more stroke": ("afterload", halved("stroke_volume", n_pouches=4)),
    "fewer pouches, higher ratio": ("afterload", halved("io_ratio", n_pouches=4)),
    "efficiencies at 90 ml": ("afterload", assigned("efficiency_90ml", 0.3)),
    "efficiency rises with P_v": ("afterload", halved("efficiency_90ml", ventricular_pressure=23.8)),
    "efficiency falls with N_p": ("afterload", halved("efficiency_90ml", n_pouches=4)),
    "N_p = 6 jumps at P_v = 3.8 kPa": ("buckling", assigned("buckling_before", 90.0)),
    "stress concentrates on seams and in buckled regions": ("stress", assigned("von_mises_peak_share", 0.1)),
    "fewer pouches, up to 50 % more peak stress": ("stress", assigned("von_mises_peak", 10.0)),
    "peak stress depends weakly on P_v": ("stress", halved("von_mises_peak", ventricular_pressure=3.8)),
    "outside, the largest strain runs around the device": ("strain_paths", assigned("direction_around", 0.2)),
    "inside, it runs about at right angles to that": ("strain_paths", assigned("direction_between", 30.0)),
    "at seams the directions of both surfaces align": ("strain_paths", assigned("direction_between_at_seams", 85.0)),
    "efficiency over AR": ("valve_support", assigned("efficiency_90ml", 0.8)),
    "efficiency is largest at AR = 2.5": ("valve_support", halved("efficiency_90ml", aspect_ratio=2.5)),
    "AR hardly changes the stroke": ("valve_support", halved("stroke_volume", aspect_ratio=1.0)),
    "smaller AR, less peak stress than at AR = 3": ("valve_support", assigned("von_mises_peak", 10.0)),
    "E_hat below one, less peak stress": ("compliance", assigned("von_mises_peak", 10.0)),
    "E_hat = 1.25, more peak stress": ("compliance", halved("von_mises_peak", stiffness_ratio=1.25)),
    "the largest stroke is that of E_hat = 0.75": ("compliance", halved("stroke_volume", stiffness_ratio=0.75)),
    "the largest efficiency is that of E_hat = 0.75": ("compliance", halved("efficiency_90ml", stiffness_ratio=0.75)),
    "symmetry and loading rate hardly change the curves": ("symmetry", halved("stroke_volume", variant="half")),
    "the device holds 300 ml": ("afterload", assigned("ventricle_volume", 348.0)),
}


@pytest.mark.parametrize("statement", [s.text for s in STATEMENTS])
def test_a_statement_that_does_not_hold_is_told_apart(data, statement):
    study, change = FALSE[statement]
    if change is None:  # another course of the pouches' volume: even, from zero on
        dataset = data[study]
        even = dataset.actuation_pressure / dataset.actuation_pressure.max() * 100.0
        even = even.where(dataset.actuation_volume.notnull())
        data[study] = dataset.assign(actuation_volume=even, actuation_volume_change=even)
    else:
        data[study] = change(data[study].copy(deep=True))
    row = table(data).loc[statement]
    assert row.verdict in ("partly", "not")
    assert row["what is known"].endswith(".")


LEVER, STARTS = "less in, more out: the ratio exceeds one for all devices", "the ratio starts close to one"
HIGHER, GROWS = "fewer pouches, higher ratio", "V_a starts to grow when P_a comes near P_v"


def touching(dataset, pressure):
    """The dataset with a contact of front and back from a pressure (kPa) on, in all cases."""
    return dataset.assign(contact_front_back=0 * dataset.efficiency_90ml + pressure)


def test_the_reading_of_each_judge_stands_in_the_table(data):
    rows = table(data)
    assert rows.reading.str.len().min() > 15
    assert rows.reading["efficiency over AR"].startswith("N_p = 6: "), "the device that the paper calls representative"
    assert (rows["read otherwise"] == "").all(), "no other reading has another verdict here"
    assert {len(s.readings) for s in STATEMENTS if s.text in (LEVER, STARTS, HIGHER, GROWS)} <= {2, 3}


def test_what_is_described_over_the_ramp_ends_at_contact(data):
    """Far beyond contact the ratio collapses: before it all holds, and to judge at P_a,max is another reading."""
    afterload = data["afterload"]
    late = afterload.actuation_pressure >= 50.0
    collapsed = touching(afterload.assign(io_ratio=afterload.io_ratio.where(~late, 0.5 * afterload.io_ratio)), 50.0)
    row = table(data | {"afterload": collapsed}).loc[LEVER]
    assert row.verdict == "reproduced"
    assert "cases before contact" in row.ours
    assert row["read otherwise"].startswith("Delta V_v / V_a at P_a,max: ")
    assert "of 12 cases at P_a,max" in row["read otherwise"]
    steep = 5.0 * (afterload.actuation_pressure - 50.0).clip(0.0)
    snapped = touching(afterload.assign(actuation_volume=afterload.actuation_volume + 100.0 * steep), 50.0)
    assert table(data | {"afterload": snapped}).loc[GROWS, "verdict"] == "reproduced", "the steepest rise comes after contact"
    unlimited = snapped.drop_vars("contact_front_back")
    assert table(data | {"afterload": unlimited}).loc[GROWS, "verdict"] == "not"


def test_a_model_whose_layers_touch_is_judged_to_the_end(data):
    """What is marked there is how far they are pressed into each other, in places; its curves hold beyond it."""
    late = data["afterload"].actuation_pressure >= 50.0
    collapsed = touching(data["afterload"].assign(io_ratio=data["afterload"].io_ratio.where(~late, 0.5)), 50.0)
    for front_back, verdict in ((False, "reproduced"), (True, "not")):
        settings = {"settings": {"": {"numerics": {"contact": {"front_back": front_back, "endo_epi": True}}}}}
        shown = collapsed.assign_attrs(config=json.dumps(settings))
        assert table(data | {"afterload": shown}).loc[LEVER, "verdict"] == verdict


def test_stress_is_read_at_an_equal_difference_of_pressures_too(data):
    """It follows P_a - P_v, which is larger at the P_a,max of a higher P_v."""
    peak = data["stress"].von_mises_peak.sel(frame=["max"])
    rising = peak * (1 + 0.02 * (data["stress"].ventricular_pressure - 3.8))
    both = xr.concat([peak.assign_coords(frame=["P_v + 40"]), rising.transpose(*peak.dims)], "frame")
    row = table(data | {"stress": data["stress"].drop_dims("frame").assign(von_mises_peak=both)}).loc[
        "peak stress depends weakly on P_v"
    ]
    assert row.verdict == "not"
    assert "top 5 % at P_v + 40, within 15 %: reproduced" in row["read otherwise"]


def test_degraded_cases_are_judged_and_counted(data):
    for name, dataset in data.items():
        data[name] = dataset.assign(case_status=xr.full_like(dataset.case_status, "degraded"))
    rows = table(data)
    assert (rows.verdict == "reproduced").all()
    assert rows.ours.str.endswith("cases degraded)").all()
    assert "(12 of 12 cases degraded)" in rows.ours[LEVER]


def test_the_ratio_begins_when_pouches_inflate(data):
    """Layers through each other at rest: the change of V_a runs ahead of the stroke, V_a does not."""
    afterload = data["afterload"]
    row = table(data | {"afterload": assigned("io_ratio_of_change", 0.5)(afterload)}).loc[STARTS]
    assert row.verdict == "reproduced"
    assert "over the change of V_a, when 5 % of that is reached: not" in row["read otherwise"]


def test_a_higher_ratio_is_one_over_the_common_ramp(data):
    """N_p = 4 leads until it would touch, and lies below the others at its P_a,max."""
    afterload = data["afterload"].copy(deep=True)
    late = {"n_pouches": 4, "actuation_pressure": slice(40.0, None)}
    afterload.io_ratio.loc[late] *= 0.3
    contact = touching(afterload, 40.0)
    row = table(data | {"afterload": contact}).loc[HIGHER]
    assert row.verdict == "reproduced"
    assert f"partly ({6} of 9" in row["read otherwise"]


def test_designs_are_judged_for_each_number_of_pouches_that_the_paper_may_mean(data):
    valve = data["valve_support"]
    both = xr.concat([valve.isel(n_pouches=0), 0.5 * valve.isel(n_pouches=0).drop_vars("case_status")], "n_pouches")
    both = both.assign(case_status=valve.case_status.isel(n_pouches=0)).assign_coords(n_pouches=[6, 8])
    row = table(data | {"valve_support": both}).loc["efficiency over AR"]
    assert row.verdict == "reproduced"
    assert row["read otherwise"].startswith("N_p = 8: every AR within one point of that range: not (0 of 5")


def test_the_largest_jump_counts_and_another_near_the_papers_in_part(data):
    statement, buckling = "N_p = 6 jumps at P_v = 3.8 kPa", data["buckling"]
    turned = buckling.copy(deep=True)
    turned.buckling_jump[..., :2] = [-4.8, -2.0]
    row = table(data | {"buckling": turned}).loc[statement]
    assert (row.verdict, row.ours) == ("partly", "-4.8 ml at 12.2 kPa, the largest of 2; -2.0 ml at 30.1 kPa")
    none = buckling.assign(buckling_before=np.nan * buckling.buckling_before)
    row = table(data | {"buckling": none}).loc[statement]
    assert (row.verdict, row.ours) == ("not", "no jump")


def test_a_rate_that_the_engine_does_not_know_is_not_tested(data):
    symmetry = data["symmetry"].copy(deep=True)
    symmetry.stroke_volume.loc[{"variant": "half_rate"}] = symmetry.stroke_volume.sel(variant="quarter")
    row = table(data | {"symmetry": symmetry}).loc["symmetry and loading rate hardly change the curves"]
    assert row.verdict == "partly"
    assert row.ours.endswith("half 2.0%, half_rate not tested (same solution)")
    assert "rate" in row["what is known"]
    symmetry.stroke_volume.loc[{"variant": "half"}] = np.nan
    row = table(data | {"symmetry": symmetry}).loc["symmetry and loading rate hardly change the curves"]
    assert row.verdict == "no data"
    assert "half not known (no solution)" in row.ours


def test_a_case_that_failed_does_not_count_as_one_that_holds(data):
    afterload = data["afterload"].copy(deep=True)
    afterload.case_status.loc[{"n_pouches": 4, "ventricular_pressure": 3.8}] = "diverged"
    rows = table(data | {"afterload": afterload})
    assert rows.loc["less in, more out: the ratio exceeds one for all devices", "ours"].startswith("11 of 12")
    assert rows.loc["fewer pouches, more stroke", "verdict"] == "partly"


def test_branches_with_the_verdict_of_the_first_are_counted(data):
    assert "branches" not in table(data)
    afterload = data["afterload"]
    other = afterload.copy(deep=True)
    other["efficiency_90ml"].loc[{"n_pouches": 4}] *= 0.5
    together = xr.concat([afterload, other, afterload], pd.Index([0, 1, 2], name="branch"))
    rows = table(data | {"afterload": together})
    assert dict(rows.verdict) == dict.fromkeys(rows.index, "reproduced")
    assert rows.loc["efficiency falls with N_p", "branches"] == "2 of 3"
    assert rows.loc["less in, more out: the ratio exceeds one for all devices", "branches"] == "3 of 3"
    assert rows.loc["peak stress depends weakly on P_v", "branches"] == "1 of 1"
    together.case_status[{d: 0 for d in together.case_status.dims} | {"branch": 2}] = "missing"
    rows = table(data | {"afterload": together})
    assert rows.loc["efficiency falls with N_p", "branches"] == "1 of 2", "the third is not solved yet"
    together.case_status[{d: 0 for d in together.case_status.dims}] = "missing"
    row = table(data | {"afterload": together}).loc["efficiency falls with N_p"]
    assert (row.verdict, row.ours) == ("no data", "1 of 12 cases are not solved yet")


def test_what_was_not_run_has_no_verdict(data):
    del data["symmetry"]
    data["stress"] = data["stress"].drop_vars("von_mises_peak")
    data["valve_support"] = data["valve_support"].sel(aspect_ratio=[1.0, 2.0])
    rows = table(data)
    assert rows.loc["symmetry and loading rate hardly change the curves", ["ours", "verdict"]].tolist() == ["-", "no data"]
    assert "von_mises_peak" in rows.loc["peak stress depends weakly on P_v", "ours"]
    assert rows.loc["smaller AR, less peak stress than at AR = 3", "verdict"] == "no data"
    assert set(rows.verdict) <= set(VERDICTS)


def test_onset_is_where_the_steepest_tangent_meets_zero(data):
    found = onset_pressures(on_grid(data["afterload"]))
    expected = data["afterload"].ventricular_pressure
    # the gradual part adds a little to the slope and starts with the fast one
    np.testing.assert_allclose(found - expected, 0.0, atol=0.3)


@pytest.mark.parametrize(("held", "verdict"), [(4, "reproduced"), (3, "partly"), (2, "partly"), (1, "not"), (0, "not")])
def test_many_are_counted(held, verdict):
    assert counted([k < held for k in range(4)], "cases") == (f"{held} of 4 cases", verdict)


@pytest.mark.parametrize(
    ("value", "verdict"),
    [(1.0, "reproduced"), (2.0, "reproduced"), (2.4, "partly"), (0.6, "partly"), (2.6, "not"), (np.nan, "not")],
)
def test_a_number_has_two_bands(value, verdict):
    assert graded(value, 1.0, 2.0, 0.5) == verdict


def test_the_command_writes_a_table_and_a_page(data, tmp_path, capsys):
    for name, dataset in data.items():
        (tmp_path / name).mkdir()
        dataset.to_netcdf(tmp_path / name / "study.nc")
    files = ["--table", str(tmp_path / "check.csv"), "--page", str(tmp_path / "check.md")]
    assert main(["paper-check", "--data", str(tmp_path), *files]) == 0
    assert "26 reproduced, 0 partly, 0 not, 0 no data" in capsys.readouterr().out
    assert len(pd.read_csv(tmp_path / "check.csv")) == 26
    page = (tmp_path / "check.md").read_text()
    assert page.count("| reproduced |") == 26
    assert write_check(tmp_path, tmp_path / "check.csv", tmp_path / "check.md").startswith("26")


def test_another_set_has_its_verdicts_beside(data, tmp_path):
    coarse = data["afterload"].assign(efficiency_90ml=0.0 * data["afterload"].efficiency_90ml + 0.95)
    for folder, datasets in (("fine", data), ("coarse", {"afterload": coarse})):
        (tmp_path / folder).mkdir()
        for name, dataset in datasets.items():
            dataset.to_netcdf(tmp_path / folder / f"{name}.nc")
    table, beside = tmp_path / "check.csv", {"as_in_paper": tmp_path / "coarse", "same": tmp_path / "fine"}
    assert write_check(tmp_path / "fine", table, tmp_path / "check.md", beside).startswith("26 reproduced")
    rows = pd.read_csv(table).set_index("statement")
    assert rows.loc["efficiencies at 90 ml", "as_in_paper"].startswith("not: 0 of 12")
    assert rows.loc["inside, it runs about at right angles to that", "as_in_paper"] == "no data: -"
    assert rows.loc["efficiencies at 90 ml", "holds in"] == "ours, same"
    assert rows.loc["fewer pouches, more stroke", "holds in"] == "ours, as_in_paper, same"
    page = (tmp_path / "check.md").read_text()
    assert f"--beside as_in_paper={tmp_path / 'coarse'} --beside same=" in page
    held = rows.as_in_paper.str.startswith("reproduced").sum()
    assert 0 < held < 26
    assert f"In `as_in_paper`: {held} reproduced" in page
    files = ["--table", str(table), "--page", str(tmp_path / "check.md"), "--beside", f"as_in_paper={tmp_path / 'coarse'}"]
    assert main(["paper-check", "--data", str(tmp_path / "fine"), *files]) == 0
    assert list(pd.read_csv(table))[-4:] == ["as_in_paper", "holds in", "study", "what is known"]


def test_a_damaged_dataset_is_one_message(tmp_path):
    (tmp_path / "afterload.nc").write_bytes(b"no netCDF")
    with pytest.raises(LimoError, match=r"afterload\.nc"):
        read_studies(tmp_path)
