"""Seams and numbers of pouches that are known, found again from the statements that depend on them; the others are held out."""

import json

import numpy as np
import pandas as pd
import pytest
import xarray as xr
import yaml

from limo.errors import ConfigError, LimoError
from limo.reports import inference
from limo.reports.inference import SeamStudy, infer, read_inference, seam_studies
from limo.reports.paper_check import check, read_inferred, read_studies
from limo.terminal.cli import main
from tests.unit.reports.test_paper_check import data  # noqa: F401 (a fixture)

POSITIONS = {
    6: [[0.62], [0.50], [0.74], [0.56], [0.68]],
    10: [[0.5, 1.3], [0.4, 1.2], [0.6, 1.4], [0.4, 1.4], [0.6, 1.2]],
}
VARIANTS = ["prior", "inner", "outer", "apart", "together"]
ETA = 0.30  # of N_p = 10 with the prior at the lowest P_v; the paper's range begins at 0.43


def rising(f):
    """Efficiency of N_p = 10 at the lowest P_v, which only the inner seam decides: 0.43 at 0.565."""
    return ETA + 2.0 * (f[0] - 0.5)


def seams(afterload, eta=rising):
    """A study over seams whose devices are those of ``afterload``, but for the efficiency of N_p = 10."""
    parts = []
    for k in range(len(VARIANTS)):
        one = afterload.sel(n_pouches=[6, 10]).copy(deep=True)
        one.efficiency_90ml.loc[{"n_pouches": 10}] += eta(POSITIONS[10][k]) - float(one.efficiency_90ml.sel(n_pouches=10).min())
        parts.append(one)
    dataset = xr.concat(parts, pd.Index(VARIANTS, name="variant"))
    settings = {
        name: {"device": {"pattern": {"seams": {"fractions": {str(n): POSITIONS[n][k] for n in POSITIONS}}}}}
        for k, name in enumerate(VARIANTS)
    }
    return dataset.assign_attrs(config=json.dumps({"settings": settings}))


@pytest.fixture(autouse=True)
def coarse(monkeypatch):
    """Fewer places than usual: each takes a few hundredths of a second."""
    monkeypatch.setattr(inference, "PLACES", 64)


@pytest.fixture
def folder(data, tmp_path):  # noqa: F811
    """Datasets of which all statements hold, but that N_p = 10 is less efficient than the paper's range with the prior."""
    wrong = data["afterload"].copy(deep=True)
    wrong.efficiency_90ml.loc[{"n_pouches": 10}] += ETA - float(wrong.efficiency_90ml.sel(n_pouches=10).min())
    valve = data["valve_support"]
    values = [valve.isel(n_pouches=0).assign(efficiency_90ml=valve.efficiency_90ml.isel(n_pouches=0) + by) for by in (0.2, 0.0)]
    both = xr.concat(values, pd.Index([6, 8], name="n_pouches")).transpose(*valve.dims)
    for name, dataset in (data | {"afterload": wrong, "seam_positions": seams(data["afterload"]), "valve_support": both}).items():
        dataset.to_netcdf(tmp_path / f"{name}.nc")
    return tmp_path


@pytest.fixture
def asked(root, tmp_path):
    """``asked(**changes)``: the shipped question with other keys."""

    def write(**changes):
        values = yaml.safe_load((root / "config/inferences/seams.yaml").read_text(encoding="utf-8"))
        file = tmp_path / "inference.yaml"
        file.write_text(yaml.safe_dump(values | changes), encoding="utf-8")
        return file

    return write


def test_known_seams_and_pouches_are_found_again(asked, folder):
    rows = infer(asked(), folder)
    places = rows[rows.kind == "position"].set_index("name")
    assert list(places.index) == ["N_p = 6", "N_p = 10, seam 1", "N_p = 10, seam 2"]
    inner = places.loc["N_p = 10, seam 1"]
    assert inner.prior == 0.5
    assert inner.inferred > 0.51, "towards where N_p = 10 is in the paper's range, from 0.565 on"
    assert inner.low < inner.inferred < inner.high
    for name, prior in (("N_p = 6", 0.62), ("N_p = 10, seam 2", 1.3)):
        assert places.inferred[name] == pytest.approx(prior, abs=0.02), "nothing depends on it, so that the prior stays"
    said = rows[rows.kind == "statement"].set_index("name")
    assert said.loc["efficiencies at 90 ml", ["inference", "prior"]].tolist() == ["used", "partly"]
    assert said.loc["efficiency falls with N_p", ["inference", "inferred"]].tolist() == ["held out", "reproduced"]
    assert said.loc["the device holds 300 ml", "inference"] == ""
    before, after = said.loc["efficiencies at 90 ml", ["chance_before", "chance"]]
    assert after / (1 - after) == pytest.approx(np.e * before / (1 - before), rel=1e-9), "one verdict better is e times as likely"
    pouches = rows[rows.kind == "pouches"].set_index("name").loc["N_p of valve_support"]
    assert (pouches.prior, pouches.inferred) == (6, 8), "the efficiencies over AR are those of N_p = 8"
    assert pouches.chance == pytest.approx(np.e**2 / (1 + np.e**2)), "a statement that does not hold with 6 and does with 8"
    assert said.loc["efficiency over AR", ["prior", "inferred"]].tolist() == ["not", "reproduced"]


def test_statements_that_are_held_out_decide_nothing(asked, folder):
    given = yaml.safe_load(asked().read_text())
    text = "efficiencies at 90 ml"
    used = [t for t in given["used"] if t != text] + ["efficiency rises with P_v"]
    held_out = [t for t in given["held_out"] if t != "efficiency rises with P_v"] + [text]
    places = infer(asked(used=used, held_out=held_out), folder).set_index("name")
    assert places.inferred["N_p = 10, seam 1"] == pytest.approx(0.5, abs=0.01)
    assert places.loc[text, ["inference", "inferred"]].tolist() == ["held out", "partly"]


def test_between_variants_numbers_are_interpolated(data):  # noqa: F811
    six, ten = seam_studies(seams(data["afterload"]), "here")
    assert (six.n_pouches, ten.n_pouches) == (6, 10)
    for place in ([0.5, 1.3], [0.6, 1.2], [0.47, 1.33]):
        found = float(ten.at(np.array(place)).efficiency_90ml.min())
        assert found == pytest.approx(rising(place), abs=1e-6), "a plane stays a plane"
    assert six.at(np.array([0.7])).case_status.values.ravel()[0] == "converged"


def test_a_variant_that_failed_is_left_out_and_too_few_are_refused(data):  # noqa: F811
    dataset = seams(data["afterload"])
    dataset.case_status.loc[{"variant": "inner", "n_pouches": 10}] = "diverged"
    assert [len(s.positions) for s in seam_studies(dataset, "here")] == [5, 4]
    dataset.case_status.loc[{"variant": ["inner", "outer"], "n_pouches": 10}] = "diverged"
    with pytest.raises(LimoError, match=r"here: variants = 3 usable ones of N_p = 10; expected 4 or more.*for example"):
        seam_studies(dataset, "here")


@pytest.mark.parametrize(
    ("changes", "key", "words"),
    [
        ({"used": ["efficiencies at 90 ml", "the ratio starts close to one"]}, "used", "4 or more statements about afterload"),
        ({"used": ["efficiency falls with N_p"]}, "(file)", "both used and held out"),
        ({"used": ["pouches are blue"]}, "used", "a statement of docs/paper_check.md"),
        ({"held_out": ["stress concentrates on seams and in buckled regions"]}, "held_out", "a statement about afterload"),
        ({"used": []}, "used", "at least 1"),
        ({"prior_spread": 0}, "prior_spread", "greater than 0"),
        ({"colour": "red"}, "colour", "no such key"),
    ],
)
def test_mistakes_are_refused(asked, folder, changes, key, words):
    with pytest.raises(ConfigError) as caught:
        infer(asked(**changes), folder)
    assert caught.value.key == key
    assert words in str(caught.value)
    assert "inference.yaml" in str(caught.value)


def test_what_is_not_solved_is_one_message(asked, tmp_path, capsys):
    assert main(["infer", "--file", str(asked()), "--data", str(tmp_path / "nothing")]) == 1
    assert "no dataset of afterload; snakemake --cores 2 afterload makes it" in capsys.readouterr().err


def test_the_paper_check_says_which_rows_were_used(asked, folder, capsys):
    before = check(read_studies(folder), read_inferred(folder)).set_index("statement")
    assert set(before.inference) == {"not used"}
    assert main(["infer", "--file", str(asked()), "--data", str(folder), "--table", str(folder / "inference.csv")]) == 0
    assert "N_p = 10, seam 1" in capsys.readouterr().out
    rows = check(read_studies(folder), read_inferred(folder)).set_index("statement")
    question = read_inference(asked())
    asked_of = rows.study.isin(["afterload", "valve_support"])  # of compliance there is N_p = 6 alone: nothing to choose
    for role, texts in (("used", question.used), ("held out", question.held_out)):
        assert set(rows.index[rows.inference == role]) == {text for text in texts if asked_of[text]}
    assert rows.inference["the device holds 300 ml"] == "not used"
    elsewhere = (folder / "inference.csv").rename(folder.parent / "elsewhere.csv")
    assert read_inferred(folder) == {}
    assert {k: v or "not used" for k, v in read_inferred(folder, elsewhere).items()}.items() <= dict(rows.inference).items()


def test_the_shipped_question_holds_half_out(root):
    question = read_inference(root / "config/inferences/seams.yaml")
    assert abs(len(question.used) - len(question.held_out)) <= 1


def test_positions_are_those_of_the_shipped_study(loaded):
    settings = loaded.settings("seam_positions")
    fractions = {name: s.device.pattern.seams.fractions for name, s in settings.items()}
    own = loaded.devices["limo"].pattern.seams.fractions
    first = next(iter(fractions.values()))
    assert (first[6], first[10]) == (own[6], own[10]), "the first variant is the prior"
    for n in (6, 10):
        positions = np.array([f[n] for f in fractions.values()])
        study = SeamStudy(n, positions, xr.Dataset())
        assert np.linalg.matrix_rank(positions[1:] - positions[0]) == positions.shape[1], "each unknown is varied"
        assert len(study.names) == positions.shape[1]
