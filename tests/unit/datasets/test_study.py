"""Gathering a study from its cases, and drawing it."""

import json
import re

import numpy as np
import pytest
import xarray as xr
from matplotlib.collections import PolyCollection

from limo.bench.curves import read_curves
from limo.cases.grid import cross_checks, study_cases
from limo.config.project import Project
from limo.datasets.curves import curves
from limo.datasets.study import gather_study
from limo.datasets.variables import COORDINATES, CURVE_DIMS, STATUSES, VARIABLES
from limo.engines.calculix.deck import stage_times
from limo.errors import ConfigError, ResultError
from limo.figures import afterload, pressure_volume, style
from limo.schema.bench import MeasuredCurves
from limo.schema.study import Study, Variant
from limo.solve.harvest import _history
from limo.store.files import write_json
from limo.terminal.tables import study_table
from tests.helpers.curves import FILLING, STROKE, history_of, path_at

STOPPED_AT = 31.3  # kPa, where the failing case diverges


@pytest.fixture(scope="module")
def grid(loaded):
    """A study of N_p = 4, 6, 8 at two ventricular pressures."""
    study = Study(
        description="a test", axes={"n_pouches": [4, 6, 8], "ventricular_pressure": [3.8, 13.8]},
        actuation_pressure_max={3.8: 60, 13.8: 100}, pressure_step=2.5, outputs=["volumes"], figures=["pressure_volume"],
    )  # fmt: skip
    return Project(loaded.config, loaded.devices, {"grid": study}, loaded.files)


@pytest.fixture(scope="module")
def gathered(grid, tmp_path_factory):
    """The dataset of cases of which N_p = 6 diverged, and of N_p = 8 at 13.8 kPa two files are absent or damaged."""
    folder = tmp_path_factory.mktemp("cases")
    for (n_pouches, pressure, *_), case in study_cases(grid, "grid").items():
        failed = n_pouches == 6
        target = folder / case.case_id
        target.mkdir()
        if n_pouches == 8 and pressure == 13.8:
            (target / "status.json").write_text('{"status": "conv')
            continue
        history_of(case, STOPPED_AT if failed else None).to_netcdf(target / "volumes.nc")
        status = {
            "status": "diverged" if failed else "converged",
            "reason": "too many cutbacks" if failed else "",
            "iterations": 100 * n_pouches,
            "actuation_pressure_reached": STOPPED_AT if failed else case.actuation_pressure_max,
            "rest_change": None,
            "solver": {"version": "2.20", "sha256": "ab" * 8, "build": "tuned"},
        }
        write_json(target / "status.json", status)
        if n_pouches == 8:
            (target / "volumes.nc").write_bytes((target / "volumes.nc").read_bytes()[:2000])
    return gather_study(grid, "grid", folder)


def pick(dataset, n_pouches, pressure=3.8):
    return dataset.sel(n_pouches=n_pouches, ventricular_pressure=pressure, aspect_ratio=2.0, stiffness_ratio=1.0)


# --------------------------------------------------------------------------------------------------------------------
# the dataset


def test_every_variable_has_its_dimensions_units_and_long_name(gathered):
    for name, variable in VARIABLES.items():
        stored = gathered[name]
        varied = tuple(
            d for d in variable.dims if d not in ("width_scale", "fabric_angle", "bending_factor", "variant", "branch")
        )
        assert stored.dims == varied, "one is no dimension"
        assert (stored.attrs["units"], stored.attrs["long_name"]) == (variable.units, variable.long_name)
        assert stored.dtype == float
    for name in COORDINATES.keys() - {"variant", "fabric_angle", "bending_factor"}:  # what the study does not vary
        units, long_name = COORDINATES[name]
        assert (gathered[name].attrs["units"], gathered[name].attrs["long_name"]) == (units, long_name)
    assert all(v.attrs.get("long_name") for v in gathered.variables.values())
    assert set(np.unique(gathered.case_status)) <= set(STATUSES)


def test_curves_are_interpolated_to_the_pressures_of_the_study(gathered):
    case = pick(gathered, 4)
    pressure = gathered.actuation_pressure
    assert {60.0, 100.0} <= set(pressure.values)
    inside = pressure <= 60.0
    np.testing.assert_allclose(case.stroke_volume[inside], STROKE * pressure[inside], atol=1e-9)
    np.testing.assert_allclose(case.actuation_volume_change[inside], FILLING * pressure[inside], atol=1e-9)
    np.testing.assert_allclose(case.ventricle_volume[inside], 400 - STROKE * pressure[inside])
    np.testing.assert_allclose(case.actuation_volume[inside], 2 + FILLING * pressure[inside])
    np.testing.assert_allclose(case.io_ratio[inside], STROKE * pressure[inside] / (2 + FILLING * pressure[inside]), atol=1e-9)
    np.testing.assert_allclose(case.io_ratio_of_change[inside][1:], STROKE / FILLING)
    assert np.isfinite(case.stroke_volume[inside]).all(), "up to and with P_a,max"
    for name, variable in VARIABLES.items():
        if variable.dims == CURVE_DIMS:
            assert np.isnan(case[name][~inside]).all(), "beyond the case's own P_a,max"


def test_efficiency_is_that_of_the_straight_curves(gathered):
    """W_out / W_in at 90 ml: P_v 90 / (1.5 P^2 / 2) with P = 45 kPa."""
    for pressure in (3.8, 13.8):
        case = pick(gathered, 4, pressure)
        assert float(case.pressure_90ml) == pytest.approx(45.0)
        assert float(case.efficiency_90ml) == pytest.approx(pressure * 90 / (FILLING * 45**2 / 2), rel=1e-3)
        assert str(case.efficiency_90ml_reason.values) == ""


def test_case_that_failed_keeps_what_it_reached_and_says_why(gathered):
    case = pick(gathered, 6)
    reached = gathered.actuation_pressure.values <= STOPPED_AT
    np.testing.assert_allclose(case.stroke_volume[reached], STROKE * gathered.actuation_pressure[reached], atol=1e-9)
    assert np.isnan(case.stroke_volume[~reached]).all()
    assert np.isnan(case.efficiency_90ml)
    assert np.isnan(case.pressure_90ml)
    assert float(case.actuation_pressure_reached) == STOPPED_AT
    assert (str(case.case_status.values), str(case.case_reason.values)) == ("diverged", "too many cutbacks")
    assert "ml" in str(case.efficiency_90ml_reason.values)
    assert np.isnan(case.rest_change), "a number that is null in the status"
    assert float(case.iterations) == 600


@pytest.mark.parametrize("pressure", [3.8, 13.8], ids=["damaged volumes", "damaged status"])
def test_case_whose_files_cannot_be_read_is_missing(gathered, pressure):
    case = pick(gathered, 8, pressure)
    assert str(case.case_status.values) == "missing"
    assert str(case.case_reason.values)
    assert all(np.isnan(case[name]).all() for name in VARIABLES)
    assert "missing" in str(case.efficiency_90ml_reason.values)


def test_study_of_absent_results_is_all_missing(grid, tmp_path):
    dataset = gather_study(grid, "grid", tmp_path / "nowhere")
    assert (dataset.case_status == "missing").all()
    assert dataset.stroke_volume.isnull().all()


def test_attributes_tell_where_the_dataset_comes_from(grid, gathered):
    assert json.loads(gathered.attrs["config"]) == json.loads(json.dumps(grid.content("grid")))
    assert {"limo", "python", "numpy", "gmsh"} <= set(json.loads(gathered.attrs["versions"]))
    assert re.fullmatch(r"[0-9a-f]{40}\+?|unknown", gathered.attrs["git_commit"])
    assert gathered.attrs["study"] == "grid"
    assert "a test" in gathered.attrs["title"]
    assert str(pick(gathered, 4).solver_build.values) == "2.20 " + "ab" * 8 + " tuned"


def test_dataset_round_trip(gathered, tmp_path):
    gathered.to_netcdf(tmp_path / "study.nc")
    with xr.open_dataset(tmp_path / "study.nc") as again:
        xr.testing.assert_identical(again.load(), gathered)


def test_width_scale_is_a_dimension_where_a_study_varies_it(grid, tmp_path):
    study = grid.studies["grid"]
    axes = study.axes.model_copy(update={"width_scale": [0.8, 1.0], "n_pouches": [8]})
    wide = Project(grid.config, grid.devices, {"wide": study.model_copy(update={"axes": axes})}, grid.files)
    dataset = gather_study(wide, "wide", tmp_path)
    assert dataset.efficiency_90ml.dims[-1] == "width_scale"
    np.testing.assert_array_equal(dataset.width_scale, [0.8, 1.0])


def test_variants_are_a_dimension_of_names_where_a_study_has_them(grid, gathered, tmp_path):
    study = grid.studies["grid"].model_copy(
        update={"variants": {"quarter": Variant(), "half": Variant(mesh={"symmetry": "full"})}}
    )
    both = Project(grid.config, grid.devices, {"both": study}, grid.files)
    for key, case in study_cases(both, "both").items():
        (tmp_path / case.case_id).mkdir()
        history_of(case, 10.0 if key.variant == "half" else None).to_netcdf(tmp_path / case.case_id / "volumes.nc")
        status = {"status": "converged", "reason": "", "actuation_pressure_reached": 10.0}
        write_json(tmp_path / case.case_id / "status.json", status)
    dataset = gather_study(both, "both", tmp_path)
    assert list(dataset.variant.values) == ["quarter", "half"]
    reached = dataset.stroke_volume.sel(n_pouches=4, ventricular_pressure=3.8).squeeze().notnull().sum("actuation_pressure")
    assert reached.sel(variant="half") == 5 < reached.sel(variant="quarter")
    assert "variant" not in gathered.coords
    dataset.to_netcdf(tmp_path / "study.nc")
    assert "half" in study_table(tmp_path / "study.nc")
    labels = [line.get_label() for line in pressure_volume.draw(dataset).axes[1].lines]
    assert "$N_p$ = 4, $P_v$ = 3.8 kPa, half" in labels


def test_converged_case_has_a_value_at_its_last_pressure(make_case):
    """The solver prints its clock with ten digits: the last increment may lie a hair before P_a,max."""
    case = make_case()
    times = stage_times(case.numerics, case.actuation_pressure_max)
    history = history_of(case)
    clock = history.solver_time.values.copy()
    clock[-1] = times[-1].end * (1 - 1e-10)
    printed = _history(path_at(case, clock), np.column_stack([1e3 * history[n].values for n in history.data_vars]))
    values = curves(printed, case.ventricular_pressure, np.array([0.0, 30.0, case.actuation_pressure_max]))
    np.testing.assert_allclose(values["stroke_volume"], [0.0, 60.0, 120.0], atol=1e-6)


@pytest.mark.parametrize("stages", [0, 5, 9])
def test_case_without_a_ramp_has_no_curve(make_case, stages):
    """Nothing accepted, the fit alone, or fit and part of the hold: P_a = 0 is all there may be."""
    case = make_case()
    values = curves(history_of(case).isel(increment=slice(0, stages)), case.ventricular_pressure, np.array([0.0, 10.0]))
    assert np.isnan(values["stroke_volume"][1])
    assert np.isnan(values["efficiency_90ml"])


# --------------------------------------------------------------------------------------------------------------------
# cases that went further for another study


@pytest.fixture
def further(loaded, tmp_path):
    """``further(maximum, status, reached)``: the dataset of a study up to ``maximum`` from one case up to 60 kPa."""

    def gather(maximum, status="converged", reached=60.0):
        def up_to(pressure):
            axes = {"n_pouches": [8], "ventricular_pressure": [3.8]}
            study = Study(axes=axes, actuation_pressure_max=pressure, pressure_step=2.5)
            return Project(loaded.config, loaded.devices, {"s": study}, loaded.files)

        (case,) = study_cases(up_to(60.0), "s").values()
        folder = tmp_path / case.case_id
        folder.mkdir()
        history_of(case, reached).to_netcdf(folder / "volumes.nc")
        why = "" if status == "converged" else "too many cutbacks"
        write_json(folder / "status.json", {"status": status, "reason": why, "actuation_pressure_reached": reached})
        return gather_study(up_to(maximum), "s", tmp_path, [case.case_id]).squeeze(drop=True), case

    return gather


def test_a_study_sees_nothing_beyond_its_own_maximum(further):
    """40.1 kPa lies between two increments of the case that went to 60: a stroke of 80.2 ml, so none of 90."""
    found, case = further(40.1)
    assert float(found.actuation_pressure[-1]) == 40.1
    np.testing.assert_allclose(found.stroke_volume, STROKE * found.actuation_pressure, atol=1e-9)
    assert float(found.actuation_pressure_reached) == 40.1
    assert np.isnan(found.efficiency_90ml)
    assert np.isnan(found.pressure_90ml)
    assert str(found.efficiency_90ml_reason.values) == "largest stroke 80.2 ml"
    assert str(found.case_id.values) == case.case_id


def test_efficiency_does_not_depend_on_how_far_a_case_went(further):
    found, _ = further(46.0)
    assert float(found.pressure_90ml) == pytest.approx(45.0)
    assert float(found.efficiency_90ml) == pytest.approx(3.8 * 90 / (FILLING * 45**2 / 2), rel=1e-3)


@pytest.mark.parametrize(("maximum", "status", "reason"), [(50.0, "converged", ""), (58.0, "diverged", "too many cutbacks")])
def test_a_failure_counts_only_where_a_study_gets_that_far(further, maximum, status, reason):
    found, _ = further(maximum, "diverged", 55.0)
    assert (str(found.case_status.values), str(found.case_reason.values)) == (status, reason)
    assert float(found.actuation_pressure_reached) == min(maximum, 55.0)
    reached = found.actuation_pressure <= min(maximum, 55.0)
    assert np.isfinite(found.stroke_volume[reached]).all()
    assert np.isnan(found.stroke_volume[~reached]).all()


# --------------------------------------------------------------------------------------------------------------------
# figures

MEASURED = """# a comment
label,actuation_pressure,actuation_volume_change,stroke_volume
3.8 kPa,0,0,0
3.8 kPa,10,12,
3.8 kPa,20,30,41.5
"""


@pytest.mark.parametrize(("kind", "with_measured"), [("png", False), ("pdf", True)])
def test_figure_is_the_same_bytes_twice(gathered, tmp_path, kind, with_measured):
    measured = None
    if with_measured:
        (tmp_path / "measured.csv").write_text(MEASURED)
        measured = read_curves(MeasuredCurves(data=str(tmp_path / "measured.csv"))).table
    written = []
    for k in range(2):
        path = tmp_path / f"{k}.{kind}"
        style.save(pressure_volume.draw(gathered, measured), path)
        written.append(path.read_bytes())
    assert written[0] == written[1]
    assert len(written[0]) > 5000


def test_figure_shows_every_case_and_names_those_that_failed(gathered):
    figure = pressure_volume.draw(gathered)
    stroke = figure.axes[1]
    curves_drawn = {line.get_label(): line for line in stroke.get_lines() if not line.get_label().startswith("_")}
    assert len(curves_drawn) == 6
    assert sum("(diverged)" in label for label in curves_drawn) == 2
    assert sum("(missing)" in label for label in curves_drawn) == 2
    good = next(line for label, line in curves_drawn.items() if "$N_p$ = 4" in label and "3.8" in label)
    np.testing.assert_allclose(good.get_ydata()[:3], [0.0, 5.0, 10.0])
    assert figure.axes[0].get_xlim()[1] == 100.0


def test_curves_and_the_table_say_where_front_and_back_would_touch(gathered, tmp_path):
    touching = xr.full_like(gathered.efficiency_90ml, np.nan)
    touching.loc[{"n_pouches": 4}] = 22.5
    dataset = gathered.assign(contact_front_back=touching)
    for figure in (pressure_volume.draw(dataset), afterload.draw(dataset)):
        lines = figure.axes[1].get_lines()
        light = [line for line in lines if line.get_alpha() == style.FADED]
        assert [line.get_xdata()[0] for line in light] == [22.5] * 2, "one for each P_v"
        for faded in light:
            before = lines[list(lines).index(faded) - 1]
            assert (before.get_xdata()[-1], before.get_color()) == (22.5, faded.get_color())
        assert not any(entry.get_text().startswith("_") for entry in figure.legends[0].get_texts())
        style.close(figure)
    dataset.to_netcdf(tmp_path / "study.nc")
    rows = study_table(tmp_path / "study.nc").splitlines()
    assert ["22.5" in row for row in rows[2:8]] == [True, True, False, False, False, False], rows[1:8]
    assert "touches [kPa]" in rows[1]
    gathered.to_netcdf(tmp_path / "plain.nc")
    assert "touches" not in study_table(tmp_path / "plain.nc")


def test_a_table_says_where_layers_of_empty_pouches_lie_in_each_other(gathered, tmp_path):
    """V_a is negative there: nothing in the model keeps them apart."""
    file, rest = tmp_path / "study.nc", {"actuation_pressure": 0.0}
    volume = gathered.actuation_volume.copy(deep=True)
    volume.loc[rest] = 0.0
    gathered.assign(actuation_volume=volume).to_netcdf(file)
    assert "V_a at rest" not in study_table(file)
    volume.loc[rest | {"n_pouches": 4, "ventricular_pressure": 3.8}] = -7.2
    gathered.assign(actuation_volume=volume).to_netcdf(file, mode="w")
    cases = volume.isel(actuation_pressure=0).size
    assert f"V_a at rest is -7.2 ml in 1 of {cases} cases" in study_table(file)


def test_a_table_of_something_else_is_one_message(tmp_path):
    xr.Dataset({"height": ("x", [1.0])}).to_netcdf(tmp_path / "airbag.nc")
    with pytest.raises(ResultError, match=r"airbag\.nc: not a study's dataset \(no case_status\)"):
        study_table(tmp_path / "airbag.nc")


def test_measured_curves_keep_gaps_and_refuse_other_tables(tmp_path):
    path = tmp_path / "measured.csv"
    path.write_text(MEASURED)
    table = read_curves(MeasuredCurves(data=str(path))).table
    np.testing.assert_array_equal(table.stroke_volume, [0.0, np.nan, 41.5])
    wrong = {"absent": None, "columns": "label,pressure\na,1\n", "text": MEASURED.replace("41.5", "many"), "empty": "",
             "bytes": b"\xff\xfe\x00"}  # fmt: skip
    for name, text in wrong.items():
        other = tmp_path / f"{name}.csv"
        if text is not None:
            other.write_bytes(text if isinstance(text, bytes) else text.encode())
        with pytest.raises(ConfigError, match=rf"{name}\.csv"):
            read_curves(MeasuredCurves(data=str(other)))


def test_branches_and_cross_checks_have_their_places(grid, tmp_path):
    study = grid.studies["grid"].model_copy(update={"branches": 2, "cross_check": 1, "engine": "newton"})
    both = Project(grid.config, grid.devices, {"both": study}, grid.files)
    twins = cross_checks(both, "both")
    for case in (*study_cases(both, "both").values(), *twins.values()):
        target = tmp_path / case.case_id
        target.mkdir()
        history = history_of(case)
        history["potential_energy"] = 0.0 * history.ventricle_volume - 5.0
        if case.engine == "calculix":  # 10 ml more at rest, and 10 % more stroke
            start = float(history.ventricle_volume[9])
            history["ventricle_volume"] = start + 10.0 + 1.1 * (history.ventricle_volume - start)
            history["potential_energy"] = 0.0 * history.ventricle_volume - 7.0
        history.to_netcdf(target / "volumes.nc")
        status = {"status": "converged", "reason": "", "actuation_pressure_reached": case.actuation_pressure_max}
        write_json(target / "status.json", status)
    dataset = gather_study(both, "both", tmp_path)
    assert dataset.sizes["branch"] == 2
    dataset.stroke_volume.loc[{"branch": 1}] *= 1.1
    for figure in (pressure_volume.draw(dataset), afterload.draw(dataset)):
        bands = [c for axis in figure.axes for c in axis.collections if isinstance(c, PolyCollection)]
        assert len(bands) == 3 * dataset.case_status.isel(branch=0).size, "of both volumes and of the ratio, for each case"
        style.close(figure)
    (point,) = twins
    checked = dataset.sel(n_pouches=point.n_pouches, ventricular_pressure=point.ventricular_pressure, branch=0).squeeze()
    assert float(checked.check_stroke_difference) == pytest.approx(0.1 / 1.1, rel=1e-6)
    assert float(checked.check_rest_difference) == pytest.approx(400 / 410 - 1, rel=1e-6)
    assert str(checked.check_status.values) == "calculix converged"
    assert float(checked.check_energy_difference) == pytest.approx(2.0 / 7.0, rel=1e-6), "the other engine's is lower"
    assert np.isfinite(dataset.check_stroke_difference).sum() == 1
    figure = pressure_volume.draw(dataset)
    bands = [c for c in figure.axes[1].collections if type(c).__name__ == "FillBetweenPolyCollection"]
    assert len(bands) == 6
    assert [line.get_linestyle() for line in figure.axes[1].lines].count(":") == 2 + 1, "two P_v and one check"
