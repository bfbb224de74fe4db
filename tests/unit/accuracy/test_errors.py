"""Errors of runs against an ensemble: points on surfaces, distances, and what is made of curves."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from importlib import import_module
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
import xarray as xr

from limo.accuracy import table as error_table
from limo.accuracy.errors import (
    ERRORS,  # fmt: skip
    chamfer,
    changes_of,
    errors_of,
    mean_of,
    preset_of,
    scatter_of,
)
from limo.accuracy.kept_names import kept_file, lacking
from limo.accuracy.kept_runs import read_runs, write_runs
from limo.accuracy.roles import error_studies, is_kept, is_timed, studies_of, subjects
from limo.accuracy.runs import Run
from limo.accuracy.sizes import COLUMNS
from limo.accuracy.statistics import exponent, pareto, richardson, rows_of, settings_of
from limo.accuracy.surfaces import CLOUD, STEP, Surface, sampled, section
from limo.accuracy.table import gather_errors, joined, read_errors, under_presets, write_errors
from limo.cases.grid import study_cases
from limo.config.project import Project
from limo.errors import ResultError
from limo.figures import style
from limo.mesh.surface import mirrors
from limo.reports.accuracy_device import NOT_MEASURED, QUESTIONS, device_report, differences
from limo.schema.config import Preset
from limo.schema.figures import DEVICE_FIGURES
from limo.schema.numerics import Mesh, Stage
from tests.helpers.patches import grid
from tests.helpers.results_page import rows, table

PRESSURE = np.linspace(0.0, 60.0, 121)


def flat(nx, ny):
    nodes, quads = grid(nx, ny)
    return np.column_stack([nodes, np.zeros(len(nodes))]), quads


def test_points_on_a_surface_are_as_dense_everywhere():
    nodes, quads = flat(6, 4)
    stretched = nodes * (2.0 * (nodes[:, :1] > 0)) * (1.0, 0.0, 0.0)  # one half three times as long
    points = sampled(nodes + stretched, quads, 4000)
    assert points.shape == (4000, 3)
    assert np.ptp(points[:, 2]) == 0
    counts, _ = np.histogram(points[:, 0], bins=[-1.0, 0.0, 1.0, 2.0, 3.0])
    assert counts == pytest.approx(np.full(4, 1000), rel=0.03)
    again = sampled(nodes + stretched, quads, 4000)
    assert np.array_equal(points, again)


def test_points_follow_curved_sides():
    nodes, quads = flat(1, 1)
    points = sampled(nodes + nodes[:, :1] ** 2 * (0.0, 0.0, 1.0), quads, 200)
    np.testing.assert_allclose(points[:, 2], points[:, 0] ** 2, atol=1e-12)


@pytest.mark.parametrize("height", [0.0, 0.313, -0.9])
def test_a_section_of_a_wave_is_the_wave(height):
    """z = sin(2 x) + y of a surface that is divided finely; every segment lies on the plane and on the surface."""
    nodes, quads = flat(30, 6)
    x, y = nodes[:, 0], nodes[:, 1]
    cut = section(np.column_stack([x, y, np.sin(2 * x) + y]), quads, height)
    np.testing.assert_allclose(cut[..., 1], np.sin(2 * cut[..., 0]) + height, atol=2e-3)
    assert np.abs(np.diff(cut[..., 0])).sum() == pytest.approx(np.ptp(x)), "from end to end and nothing twice"
    assert section(nodes, quads, 7.0).shape == (0, 2, 2)


def sheet(height=0.0, nx=3, ny=2, symmetry="full", corner=(0.0, 0.0), bend=0.0):
    """A surface 40 mm x 40 mm, z = ``height`` + 3/4 y + ``bend`` x^2, with its lowest corner at ``corner``."""
    nodes, quads = flat(nx, ny)
    points = 40.0 * (nodes - nodes.min(axis=0)) / np.maximum(np.ptp(nodes, axis=0), 1e-9)
    points[:, :2] += corner
    points[:, 2] = height + 0.75 * points[:, 1] + bend * points[:, 0] ** 2
    return Surface(np.array([0.0, 60.0]), np.array([0.0, 0.1]), points, quads, symmetry)


def test_chamfer_distance_is_that_between_surfaces_whatever_their_meshes():
    assert chamfer(sheet(), sheet()) == pytest.approx(0.0, abs=1e-9), "no spacing of points in it"
    assert chamfer(sheet(), sheet(nx=5, ny=7)) == pytest.approx(0.0, abs=1e-9)
    # parallel planes, where nothing but a strip along two edges is beyond the other's
    assert chamfer(sheet(), sheet(0.5, nx=5)) == pytest.approx(0.4, rel=2e-3)
    curved, finer = sheet(bend=0.01), sheet(bend=0.01, nx=9, ny=7)
    assert 0 < chamfer(curved, finer) < 0.02, "sides are followed"
    # a sheet beyond the edge of the other: from each, the mean way along the plane to the nearest edge
    assert chamfer(sheet(), sheet(corner=(50.0, 0.0))) == pytest.approx(30.0, rel=1e-3)
    near, far = sheet(), sheet(1.0, corner=(0.0, 10.0))
    assert chamfer(near, far) == chamfer(far, near)


@pytest.mark.parametrize(("symmetry", "copies"), [("front_back", 2), ("quarter", 4)])
def test_distances_are_from_all_copies_of_the_part(symmetry, copies):
    """Half a metre away too, and for points that are nearer to a copy than to the part."""
    part = sheet(12.0, symmetry=symmetry, corner=(15.0, -20.0))
    assert len(part.cloud) == CLOUD
    whole = [replace(part, points=part.points * sign, symmetry="full") for sign in mirrors(symmetry)]
    assert len(whole) == copies
    points = np.random.default_rng(1).uniform(-200.0, 200.0, (400, 3))
    np.testing.assert_allclose(part.distances(points), np.min([w.distances(points) for w in whole], axis=0), rtol=1e-12)
    assert chamfer(part, part) == pytest.approx(0.0, abs=1e-9)


@pytest.fixture
def make_run(make_case):
    """A run whose volumes are ``factor`` times those of a straight ramp and whose surface lies ``shift`` mm higher."""

    def make(factor=1.0, shift=0.0, role="accuracy", status="converged", until=60.0, **changed):
        stroke = np.where(until >= PRESSURE, 2.0 * factor * PRESSURE, np.nan)
        values = {
            "ventricle_volume": ("actuation_pressure", 300.0 - stroke), "stroke_volume": ("actuation_pressure", stroke),
            "actuation_volume_change": ("actuation_pressure", 0.5 * stroke), "pressure_90ml": 45.0 / factor,
            "efficiency_90ml": 0.5 * factor, "von_mises_peak": ("frame", [0.1, 10.0 * factor]),
            "fatigue_cycles_min": 1e6 * factor, "case_status": status, "case_reason": "", "solver_build": "a build",
            "dissipated_fraction": 0.02, "solver_time": 10.0, "iterations": 100.0, "solver_memory": 200.0,
        }  # fmt: skip
        values = xr.Dataset(values | changed, coords={"actuation_pressure": PRESSURE, "frame": ["0", "max"]})
        surface = replace(sheet(shift), height=np.array([0.0, 0.1 * factor]))
        return Run(role, "", "", 0, make_case(), values, surface, times=(float(values.solver_time),))

    return make


def test_errors_are_relative_to_the_mean_of_the_reference(make_run):
    reference = [make_run(0.9), make_run(1.1)]
    found = errors_of(make_run(1.2, shift=0.1), reference)
    assert list(found) == list(ERRORS)
    assert found["stroke"] == pytest.approx(0.2)
    assert found["actuation_volume"] == pytest.approx(0.2)
    volume = 300.0 - 2.0 * PRESSURE
    assert found["ventricle_volume"] == pytest.approx(np.linalg.norm(0.4 * PRESSURE) / np.linalg.norm(volume))
    assert found["stress"] == pytest.approx(0.2)
    assert found["height"] == pytest.approx(0.2)
    assert found["cycles"] == pytest.approx(np.log10(1.2) - 0.5 * np.log10(0.99))
    length = make_run().case.device.pattern.length
    assert found["chamfer"] == pytest.approx(0.8 * 0.1 / length, rel=1e-3)
    assert errors_of(make_run(), [make_run()]) == pytest.approx(dict.fromkeys(ERRORS, 0.0), abs=1e-9)


def test_what_a_run_lacks_is_no_number(make_run):
    reference = [make_run(), make_run()]
    short = errors_of(make_run(until=30.0), reference)
    assert np.isnan([short["stroke"], short["ventricle_volume"]]).all()
    bare = make_run()
    shell = Run("shells", "s8", "", 0, bare.case, bare.values.drop_vars(["von_mises_peak", "fatigue_cycles_min"]), None)
    found = errors_of(shell, reference)
    assert np.isnan([found[n] for n in ("stress", "cycles", "height", "chamfer")]).all()
    assert found["stroke"] == 0


def test_scatter_is_what_members_differ_among_themselves(make_run):
    found = scatter_of([make_run(0.9), make_run(1.0), make_run(1.1)])
    assert found["stroke"] == pytest.approx((0.15 / 1.05 + 0.0 + 0.15 / 0.95) / 3)
    assert CLOUD % 4 == 0, "the same number of points for all symmetries"


def test_the_mean_of_an_ensemble_is_that_of_its_curves(make_run):
    mean = mean_of([make_run(0.8), make_run(1.2)])
    found = errors_of(mean, [make_run(0.9), make_run(1.1)])
    assert found["actuation_volume"] == pytest.approx(0.0, abs=1e-12)
    assert found["stress"] == pytest.approx(0.0, abs=1e-12)
    assert found["cycles"] == pytest.approx(0.5 * abs(np.log10(0.96 / 0.99)))


def test_the_front_holds_what_nothing_beats_in_cost_and_error():
    cost, error = [5.0, 1.0, 2.0, 2.0, 9.0, 0.5], [0.1, 0.5, 0.6, 0.3, 0.1, np.nan]
    assert list(pareto(cost, error)) == [1, 3, 0]
    assert len(pareto([np.nan], [0.1])) == 0


def test_exponents_are_those_of_power_laws():
    size = np.array([1e3, 1e4, 1e5, 1e5])
    assert exponent(size, 3.0 * size**1.4) == pytest.approx((1.4, 3.0))
    assert np.isnan(exponent(size[2:], size[2:])).all(), "of one size"


def test_the_limit_is_that_of_a_power_of_the_edge():
    size = np.array([1e5, 4e5])
    assert richardson(size, 150.0 - 20.0 * (size / 1e5) ** -0.5, 1.0) == pytest.approx(150.0)
    assert richardson(size, 150.0 - 20.0 * (size / 1e5) ** -1.0, 2.0) == pytest.approx(150.0)


def test_a_setting_is_described_by_what_is_not_the_default(loaded, make_case):
    fast = loaded.config.numerics_presets["fast"]
    plain = make_case(numerics=fast.for_engine("calculix"))
    assert changes_of(loaded, "np4", plain) == {}
    damped = fast.model_copy(update={"fit": Stage(duration=20, damping=1e6)})
    changed = replace(plain, numerics=damped.for_engine("calculix"), mesh=Mesh(level="medium", symmetry="full"))
    found = changes_of(loaded, "np4", changed)
    assert found == {"medium": "level", "full": "symmetry", "fit.damping 1e+06": "numerics"}
    thick = plain.device.model_copy(update={"material": plain.device.material.model_copy(update={"thickness": 0.2})})
    assert changes_of(loaded, "np4", replace(plain, device=thick)) == {"thickness 0.2": "fabric"}


def test_runs_are_known_by_the_presets_that_they_are(loaded, make_case):
    newton = {"engine": "newton", "numerics": loaded.config.numerics_presets["fast"].for_engine("newton")}

    def named(**changes):
        return preset_of(loaded, SimpleNamespace(case=make_case(**newton | changes)))

    for name, preset in loaded.config.presets.items():
        numerics = loaded.config.numerics_presets[preset.numerics].for_engine("newton")
        assert named(mesh=preset.mesh, numerics=numerics) == name
    assert named(mesh=Mesh(level="coarse")) == ""
    assert named(engine="calculix") == ""


def test_measured_runs_bear_the_names_that_their_presets_have_today(loaded):
    then = {name: loaded.config.presets[name].model_dump(mode="json") for name in ("preview", "bricks")}
    kept = xr.Dataset(
        {"preset": ("run", ["standard", "preview", ""])},
        attrs={"presets": json.dumps({"preview": then["preview"], "standard": then["bricks"] | {"description": "of old"}})},
    )
    assert under_presets(kept, loaded.config.presets).preset.values.tolist() == ["bricks", "preview", ""]
    without = {name: preset for name, preset in loaded.config.presets.items() if name != "bricks"}
    assert under_presets(kept, without).preset.values.tolist() == ["", "preview", ""]


def test_what_studies_are_for_stands_in_their_files(loaded):
    """Whatever they are called; only subjects with a reference count."""
    reference, accuracy = loaded.studies["reference_np4"], loaded.studies["accuracy_np4"]
    names = {
        "settings": accuracy, "finest": reference, "plain": loaded.studies["stress"],
        "alone": accuracy.model_copy(update={"subject": "np6"}), "bent": accuracy.model_copy(update={"role": "shells"}),
    }  # fmt: skip
    project = replace(loaded, studies=names)
    assert subjects(project) == ["np4"]
    assert studies_of(project, "np4") == {"accuracy": "settings", "reference": "finest", "shells": "bent"}
    assert error_studies(project) == ["settings", "finest", "bent"]
    assert [name for name in names if is_kept(names[name])] == ["finest"]
    assert [name for name in names if is_timed(names[name])] == ["settings", "alone", "bent"]


def test_shipped_studies_have_the_roles_that_their_names_tell(loaded):
    roles = {name: (study.role, study.subject) for name, study in loaded.studies.items() if study.role}
    assert roles == {name: tuple(name.split("_")) for name in roles}
    assert set(error_studies(loaded)) == set(roles)


# --------------------------------------------------------------------------------------------------------------------
# the kept dataset, its figures and the report


@pytest.fixture
def gathered(loaded, make_run, make_case, monkeypatch, tmp_path):
    """Runs of one device whose errors and costs are known, gathered; N_p = 4 alone has been measured."""
    presets = loaded.config.numerics_presets
    fast, touching = presets["fast"], {"fine": presets["touching_finest"], "medium": presets["touching"]}
    damped = fast.model_copy(update={"ramp": fast.ramp.model_copy(update={"damping": 1e7})})

    def run(role, variant, factor, engine, seconds, branch=0, numerics=None, status="converged", **mesh):
        at_rest = touching.get(mesh.get("level"), presets["touching_at_once"])
        numerics = numerics or {"newton": at_rest, "calculix": fast}[engine]
        case = make_case(mesh=Mesh(**mesh), engine=engine, numerics=numerics.for_engine(engine), branch=branch)
        made = make_run(
            factor, role=role, status=status, solver_time=seconds, iterations=seconds * 10.0, solver_memory=9.0 * seconds
        )
        size = 2100.0 * seconds
        cuts = (np.zeros((0, 2, 2)), np.arange(8.0).reshape(2, 2, 2) * factor)
        surface = replace(made.surface, sections=cuts)
        return replace(made, variant=variant, case=case, branch=branch, surface=surface, equations=(size, 4.0 * size))

    runs = [
        *(run("reference", "", f, "newton", 1000.0, b, level="fine") for b, f in enumerate((0.99, 1.0, 1.01))),
        *(run("scatter", "preview", f, "newton", 10.0, b) for b, f in enumerate((0.86, 0.94))),
        *(run("scatter", "coarse", f, "newton", 90.0, b, level="coarse") for b, f in enumerate((0.98, 1.0))),
        run("referee", "preview", 0.88, "calculix", 100.0),
        run("referee", "medium", 0.97, "calculix", 3000.0, level="medium"),
        run("accuracy", "bricks", 0.9, "newton", 10.0),
        run("accuracy", "bricks_medium", 0.985, "newton", 400.0, level="medium"),
        run("accuracy", "bricks_paper", 0.97, "newton", 300.0, level="paper"),
        run("accuracy", "shells_paper", 0.97, "newton", 60.0, level="paper", element="SHELL8R"),
        run("accuracy", "shells_medium", 0.99, "newton", 90.0, level="medium", element="SHELL8R"),
        run("accuracy", "apart", 0.95, "newton", 5.0, numerics=fast),
        run("accuracy", "apart_medium", 0.985, "newton", 390.0, level="medium", numerics=presets["nested"]),
        run("accuracy", "half", 0.9, "newton", 30.0, symmetry="front_back"),
        run("referee", "damped", 0.5, "calculix", 50.0, numerics=damped),
        run("referee", "lost", 0.9, "calculix", 1.0, status="diverged", level="coarse"),
        replace(run("shells", "s8r", 0.99, "calculix", 200.0, symmetry="full", element="S8R"), surface=None),
        replace(run("shells", "s8", 0.9, "calculix", 300.0, symmetry="full", element="S8"), surface=None),
    ]
    monkeypatch.setattr(error_table, "runs_of", lambda project, subject, *_: runs if subject == "np4" else [])
    scaling = tmp_path / "gathered/scaling"
    scaling.mkdir(parents=True)
    sizes = [("newton", "a build", "measured", 1000.0 * 4**k, 50 * 4**k, 5, 5.0 * 8**k, 100.0 * 4**k) for k in range(4)]
    sizes.append(("newton", "", "failed: not enough memory", 256000.0, *[np.nan] * 4))
    pd.DataFrame(sizes, columns=[*COLUMNS]).to_csv(scaling / "newton.csv", index=False)
    return gather_errors(loaded, scaling.parent, None, {})


def test_the_page_of_results_says_what_is_in_the_file(gathered, tmp_path):
    file = tmp_path / "accuracy.nc"
    write_errors(gathered, file)
    assert rows(file) == table("accuracy.nc")


@pytest.fixture
def kept_runs(make_run, loaded):
    """Two runs of a reference in a file, which are those of the study ``reference_np4``."""
    cases = list(study_cases(loaded, "reference_np4").items())[:2]
    cuts = (np.zeros((0, 2, 2)), np.arange(8.0).reshape(2, 2, 2))
    runs = []
    for factor, nx, (point, case) in zip((0.9, 1.1), (3, 5), cases, strict=True):
        made = make_run(factor, role="reference", case_id=case.case_id, machine="a machine")
        surface = replace(sheet(-200.0 * factor, nx=nx, symmetry="quarter"), sections=cuts)
        runs.append(replace(made, case=case, branch=point.branch, surface=surface, equations=(100.0, 400.0)))
    return runs


def test_kept_runs_survive_their_file(kept_runs, loaded, tmp_path):
    """And those of another mesh are not taken for them."""
    file = kept_file(tmp_path, "reference_np4")
    assert read_runs(loaded, "reference_np4", file) == []
    write_runs(kept_runs, file)
    again = read_runs(loaded, "reference_np4", file)
    assert [(r.case, r.branch, r.role, r.equations) for r in again] == [
        (r.case, r.branch, r.role, r.equations) for r in kept_runs
    ]
    for one, other in zip(again, kept_runs, strict=True):
        assert errors_of(one, [other]) == pytest.approx(dict.fromkeys(ERRORS, 0.0), abs=1e-4)
        assert [c.shape for c in one.surface.sections] == [(0, 2, 2), (2, 2, 2)]
        assert float(one.values.solver_time) == 10.0
        np.testing.assert_array_equal(one.surface.quads, other.surface.quads)
        np.testing.assert_allclose(one.surface.points, other.surface.points, atol=0.5 * STEP + 1e-6)
    assert lacking(loaded, "reference_np4", tmp_path) == [False, False, True]
    renamed = loaded.studies["reference_np4"].model_copy(update={"device": "renamed"})
    devices = {**loaded.devices, "renamed": loaded.devices["limo"]}
    called = Project(loaded.config, devices, {"reference_np4": renamed}, loaded.files)
    assert lacking(called, "reference_np4", tmp_path) == [False, False, True], "the name decides nothing"
    assert len(read_runs(called, "reference_np4", file)) == 2
    coarser = loaded.studies["reference_np4"].model_copy(update={"mesh": Mesh(level="medium")})
    other = loaded.with_builds({"newton": "another"})
    assert len(read_runs(other, "reference_np4", file)) == 2, "the same cases by another build"
    other = replace(loaded, studies={**loaded.studies, "reference_np4": coarser})
    assert all(lacking(other, "reference_np4", tmp_path)), "another mesh"
    assert read_runs(other, "reference_np4", file) == []
    file.write_text("nothing")
    with pytest.raises(ResultError, match="without the file they are solved anew"):
        read_runs(loaded, "reference_np4", file)


def test_rows_survive_their_file(gathered, tmp_path):
    file = tmp_path / "accuracy.nc"
    write_errors(gathered, file)
    kept = read_errors(file)
    assert kept.sizes == gathered.sizes
    np.testing.assert_allclose(kept.sections, gathered.sections, atol=0.5 * STEP + 1e-6)
    for name in gathered:
        assert kept[name].dtype.kind == "f" or list(kept[name].values) == list(gathered[name].values)
    np.testing.assert_allclose(kept.error_stress, gathered.error_stress, rtol=1e-6)
    assert all({"units", "long_name"} <= set(v.attrs) for v in kept.data_vars.values() if v.dtype.kind == "f")
    file.write_text("nothing")
    with pytest.raises(ResultError, match="not the dataset of measured errors"):
        read_errors(file)
    gathered.drop_vars("cpu_seconds").to_netcdf(tmp_path / "other.nc")
    with pytest.raises(ResultError, match="no variables cpu_seconds"):
        read_errors(tmp_path / "other.nc")


def test_rows_that_are_measured_later_join_the_kept_ones(gathered, loaded, monkeypatch, tmp_path):
    runs = error_table.runs_of(loaded, "np4")
    reference = [run for run in runs if run.role == "reference"]
    (newton,) = (run for run in runs if run.variant == "bricks")
    fuller = replace(newton.case, mesh=Mesh(level="paper", element="C3D20"))
    longer = replace(newton.surface, pressure=np.array([0.0, 30.0, 60.0]), height=np.array([0.0, 0.05, 0.1]))
    later = [replace(newton, surface=replace(longer, sections=(*newton.surface.sections, np.ones((1, 2, 2)))))]
    later.append(replace(newton, case=fuller, variant="fuller", values=newton.values.assign(machine="another machine")))
    monkeypatch.setattr(error_table, "runs_of", lambda project, subject, *_: [*reference, *later] if subject == "np4" else [])
    both = joined(gather_errors(loaded, tmp_path, None, {}), gathered)
    named, before = ([key[1:] for key in error_table.keys_of(dataset)] for dataset in (both, gathered))
    assert len(set(named)) == len(named) == len(before) + 1
    assert set(named) - set(before) == {("accuracy", "run", "fuller", 0.0)}
    kinds = [kind for _, kind, _, _ in named]
    assert kinds == sorted(kinds, key=lambda kind: kind == "run"), "ensembles first"
    for name in ("error_stress", "stroke_volume", "cpu_seconds", "frame_height"):
        for row, key in enumerate(before):
            if name in gathered and key[2] != "bricks":
                found = both[name].values[named.index(key)]
                np.testing.assert_array_equal(found[: gathered[name][row].size] if found.ndim else found, gathered[name][row])
    assert both.machine.values[named.index(("accuracy", "run", "fuller", 0.0))] == "another machine"
    row = named.index(("accuracy", "run", "bricks", 0.0))
    assert both.frame_pressure.values[row].tolist() == [0.0, 30.0, 60.0], "the later one"
    shown = {named[int(k)]: cut for k, cut in zip(both.section_run, both.sections.values, strict=True)}
    assert np.isfinite(shown["accuracy", "run", "bricks", 0.0]).sum() == 8 + 4
    assert set(shown) == {before[int(k)] for k in gathered.section_run}
    for k, cut in zip(gathered.section_run, gathered.sections.values, strict=True):
        if (key := before[int(k)])[2] != "bricks":
            np.testing.assert_array_equal(shown[key][: len(cut), : cut.shape[1]], cut)
    assert both.size_engine.values.tolist() == gathered.size_engine.values.tolist()
    write_errors(both, tmp_path / "both.nc")
    report = device_report(read_errors(tmp_path / "both.nc"), loaded.config.presets)
    assert "C3D20 against C3D20R on `paper` with newton: volumes 7." in report
    assert "Seconds of different machines are not to be compared" in report
    assert "The paper's element at its own density (full integration, `paper`): largest w 10.0% (at most 2.0%" in report


def test_rows_say_what_ran_and_how_wrong_it_is(gathered):
    rows = rows_of(gathered)
    assert len(rows) == 21 + 6
    by = rows[rows.kind == "run"].set_index(["part", "setting", "branch"])
    bricks, apart = (by.loc["accuracy", name, 0] for name in ("bricks", "apart"))
    assert bricks.error_stress == pytest.approx(0.1)
    assert bricks.error_volumes == pytest.approx(0.1)
    assert (bricks.varied, bricks.preset, bricks.degrees_of_freedom) == ("", "", 84000)
    assert (apart.varied, apart.change, apart.preset) == ("contact", "no contact", "preview")
    named = {"apart_medium": "bricks", "shells_medium": "standard", "bricks_medium": ""}
    assert {name: by.loc["accuracy", name, 0].preset for name in named} == named
    assert by.loc["accuracy", "bricks_medium", 0].change == "medium", "the meshes that its fit begins on go without saying"
    assert by.loc["referee", "damped", 0].change == "ramp.damping 1e+07"
    assert by.loc["reference", "reference", 1].error_stress == pytest.approx(0.0, abs=1e-12)
    means = rows[(rows.kind == "mean") & (rows.part == "scatter")].set_index("setting")
    assert means.error_stress.to_dict() == pytest.approx({"preview": 0.1, "coarse": 0.01})
    assert means.cpu_seconds.to_dict() == {"preview": 10, "coarse": 90}
    chosen = list(settings_of(rows).setting)
    assert chosen.count("reference") == 1
    assert "lost" not in chosen
    assert list(rows.setting.iloc[gathered.section_run.values.astype(int)]) == [
        "reference",
        "bricks",
        "bricks_medium",
        "bricks_paper",
    ]


def test_differences_are_between_two_runs(gathered):
    rows = rows_of(gathered)
    one, other = (rows.index[rows.setting == name][0] for name in ("bricks_medium", "medium"))
    found = differences(gathered, one, other)
    assert found["stress"] == pytest.approx(0.985 / 0.97 - 1)
    assert found["actuation_volume_change"] == pytest.approx(0.985 / 0.97 - 1)
    assert found["cpu_seconds"] == pytest.approx(400 / 3000 - 1)


def test_the_report_answers_from_the_rows(gathered, loaded):
    text = device_report(gathered, loaded.config.presets)
    found = {q: text.split(f"**{q}**\n  - `np4`:")[1].split("\n- **")[0] for q in QUESTIONS.values()}
    answers = {q: answer.removeprefix("\n    -").strip() for q, answer in found.items()}
    preview = answers[QUESTIONS["preview"]]
    assert preview.startswith("5 s of CPU time and 45 MiB; volumes 5.0%, stroke 5.0%, stress 5.0%")
    assert answers[QUESTIONS["symmetry"]].startswith("front_back against quarter with newton: volumes 0.00%, stroke +0.0%")
    elements = answers[QUESTIONS["elements"]]
    assert elements.startswith("S8R against S8: volumes 10.0%, stroke +10.0%")
    assert "S8R of the full device against C3D20R on `preview` with calculix: volumes 12.5%" in elements
    assert "SHELL8R against C3D20R on `medium` with newton: volumes 0.51%" in elements
    contact = answers[QUESTIONS["contact"]]
    assert "no contact on `preview`: volumes 5.6%" in contact
    assert "no contact, newton.geometric_stiffness mixed on `medium`: volumes 0.00%, stroke +0.0%, stress +0.0%" in contact
    damping = answers[QUESTIONS["damping"]]
    assert "ramp.damping 1e+07 1/s" in damping
    assert damping.count("not harmless") == 1
    mesh = answers[QUESTIONS["mesh"]]
    assert mesh.startswith("SHELL8R on `medium` with newton, preset `standard`, for 90 s is the cheapest")
    paper = answers[QUESTIONS["paper"]]
    assert "with newton: largest w 1.5% (at most 2.0%, met)" in paper
    assert "with calculix: largest w 3.0% (at most 2.0%, **not met**)" in paper
    assert (
        "C3D20R: stroke 116.4 (`paper`), 118.2 (`medium`), 120.0 (`fine`) ml; Richardson's extrapolation adds "
        in answers[QUESTIONS["limit"]]
    )
    assert "SHELL8R: stroke 116.4 (`paper`), 118.8 (`medium`) ml" in answers[QUESTIONS["limit"]]
    scatter = answers[QUESTIONS["scatter"]]
    assert re.search(r"2 runs at `preview` [^\n]+ Their mean is off the reference by 10\.0% and 10\.0%", scatter)
    assert re.search(r"2 runs at `coarse` [^\n]+ Their mean is off the reference by 1\.0% and 1\.0%", scatter)
    assert "| scatter of coarse | coarse | newton |" in text
    assert "newton against calculix on `medium`: volumes 1.5%" in answers[QUESTIONS["engines"]]
    scaling = text.split("### What it takes")[1].split("###")[0]
    assert "| 1.50 | 1.00 | 64000 | 512.0 | 6400 | 245760 |" in scaling, "a time that grows eightfold with four times the size"
    assert re.search(r"\| lost \| coarse \| calculix \| \d+ \| diverged ", text)
    branches = loaded.config.presets["bricks"].branches
    assert re.search(
        rf"\| np4 \| bricks \| medium \| quarter \| newton \| {branches} \| converged \| 390 \| 3510 \| 1\.5% ", text
    )
    other = {**loaded.config.presets, "mine": Preset(mesh=Mesh(level="coarse"))}
    assert re.search(
        rf"\| np4 \| mine \| coarse \| quarter \| newton \| 1 \| - \| {NOT_MEASURED} ", device_report(gathered, other)
    )


def test_what_was_not_run_is_not_measured(gathered, loaded):
    away = ["medium", "preview", "half", "s8", "damped", "bricks", "bricks_medium", "apart", "shells_paper", "shells_medium"]
    kept = gathered.isel(run=~np.isin(gathered.setting, away))
    text = device_report(kept, loaded.config.presets)
    for key in ("preview", "symmetry", "elements", "damping", "engines", "contact"):
        assert f"**{QUESTIONS[key]}**\n  - `np4`: {NOT_MEASURED}.\n" in text + "\n"
    assert f"**{QUESTIONS['mesh']}**\n  - `np4`:\n    - C3D20R on `fine` with newton, preset `reference`," in text
    nothing = device_report(None, loaded.config.presets)
    assert nothing.count(f"  - {NOT_MEASURED}.") == len(QUESTIONS)


def test_without_two_runs_of_a_reference_there_are_no_errors(loaded, monkeypatch, make_run):
    monkeypatch.setattr(error_table, "runs_of", lambda *_: [make_run(role="reference"), make_run()])
    with pytest.raises(ResultError, match="two converged runs of its reference"):
        gather_errors(loaded, None, None, {})


@pytest.mark.parametrize("name", DEVICE_FIGURES)
def test_figures_are_drawn_from_the_kept_dataset_alone(gathered, name, root, tmp_path):
    write_errors(gathered, tmp_path / "accuracy.nc")
    module = import_module(f"limo.figures.{name}")
    figure = module.draw(read_errors(tmp_path / "accuracy.nc"))
    style.save(figure, tmp_path / "figure.png")
    shown = {text.get_text() for axis in figure.axes for text in axis.texts}
    style.close(figure)
    assert (tmp_path / "figure.png").stat().st_size > 10_000
    if name == "accuracy_cost":
        assert {"preview", "bricks", "reference", "standard", "apart"} <= shown
        assert not {"lost", "damped"} & shown, "not on the front"
    assert (root / f"workflow/report/{name}.rst").stat().st_size > 50
    drawn = module.draw(gathered.isel(run=gathered.kind.values != "run", section=slice(0), size=slice(0)))
    style.close(drawn)
