"""A small exploration as a person runs it: samples, a round of search, recommended designs, a page; and mistakes before that."""

from __future__ import annotations

import json

import pytest
import xarray as xr
import yaml

from .conftest import make_project, run

SMALL = {
    "description": "stroke beside stress of one tiny device",
    "device": "limo_2025",  # its pattern has good elements on so coarse a mesh
    "space": {"n_pouches": 4, "aspect_ratio": [1.5, 2.5], "stiffness_ratio": [0.8, 1.2]},
    "at": {"ventricular_pressure": [3.8], "actuation_pressure_max": 8},
    "goals": {"stroke_volume": "maximise", "von_mises_peak": "minimise"},
    "budget": {"quick": 10, "finer": 8},
    "first": 6,
    "held_out": 2,
    "batch": 2,
    "baseline": 4,
}


def write_small(project, **changes) -> None:
    """An exploration of a project, by two presets on tiny meshes."""
    mesh = {"level": "tiny", "symmetry": "quarter"}

    def presets(config):
        config["presets"] |= {
            "quick": {"mesh": mesh | {"element": "SHELL8R"}, "numerics": "fast", "engine": "newton"},
            "finer": {"mesh": mesh | {"element": "C3D20R"}, "numerics": "fast", "engine": "newton"},
        }

    project.edit("config.yaml", presets)
    (project.folder / "config/explorations/small.yaml").write_text(yaml.safe_dump(SMALL | changes))


@pytest.fixture(scope="module")
def explored(tmp_path_factory):
    project = make_project(tmp_path_factory.mktemp("explore"))
    write_small(project)
    run(project, "small")
    return project


def test_it_ends_with_a_page_of_designs_that_are_solved(explored):
    folder = explored.folder / "results/explorations/small"
    with xr.open_dataset(folder / "exploration.nc") as dataset:
        assert (dataset.sizes["design"], dataset.sizes["tested"]) == (8, 2)
        assert dataset.status.isin(["converged", "degraded"]).all()
        why = dataset.why.values.astype(str)
        assert why[0] == "the device as it is"
        assert [each.startswith("proposed by both presets") for each in why].count(True) == 4
        assert dataset.recommended_stroke_volume.notnull().all()
        assert dataset.tested_stroke_volume.notnull().all()
        count = dataset.sizes["recommended"]
    text = (folder / "README.md").read_text()
    assert "8 designs by `quick`" in text
    assert "2 more are held out" in text
    assert "the device as it is" in text
    for name in ("front.png", "effects.png", "slices.png", "indices.png", "interactions.png", "designs.png", "devices.png"):
        assert (folder / name).stat().st_size > 5000
        assert f"]({name})" in text
    assert len(list((folder / "cutting").glob("*.dxf"))) == count


def test_it_is_on_the_page_of_results(explored):
    run(explored, "page")
    page = (explored.folder / "results/index.html").read_text()
    assert '<section id="explorations">' in page
    assert "stroke beside stress of one tiny device" in page
    assert page.count(" of small") == 7, "all pictures"
    assert "explorations/small/README.md" in page


def test_a_second_call_does_nothing_and_a_removed_result_is_made_again(explored):
    assert explored.planned("small") == {}
    told = explored.folder / "results/explorations/small/told_1.json"
    before = told.read_text()
    told.unlink()
    (told.parent / "README.md").unlink()
    assert "solve_case" not in explored.planned("small")
    run(explored, "small")
    assert json.loads(told.read_text()) == json.loads(before)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"goals": {"beauty": "maximise"}}, "goals.beauty = 'maximise': expected one of"),
        ({"budget": {"quick": 4, "finer": 2}}, "a budget of more than 4 designs for 2 inputs"),
        ({"space": {"n_pouches": [4]}}, "at least 2"),
    ],
    ids=["goal", "budget", "space"],
)
def test_a_mistake_is_one_message_before_anything_is_solved(explored, changes, words):
    file = explored.folder / "config/explorations/broken.yaml"
    file.write_text(yaml.safe_dump(SMALL | changes))
    done = explored.snakemake("broken", cores=2)
    file.unlink()
    assert done.returncode != 0
    assert words in done.stderr + done.stdout
    assert "broken.yaml" in done.stderr + done.stdout
    assert not (explored.folder / "results/explorations/broken").exists()
