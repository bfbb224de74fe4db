"""The gallery: what it copies, draws and says, and what it refuses."""

from __future__ import annotations

import shutil

import pytest
import xarray as xr
import yaml

from limo import gallery
from limo.cli import main
from limo.config import load_config
from limo.dataset import gather_study
from limo.errors import LimoError
from limo.files import write_netcdf
from limo.material import tensile_test
from limo.shapes import gather_shapes, write_shapes


@pytest.fixture
def project(root, tmp_path, monkeypatch):
    """A configuration with one study, whose dataset is gathered though none of its cases is solved."""
    shutil.copytree(root / "config", tmp_path / "config")
    for study in (tmp_path / "config/studies").iterdir():
        study.unlink()
    study = {
        "description": "volumes of one device", "axes": {"n_pouches": [6], "ventricular_pressure": [3.8]},
        "actuation_pressure_max": 60, "figures": ["pressure_volume"],
    }  # fmt: skip
    (tmp_path / "config/studies/one.yaml").write_text(yaml.safe_dump(study))
    (tmp_path / "config/studies/pressure_volume.yaml").write_text(yaml.safe_dump(study | {"figures": []}))
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
    assert gallery._packed(source, target) == target
    assert target.stat().st_size < 0.8 * source.stat().st_size
    kept = xr.load_dataset(target)
    assert kept.stroke_volume.dtype == "float32"
    xr.testing.assert_allclose(kept, curves, rtol=1e-6)


def test_the_tensile_test_is_kept_with_its_picture(project, capsys):
    folder = project / "results/material"
    folder.mkdir()
    tensile_test(load_config("config/config.yaml").config.tensile_test).to_netcdf(folder / "tensile_test.nc")
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


def test_a_set_stands_in_a_folder_of_its_own_without_surfaces(project, capsys):
    study = yaml.safe_load((project / "config/studies/one.yaml").read_text())
    shapes = project / "results/studies/one/shapes.nc"
    (project / "config/studies/one.yaml").write_text(yaml.safe_dump(study | {"figures": ["pressure_volume", "deformation"]}))
    write_shapes(gather_shapes(load_config("config/config.yaml"), "one", project / "cases", project / "meshes"), shapes)
    assert main(["gallery", "--set", "standard"]) == 0
    made, picture = project / "docs/gallery/standard", "one_deformation.png"
    assert [f.name for f in (made / "data").iterdir()] == ["one.nc"]
    drawn = (made / picture).read_bytes()
    page = (made / "README.md").read_text()
    assert f"({picture})" in page
    assert "Surfaces are not among these data" in page
    (made / "one_pressure_volume.png").unlink()
    assert main(["gallery", "--set", "standard", "--redraw"]) == 0
    assert (made / picture).read_bytes() == drawn, "what cannot be drawn again stays"
    assert (made / "one_pressure_volume.png").exists()
    assert main(["gallery"]) == 0
    page = (project / "docs/gallery/README.md").read_text()
    assert "[standard](standard/README.md)" in page
    assert "Surfaces are not" not in page
    assert main(["gallery", "--set", "../x"]) == 1
    assert "--set standard" in capsys.readouterr().err


def test_what_the_error_studies_keep_does_not_count(project, monkeypatch):
    loaded, folder = load_config("config/config.yaml"), project / "gallery"
    (folder / "data").mkdir(parents=True)
    (folder / "data/accuracy.nc").write_bytes(bytes(200_000))
    monkeypatch.setattr(gallery, "LARGEST_DATA", 150_000)
    gallery.keep(loaded, [], project / "results", folder)
    monkeypatch.setattr(gallery, "LARGEST_DATA", 60_000)
    with pytest.raises(LimoError, match="is the most"):
        gallery.keep(loaded, [], project / "results", folder, "standard")
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
