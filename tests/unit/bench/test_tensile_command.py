"""``limo tensile``: without a configuration, and from one; a picture; the modulus in a device."""

from __future__ import annotations

import json
import shutil

import pytest
import yaml

from limo.bench.tensile import fit_tensile, tensile_dataset
from limo.config.load import load_config
from limo.figures import style
from limo.figures.tensile_test import draw
from limo.terminal.cli import main

from .conftest import FIXTURES

SIZE = ["--length", "100", "--width", "15", "--thickness", "0.12"]


@pytest.fixture
def outside(tmp_path, monkeypatch):
    """An empty folder, without any configuration."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_file_needs_no_configuration(outside, capsys):
    assert main(["tensile", str(FIXTURES / "side_by_side.csv"), *SIZE]) == 0
    said = capsys.readouterr().out
    assert "strip A" in said
    assert "strip B" in said
    assert "mean of 2 specimens" in said
    assert (outside / "results/tensile/side_by_side.png").read_bytes().startswith(b"\x89PNG")


def test_json_is_for_machines(outside, capsys):
    files = [str(FIXTURES / n) for n in ("semicolon_comma.csv", "break.csv")]
    assert main(["tensile", *files, *SIZE, "--json", "--picture", "both.pdf"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["youngs_modulus"] == pytest.approx(180, rel=0.01)
    assert said["units"] == "MPa"
    assert [s["name"] for s in said["specimens"]] == ["semicolon_comma", "break"]
    assert all(s["error"] > 0 and s["window"][0] < s["window"][1] for s in said["specimens"])
    assert said["picture"] == "both.pdf"
    assert (outside / "both.pdf").exists()


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["kilonewton_silent.csv", *SIZE], "--set 'units={force: kN}'"),
        (["semicolon_comma.csv"], "--length 200"),
        (["semicolon_comma.csv", *SIZE, "--set", "colour=red"], "colour"),
        (["semicolon_comma.csv", *SIZE, "--set", "units"], "KEY=VALUE"),
        (["semicolon_comma.csv", *SIZE, "--window", "0.05", "0.01"], "lower end"),
        (["semicolon_comma.csv", *SIZE, "--picture", "mine.doc"], "png"),
        (["semicolon_comma.csv", *SIZE, "--into", "limo"], "--into"),
        (["absent.csv", *SIZE], "absent.csv"),
    ],
)
def test_a_mistake_is_one_message(outside, capsys, words, says):
    assert main(["tensile", str(FIXTURES / words[0]), *words[1:]]) == 1
    said = capsys.readouterr()
    assert says in said.err
    assert len(said.err.strip().splitlines()) == 1
    assert said.out == ""


@pytest.mark.parametrize("setting", ["units.force=kN", "units={force: kN}"])
def test_the_option_of_a_message_settles_it(outside, capsys, setting):
    assert main(["tensile", str(FIXTURES / "kilonewton_silent.csv"), *SIZE, "--set", setting]) == 0
    assert "in kN (key units)" in capsys.readouterr().out


def test_marks_are_settings_as_they_are(outside, capsys):
    file = str(FIXTURES / "thousand_or_decimal.csv")
    assert main(["tensile", file, *SIZE, "--set", "decimal=.", "--set", "thousands=,", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["youngs_modulus"] == pytest.approx(180, rel=0.01)
    file = str(FIXTURES / "hash_first.csv")
    assert main(["tensile", file, *SIZE, "--set", "comment=", "--set", "separator=,", "--json"]) == 0
    assert len(json.loads(capsys.readouterr().out)["specimens"]) == 2


def test_a_window_and_the_papers_method_are_options(outside, capsys):
    for words, method in ((["--window", "0.01", "0.03"], "window"), (["--method", "paper"], "paper")):
        assert main(["tensile", str(FIXTURES / "break.csv"), *SIZE, *words, "--json", "--set", "largest_strain=0.05"]) == 0
        said = json.loads(capsys.readouterr().out)
        assert said["method"] == method
        assert said["youngs_modulus"] == pytest.approx(180, rel=0.01)


def test_without_files_the_test_of_the_configuration_is_fitted(root, monkeypatch, tmp_path, capsys):
    monkeypatch.chdir(root)
    assert main(["tensile", "--results", str(tmp_path)]) == 0
    said = capsys.readouterr().out
    assert "uniaxial_synthetic" in said
    assert (tmp_path / "tensile/uniaxial_synthetic.png").exists()


@pytest.mark.parametrize("device", ["limo", "mini_limo", "braces"])
def test_a_modulus_goes_into_a_device_with_its_origin_and_nothing_else_changes(root, tmp_path, monkeypatch, capsys, device):
    shutil.copytree(root / "config", tmp_path / "config")
    monkeypatch.chdir(tmp_path)
    file = tmp_path / f"config/devices/{device}.yaml"
    if device == "braces":
        data = yaml.safe_load((tmp_path / "config/devices/limo.yaml").read_text())
        file.write_text(yaml.safe_dump(data, default_flow_style=None) + "# the end\n")
    before = file.read_text()
    for name in ("semicolon_comma.csv", "side_by_side.csv"):  # the second one takes the place of the first
        assert main(["tensile", str(FIXTURES / name), *SIZE, "--into", device]) == 0
    after = file.read_text()
    old, new = yaml.safe_load(before), yaml.safe_load(after)
    assert new["material"].pop("youngs_modulus") == pytest.approx(135, rel=0.01)
    assert "side_by_side.csv" in new["material"].pop("modulus_origin")
    del old["material"]["youngs_modulus"]
    assert new == old
    comments = [line.partition("#")[2] for line in before.splitlines() if "#" in line]
    assert [line.partition("#")[2] for line in after.splitlines() if "#" in line] == comments
    loaded = load_config("config/config.yaml")
    material = loaded.devices[device].material
    assert material.modulus_origin.startswith("tensile test side_by_side.csv")
    assert "modulus_origin" not in material.model_dump(), "a name of a case does not depend on words"
    capsys.readouterr()


def test_a_file_without_the_place_is_left_alone(root, tmp_path, monkeypatch, capsys):
    shutil.copytree(root / "config", tmp_path / "config")
    monkeypatch.chdir(tmp_path)
    file = tmp_path / "config/devices/limo.yaml"
    file.write_text(file.read_text().replace("youngs_modulus: 267.0", '"youngs_modulus": 267.0'))
    before = file.read_text()
    assert main(["tensile", str(FIXTURES / "semicolon_comma.csv"), *SIZE, "--into", "limo"]) == 1
    assert "by hand" in capsys.readouterr().err
    assert file.read_text() == before


def test_the_picture_shows_every_specimen_its_line_and_what_is_not_fitted(tensile):
    figure = draw(tensile_dataset(fit_tensile(tensile("break.csv"))))
    axis = figure.axes[0]
    labels = [text.get_text() for text in axis.get_legend().get_texts()]
    assert labels[:2] == ["measured", "not fitted"]
    assert "180" in labels[2]
    shown = sum(len(line.get_xdata()) for line in axis.get_lines() if line.get_marker() == "o")
    assert shown == 60
    style.close(figure)
    figure = draw(tensile_dataset(fit_tensile(tensile("shared_elongation.csv"))))
    labels = [text.get_text() for text in figure.axes[0].get_legend().get_texts()]
    assert len(labels) == 4
    assert labels[-1].startswith("mean")
    style.close(figure)


def test_the_shipped_test_is_marked_as_synthetic_and_gives_the_modulus_of_the_paper(root):
    for keys in ({}, {"method": "paper"}):
        test = load_config(root / "config/config.yaml").config.tensile_test
        test = test.model_copy(update={"data": str(root / test.data), **keys})
        fit = fit_tensile(test)
        assert abs(fit.modulus - 267.0) < 2.0
        dataset = tensile_dataset(fit)
        assert dataset.attrs["synthetic"] == "True"
        labels = [text.get_text() for text in draw(dataset).axes[0].get_legend().get_texts()]
        assert labels[0] == "synthetic data, no measurement"
        assert "MPa" in labels[-1]
