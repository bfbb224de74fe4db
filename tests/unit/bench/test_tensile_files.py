"""Each kind of file that a tensile machine writes gives its true modulus, or one message with the key that settles it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml

from limo.bench.tensile import fit_tensile, report, specimen_table, tensile_dataset, to_plain
from limo.config.yaml_file import parse
from limo.errors import ConfigError
from limo.schema.bench import TensileTest

#: moduli (MPa) of the specimens of each fixture: E = 180, and what its name says
READ = {
    "semicolon_comma.csv": [180],
    "tab_comma_german.txt": [180],
    "percent_utf16.txt": [180],
    "micrometres_cp1252.csv": [180],
    "unit_row.csv": [180],
    "kilonewton_header.csv": [180],
    "header_case.csv": [180],
    "trailing_separator.csv": [180],
    "slack.csv": [180],
    "break.csv": [180],
    "return.csv": [180],
    "negative.csv": [180],
    "reversed.csv": [180],
    "shuffled.csv": [180],
    "position_down.csv": [180],
    "side_by_side.csv": [180, 90],
    "shared_elongation.csv": [180, 198, 162],
    "stacked_headers.csv": [180, 90],
    "stacked_plain.csv": [180, 90],
    "hash_in_name.csv": [180, 180],
    "numbered.csv": [90, 180],
    "results_table_above.csv": [180],
    "three_header_rows.csv": [180, 90],
    "metadata_above.csv": [180],
    "savetxt.txt": [180],
    "units_behind_values.csv": [180],
    "gaps.csv": [180],
    "hash_header.csv": [180],
}
#: what is refused: a word of the message, and whether its example alone settles it, with what moduli
REFUSED = {
    "kilonewton_silent.csv": ("180", [180]),
    "metres_silent.csv": ("m perhaps", [180]),
    "strain_silent.csv": ("units", None),
    "load_silent.csv": ("units", None),
    "one_value_more.csv": ("columns", None),
    "one_value_less.csv": ("columns", [180]),
    "comma_everywhere.csv": ("commas are decimal marks", None),
    "hash_first.csv": ("comment", [180, 180]),
    "unnamed_text.csv": ("specimens: one", [180, 180]),
    "no_names.csv": ("columns", [180]),
    "unknown_names.csv": ("columns", None),
    "text_among_numbers.csv": ("overload", [180]),
    "thousand_or_decimal.csv": ("decimal or thousands", None),
    "two_gauges.csv": ("1.25 times", [180]),
    "cycles.csv": ("data_rows", [180]),
    "two_tables.csv": ("time, temperature", [180]),
}


@pytest.mark.parametrize("name", READ)
def test_a_file_gives_the_modulus_of_each_of_its_specimens(tensile, name):
    fit = fit_tensile(tensile(name))
    assert fit.moduli == pytest.approx(READ[name], rel=0.01)
    for line, true in zip(fit.lines, READ[name], strict=True):
        assert abs(line.modulus - true) < max(4 * line.error, 0.005 * true), "the error is no better than the fit"
    assert fit.reading.understood[0].startswith(name), "what was understood begins with the file"


@pytest.mark.parametrize("name", REFUSED)
def test_a_file_that_could_mean_two_things_is_one_message_with_the_key(tensile, name):
    says, settled = REFUSED[name]
    with pytest.raises(ConfigError) as caught:
        fit_tensile(tensile(name))
    message = str(caught.value)
    assert name in message
    assert says in message
    assert "for example" in message
    if settled:
        keys = yaml.safe_load(caught.value.example)
        assert fit_tensile(tensile(name, **keys)).moduli == pytest.approx(settled, rel=0.02)


#: keys that settle what is refused where the example of the message alone does not know them
SETTLED = {
    "strain_silent.csv": ({"units": {"strain": "%", "stress": "MPa"}}, [180]),
    "load_silent.csv": ({"units": {"elongation": "mm", "force": "N"}}, [180]),
    "one_value_more.csv": ({"columns": {"elongation": 2, "force": 3}}, [180]),
    "unknown_names.csv": (
        {"columns": {"elongation": "channel 1", "force": 2}, "units": {"elongation": "mm", "force": "N"}},
        [180],
    ),
    "text_among_numbers.csv": ({"data_rows": [2, 10]}, [180]),
    "thousand_or_decimal.csv": ({"thousands": ","}, [180]),
    "unnamed_text.csv": ({"specimens": "one"}, [180]),
    "kilonewton_header.csv": ({"units": {"force": "N"}, "modulus_range": [1e-3, 1]}, [0.18]),
    "two_gauges.csv": ({"columns": {"strain": "strain"}}, [144]),
    "stacked_plain.csv": ({"leave_out": ["2"]}, [180]),
    "side_by_side.csv": ({"coupons": {"strip B": {"thickness": 0.06}}}, [180, 180]),
}


@pytest.mark.parametrize("name", SETTLED)
def test_keys_settle_what_a_file_leaves_open_and_overrule_what_it_says(tensile, name):
    keys, moduli = SETTLED[name]
    assert fit_tensile(tensile(name, **keys)).moduli == pytest.approx(moduli, rel=0.01)


def test_what_was_understood_says_where_each_unit_is_from(tensile):
    said = "\n".join(fit_tensile(tensile("unit_row.csv")).reading.understood)
    assert "in lbf (unit row)" in said
    said = "\n".join(fit_tensile(tensile("header_case.csv")).reading.understood)
    assert said.count("assumed") == 2
    said = "\n".join(fit_tensile(tensile("kilonewton_header.csv", units={"force": "kN"})).reading.understood)
    assert "in kN (key units)" in said
    said = "\n".join(fit_tensile(tensile("gaps.csv")).reading.understood)
    assert "3 rows have only one of two values" in said
    said = "\n".join(fit_tensile(tensile("negative.csv")).reading.understood)
    assert "turned" in said


def test_pulls_below_each_other_are_those_of_specimens_only_where_a_key_says_so(tensile, tmp_path):
    file = tmp_path / "pulls.csv"
    up = np.linspace(0.0, 6.0, 40)
    pulls = [(x, k * 180 * 1.8 * x / 100) for k in (1, 0.5) for x in (*up, *up[::-1])]
    file.write_text("elongation,force\n" + "".join(f"{x:.4f},{f:.4f}\n" for x, f in pulls))
    with pytest.raises(ConfigError, match="specimens: stacked"):
        fit_tensile(tensile(file))
    assert fit_tensile(tensile(file, specimens="stacked")).moduli == pytest.approx([180, 90], rel=0.01)
    assert fit_tensile(tensile(file, specimens="one")).moduli == pytest.approx([180], rel=0.01)


def test_several_files_are_specimens_of_one_test(tensile):
    names = ["semicolon_comma.csv", "side_by_side.csv"]
    fit = fit_tensile(tensile("", data=[tensile(n).data for n in names]))
    assert [s.name for s in fit.specimens] == ["semicolon_comma", "side_by_side strip A", "side_by_side strip B"]
    assert fit.modulus == pytest.approx(150, rel=0.01)
    assert fit.scatter == pytest.approx(fit.moduli.std(ddof=1))
    assert fit.scatter / 3**0.5 < fit.error < fit.scatter
    assert any("differ by" in note for note in fit.notes)


def test_table_dataset_report_and_json_say_the_same(tensile):
    fit = fit_tensile(tensile("side_by_side.csv"))
    table, dataset, plain = specimen_table(fit), tensile_dataset(fit), to_plain(fit)
    assert table["specimen"].tolist() == ["strip A", "strip B", "mean"]
    assert float(dataset.youngs_modulus) == plain["youngs_modulus"] == table["youngs_modulus [MPa]"].iloc[-1]
    assert dataset.specimen_modulus.values.tolist() == [s["youngs_modulus"] for s in plain["specimens"]]
    assert dataset.fitted.values.sum() == sum(s["points"] for s in plain["specimens"]) == 19 + 12
    text = report(fit)
    assert "strip B" in text
    assert f"{fit.modulus:.0f}" in text
    assert "side_by_side.csv" in dataset.attrs["origin"]


def test_the_sign_of_forces_may_be_kept_or_turned(tensile):
    with pytest.raises(ConfigError, match="sign"):
        fit_tensile(tensile("negative.csv", sign="keep", method="paper"))
    assert fit_tensile(tensile("negative.csv", sign="turn")).modulus == pytest.approx(180, rel=0.01)


@pytest.mark.parametrize(
    ("keys", "says"),
    [
        ({"method": "window"}, "window"),
        ({"window": [0.01, 0.05]}, "window"),
        ({"method": "window", "window": [0.05, 0.01]}, "lower end"),
        ({"units": {"colour": "kN"}}, "colour"),
        ({"separator": "ab"}, "separator|character"),
        ({"encoding": "klingon"}, "encoding"),
        ({"data_rows": [5, 2]}, "first line"),
        ({"data": []}, "path"),
    ],
)
def test_keys_that_cannot_be_are_refused(keys, says):
    with pytest.raises(ConfigError, match=says):
        parse(TensileTest, keys, Path("some.yaml"))


@pytest.mark.parametrize(
    ("name", "keys", "says"),
    [
        ("semicolon_comma.csv", {"leave_out": ["nobody"]}, "leave_out"),
        ("semicolon_comma.csv", {"columns": {"force": "nothing"}}, "1 elongation, 2 force"),
        ("semicolon_comma.csv", {"units": {"force": "furlong"}}, "unit of force"),
        ("semicolon_comma.csv", {"header_row": 400}, "header_row"),
        ("semicolon_comma.csv", {"method": "window", "window": [0.5, 0.6]}, "three or more"),
        ("semicolon_comma.csv", {"encoding": "utf-16"}, "encoding"),
        ("semicolon_comma.csv", {"modulus_range": [500, 900]}, "500 to 900"),
        ("absent.csv", {}, "CSV file"),
    ],
)
def test_keys_that_do_not_fit_the_file_are_one_message(tensile, name, keys, says):
    with pytest.raises(ConfigError, match=says) as caught:
        fit_tensile(tensile(name, **keys))
    assert name in str(caught.value)


@pytest.mark.parametrize(
    "content", [b"", b"\n\n", b"PK\x03\x04 a workbook", b"\x00\x01\x02" * 50, b"just words\nand more\n", b"1\n2\n3\n"]
)
def test_what_is_no_table_is_one_message(tensile, tmp_path, content):
    file = tmp_path / "mine.csv"
    file.write_bytes(content)
    with pytest.raises(ConfigError, match=r"mine\.csv"):
        fit_tensile(tensile(file))


@pytest.mark.parametrize(
    ("names", "scales", "says", "settled"),
    [
        ("elongation,force", (1.0, 1000.0), "forces in mN 180", {}),
        ("elongation,force", (0.001, 1.0), "m perhaps", {}),
        ("strain (-),stress (MPa)", (1.0, 1 / 1.8), "in % they would be", {}),
        ("strain (%),stress (kPa)", (1.0, 1 / 1.8), "forces in kN|stress", {"stress": "MPa"}),
    ],
    ids=["mN", "m", "per cent called a share", "MPa called kPa"],
)
def test_a_wrong_unit_is_one_message_that_names_the_likely_one(tensile, tmp_path, names, scales, says, settled):
    """Of a line of 180 MPa over strains of 1 to 8 % on the coupon of 100 mm by 1.8 mm2."""
    file, x = tmp_path / "mine.csv", np.linspace(1, 8, 20)
    rows = zip(scales[0] * x, scales[1] * 180 * 1.8 * x / 100, strict=True)
    file.write_text(f"{names}\n" + "".join(f"{a:.6f},{b:.6f}\n" for a, b in rows))
    with pytest.raises(ConfigError, match=says) as caught:
        fit_tensile(tensile(file))
    keys = {"units": settled} if settled else yaml.safe_load(caught.value.example)
    assert fit_tensile(tensile(file, **keys)).modulus == pytest.approx(180, rel=0.01)


def test_large_strains_that_are_stated_are_told(tensile, tmp_path):
    file, x = tmp_path / "mine.csv", np.linspace(0, 8, 400)
    file.write_text("strain (-),stress (MPa)\n" + "".join(f"{a:.4f},{1.8 * a:.6f}\n" for a in x))
    fit = fit_tensile(tensile(file))
    assert fit.modulus == pytest.approx(1.8, rel=0.01)
    assert any("if they are in %" in note for note in fit.notes)
