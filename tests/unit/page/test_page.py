"""The page of results: what is on it, what is left out, and that no text of a result becomes code."""

from __future__ import annotations

import base64
import json
import re
import shutil
import zlib
from html.parser import HTMLParser

import numpy as np
import pytest
import xarray as xr
from PIL import Image

from limo.beat.circulations import read_circulations
from limo.beat.surface import Surface as SurfaceOfADevice
from limo.beat.surface import write_surfaces
from limo.cases.case import describe
from limo.cases.grid import study_cases
from limo.cases.plan import make_plan
from limo.datasets.study import gather_study
from limo.measure.case import measure_case
from limo.mechanics.build import build_model
from limo.mechanics.layer import nodal
from limo.mesh.file import write_mesh
from limo.page import BUDGET, sources
from limo.page.beats import MOMENTS, beats_of
from limo.page.devices import LEFT_OUT, MOST_PRESSURES, QUANTITIES, Devices, spread
from limo.page.packing import pack, pack_steps
from limo.page.write import write_page
from limo.store.files import read_json, write_json
from tests.helpers.cases import configured, moved, study, write_case

PRESSURES = [0.0, 13.8, 60.0]
NASTY = '</script><script>window.hacked = 1</script><img src=x onerror="window.hacked = 2"> a & b {{ 1 }} \''


def unpack(text: str, kind: str) -> np.ndarray:
    """What ``page.js`` makes of packed numbers."""
    planes = np.frombuffer(zlib.decompress(base64.b64decode(text)), np.uint8)
    return np.ascontiguousarray(planes.reshape(np.dtype(kind).itemsize, -1).T).reshape(-1).view(kind)


@pytest.fixture(scope="module")
def folder(tmp_path_factory, loaded, device_mesh):
    """Results: N_p = 8 measured, of N_p = 4 nothing but a status; another study is of volumes alone, a third damaged."""
    axes = {"n_pouches": [4, 8], "ventricular_pressure": [3.8]}
    outputs = ["volumes", "stress", "strain", "fatigue"]
    configuration = configured(
        loaded,
        all=study(axes=axes, outputs=outputs, description=NASTY, figures=["pressure_volume", "strain_life"]),
        plain=study(axes=axes, actuation_pressure_max=50.0),
        damaged=study(axes=axes),
        never=study(axes=axes),
    )
    results = tmp_path_factory.mktemp("page") / "results"
    plan, cases = make_plan(configuration, results), results / "cases"
    for case in study_cases(configuration, "all").values():
        if case.n_pouches == 4:
            write_json(cases / case.case_id / "status.json", {"status": "diverged", "reason": NASTY})
            history = xr.Dataset({n: ("increment", np.array([400.0])) for n in ("ventricle_volume", "actuation_volume")})
            history = history.assign_coords(actuation_pressure=("increment", [0.0]), stage=("increment", [1]))
            history.to_netcdf(cases / case.case_id / "volumes.nc")
            continue
        model = build_model(case, device_mesh())
        mesh_file = results / "meshes" / f"{case.mesh_id}.vtu"
        mesh_file.parent.mkdir()
        write_mesh(model.mesh, mesh_file)
        write_case(cases / case.case_id, model, {p: moved(model, p) for p in PRESSURES})
        status = read_json(cases / case.case_id / "status.json")
        write_json(cases / case.case_id / "status.json", status | {"remarks": ["layers pass each other: by 2 mm"]})
        write_json(cases / case.case_id / "case.json", describe(case))
        measure_case(case, plan.wanted[case.case_id], loaded.config.fatigue, mesh_file, cases / case.case_id)
        fields = cases / case.case_id / "fields"
        fields.mkdir()
        (fields / "deformed.pvd").write_text("")
    for name in ("all", "plain"):
        dataset = gather_study(configuration, name, cases, list(plan.served[name].values()))
        (results / "studies" / name).mkdir(parents=True)
        dataset.to_netcdf(results / "studies" / name / "study.nc")
    (results / "studies" / "damaged").mkdir()
    (results / "studies" / "damaged" / "study.nc").write_text("cut off")
    figures = results / "studies" / "all" / "figures"
    figures.mkdir()
    Image.new("RGB", (40, 20), "red").save(figures / "pressure_volume.png")
    (figures / "strain_life.png").write_bytes(b"cut off")
    return configuration, results, model


@pytest.fixture(scope="module")
def page(folder) -> str:
    configuration, results, _ = folder
    said = write_page(results, configuration.studies)
    assert "3 studies, 1 cases in three dimensions" in said
    text = (results / "index.html").read_text(encoding="utf-8")
    assert len(text.encode()) < BUDGET
    return text


class Reader(HTMLParser):
    """Texts, links and scripts of a page."""

    def __init__(self, text: str):
        super().__init__()
        self.texts, self.links, self.tags, self.data, self.inside = [], [], [], {}, None
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        attributes = dict(attributes)
        self.tags.append((tag, attributes))
        if tag == "a":
            self.links.append(attributes["href"])
        self.inside = attributes.get("id", "code") if tag == "script" else None

    def handle_data(self, data):
        if self.inside:
            self.data[self.inside] = self.data.get(self.inside, "") + data
        elif data.strip():
            self.texts.append(data.strip())

    def handle_endtag(self, tag):
        self.inside = None


@pytest.fixture(scope="module")
def read(page) -> Reader:
    return Reader(page)


@pytest.fixture(scope="module")
def devices(read) -> dict:
    return json.loads(read.data["devices"])


def test_a_study_without_surfaces_has_no_beats_and_one_with_them_has_every_circulation(tmp_path, root):
    circulations = read_circulations(root / "config/beats")
    none = tmp_path / "study.nc"
    xr.Dataset({"stroke_volume": 1.0}).to_netcdf(none)
    assert beats_of(none, circulations) == {}
    p_v, p_a = np.linspace(0, 40, 9), np.linspace(0, 62, 32)
    x, y = np.meshgrid(p_v, p_a, indexing="ij")
    volumes = np.stack([250 + 6 * x - 1.4 * y, 60 - 1.4 * x + 1.2 * y])
    write_surfaces({8: SurfaceOfADevice("linear", p_v, p_a, np.stack([volumes, volumes]))}, tmp_path / "study_surfaces.nc")
    found = beats_of(none, circulations)["8"]
    assert set(found) == set(circulations)
    assert "outside surface" in found["hypertension"]["note"], "its driver goes beyond 62 kPa"
    assert "time" not in found["hypertension"]
    one = found["healthy"]
    assert len(one["time"]) == len(one["arterial_pressure"]) == MOMENTS
    assert np.ptp(one["ventricle_volume"]) > 20
    assert "ml a beat" in one["note"]


def test_no_text_of_a_result_becomes_code(page, read):
    assert read.texts.count(NASTY) == 4  # of the study in its table and above its figures, and of a case of two studies
    assert "window.hacked" not in "".join(read.data.values())
    assert [tag for tag, _ in read.tags].count("script") == 4
    assert not [a for tag, a in read.tags if any(name.startswith("on") for name in a)]


def test_texts_within_the_data_cannot_end_their_element(folder, tmp_path):
    configuration, results, _ = folder
    shutil.copytree(results, tmp_path / "results")
    file = tmp_path / "results/studies/all/study.nc"
    dataset = xr.load_dataset(file)
    dataset.stroke_volume.attrs["long_name"] = dataset.n_pouches.attrs["units"] = NASTY
    dataset.to_netcdf(file)
    write_page(tmp_path / "results", configuration.studies)
    read = Reader((tmp_path / "results/index.html").read_text(encoding="utf-8"))
    assert [tag for tag, _ in read.tags].count("script") == 4
    assert NASTY in json.loads(read.data["devices"])["studies"]["all"][0]["label"]
    plots = json.loads(zlib.decompress(base64.b64decode(read.data["plots"])))
    assert plots["studies"]["all"]["variables"]["stroke_volume"]["long_name"] == NASTY


def test_nothing_is_fetched(page, read):
    policy = next(a["content"] for tag, a in read.tags if a.get("http-equiv") == "Content-Security-Policy")
    assert policy.startswith("default-src 'none'")
    sources = [a[k] for _, a in read.tags for k in ("src", "srcset", "data") if k in a]
    assert all(source.startswith("data:") for source in sources)
    assert not [a for tag, a in read.tags if tag == "link"]


def test_studies_and_what_is_missing_are_said(page, read):
    text = " ".join(read.texts)
    assert "1 converged" in text
    assert "1 diverged" in text
    assert "Not gathered: never." in text
    assert "study.nc: not a study's dataset" in text
    assert "Not drawn yet: strain_life." in text
    assert "not in the 3D view" in text
    assert "not measured" in text
    assert "layers pass each other: by 2 mm" in text


def test_links_lead_to_files_that_are_there(folder, read):
    relative = [link for link in read.links if not link.startswith("#")]
    assert {link.rsplit("/", 1)[-1] for link in relative} >= {"study.nc", "frames.nc", "measures.nc", "deformed.pvd"}
    assert all((folder[1] / link).exists() for link in relative)


def test_every_number_of_a_study_can_be_plotted(folder, read):
    plots = json.loads(zlib.decompress(base64.b64decode(read.data["plots"])))["studies"]
    dataset = xr.load_dataset(folder[1] / "studies/all/study.nc")
    numeric = {n for n, v in dataset.data_vars.items() if v.dtype.kind in "fiu"}
    assert set(plots["all"]["variables"]) == numeric
    stroke = plots["all"]["variables"]["stroke_volume"]
    values = np.array(stroke["values"], float).reshape([len(plots["all"]["dims"][d]["values"]) for d in stroke["dims"]])
    np.testing.assert_allclose(values, dataset.stroke_volume.values, rtol=1e-5)
    assert "max" in plots["all"]["dims"]["frame"]["values"]


def test_a_device_is_where_the_solver_left_it(folder, devices):
    """Displacements come back to 0.01 mm, at the frames and around the buckling event."""
    model = folder[2]
    (case,) = devices["cases"].values()
    mesh = devices["meshes"][case["mesh"]]
    assert [stop["pressure"] for stop in case["stops"]] == pytest.approx([0.0, 13.8, 20.1, 20.15, 60.0])
    assert [stop["remark"] for stop in case["stops"]][2:4] == ["before a buckling event", "after a buckling event"]
    u = unpack(case["stops"][-1]["values"]["displacement"], "<i2").reshape(-1, 3) * case["steps"]["displacement"]
    _, node, quads = nodal(model.mesh, np.zeros((len(model.mesh.quads), 4)))
    np.testing.assert_allclose(u, model.expansion.midsurface(moved(model, 60.0))[node], atol=0.01)
    np.testing.assert_array_equal(unpack(mesh["quads"], "<i4").reshape(-1, 8), quads)
    np.testing.assert_allclose(unpack(mesh["flat"], "<f4").reshape(-1, 2), model.mesh.nodes[node, :2], atol=1e-4)
    shape = unpack(devices["shapes"][str(mesh["divisions"])], "<f4").reshape(-1, 8)
    np.testing.assert_allclose(shape.sum(axis=1), 1.0, atol=1e-6)
    assert unpack(mesh["first"], "<i4").max() < len(quads) * len(shape)


def test_only_what_was_asked_for_is_offered_and_only_where(devices):
    (case,) = devices["cases"].values()
    assert set(case["steps"]) == set(QUANTITIES)
    with_stress = [stop["pressure"] for stop in case["stops"] if "von_mises" in stop["values"]]
    assert with_stress == pytest.approx(PRESSURES), "not around the event"
    assert set(case["constant"]) == {"cycles"}


def test_a_case_that_was_not_measured_shows_displacements_alone(folder, tmp_path):
    _, results, model = folder
    shutil.copytree(results, tmp_path / "results")
    case_id = model.name
    (tmp_path / "results/cases" / case_id / "measures.nc").unlink()
    found = Devices(tmp_path / "results")
    found.add(case_id)
    assert set(found.cases[case_id]["steps"]) == {"displacement"}
    found.add("nowhere")
    assert "nowhere" in found.reasons["nowhere"]


def test_pressures_are_dropped_before_cases(folder):
    found = Devices(folder[1])
    found.add(folder[2].name)
    (case,) = found.cases.values()
    found.cases = {f"case {k}": case for k in range(3)}
    whole = len(json.dumps(found.meshes)) + 3 * len(json.dumps(case))
    assert found.fit(2 * whole) == ""
    assert {len(c["stops"]) for c in found.cases.values()} == {5}
    assert re.fullmatch("each case is shown at [34] of its stored pressures at most", found.fit(int(0.8 * whole)))
    stops = next(iter(found.cases.values()))["stops"]
    assert 2 < len(stops) < 5
    assert (stops[0]["pressure"], stops[-1]["pressure"]) == (0.0, 60.0)
    said = found.fit(len(json.dumps(found.meshes)) + int(0.7 * len(json.dumps(case))))
    assert "2 of 3 cases are left out" in said
    assert len(found.cases) == 1
    assert "left out" in found.reasons["case 2"]


def test_no_more_cases_are_opened_than_a_page_can_take(folder):
    _, results, model = folder
    found = Devices(results, most=1)
    found.add(model.name)
    found.add("nowhere")  # a case that is opened and not there leaves another reason
    assert found.reasons == {"nowhere": LEFT_OUT}
    assert "1 of 2 cases are left out" in found.fit(10**9)
    assert set(found.cases) == {model.name}


def test_a_page_that_is_too_large_says_what_it_leaves_out(folder, page, tmp_path, monkeypatch):
    configuration, results, _ = folder
    shutil.copytree(results, tmp_path / "results")
    small = len(page.encode()) - 40_000
    monkeypatch.setattr("limo.page.write.BUDGET", small)
    write_page(tmp_path / "results", configuration.studies)
    text = (tmp_path / "results/index.html").read_text(encoding="utf-8")
    assert len(text.encode()) <= small
    assert "To keep this page small each case is shown at" in " ".join(Reader(text).texts)


def test_places_are_spread_with_both_ends():
    assert spread(5, 20) == [0, 1, 2, 3, 4]
    assert spread(60, MOST_PRESSURES)[0] == 0
    assert spread(60, MOST_PRESSURES)[-1] == 59
    assert len(spread(60, MOST_PRESSURES)) == MOST_PRESSURES
    assert spread(1, 2) == [0]
    assert spread(7, 2) == [0, 6]


def test_packed_numbers_come_back():
    values = np.array([[0.0, -1.0], [np.nan, 3.14159]])
    steps = unpack(pack_steps(values, 0.001), "<i2").reshape(2, 2)
    np.testing.assert_array_equal(steps, [[0, -1000], [-32768, 3142]])
    np.testing.assert_array_equal(unpack(pack(np.array([70000, -1])), "<i4"), [70000, -1])
    assert re.fullmatch(r"[A-Za-z0-9+/=]+", pack(values))


def test_a_project_without_results_has_a_page(tmp_path, loaded):
    said = write_page(tmp_path / "results", loaded.studies)
    assert "0 studies" in said
    text = (tmp_path / "results/index.html").read_text(encoding="utf-8")
    assert "No study has been gathered yet" in text
    assert sources(tmp_path / "results", loaded.studies) == []
