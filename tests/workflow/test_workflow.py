"""What is planned, what is run again, and what a user's mistake says."""

from __future__ import annotations

import os
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from limo.accuracy.statistics import rows_of, sizes_of
from limo.accuracy.table import read_errors
from limo.reports.accuracy_airbag import read_airbags
from limo.terminal.cli import main
from tests.helpers.results_page import rows, table

from .conftest import ROOT, Project, copied, jobs, make_project, run


def test_default_configuration_plans_one_solve_and_mesh_a_device(tmp_path):
    project = Project(tmp_path)
    shutil.copytree(ROOT / "config", tmp_path / "config")
    assert project.planned("pressure_volume") == {
        "mesh_device": 4,
        "solve_case": 4,
        "measure_case": 4,
        "gather_study": 1,
        "export_study": 1,
        "gather_shapes": 1,
        "draw_figure": 2,
        "pressure_volume": 1,
        "total": 18,
    }


WITHOUT_EGL = """
import ctypes

load = ctypes.CDLL


def refuse(name, *arguments, **options):
    if name == "libEGL.so.1":
        raise OSError(f"{name}: cannot open shared object file")
    return load(name, *arguments, **options)


ctypes.CDLL = refuse
"""


def test_figures_of_surfaces_wait_for_what_renders_them(tmp_path, monkeypatch):
    project = Project(tmp_path)
    shutil.copytree(ROOT / "config", tmp_path / "config")
    (tmp_path / "sitecustomize.py").write_text(WITHOUT_EGL)
    monkeypatch.setenv("PYTHONPATH", f"{tmp_path}:{os.environ.get('PYTHONPATH', '')}")
    done = project.snakemake("-n", "pressure_volume", fresh=True)
    planned = jobs(done)
    assert planned["draw_figure"] == 1
    assert "gather_shapes" not in planned
    assert (done.stdout + done.stderr).count("install the system's packages libegl1") == 1


def test_a_new_study_file_is_all_a_new_study_takes(project):
    text = (project.folder / "config/studies/tiny.yaml").read_text().replace("3.8", "5.0")
    (project.folder / "config/studies/mine.yaml").write_text(text)
    assert project.planned("mine")["solve_case"] == 2


def test_cases_shared_by_two_studies_are_solved_once(project):
    shutil.copy(project.folder / "config/studies/tiny.yaml", project.folder / "config/studies/again.yaml")
    assert project.planned("tiny", "again")["solve_case"] == 2


@pytest.mark.parametrize(
    ("file", "change", "says"),
    [
        ("studies/tiny.yaml", lambda d: d["axes"].update(n_pouches=[5]), ("tiny.yaml", "n_pouches", "5", "example")),
        (
            "studies/tiny.yaml",
            lambda d: d.update(actuation_pressure_max=2.0),
            ("tiny.yaml", "actuation_pressure_max", "2.0", "3.8"),
        ),
        ("studies/tiny.yaml", lambda d: d.update(colour="red"), ("tiny.yaml", "colour", "no such key")),
        (
            "config.yaml",
            lambda d: d.update(solver={"command": "/nowhere/ccx"}),
            ("config.yaml", "solver.command", "/nowhere/ccx"),
        ),
        (
            "devices/limo.yaml",
            lambda d: d["pattern"]["seams"]["fractions"].update({4: [2.5]}),
            ("limo.yaml", "seams", "example"),
        ),
    ],
)
def test_a_mistake_in_the_configuration_is_one_message_before_anything_runs(project, file, change, says):
    project.edit(file, change)
    done = project.snakemake()
    output = done.stdout + done.stderr
    assert done.returncode != 0
    assert "Traceback" not in output
    for word in says:
        assert word in output
    assert not (project.folder / "results").exists()


def test_a_key_of_the_configuration_is_not_taken_from_the_command_line(project):
    """It would mean nothing there, and be overlooked."""
    done = project.snakemake("-n", config="preset=standard")
    output = done.stdout + done.stderr
    assert done.returncode != 0
    assert "Traceback" not in output
    assert "preset = 'standard': expected the key file alone" in output


def test_a_missing_solver_is_one_message(project, monkeypatch):
    keep = [p for p in os.environ["PATH"].split(os.pathsep) if not os.path.exists(os.path.join(p, "ccx"))]
    monkeypatch.setenv("PATH", os.pathsep.join(keep))
    if (ROOT / ".local/bin/ccx").exists():
        pytest.skip("a solver was unpacked into the project itself")
    # a tuned build in the project itself would do
    project.edit("config.yaml", lambda d: d.update(solver={"build": "stock"}))
    done = project.snakemake("-n")
    assert done.returncode != 0
    assert "CalculiX was not found" in done.stdout + done.stderr
    assert "Traceback" not in done.stdout + done.stderr


def test_nothing_is_solved_again_without_a_reason(solved, tmp_path):
    assert solved.planned() == {}
    study = solved.folder / "config/studies/tiny.yaml"
    study.write_text("# a comment\n" + study.read_text())
    assert solved.planned() == {}


def test_a_touched_script_runs_nothing_and_limo_check_says_the_same(pretended, capsys, monkeypatch):
    """Times of scripts are no reason: the digest of the code is a parameter of every rule."""
    scripts = [ROOT / "scripts/solve_case.py", ROOT / "scripts/gather_study.py"]
    before = {script: script.stat() for script in scripts}
    try:
        for script in scripts:
            script.touch()
        assert pretended.planned() == {}
    finally:
        for script, then in before.items():
            os.utime(script, ns=(then.st_atime_ns, then.st_mtime_ns))
    monkeypatch.chdir(pretended.folder)
    assert main(["check", "tiny"]) == 0
    assert "2 solved" in capsys.readouterr().out


def test_an_archive_without_conda_is_one_message_with_what_helps(project, monkeypatch):
    monkeypatch.setenv("PATH", str(Path(sys.executable).parent))  # where no conda is
    done = project.snakemake("--archive", "limo.tar.gz", "tiny")
    assert done.returncode != 0
    assert "git archive" in done.stdout + done.stderr
    assert "Traceback" not in done.stdout + done.stderr


def test_another_ventricular_pressure_solves_that_case_on_the_same_mesh(solved, tmp_path):
    project = copied(solved.folder, tmp_path / "copy")
    project.edit("studies/tiny.yaml", lambda d: d["axes"].update(n_pouches=[2], ventricular_pressure=[4.8]))
    planned = project.planned()
    assert planned["solve_case"] == 1
    assert "mesh_device" not in planned


def test_another_mesh_level_makes_new_meshes_and_cases(solved, tmp_path):
    project = copied(solved.folder, tmp_path / "copy")
    project.edit("config.yaml", lambda d: d["mesh_levels"]["tiny"].update(degrees_of_freedom=3500))
    planned = project.planned()
    assert planned["mesh_device"] == 2
    assert planned["solve_case"] == 2


def test_a_change_of_style_draws_the_figures_again_and_nothing_else(solved, tmp_path):
    """In a copy of the checkout, which takes the results for its own as long as nothing is changed."""
    workflow = tmp_path / "workflow"
    shutil.copytree(
        ROOT, workflow, symlinks=True, ignore=shutil.ignore_patterns(".venv", ".git", "results", ".snakemake", ".local")
    )
    (workflow / ".local").symlink_to(ROOT / ".local")  # the same solver
    project = copied(solved.folder, tmp_path / "copy")
    snakefile = str(workflow / "Snakefile")
    assert project.planned("--snakefile", snakefile) == {}
    style = workflow / "scripts/limo/figures/style.py"
    style.write_text(style.read_text().replace('"lines.linewidth": 1.6', '"lines.linewidth": 2.0'))
    planned = project.planned("--snakefile", snakefile)
    assert set(planned) == {"draw_figure", "all", "total"}


def test_the_report_has_a_caption_for_each_figure(solved):
    done = solved.snakemake("--report", "report.html", cores=None)
    assert done.returncode == 0, done.stdout + done.stderr
    page = (solved.folder / "report.html").read_text()
    captions = {file.stem: file.read_text().split("\n")[0] for file in (ROOT / "workflow/report").glob("*.rst")}
    assert captions["pressure_volume"] in page
    assert captions["afterload"] not in page, "a figure of another study"


def test_the_unsolved_project_is_valid(tmp_path):
    assert make_project(tmp_path).planned()["solve_case"] == 2


def test_the_page_is_made_of_what_is_there(project):
    assert project.planned("page") == {"page": 1, "total": 1}, "though nothing is solved"
    done = project.snakemake("page")
    assert done.returncode == 0, done.stderr
    assert "No study has been gathered yet" in (project.folder / "results/index.html").read_text()
    assert project.planned("page") == {}


def test_nothing_is_measured_for_a_study_of_volumes_alone(project):
    planned = project.planned("tiny")
    assert "measure_case" not in planned
    assert "write_fields" not in planned


def test_contact_is_measured_unless_a_study_says_otherwise(project):
    project.edit("studies/tiny.yaml", lambda d: d.pop("outputs"))
    assert project.planned("tiny")["measure_case"] == 2


def test_only_cases_of_studies_that_ask_are_measured(project):
    """Of two studies that share a case the one that asks for stress has it measured; fields are written only on demand."""
    text = (project.folder / "config/studies/tiny.yaml").read_text()
    asking = project.folder / "config/studies/asking.yaml"
    text = text.replace("- 2\n", "").replace("[2, 4]", "[4]")
    asking.write_text(text.replace("outputs:\n- volumes\n", "outputs: [volumes, stress]\n"))
    planned = project.planned("tiny", "asking")
    assert planned["solve_case"] == 2
    assert planned["measure_case"] == 1
    assert "write_fields" not in planned
    asking.write_text(asking.read_text().replace("[volumes, stress]", "[volumes, stress, fields]"))
    assert project.planned("tiny", "asking")["write_fields"] == 1
    assert "measure_case" not in project.planned("tiny")


def test_accuracy_plans_the_airbags_run_by_run(project):
    def fewer(airbag):
        airbag["series"] = [{"element": "S8R", "divisions": [4, 8], "path": [100, 10]}, {"element": "S3", "divisions": [4]}]

    (project.folder / "config/airbags/paper.yaml").unlink()
    project.edit("airbags/classical.yaml", fewer)
    jobs = {"solve_airbag": 3, "gather_airbag": 1, "draw_airbag": 2, "keep_airbags": 1, "accuracy": 1}
    assert project.planned("accuracy") == jobs | {"total": sum(jobs.values())}
    assert "solve_airbag" not in project.planned(), "no study needs them"


def without_airbags(project):
    for airbag in (project.folder / "config/airbags").iterdir():
        airbag.unlink()


def test_accuracy_solves_the_devices_that_have_a_reference(project):
    without_airbags(project)
    assert "gather_accuracy" not in project.planned("accuracy"), "no device has a reference"
    axes = {"n_pouches": [2], "ventricular_pressure": [3.8]}
    reference, accuracy = ({"role": role, "subject": "small", "axes": axes, "figures": []} for role in ("reference", "accuracy"))
    project.study("reference_small", engine="newton", branches=2, **reference)
    project.study("accuracy_small", variants={"plain": {}, "half": {"mesh": {"symmetry": "front_back"}}}, **accuracy)
    planned = project.planned("accuracy")
    assert planned["solve_case"] == 4
    assert (planned["gather_study"], planned["keep_runs"]) == (1, 1)
    assert (planned["gather_accuracy"], planned["draw_accuracy"]) == (1, 4)


def test_a_reference_is_solved_once_and_kept(project):
    """Without any results the kept runs of the reference serve; a further member is solved alone, and joins them."""
    without_airbags(project)
    axes, kept = {"n_pouches": [2], "ventricular_pressure": [3.8]}, project.folder / "docs/gallery/data/reference_small_runs.nc"
    same = {"axes": axes, "engine": "newton", "figures": [], "outputs": ["volumes", "stress", "fatigue"], "frames": [0, 10]}
    same |= {"subject": "small"}
    project.study("reference_small", branches=2, role="reference", **same)
    project.study("accuracy_small", variants={"even": {"mesh": {"symmetry": "front_back"}}}, role="accuracy", **same)
    run(project, "accuracy")
    assert rows(kept) == table("<study>_runs.nc")
    before = xr.load_dataset(kept)
    assert list(before.case_status.values) == ["converged"] * 2
    assert np.isfinite(before.points).all()
    reference = set(map(str, before.case_id.values))
    for case_id in reference:
        shutil.rmtree(project.folder / "results/cases" / case_id)
    assert "solve_case" not in project.planned("accuracy")

    project.study("reference_small", branches=3, role="reference", **same)
    assert project.planned("accuracy")["solve_case"] == 1
    for leftover in ("results", ".snakemake"):
        (project.folder / leftover).rename(project.folder / f"{leftover}_of_before")
    assert project.planned("accuracy")["solve_case"] == 2, "that one and the setting, though files of both lie in docs/"
    for leftover in ("results", ".snakemake"):
        shutil.rmtree(project.folder / leftover, ignore_errors=True)
        (project.folder / f"{leftover}_of_before").rename(project.folder / leftover)
    run(project, "docs/gallery/data/accuracy.nc")
    after = xr.load_dataset(kept)
    assert len(reference & set(map(str, after.case_id.values))) == 2
    for name in ("ventricle_volume", "picture_height", "points", "solver_time"):
        np.testing.assert_array_equal(after[name][:2], before[name])
    kept_errors = read_errors(project.folder / "docs/gallery/data/accuracy.nc")
    assert list(sizes_of(kept_errors).engine) == ["calculix", "newton"]
    errors = rows_of(kept_errors)
    assert list(errors.members[errors.kind == "scatter"]) == [3]
    assert list(errors.timed[errors.part == "accuracy"]) == [3], "a case of less than a minute"
    assert "solve_case" not in project.planned("accuracy")
    written = kept.read_bytes()
    (project.folder / "results/kept/reference_small.txt").unlink()
    assert project.snakemake("results/kept/reference_small.txt").returncode == 0
    assert kept.read_bytes() == written, "nothing to add"
    kept.unlink()
    assert project.planned("accuracy")["solve_case"] == 2, "the third is still among the results"


def test_accuracy_of_a_small_airbag_ends_in_figures_and_kept_rows(project):
    """Another reference draws again and solves nothing; another pressure solves."""

    def small(airbag):
        shells = {"element": "S8R", "divisions": [2]}
        airbag["series"] = [shells, {"element": "C3D20R", "engine": "newton", "divisions": [2]}]

    (project.folder / "config/airbags/paper.yaml").unlink()
    project.edit("airbags/classical.yaml", small)
    run(project, "accuracy")
    rows = read_airbags(project.folder / "docs/gallery/data/airbag.csv")
    assert list(rows.element) == ["S8R", "C3D20R"]
    assert list(rows.status) == ["converged"] * 2
    assert project.planned("accuracy") == {}
    project.edit("airbags/classical.yaml", lambda airbag: airbag.update(references=[]))
    planned = project.planned("accuracy")
    assert planned["draw_airbag"] == 2
    assert "solve_airbag" not in planned
    project.edit("airbags/classical.yaml", lambda airbag: airbag["numerics"].update(rise=2.0))
    assert project.planned("accuracy")["solve_airbag"] == 1, "the engine newton has no time"
