"""Nothing that a study does not need: what a change of the configuration runs again, and which results serve others."""

from __future__ import annotations

import base64
import shutil
from pathlib import Path

import pytest
import xarray as xr

from limo.config.load import load_config
from limo.engines.calculix.build import find_ccx
from limo.errors import LimoError
from limo.reports.overhead import time_of_nothing, time_of_planning
from limo.terminal.cli import main

from .conftest import ROOT, Project, copied


@pytest.mark.parametrize(
    ("file", "change"),
    [
        ("studies/tiny.yaml", lambda d: d.update(description="other words")),
        ("config.yaml", lambda d: d["numerics_presets"]["fast"].update(description="other words")),
        ("config.yaml", lambda d: d.update(solver={"time_limit": 999.0})),
        ("config.yaml", lambda d: d["numerics_presets"]["paper_too"].update(hht_alpha=-0.1)),
        ("config.yaml", lambda d: d["fatigue"].update(youngs_modulus={"value": 120.0, "origin": "a test"})),
    ],
    ids=["words about a study", "words about a preset", "time limit", "preset of nobody", "fatigue of nobody"],
)
def test_what_no_result_depends_on_runs_nothing(pretended, file, change):
    def prepared(data):
        if file == "config.yaml":
            data["numerics_presets"]["paper_too"] = data["numerics_presets"]["paper"].copy()
            data.setdefault("fatigue", {})
        change(data)

    pretended.edit(file, prepared)
    path = pretended.folder / "config" / file
    path.write_text("# a comment\n" + path.read_text())
    assert pretended.planned() == {}


def test_the_same_solver_elsewhere_runs_nothing_and_another_build_everything_beside_it(pretended, tmp_path):
    ccx = tmp_path / "elsewhere" / "ccx"
    ccx.parent.mkdir()
    shutil.copy(find_ccx(pretended_solver(pretended)).resolve(), ccx)
    pretended.edit("config.yaml", lambda d: d.update(solver={"command": str(ccx)}))
    assert pretended.planned() == {}
    with ccx.open("ab") as file:
        file.write(b"another build")
    planned = pretended.planned()
    assert planned["solve_case"] == 5
    assert "mesh_device" not in planned
    here = {f.name for f in (pretended.folder / "results/cases").iterdir()}
    assert here.isdisjoint(pretended.plan().to_solve)


def test_a_mesh_left_unfinished_holds_no_case_back(pretended):
    """Snakemake 9 leaves cases out behind an input marked `ancient` that it makes again, and ends as if all were done."""
    plan = pretended.plan()
    case_id, case = next((name, plan.cases[name]) for name in plan.of_study("tiny"))
    shutil.rmtree(pretended.folder / "results/cases" / case_id)
    marks = pretended.folder / ".snakemake/incomplete"
    marks.mkdir(exist_ok=True)
    marks.joinpath(base64.b64encode(f"results/meshes/{case.mesh_id}.vtu".encode()).decode()).touch()
    planned = pretended.planned("tiny")
    assert planned["mesh_device"] == 1
    assert planned["solve_case"] >= 1
    assert planned["gather_study"] == 1


def pretended_solver(project: Project):
    return load_config(project.config_file).config.solver


@pytest.mark.parametrize(("preset", "solved_again"), [("fast", 3), ("paper", 2)])
def test_another_damping_solves_the_cases_that_have_it_and_no_others(pretended, preset, solved_again):
    pretended.edit("config.yaml", lambda d: d["numerics_presets"][preset]["ramp"].update(damping=9e5 if preset == "fast" else 99))
    planned = pretended.planned()
    assert planned["solve_case"] == solved_again
    assert planned["gather_study"] == (2 if preset == "fast" else 1)
    assert "mesh_device" not in planned


@pytest.mark.parametrize(
    ("change", "solves"),
    [
        ({"actuation_pressure_max": 8.0}, 0),
        ({"frames": [0, "max"]}, 0),
        ({"frames": [0, "P_v", 7.0, "max"]}, 2),
        ({"actuation_pressure_max": 8.0, "reuse": "exact"}, 2),
        ({"actuation_pressure_max": 11.0}, 2),
    ],
    ids=["lower maximum", "fewer frames", "new frame", "lower maximum and exact", "higher maximum"],
)
def test_a_changed_study_is_gathered_again_and_solved_only_where_results_do_not_reach(pretended, change, solves):
    pretended.study("tiny", **change)
    planned = pretended.planned("tiny")
    assert planned.get("solve_case", 0) == solves
    assert planned["gather_study"] == 1
    assert "measure_case" not in planned


def test_a_study_that_stops_earlier_is_served_by_what_is_solved(pretended):
    pretended.study("short", actuation_pressure_max=7.0)
    assert set(pretended.planned("short")) == {"gather_study", "export_study", "draw_figure", "short", "total"}


def test_of_two_unsolved_studies_the_further_serves_both_in_either_order(project):
    project.study("long", actuation_pressure_max=20.0)
    assert project.planned("tiny", "long")["solve_case"] == 2
    assert project.planned("tiny")["solve_case"] == 2
    assert {c.actuation_pressure_max for c in project.plan().cases.values()} == {20.0}


def test_a_further_study_does_not_solve_what_is_solved(pretended):
    pretended.study("long", actuation_pressure_max=20.0)
    assert pretended.planned("tiny") == {}
    assert pretended.planned("long")["solve_case"] == 2


def test_a_better_mesh_serves_only_who_says_so(pretended):
    mesh = {"level": "rougher", "symmetry": "quarter", "element": "C3D20R"}
    pretended.edit("config.yaml", lambda d: d["mesh_levels"].update(rougher={"degrees_of_freedom": 2500}))
    pretended.study("rough", mesh=mesh)
    assert pretended.planned("rough")["solve_case"] == 2
    pretended.study("rough", mesh=mesh, reuse="better")
    assert "solve_case" not in pretended.planned("rough")


def test_stress_of_solved_cases_is_measured_without_solving(pretended):
    pretended.study("tiny", outputs=["volumes", "stress"])
    planned = pretended.planned("tiny")
    assert planned["measure_case"] == 2
    assert "solve_case" not in planned


def test_other_figures_do_not_gather_again(pretended):
    pretended.study("tiny", figures=[])
    assert pretended.planned("tiny") == {}
    (pretended.folder / "results/studies/tiny/figures/pressure_volume.png").unlink()
    pretended.study("tiny", figures=["pressure_volume"])
    assert set(pretended.planned("tiny")) == {"draw_figure", "tiny", "total"}


def test_each_solve_says_how_long_it_will_take(project):
    said = project.snakemake("-n").stdout
    assert said.count("s of CPU time") == 2
    assert "predicted 0 s" not in said


def test_a_case_of_no_study_is_one_message(pretended):
    done = pretended.snakemake("-n", "results/cases/unknown/status.json")
    assert done.returncode != 0
    assert "no study of" in done.stdout + done.stderr


def test_check_tells_what_is_solved_served_and_left(pretended, capsys, monkeypatch):
    pretended.study("short", actuation_pressure_max=7.0)
    pretended.study("long", actuation_pressure_max=20.0)
    monkeypatch.chdir(pretended.folder)
    assert main(["check", "--cores", "2"]) == 0
    said = {line.split(":")[0].strip(): line for line in capsys.readouterr().out.splitlines()}
    assert "2 cases on 2 meshes, 2 solved" in said["tiny"]
    assert "2 solved, 2 of 2 served by a case beyond them" in said["short"]
    assert "0 solved, 2 to solve in" in said["long"]
    assert main(["check", "long", "short"]) == 0
    assert "together 4 distinct cases, 2 to solve in" in capsys.readouterr().out
    assert main(["check", "nobody"]) == 1
    assert "nobody" in capsys.readouterr().err


def test_a_case_that_was_removed_is_solved_again_once_its_study_is_gathered(pretended):
    (case_id, _) = pretended.plan().of_study("tiny")
    shutil.rmtree(pretended.folder / "results/cases" / case_id)
    assert pretended.planned("tiny", "--forcerun", "gather_study")["solve_case"] == 1


def test_a_thousand_cases_are_planned_and_what_that_takes_is_measured(project):
    row = time_of_planning(Path("config/config.yaml"), project.folder, ROOT / "Snakefile", runs=1)
    assert row["cases"] == 1000
    assert 0 < row["wall_seconds"] < float("inf")


def test_doing_nothing_is_measured_only_where_nothing_is_to_be_done(pretended, project):
    row = time_of_nothing(Path("config/config.yaml"), pretended.folder, ROOT / "Snakefile", runs=1)
    assert row["cases"] == len(pretended.plan().cases)
    with pytest.raises(LimoError, match="not all is solved"):
        time_of_nothing(Path("config/config.yaml"), project.folder, ROOT / "Snakefile", runs=1)


def test_a_dataset_from_a_further_case_stops_where_its_study_does(solved, tmp_path):
    project = copied(solved.folder, tmp_path / "copy")
    project.study("short", actuation_pressure_max=7.3)
    done = project.snakemake("short")
    assert done.returncode == 0, done.stdout + done.stderr
    results = project.folder / "results/studies"
    with xr.open_dataset(results / "short/study.nc") as short, xr.open_dataset(results / "tiny/study.nc") as tiny:
        assert float(short.actuation_pressure.max()) == 7.3
        assert (short.actuation_pressure_reached == 7.3).all()
        assert (short.case_id == tiny.case_id).all()
        assert short.stroke_volume.notnull().all()
        shared = [p for p in short.actuation_pressure.values if p in tiny.actuation_pressure.values]
        xr.testing.assert_allclose(
            short.stroke_volume.sel(actuation_pressure=shared), tiny.stroke_volume.sel(actuation_pressure=shared)
        )
    assert project.planned("short") == {}
