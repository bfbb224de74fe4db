"""The second engine through the workflow: branches, cross checks, and what depends on an engine."""

import shutil

import numpy as np
import pytest
import xarray as xr

from limo.store.files import read_json

from .conftest import copied, run


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
    assert float(abs(study.check_energy_difference[0])) < 0.02
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


def test_a_case_begins_at_the_state_that_the_device_has_on_a_coarser_mesh(project):
    """A case without a ramp, which no other branch shares; it is solved again only for a case that has to be."""
    project.edit("config.yaml", lambda c: c["mesh_levels"].update(finer={"degrees_of_freedom": 6000, "grading": 1.0}))
    begun = {"newton": {"fit_on": ["tiny"], "fit_via": [1, 3]}}
    axes = {"n_pouches": [4], "ventricular_pressure": [3.8]}
    changes = {"axes": axes, "engine": "newton", "branches": 2, "actuation_pressure_max": 5.0, "figures": []}
    project.study("tiny", mesh={"level": "finer", "element": "SHELL8R"}, numerics=begun, **changes)
    assert project.planned("tiny")["solve_case"] == 4
    run(project, "tiny")
    plan, cases = project.plan(), project.folder / "results" / "cases"
    for case in map(plan.cases.get, plan.of_study("tiny")):
        status, coarse = (read_json(cases / name / "status.json") for name in (case.case_id, case.fit.case_id))
        assert {status["status"], coarse["status"]} == {"converged"}
        assert status["begun_at"] == case.fit.case_id
        assert status["iterations_by_stage"]["fit"] == 0 < status["iterations_by_stage"]["hold"]
        assert status["fit_cpu_seconds"] == coarse["solver_cpu_seconds"]
        assert [way["via"] for way in coarse["ways"]] == [1, 3]
        history = xr.open_dataset(cases / case.fit.case_id / "volumes.nc")
        lowest = min(way["potential_energy_mj"] for way in coarse["ways"])
        assert float(history.potential_energy[-1]) == pytest.approx(lowest, rel=1e-6)
    study = xr.open_dataset(project.folder / "results/studies/tiny/study.nc").squeeze()
    assert int(study.lowest_branch) == int(study.potential_energy.isel(actuation_pressure=0).argmin("branch"))
    assert project.planned("tiny") == {}
    lost = plan.cases[plan.of_study("tiny")[0]].fit.case_id
    shutil.rmtree(cases / lost)
    assert project.planned("tiny") == {}, "what began there is solved"
    shutil.rmtree(cases / plan.of_study("tiny")[0])
    status = f"results/cases/{plan.of_study('tiny')[0]}/status.json"
    assert project.planned(status)["solve_case"] == 2, "the case and where it begins"
