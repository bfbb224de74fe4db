"""Measured pressure-volume curves: units, what is missing, loops, and what is refused."""

from __future__ import annotations

import os

import numpy as np
import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from limo.bench.curves import LOADING, UNLOADING, Expected, _turns, read_curves
from limo.errors import ConfigError
from limo.schema.bench import MeasuredCurves

from .conftest import FIXTURES

#: a study of P_v = 3.8 kPa up to 60 kPa, of a device of 140 mm
STUDY = Expected((12.0, 90.0), (5.0, 2700.0), (3.8,), (4, 6, 8, 10))


def curves(name: str, **keys):
    return read_curves(MeasuredCurves(data=str(FIXTURES / name), **keys), STUDY)


def change(pressure):
    """Delta V_a of the fixtures in ml; the stroke is 2.5 ml/kPa."""
    return 60.0 * pressure / (pressure + 8.0)


@pytest.mark.parametrize("name", ["curves_plain.csv", "curves_units.csv", "curves_psi_row.csv"])
def test_pressures_and_volumes_come_in_kpa_and_ml_whatever_their_units(name):
    table = curves(name).table
    pressure = np.linspace(0, 24, 9)
    np.testing.assert_allclose(table.actuation_pressure, pressure, atol=2e-3)
    np.testing.assert_allclose(table.actuation_volume_change, change(pressure), atol=2e-3)
    np.testing.assert_allclose(table.stroke_volume, 2.5 * pressure, atol=2e-3)
    np.testing.assert_allclose(table.io_ratio[1:], 2.5 * pressure[1:] / change(pressure[1:]), rtol=1e-3)
    assert (table.direction == LOADING).all()
    assert (table.cycle == 1).all()


def test_a_label_may_hold_a_hash():
    assert curves("curves_plain.csv").labels == ["bag #2"]


def test_what_was_not_measured_is_missing_and_no_mistake():
    found = curves("curves_stroke_only.csv")
    assert found.measured("stroke_volume")
    assert not found.measured("actuation_volume_change")
    assert not found.measured("io_ratio")


def test_loading_and_unloading_are_told_apart():
    table = curves("curves_loop.csv").table
    assert table.direction.tolist() == [LOADING] * 9 + [UNLOADING] * 9
    up, down = (table[table.direction == d].sort_values("actuation_pressure") for d in (LOADING, UNLOADING))
    np.testing.assert_allclose(down.stroke_volume.to_numpy() - up.stroke_volume.to_numpy(), 3.0)


def test_a_time_series_has_cycles_and_volumes_are_counted_from_its_begin():
    table = curves("curves_time_series.csv").table
    assert table.cycle.max() == 3
    for _, cycle in table.groupby("cycle"):
        up, down = (cycle[cycle.direction == d] for d in (LOADING, UNLOADING))
        assert min(len(up), len(down)) > 40
        middle = []
        for branch in (up, down):
            ordered = branch.sort_values("actuation_pressure")
            middle.append(np.interp(12.0, ordered.actuation_pressure, ordered.stroke_volume))
        assert middle[0] == pytest.approx(30.0, abs=1.5)
        assert middle[1] == pytest.approx(33.0, abs=1.5)


@pytest.mark.parametrize("noise", [0.0, 0.3])
@pytest.mark.parametrize("first", ["up", "down"])
def test_a_series_turns_where_it_turns_and_noise_does_not_turn_it(noise, first):
    up = np.linspace(0, 20, 200)
    parts = [up, up[::-1], up, up[::-1]] if first == "up" else [up[::-1], up, up[::-1]]
    pressure = np.concatenate(parts) + np.random.default_rng(5).normal(0, noise, 200 * len(parts))
    cycle, direction = _turns(pressure)
    true = np.concatenate([np.full(200, (k % 2 == 0) == (first == "up")) for k in range(len(parts))])
    assert np.mean((direction == LOADING) == true) > 0.97
    assert cycle.max() == 2


def test_words_and_numbers_say_direction_and_cycle():
    found = curves("curves_by_pouches.csv")
    assert found.labels == ["N_p = 5", "N_p = 7", "N_p = 9"]
    table = found.table
    assert set(table.n_pouches) == {5, 7, 9}
    assert (table.ventricular_pressure == 3.8).all()
    assert (table.direction == UNLOADING).sum() == 27


def test_columns_side_by_side_are_curves():
    table = curves("curves_wide.csv").table
    assert table.groupby("label").stroke_volume.max().to_dict() == {"A": 60.0, "B": 30.0}


def test_strokes_counted_negative_are_turned():
    assert curves("curves_negative.csv").table.stroke_volume.max() == 60.0


def test_rows_from_the_highest_to_the_lowest_pressure_are_a_loading(tmp_path):
    file = tmp_path / "mine.csv"
    file.write_text("actuation_pressure,stroke_volume\n" + "".join(f"{p},{2 * p}\n" for p in range(30, -1, -3)))
    found = read_curves(MeasuredCurves(data=str(file)), STUDY)
    assert (found.table.direction == LOADING).all()
    assert any("taken for loading" in said for said in found.understood)


@pytest.mark.parametrize(
    ("name", "says", "settled"),
    [
        ("curves_mmhg_silent.csv", "24 kPa if in mmHg", True),
        ("curves_oz_silent.csv", "60 ml if in oz", False),
        ("curves_no_pressure.csv", "actuation_pressure", False),
        ("curves_pressure_alone.csv", "stroke_volume", False),
        ("semicolon_comma.csv", "actuation_pressure", False),
    ],
)
def test_what_cannot_be_right_is_one_message_with_the_key(name, says, settled):
    with pytest.raises(ConfigError) as caught:
        curves(name)
    assert name in str(caught.value)
    assert says in str(caught.value)
    if settled:
        assert curves(name, **yaml.safe_load(caught.value.example)).table.actuation_pressure.max() == pytest.approx(24, rel=1e-3)


def test_units_that_are_stated_are_believed():
    table = curves("curves_oz_silent.csv", units={"stroke_volume": "oz", "actuation_volume_change": "oz"}).table
    assert table.stroke_volume.max() == pytest.approx(60, rel=1e-3)
    table = curves("curves_mmhg_silent.csv", units={"actuation_pressure": "kPa"}).table
    assert table.actuation_pressure.max() == pytest.approx(180, rel=1e-3), "whoever says so measured at 180 kPa"


def test_n_p_p_v_and_efficiency_come_from_keys_columns_labels_or_the_study(root):
    found = curves("curves_plain.csv", n_pouches={"bag #2": 5}, ventricular_pressure=3.8, efficiency={5: 0.8, 7: 0.7}).table
    assert found.n_pouches.iloc[0] == 5
    assert found.groupby("n_pouches").efficiency.first().to_dict() == {5: 0.8, 7: 0.7}
    assert np.isnan(curves("curves_plain.csv").table.n_pouches).all()
    assert (curves("curves_plain.csv").table.ventricular_pressure == 3.8).all(), "the only one of the study"
    shipped = read_curves(MeasuredCurves(data=str(root / "config/measured/curves_synthetic.csv")), STUDY)
    assert sorted(shipped.table.n_pouches.unique()) == [5, 7, 9, 11]


PRESSURE_UNITS = {"kPa": 1.0, "mmHg": 1 / 0.133322387415, "psi": 1 / 6.894757293168, "bar": 0.01, "cmH2O": 1 / 0.0980665}
VOLUME_UNITS = {"ml": 1.0, "l": 1e-3, "cm³": 1.0, "oz": 1 / 29.5735295625}


@settings(
    max_examples=int(os.environ.get("LIMO_EXAMPLES", "60")), deadline=None, derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)  # fmt: skip
@given(
    units=st.tuples(st.sampled_from(sorted(PRESSURE_UNITS)), st.sampled_from(sorted(VOLUME_UNITS))),
    marks=st.sampled_from([(",", "."), (";", ","), ("\t", ","), ("|", ".")]),
    shape=st.sampled_from(["points", "loop", "three loops"]),
    absolute=st.booleans(),
    header=st.sampled_from(["{} ({})", "{} [{}]", "{} in {}", "row"]),
    labels=st.integers(1, 3),
    noise=st.sampled_from([0.0, 0.05]),
    slope=st.floats(1.5, 4.0),
)
def test_known_curves_come_back_from_any_layout(tmp_path, units, marks, shape, absolute, header, labels, noise, slope):
    up = np.linspace(0, 40, 41)
    pressure = {"points": up, "loop": np.append(up, up[-2::-1]), "three loops": np.concatenate([up, up[::-1]] * 3)}[shape]
    rising = np.append(True, np.diff(pressure) > 0)
    separator, decimal = marks
    volume = "ventricle volume" if absolute else "stroke volume"
    named = zip(("actuation pressure", volume), units, strict=True)
    head = ["label", *(name if header == "row" else header.format(name, unit) for name, unit in named)]
    lines = [separator.join(head)] + ([separator.join(["", *units])] if header == "row" else [])
    rng = np.random.default_rng(7)
    for k in range(labels):
        stroke = slope * (k + 1) * pressure + np.where(rising, 0.0, 6.0) * (pressure < 40)
        measured = pressure + rng.normal(0, noise, len(pressure))
        values = zip(
            measured * PRESSURE_UNITS[units[0]], (400 - stroke if absolute else stroke) * VOLUME_UNITS[units[1]], strict=True
        )
        lines += [separator.join([f"bag {k}", *(f"{v:.7f}".replace(".", decimal) for v in pair)]) for pair in values]
    file = tmp_path / "mine.csv"
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")
    table = read_curves(MeasuredCurves(data=str(file)), STUDY).table
    assert list(dict.fromkeys(table.label)) == [f"bag {k}" for k in range(labels)]
    assert table.cycle.max() == (3 if shape == "three loops" else 1)
    for k, (_, one) in enumerate(table.groupby("label", sort=False)):
        found = np.polyfit(one.actuation_pressure[one.direction == LOADING], one.stroke_volume[one.direction == LOADING], 1)[0]
        assert found == pytest.approx(slope * (k + 1), rel=0.02)
        assert (one.direction == UNLOADING).any() == (shape != "points")


@pytest.mark.parametrize("content", [b"", b"\x00" * 40, b"label,actuation_pressure,stroke_volume\n", b"a;b\n1;2\n"])
def test_what_holds_no_curves_is_one_message(tmp_path, content):
    file = tmp_path / "mine.csv"
    file.write_bytes(content)
    with pytest.raises(ConfigError, match=r"mine\.csv"):
        read_curves(MeasuredCurves(data=str(file)))


def written(tmp_path, head: str, *columns) -> str:
    file = tmp_path / "mine.csv"
    rows = [",".join(str(v) for v in row) for row in zip(*columns, strict=True)]
    file.write_text("\n".join([head, *rows, ""]))
    return str(file)


P, SV = np.linspace(0, 24, 9), 2.5 * np.linspace(0, 24, 9)


@pytest.mark.parametrize(
    ("head", "columns", "says", "keys"),
    [
        ("P_a (kPa),SV (l)", (P, SV), "60 ml if in ml", {"units": {"stroke_volume": "ml"}}),
        ("P_a (kPa),SV (ml)", (P + 101.3, SV), "over that of the air", {"units": {"actuation_pressure": "kPa"}}),
        ("P_a (kPa),SV (ml),efficiency (%)", (P, SV, [7200] * 9), "shares from 0 to 1", {"units": {"efficiency": "0.0001"}}),
        ("P_a (kPa),SV (ml),n_pouches", (P, SV, [0] * 9), "1 to 100", {"n_pouches": 6}),
        ("P_a (kPa),SV (ml),P_v (kPa)", (P, SV, [-3.8] * 9), "0 to 1000", {"ventricular_pressure": 3.8}),
    ],
    ids=["litres", "absolute", "efficiency", "pouches", "P_v"],
)
def test_numbers_that_cannot_be_are_refused_whatever_unit_is_named(tmp_path, head, columns, says, keys):
    file = written(tmp_path, head, *columns)
    with pytest.raises(ConfigError, match=says):
        read_curves(MeasuredCurves(data=file), STUDY)
    if "efficiency" not in keys.get("units", {}):
        assert len(read_curves(MeasuredCurves(data=file, **keys), STUDY).table) == 9


def test_a_pressure_beyond_the_study_in_a_unit_that_is_named_is_believed_and_told(tmp_path):
    found = read_curves(MeasuredCurves(data=written(tmp_path, "P_a (kPa),SV (ml)", 7.5 * P, SV)), STUDY)
    assert found.table.actuation_pressure.max() == 180.0
    assert any("taken as the file says, although 24 kPa if in mmHg" in said for said in found.understood)


def test_pressures_counted_negative_are_turned(tmp_path):
    found = read_curves(MeasuredCurves(data=written(tmp_path, "P_a (kPa),SV (ml)", -P, SV)), STUDY)
    assert found.table.actuation_pressure.max() == 24.0
    assert any("negative: turned" in said for said in found.understood)


@pytest.mark.parametrize("names", [("A", "B"), ("bag A", "bag B")])
def test_a_letter_in_a_name_is_no_symbol_of_a_pressure_or_a_volume(tmp_path, names):
    head = "P_a (kPa)," + ",".join(f"SV {name} (ml)" for name in names)
    found = read_curves(MeasuredCurves(data=written(tmp_path, head, P, SV, SV / 2)), STUDY)
    assert found.labels == list(names)
    assert found.table.groupby("label").stroke_volume.max().tolist() == [60.0, 30.0]
