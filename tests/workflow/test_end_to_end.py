"""The tiny sweep's results, as CalculiX gave them."""

from __future__ import annotations

import json

import numpy as np
import pytest
import xarray as xr

from limo.terminal.cli import main


@pytest.fixture(scope="module")
def study(solved) -> xr.Dataset:
    with xr.open_dataset(solved.folder / "results/studies/tiny/study.nc") as dataset:
        return dataset.load()


def statuses(solved) -> list[dict]:
    return [json.loads(f.read_text()) for f in sorted(solved.folder.glob("results/cases/*/status.json"))]


def test_every_case_converges_and_comes_to_rest(solved):
    for status in statuses(solved):
        assert status["status"] == "converged", status["reason"]
        assert status["rested"]
        assert status["actuation_pressure_reached"] == pytest.approx(10.0)
        assert sum(status["iterations_by_stage"].values()) == status["iterations"]


def test_the_energy_of_the_ramp_is_accounted_for(solved):
    for status in statuses(solved):
        assert 0.0 <= status["dissipated_fraction"] < 0.4
        balance = status["actuation_work_mj"] + status["ventricular_work_mj"] - status["strain_energy_change_mj"]
        assert balance == pytest.approx(status["dissipated_mj"], abs=1e-3)
        assert status["ventricular_work_mj"] < 0 < status["actuation_work_mj"]


def test_the_study_shows_what_the_paper_describes(study):
    curve = study.squeeze(drop=True)
    assert float(curve.ventricle_volume.sel(actuation_pressure=0.0).min()) > 150.0
    small = curve.sel(actuation_pressure=3.0).stroke_volume
    end = curve.sel(actuation_pressure=10.0)
    assert (np.abs(small) < 0.2 * end.stroke_volume).all()  # hardly anything before P_a reaches P_v
    few, many = end.sel(n_pouches=2), end.sel(n_pouches=4)
    assert float(few.stroke_volume) > float(many.stroke_volume) > 10.0  # fewer pouches, more stroke
    assert (end.io_ratio > curve.sel(actuation_pressure=5.0).io_ratio).all()  # the lever grows as pouches inflate


def test_every_variable_has_a_unit_and_a_name(study):
    for name, variable in study.variables.items():
        assert variable.attrs.get("long_name"), name
        if variable.dtype.kind == "f":
            assert variable.attrs.get("units"), name
    assert json.loads(study.attrs["config"])["study"]["axes"]["n_pouches"] == [2, 4]
    assert study.attrs["git_commit"]


def test_what_is_kept_and_what_is_dropped(solved):
    for folder in solved.folder.glob("results/cases/*"):
        assert not list(folder.glob("run/*.frd"))
        assert (folder / "run/deck.inp").stat().st_size > 0
        with xr.open_dataset(folder / "frames.nc") as frames:
            assert frames.actuation_pressure.values[0] == 0.0
            assert frames.actuation_pressure.values[-1] == pytest.approx(10.0)
            assert np.isfinite(frames.displacement).all()


def test_volumes_of_the_two_methods_agree_to_the_order_of_the_triangles(solved):
    for file in solved.folder.glob("results/cases/*/volumes.nc"):
        with xr.open_dataset(file) as history:
            last = history.isel(increment=-1)
            assert float(last.ventricle_volume_triangles) == pytest.approx(float(last.ventricle_volume), rel=0.05)
            assert float(last.ventricle_volume_conjugate) == pytest.approx(float(last.ventricle_volume), abs=10.0)


def test_tables_print(solved, capsys, monkeypatch):
    monkeypatch.chdir(solved.folder)
    assert main(["table", "results/studies/tiny/study.nc"]) == 0
    said = capsys.readouterr().out
    assert "converged" in said
    assert "pressure_volume.png" in said
    assert main(["benchmark"]) == 0
    assert "python share" in capsys.readouterr().out
    assert main(["table", "nowhere.nc"]) == 1
    assert "nowhere.nc" in capsys.readouterr().err


def test_cases_are_shown_and_compared(solved, capsys, monkeypatch):
    monkeypatch.chdir(solved.folder)
    assert main(["status"]) == 0
    assert "2 cases, 2 converged" in capsys.readouterr().out
    assert main(["show", "np4", "pv3.8", "--at", "5", "10", "--picture", "np4.png"]) == 0
    said = capsys.readouterr().out
    assert "converged reached P_a = 10 of 10 kPa" in said
    assert "deck.sta" in said
    assert (solved.folder / "np4.png").exists()
    assert main(["compare", "np2", "np4,pv3.8"]) == 0
    said = capsys.readouterr().out
    assert said.split("parameters that differ")[1].split("curves")[0].split() == ["a", "b", "n_pouches", "2", "4"]
    assert main(["clean"]) == 0
    assert "nothing to delete" in capsys.readouterr().out
