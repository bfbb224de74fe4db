"""The gallery: what it copies, draws and says, and what it refuses."""

from __future__ import annotations

import shutil

import pytest
import xarray as xr
import yaml

from limo.bench.tensile import fit_tensile, tensile_dataset
from limo.cases.grid import study_cases
from limo.config.builds import with_found_builds
from limo.config.load import load_config
from limo.datasets.shapes import gather_shapes
from limo.datasets.study import gather_study
from limo.errors import LimoError
from limo.reports import gallery
from limo.store.files import write_json, write_netcdf
from limo.terminal.cli import main
from tests.helpers.cases import without_studies
from tests.helpers.curves import history_of


@pytest.fixture
def project(root, tmp_path, monkeypatch):
    """A configuration with one study, whose dataset is gathered though none of its cases is solved."""
    studies = without_studies(root, tmp_path)
    study = {
        "description": "volumes of one device", "axes": {"n_pouches": [6], "ventricular_pressure": [3.8]},
        "actuation_pressure_max": 60, "outputs": ["volumes"], "figures": ["pressure_volume"],
    }  # fmt: skip
    (studies / "one.yaml").write_text(yaml.safe_dump(study))
    (studies / "pressure_volume.yaml").write_text(yaml.safe_dump(study | {"figures": []}))
    folder = tmp_path / "results/studies/one"
    folder.mkdir(parents=True)
    loaded = load_config(tmp_path / "config/config.yaml")
    gather_study(loaded, "one", tmp_path / "results/cases").to_netcdf(folder / "study.nc")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_what_is_gathered_is_kept_and_drawn_and_the_page_says_what_failed(project, capsys):
    assert main(["gallery"]) == 0
    made = project / "docs/gallery"
    written = capsys.readouterr().out.split()
    assert written == ["docs/gallery/data/one.nc", "docs/gallery/one_pressure_volume.png", "docs/gallery/README.md"]
    kept, gathered = xr.load_dataset(made / "data/one.nc"), xr.load_dataset(project / "results/studies/one/study.nc")
    xr.testing.assert_allclose(kept, gathered, rtol=1e-6)
    assert kept.attrs == gathered.attrs
    page = (made / "README.md").read_text()
    assert "| one | 1 | 0 |" in page
    assert "(one_pressure_volume.png)" in page
    assert "missing, not solved" in page
    assert "volumes of one device" in page


def test_curves_are_kept_in_fewer_bytes_and_to_six_digits(project, root):
    source, target = project / "results/studies/one/study.nc", project / "kept.nc"
    curves = xr.load_dataset(root / "docs/gallery/data/afterload.nc")
    curves = curves.map(lambda v: v.astype(float) * (1 + 1e-9) if v.dtype.kind == "f" else v, keep_attrs=True)
    write_netcdf(curves.drop_encoding(), source, checked=False)
    assert gallery._pack(xr.load_dataset(source), target) == target
    assert target.stat().st_size < 0.8 * source.stat().st_size
    kept = xr.load_dataset(target)
    assert kept.stroke_volume.dtype == "float32"
    xr.testing.assert_allclose(kept, curves, rtol=1e-6)


def test_the_tensile_test_is_kept_with_its_picture(project, capsys):
    folder = project / "results/material"
    folder.mkdir()
    fit = fit_tensile(load_config("config/config.yaml").config.tensile_test)
    write_netcdf(tensile_dataset(fit), folder / "tensile_test.nc", checked=False)
    assert main(["gallery", "one"]) == 0
    assert "material" not in capsys.readouterr().out, "only what is named"
    assert main(["gallery"]) == 0
    assert "docs/gallery/data/material.nc" in capsys.readouterr().out
    assert (project / "docs/gallery/material_tensile_test.png").stat().st_size < 300_000
    assert "(material_tensile_test.png)" in (project / "docs/gallery/README.md").read_text()


def test_figures_come_from_the_gallery_alone(project):
    assert main(["gallery", "one"]) == 0
    figure = project / "docs/gallery/one_pressure_volume.png"
    drawn = figure.read_bytes()
    figure.unlink()
    shutil.rmtree(project / "results")
    assert main(["gallery", "--redraw"]) == 0
    assert figure.read_bytes() == drawn


def solve(project, branch, **changes):
    """Put a result of one branch of the study into the project's results; ``changes`` to its status."""
    loaded, _ = with_found_builds(load_config("config/config.yaml"), "config/config.yaml")
    (case,) = (c for point, c in study_cases(loaded, "one").items() if point.branch == branch)
    folder = project / "results/cases" / case.case_id
    folder.mkdir(parents=True)
    history_of(case).to_netcdf(folder / "volumes.nc")
    write_json(folder / "status.json", {"status": "converged", "reason": "", "iterations": 100 + branch} | changes)
    return folder


@pytest.fixture
def branches(project):
    """The project with three branches of the case, and a picture of surfaces among the figures of the study."""
    file = project / "config/studies/one.yaml"
    study = yaml.safe_load(file.read_text())
    file.write_text(yaml.safe_dump(study | {"branches": 3, "figures": ["pressure_volume", "deformation"]}))
    config = project / "config/config.yaml"
    config.write_text(config.read_text().replace("studies: [pressure_volume]", "studies: [one, pressure_volume]"))
    return project


def test_a_set_grows_by_the_cases_that_are_solved_wherever_that_was(branches, capsys):
    first = solve(branches, 0)
    assert main(["gallery", "--set", "standard"]) == 0
    made = branches / "docs/gallery/standard"
    assert sorted(f.name for f in (made / "data").iterdir()) == ["one.nc", "pressure_volume.nc"], "no surfaces"
    assert xr.load_dataset(made / "data/one.nc").case_status.values.ravel().tolist() == ["converged", "missing", "missing"]
    before = xr.load_dataset(made / "data/one.nc")
    shutil.rmtree(branches / "results")  # another machine
    solve(branches, 2, status="diverged", reason="no equilibrium")
    assert main(["gallery", "--set", "standard"]) == 0
    kept = xr.load_dataset(made / "data/one.nc")
    assert kept.case_status.values.ravel().tolist() == ["converged", "missing", "diverged"]
    xr.testing.assert_identical(kept.isel(branch=0).drop_vars("branch"), before.isel(branch=0).drop_vars("branch"))
    assert kept.iterations.values.ravel()[[0, 2]].tolist() == [100, 102]
    assert (kept.stroke_volume.isel(branch=2, actuation_pressure=-1) == 120.0).all()
    assert kept.stroke_volume.attrs == {"units": "ml", "long_name": before.stroke_volume.long_name}
    capsys.readouterr()
    assert main(["gallery", "one", "--set", "standard", "--lacking"]) == 0
    (lacks,) = capsys.readouterr().out.split()
    assert lacks.endswith("/status.json")
    assert first.name not in lacks, "it is in the set"


def test_the_page_says_how_far_apart_the_solutions_of_a_case_are(root):
    curves = xr.load_dataset(root / "docs/gallery/data/afterload.nc")
    assert gallery._band(curves) == [], "one solution each"
    second = curves.copy(deep=True)
    at = {"n_pouches": 4, "ventricular_pressure": 3.8, "aspect_ratio": 2.0, "stiffness_ratio": 1.0}
    second.stroke_volume.loc[at | {"actuation_pressure": 20.0}] += 7.0
    second.stroke_volume.loc[at | {"actuation_pressure": 60.0}] *= 0.95
    second.case_status.loc[{"n_pouches": 10}] = "diverged"
    (sentence,) = gallery._band(xr.concat([curves, second], "branch"))
    largest = max(7.0, 0.05 * float(curves.stroke_volume.sel(at | {"actuation_pressure": 60.0})))
    assert sentence.startswith("Band (9 of 12 cases):"), "what failed has no band"
    assert f"{largest:.1f} ml at any P_a. At the highest P_a they differ by at most 5.0 %." in sentence


@pytest.mark.parametrize(("part", "cases"), [("", 76), ("standard", 104)])
def test_the_pages_are_those_of_the_data_and_count_shared_cases_once(root, part, cases, monkeypatch):
    monkeypatch.chdir(root)
    folder = root / "docs/gallery" / part
    loaded = load_config(f"config/{part or 'config'}.yaml")
    assert (page := gallery.page_of(loaded, folder)) == (folder / gallery.PAGE).read_text()
    assert f"Together {cases} distinct cases, " in page


def test_a_set_of_another_configuration_is_not_mixed_with_this_one(branches, capsys):
    solve(branches, 0)
    assert main(["gallery", "--set", "standard"]) == 0
    kept = (branches / "docs/gallery/standard/data/one.nc").read_bytes()
    file = branches / "config/studies/one.yaml"
    file.write_text(file.read_text().replace("actuation_pressure_max: 60", "actuation_pressure_max: 50"))
    solve(branches, 1)
    assert main(["gallery", "--set", "standard"]) == 1
    assert "standard/data/one.nc: gathered with another configuration; remove the file" in capsys.readouterr().err
    assert (branches / "docs/gallery/standard/data/one.nc").read_bytes() == kept


def test_a_picture_stays_where_fewer_cases_would_be_seen(branches, monkeypatch):
    solve(branches, 0)
    monkeypatch.setattr(gallery, "_shapes", lambda loaded, *_: gather_shapes(loaded, "one", branches, branches))
    assert main(["gallery", "--set", "standard"]) == 0
    made = branches / "docs/gallery/standard"
    assert "(one_deformation.png)" in (made / "README.md").read_text()
    assert "Surfaces are not among these data" in (made / "README.md").read_text()
    for file in made.glob("*.png"):
        file.write_bytes(b"as it was")
    assert main(["gallery", "--set", "standard"]) == 0
    assert (made / "one_deformation.png").read_bytes() == b"as it was", "its case has no shapes now"
    assert (made / "one_pressure_volume.png").read_bytes() != b"as it was"
    assert main(["gallery"]) == 0
    assert "[standard](standard/README.md)" in (branches / "docs/gallery/README.md").read_text()


def test_a_set_that_cannot_be_is_one_message(project, capsys):
    assert main(["gallery", "--set", "../x"]) == 1
    assert "--set standard" in capsys.readouterr().err
    assert main(["gallery", "one", "--set", "standard"]) == 1
    assert "no case of one is solved; snakemake --cores 2 one" in capsys.readouterr().err
    assert main(["gallery", "--lacking"]) == 1
    assert "of which set" in capsys.readouterr().err


def test_what_the_error_studies_keep_does_not_count(project, monkeypatch):
    loaded, _ = with_found_builds(load_config("config/config.yaml"), "config/config.yaml")
    folder = project / "gallery"
    (folder / "data").mkdir(parents=True)
    (folder / "data/accuracy.nc").write_bytes(bytes(200_000))
    monkeypatch.setattr(gallery, "LARGEST_DATA", 150_000)
    gallery.keep(loaded, [], project / "results", folder)
    monkeypatch.setattr(gallery, "LARGEST_DATA", 60_000)
    solve(project, 0)
    with pytest.raises(LimoError, match="is the most"):
        gallery.keep(loaded, ["one"], project / "results", folder, "standard")
    assert not (folder / "standard").exists()


def test_a_study_that_is_not_gathered_or_not_there_is_one_message(project, capsys):
    assert main(["gallery", "pressure_volume"]) == 1
    assert "results/studies/pressure_volume/study.nc: not gathered yet" in capsys.readouterr().err
    assert main(["gallery", "two"]) == 1
    assert "two" in capsys.readouterr().err
    (project / "docs/gallery/data").mkdir(parents=True)
    (project / "docs/gallery/data/one.nc").write_bytes(b"no netCDF")
    assert main(["gallery", "--redraw"]) == 1
    assert "not a dataset of the gallery" in capsys.readouterr().err


def test_data_that_are_too_large_are_not_kept(project, monkeypatch):
    monkeypatch.setattr(gallery, "LARGEST_DATA", 1000)
    with pytest.raises(LimoError, match="is the most"):
        gallery.keep(load_config("config/config.yaml"), [], project / "results", project / "gallery")
    assert not (project / "gallery").exists()
