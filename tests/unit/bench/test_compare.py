"""A study beside measured curves: interpolation in N_p, relative L2 errors, efficiencies, and where it all lands."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr
import yaml

from limo.bench.check import soft_devices
from limo.bench.compare import comparison, relative_l2, study_curves
from limo.bench.curves import Expected, read_curves
from limo.cases.grid import study_cases
from limo.config.load import load_config
from limo.datasets.export import tidy
from limo.datasets.study import gather_study
from limo.errors import ConfigError
from limo.figures import afterload, buckling, pressure_volume, style
from limo.figures.renderer import renderer_lacks
from limo.measure.efficiency import efficiency_at_stroke
from limo.schema.bench import MeasuredCurves
from limo.store.files import write_json, write_netcdf
from limo.terminal.cli import main
from tests.helpers.cases import without_studies
from tests.helpers.curves import history_of

from .conftest import FIXTURES

PRESSURES = np.arange(0, 60.5, 0.5)


def ratio_of(count, pressure):
    """A ratio that is linear in N_p, over P_a."""
    return (1.0 + 0.1 * count) * (1 + 0.005 * pressure)


def change_of(pressure):
    return 120.0 * pressure / (pressure + 10.0)


@pytest.fixture
def measured(tmp_path):
    """Curves at N_p = 5, 7, 9 whose ratio is linear in N_p."""
    file = tmp_path / "measured.csv"
    lines = ["n_pouches,ventricular_pressure (kPa),actuation_pressure (kPa),actuation_volume_change (ml),stroke_volume (ml)"]
    for n in (5, 7, 9):
        lines += [f"{n},3.8,{p},{change_of(p):.8g},{ratio_of(n, p) * change_of(p):.8g}" for p in np.arange(0, 61, 1.0)]
    file.write_text("\n".join(lines) + "\n")
    return MeasuredCurves(data=str(file))


def dataset_of(ratio, pouches=(4, 6, 8, 10), pressures=(3.8,)):
    """A study's dataset with a ratio by N_p."""
    shape = (len(pouches), len(pressures), 1, 1, 1, 1, 1)
    dims = ("n_pouches", "ventricular_pressure", "aspect_ratio", "stiffness_ratio", "width_scale", "variant", "branch")
    along = (*dims, "actuation_pressure")
    curves = np.stack([ratio(n, PRESSURES) for n in pouches]).reshape(len(pouches), 1, 1, 1, 1, 1, 1, -1)
    curves = np.broadcast_to(curves, (*shape, len(PRESSURES)))
    change = np.broadcast_to(change_of(PRESSURES), curves.shape)
    return xr.Dataset(
        {
            "io_ratio": (along, curves), "stroke_volume": (along, curves * change), "actuation_volume_change": (along, change),
            "case_status": (dims, np.full(shape, "converged")),
        },
        coords={"n_pouches": list(pouches), "ventricular_pressure": list(pressures), "actuation_pressure": PRESSURES},
    )  # fmt: skip


def errors_of(dataset, measured, name="io_ratio"):
    curves = read_curves(measured, Expected(ventricular_pressures=(3.8,)))
    found = comparison(dataset, curves, measured)
    return found[f"measured_error_{name}"].values.squeeze(), found


def test_the_error_is_the_relative_l2_norm_of_the_difference():
    p = np.linspace(0, 10, 1001)
    error, ends = relative_l2(p, 2 * p, p)
    assert error == pytest.approx(0.5)
    assert ends == (0, 10)
    # int (p^2 - p)^2 / int p^2 over 0 to 1: (1/5 - 1/2 + 1/3) / (1/3)
    p = np.linspace(0, 1, 4001)
    assert relative_l2(p**2, p, p)[0] == pytest.approx(np.sqrt((1 / 5 - 1 / 2 + 1 / 3) * 3), rel=1e-5)
    gaps = np.where(p < 0.5, np.nan, p)
    assert relative_l2(1.1 * gaps, p, p)[1] == (0.5, 1.0)
    assert np.isnan(relative_l2(np.full_like(p, np.nan), p, p)[0])


def test_curves_are_interpolated_linearly_in_n_p_and_go_on_beyond(measured):
    same, found = errors_of(dataset_of(ratio_of), measured)
    assert same == pytest.approx(np.zeros(4), abs=2e-3)
    assert found.measured_beyond.values.squeeze().tolist() == [1, 0, 0, 1]
    scaled, _ = errors_of(dataset_of(lambda n, p: 1.2 * ratio_of(n, p)), measured)
    assert scaled == pytest.approx(np.full(4, 0.2), abs=3e-3)
    exact, found = errors_of(dataset_of(ratio_of, pouches=(5, 7)), measured)
    assert exact == pytest.approx(np.zeros(2), abs=1e-6)
    assert not found.measured_beyond.any()


def test_only_curves_of_the_same_p_v_are_compared(measured):
    error, found = errors_of(dataset_of(ratio_of, pressures=(3.8, 13.8)), measured)
    assert np.isfinite(error[:, 0]).all()
    assert np.isnan(error[:, 1]).all()
    assert "not measured at P_v = 13.8 kPa" in found.measured_reason.values.ravel().tolist()


def test_a_stroke_alone_is_compared_as_such(measured, tmp_path):
    lines = [",".join(np.array(line.split(","))[[0, 1, 2, 4]]) for line in Path(measured.data).read_text().splitlines()]
    (tmp_path / "stroke.csv").write_text("\n".join(lines) + "\n")
    stroke = MeasuredCurves(data=str(tmp_path / "stroke.csv"))
    error, _ = errors_of(dataset_of(ratio_of), stroke, "stroke_volume")
    assert error == pytest.approx(np.zeros(4), abs=2e-3)
    error, found = errors_of(dataset_of(ratio_of), stroke)
    assert np.isnan(error).all()
    assert all("io_ratio not measured" in reason for reason in found.measured_reason.values.ravel())


def test_one_number_of_pouches_is_compared_with_its_own_alone(measured, tmp_path):
    lines = Path(measured.data).read_text().splitlines()
    (tmp_path / "one.csv").write_text("\n".join(lines[:62]) + "\n")
    error, found = errors_of(dataset_of(ratio_of, pouches=(4, 5)), MeasuredCurves(data=str(tmp_path / "one.csv")))
    assert np.isnan(error[0])
    assert error[1] == pytest.approx(0, abs=1e-6)
    assert "N_p = 5 alone" in str(found.measured_reason.values.ravel()[0])


def test_efficiencies_are_those_of_the_measured_volumes_or_stated(measured):
    _, found = errors_of(dataset_of(ratio_of), measured.model_copy(update={"efficiency": {7: 0.42}}))
    p = np.arange(0, 61, 1.0)
    change = change_of(p)
    expected, _ = efficiency_at_stroke(p, 3.8, ratio_of(5, p) * change, change, 90.0)
    assert found.measurement_n_pouches.values.tolist() == [5, 7, 9]
    assert found.measurement_efficiency_90ml.values[0] == pytest.approx(expected, rel=1e-4)
    assert found.measurement_efficiency_90ml.values[1] == 0.42


# --------------------------------------------------------------------------------------------------------------------
# a study with measured curves


@pytest.fixture
def project(root, tmp_path, monkeypatch):
    """A configuration with one study that has measured curves, whose cases are solved up to 60 kPa."""
    studies = without_studies(root, tmp_path)
    study = {
        "description": "beside measured curves", "axes": {"n_pouches": [4, 6], "ventricular_pressure": [3.8, 13.8]},
        "actuation_pressure_max": {3.8: 60, 13.8: 60}, "figures": ["pressure_volume"], "engine": "newton",
        "measured": "config/measured/curves_synthetic.csv", "outputs": ["volumes"],
    }  # fmt: skip
    file = studies / "mine.yaml"
    config = yaml.safe_load((root / "config/config.yaml").read_text())
    (tmp_path / "config/config.yaml").write_text(yaml.safe_dump(config | {"studies": ["mine"]}))
    monkeypatch.chdir(tmp_path)

    def write(**changes):
        data = {k: v for k, v in (study | changes).items() if v is not None}
        file.write_text(yaml.safe_dump(data))
        return load_config("config/config.yaml", ["mine"])

    return SimpleNamespace(folder=tmp_path, write=write)


def solve(loaded, folder):
    """Histories of all cases of the study."""
    for case in study_cases(loaded, "mine").values():
        target = folder / "results/cases" / case.case_id
        target.mkdir(parents=True)
        history_of(case).to_netcdf(target / "volumes.nc")
        write_json(target / "status.json", {"status": "converged", "reason": "", "actuation_pressure_reached": 60.0})


def test_the_dataset_keeps_the_comparison_and_a_command_prints_it(project, capsys):
    loaded = project.write()
    solve(loaded, project.folder)
    dataset = gather_study(loaded, "mine", project.folder / "results/cases")
    errors = dataset.measured_error_io_ratio
    assert errors.dims == dataset.case_status.dims
    assert np.isfinite(errors.sel(ventricular_pressure=3.8)).all()
    assert np.isnan(errors.sel(ventricular_pressure=13.8)).all()
    assert "curves_synthetic.csv" in dataset.attrs["measured"]
    assert "kPa (in its name)" in dataset.attrs["measured_understood"]
    assert "measured_error_io_ratio [1]" in tidy(dataset).columns
    write_netcdf(dataset, project.folder / "results/studies/mine/study.nc", checked=False)
    assert main(["measured", "mine"]) == 0
    said = capsys.readouterr().out
    assert "4 curves" in said
    assert f"{float(errors.isel(n_pouches=0, ventricular_pressure=0).squeeze()):.1%}" in said
    assert "4 (beyond)" in said
    assert "measured, N_p = 5, P_v = 3.8 kPa" in said
    assert "simulated, N_p = 6" in said
    assert main(["measured", "mine", "--data", "config/measured/curves_synthetic.csv", "--set", "efficiency={5: 0.5}"]) == 0
    assert "N_p = 5, P_v = 3.8 kPa: 50.0%" in capsys.readouterr().out
    plain = gather_study(project.write(measured=None), "mine", project.folder / "results/cases")
    assert not [n for n in plain if str(n).startswith("measure")]


def test_check_reads_measured_curves_before_anything_is_solved(project, capsys):
    project.write()
    assert main(["check", "mine"]) == 0
    assert "measured curves of mine: 4 curves" in capsys.readouterr().out
    project.write(measured=str(FIXTURES / "curves_mmhg_silent.csv"))
    assert main(["check", "mine"]) == 1
    assert "mmHg" in capsys.readouterr().err
    described = {"data": str(FIXTURES / "curves_mmhg_silent.csv"), "units": {"actuation_pressure": "mmHg"}}
    project.write(measured=described | {"ventricular_pressure": 3.8})
    assert main(["check", "mine"]) == 0
    project.write(measured=described | {"ventricular_pressure": 7.0})
    assert main(["check", "mine"]) == 1
    assert "3.8, 13.8 kPa" in capsys.readouterr().err
    assert main(["measured", "mine"]) == 1
    capsys.readouterr()


def test_without_results_the_command_says_what_it_read(project, capsys):
    project.write()
    assert main(["measured", "mine"]) == 0
    assert "not gathered yet" in capsys.readouterr().out
    project.write(measured=None)
    assert main(["measured", "mine"]) == 1
    assert "--data" in capsys.readouterr().err
    assert main(["measured", "nobody"]) == 1
    assert main(["measured", "mine", "--set", "decimal=,"]) == 1
    capsys.readouterr()


@pytest.mark.parametrize("figures", [["kinematics"], ["von_mises", "deformation"]])
def test_a_study_whose_figures_cannot_show_measured_curves_is_refused(project, figures):
    with pytest.raises(ConfigError, match="pressure_volume"):
        project.write(figures=figures, outputs=["volumes", "stress"])
    project.write(figures=[*figures, "pressure_volume"], outputs=["volumes", "stress"])
    project.write(figures=[])


def test_figures_show_measured_curves_loops_and_efficiencies(project):
    loaded = project.write(outputs=["volumes", "contact"])
    solve(loaded, project.folder)
    dataset = gather_study(loaded, "mine", project.folder / "results/cases")
    table = study_curves(loaded, "mine").table
    figure = pressure_volume.draw(dataset, table)
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert sum(label.startswith("measured") for label in labels) == 5, "four devices, and unloading"
    for axis, name in zip(figure.axes, ("actuation_volume_change", "stroke_volume", "io_ratio"), strict=True):
        points = [line for line in axis.get_lines() if line.get_marker() not in ("None", None)]
        assert sum(len(line.get_xdata()) for line in points) == table[name].notna().sum()
    style.close(figure)
    with_contact = dataset.assign(contact_front_back=xr.full_like(dataset.efficiency_90ml, np.nan))
    bare, drawn = afterload.draw(with_contact), afterload.draw(with_contact, table)
    assert len(drawn.axes[2].patches) - len(bare.axes[2].patches) == 4, "a bar for each measured N_p"
    assert len(drawn.axes[3].get_lines()) > len(bare.axes[3].get_lines()), "at the P_v of the measurement"
    assert len(drawn.axes[4].get_lines()) == len(bare.axes[4].get_lines()), "and not at another"
    alone = table.assign(actuation_volume_change=np.nan, io_ratio=np.nan)
    figure = pressure_volume.draw(dataset, alone)
    assert not [line for line in figure.axes[0].get_lines() if line.get_marker() not in ("None", None)]
    for made in (bare, drawn, figure):
        style.close(made)


@pytest.mark.skipif(bool(renderer_lacks()), reason="no surfaces can be rendered")
def test_the_jump_has_the_strokes_that_were_measured_at_its_own_n_p(root):
    dataset, shapes = (xr.load_dataset(root / f"docs/gallery/data/buckling{part}.nc") for part in ("", "_shapes"))
    measured = MeasuredCurves(data=str(FIXTURES / "curves_loop.csv"), n_pouches=6, ventricular_pressure=3.8)
    table = read_curves(measured).table
    drawn = []
    for one in (table, table.assign(n_pouches=8.0)):
        figure = buckling.draw(dataset, one, shapes)
        whole = next(axis for axis in figure.axes if axis.child_axes).child_axes[0]
        drawn.append(sum(len(line.get_xdata()) for line in whole.get_lines() if line.get_marker() in ("o", "v")))
        style.close(figure)
    assert drawn == [18, 0]


def test_a_p_v_in_another_unit_is_one_message_that_names_the_unit(project):
    file = project.folder / "mine.csv"
    rows = "".join(f"{p},28.5,{2 * p}\n" for p in range(0, 42, 3))
    file.write_text(f"actuation_pressure,ventricular_pressure,stroke_volume\n{rows}")
    loaded = project.write(measured=str(file))
    with pytest.raises(ConfigError, match="in mmHg they would be") as caught:
        study_curves(loaded, "mine")
    loaded = project.write(measured={"data": str(file)} | yaml.safe_load(caught.value.example))
    assert study_curves(loaded, "mine").table.ventricular_pressure.iloc[0] == pytest.approx(3.8, abs=0.01)


def test_check_tells_of_a_modulus_that_may_be_in_gpa(project):
    assert soft_devices(project.write(), ["mine"]) == []
    assert "in GPa it would be 267 MPa" in soft_devices(project.write(material={"youngs_modulus": 0.267}), ["mine"])[0]
