"""The second engine through the workflow: branches, cross checks, and what depends on an engine."""

import numpy as np
import xarray as xr

from limo.store.files import read_json

from .conftest import copied


def statuses(project):
    plan = project.plan()
    folder = project.folder / "results" / "cases"
    return {name: read_json(folder / name / "status.json") for name in (*plan.of_study("tiny"), *plan.checks_of_study("tiny"))}


def test_each_engine_solves_its_cases_and_says_so(everything):
    found = statuses(everything)
    assert [s["engine"] for s in found.values()] == ["newton", "newton", "calculix"]
    assert {s["status"] for s in found.values()} == {"converged"}
    for name, status in found.items():
        assert status["solver_cpu_seconds"] > 0
        assert (status["solver"]["version"] == "2.20") == (status["engine"] == "calculix")
        run = everything.folder / "results" / "cases" / name / "run"
        assert (run / "deck.inp").exists() == (status["engine"] == "calculix")
    newton = next(iter(found.values()))
    assert newton["rest_change"] == 0.0
    assert newton["factorisations"] >= newton["iterations"]


def test_frames_of_the_second_engine_are_equilibria_at_the_pressures_asked_for(everything):
    study = xr.open_dataset(everything.folder / "results/studies/tiny/study.nc").squeeze()
    asked = study.frame_pressure.values[0]
    np.testing.assert_allclose(asked, [0.0, 4.3, 10.0], atol=1e-9)
    assert float(study.residual.max()) < 2e-3, "said by the independent check of forces"
    assert float(study.residual_floor.max()) < 1e-4, "frames are kept in double precision"


def test_the_dataset_has_branches_and_the_other_engine(everything):
    study = xr.open_dataset(everything.folder / "results/studies/tiny/study.nc").squeeze()
    assert study.sizes["branch"] == 2
    stroke = study.stroke_volume.sel(actuation_pressure=10.0)
    assert (stroke > 1.0).all()
    assert str(study.check_status.values[0]) == "calculix converged"
    assert float(abs(study.check_rest_difference[0])) < 0.02
    assert (everything.folder / "results/studies/tiny/figures/pressure_volume.png").stat().st_size > 10_000


def test_what_one_engine_does_not_look_at_runs_none_of_its_cases_again(everything, tmp_path):
    swept = copied(everything.folder, tmp_path / "copy")
    swept.study("tiny", cross_check=0)
    assert "solve_case" not in swept.planned("tiny")
    swept.edit("config.yaml", lambda c: c["numerics_presets"]["fast"]["ramp"].update(damping=1.0e5))
    assert "solve_case" not in swept.planned("tiny"), "newton has no damping"
    swept.edit("config.yaml", lambda c: c["numerics_presets"]["fast"].update(newton={"load_step": 0.5}))
    assert swept.planned("tiny")["solve_case"] == 2
    swept.study("tiny", engine="calculix", branches=1)
    assert swept.planned("tiny")["solve_case"] == 1, "damped otherwise than when it was the cross check"
