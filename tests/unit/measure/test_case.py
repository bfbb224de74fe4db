"""What studies want of cases, what is measured, and what a damaged result says."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
import xarray as xr

from limo.cases.grid import study_cases
from limo.cases.plan import make_plan
from limo.cases.wanted import Wanted, wanted_cases
from limo.datasets.fields import frame_fields, mirrored, write_fields
from limo.datasets.measures import gather_measures
from limo.datasets.study import gather_study
from limo.measure.case import measure_case
from limo.measure.fatigue import cycles_to_failure, strain_cycle
from limo.measure.quantities import CYCLE, MEASURES, chosen_measures
from limo.mechanics.build import build_model
from limo.mechanics.layer import inside_out, surface_state
from limo.mesh.file import write_mesh
from limo.schema.fatigue import Fatigue, Parameter
from tests.helpers.cases import configured, moved, study, write_case

PRESSURES = [0.0, 13.8, 60.0]
ALL = ["volumes", "stress", "strain", "fatigue", "fields"]


def only_case(configuration, name):
    (case,) = study_cases(configuration, name).values()
    return case


@pytest.fixture(scope="module")
def solved(tmp_path_factory, loaded, device_mesh):
    """A configuration of two studies of one case with made-up frames: (configuration, folder of cases, mesh file)."""
    configuration = configured(loaded, everything=study(outputs=ALL, fields_at=["P_v + 10", "max"]), plain=study())
    case, folder = only_case(configuration, "everything"), tmp_path_factory.mktemp("cases")
    mesh = device_mesh()
    mesh_file = folder / "mesh.vtu"
    write_mesh(mesh, mesh_file)
    write_case(folder / case.case_id, build_model(case, mesh), {p: moved(build_model(case, mesh), p) for p in PRESSURES})
    return configuration, folder, mesh_file


def measured(solved, outputs=tuple(ALL), fatigue=None):
    configuration, folder, mesh_file = solved
    case = only_case(configuration, "everything")
    wanted = wanted_cases(configuration)[case.case_id]
    wanted = Wanted({k: v for k, v in wanted.pressures.items() if k in outputs}, tuple(o for o in wanted.drawn if o in outputs))
    return measure_case(case, wanted, fatigue or Fatigue(), mesh_file, folder / case.case_id)


# --------------------------------------------------------------------------------------------------------------------
# what is wanted


def test_volumes_alone_want_nothing_measured_and_change_no_frames(loaded):
    configuration = configured(loaded, plain=study())
    assert wanted_cases(configuration) == {}
    assert only_case(configuration, "plain").frames == (0.0, 13.8, 60.0)


def test_studies_that_share_a_case_add_up(loaded, tmp_path):
    configuration = configured(
        loaded,
        one=study(outputs=["stress"], frames=[0, 20], fields_at=["max"]),
        two=study(outputs=["volumes", "strain", "fields"], frames=[0], fields_at=[30]),
        three=study(frames=[0, 44]),
    )
    ((case_id, wanted),) = wanted_cases(configuration).items()
    assert wanted.pressures == {"stress": (0.0, 20.0, 60.0), "strain": (0.0, 30.0), "fields": (30.0,)}
    assert wanted.drawn == ("strain",)
    assert make_plan(configuration, tmp_path).cases[case_id].frames == (0.0, 20.0, 30.0, 44.0, 60.0)
    assert Wanted.from_dict(json.loads(json.dumps(wanted.to_dict()))) == wanted


def test_outputs_do_not_change_what_is_solved(loaded):
    plain, asking = (only_case(configured(loaded, s=study(outputs=o)), "s") for o in (["volumes"], ALL))
    assert plain.case_id == asking.case_id
    assert set(asking.to_dict()) == set(plain.to_dict())


# --------------------------------------------------------------------------------------------------------------------
# what is measured


def test_every_measure_is_there_with_its_unit(solved):
    found = measured(solved)
    assert found.attrs["status"] == "measured"
    for name, measure in chosen_measures(ALL, is_cycled=False).items():
        assert found[name].attrs.get("units", "") == measure.units
        assert found[name].attrs["long_name"]
    assert found.requested_pressure.values.tolist() == PRESSURES
    for name in ("von_mises_peak", "strain_peak", "residual", "direction_between", "frame_pressure"):
        assert np.isfinite(found[name].values).all(), name
    assert (np.diff(found.von_mises_peak) > 0).all()
    assert (found.von_mises_peak <= found.von_mises_max).all()
    np.testing.assert_allclose(found.von_mises_peak_share.sum("zone"), 1)


def test_maps_add_up_to_the_numbers(solved):
    found = measured(solved)
    envelope = found.von_mises.isel(map=-1).max("surface")
    assert float(envelope.max()) == pytest.approx(float(found.von_mises_max[-1]), rel=1e-6)
    assert found.map_pressure.values.tolist() == [13.8, 60.0]
    assert float(found.fatigue_amplitude.max()) >= float(found.fatigue_amplitude_peak)
    near = found.near_seam.values.astype(bool)
    distance = found.seam_distance.values
    assert near[distance <= 4.0].all()


def test_only_what_is_wanted_is_computed(solved):
    found = measured(solved, ("stress",))
    assert "von_mises_peak" in found
    assert not [n for n in found.variables if n.startswith(("strain", "fatigue", "direction"))]
    assert "von_mises" not in found
    assert "fatigue" not in found.attrs
    measured(solved)


def test_the_known_jump_is_a_buckling_event(solved):
    found = measured(solved)
    assert float(found.buckling_before[0]) == pytest.approx(20.1, abs=0.1)
    assert float(found.buckling_jump[0]) == pytest.approx(10, rel=0.05)
    assert np.isnan(found.buckling_before[1])
    assert float(found.buckling_displacement[0]) == pytest.approx(7.0 / 125.0)
    assert found.buckling_difference.sizes["node"] > 0


def test_parameters_of_fatigue_and_their_origins_are_stored(solved):
    fatigue = Fatigue(strength_exponent=Parameter(value=-0.1, origin="a test of ours"))
    stored = Fatigue.model_validate_json(measured(solved, fatigue=fatigue).attrs["fatigue"])
    assert stored == fatigue
    measured(solved)


def test_a_cycle_has_its_own_amplitudes_means_and_lives(loaded, device_mesh, tmp_path):
    """Half of the frames' range, about a mean as large; a device that only went up, or part of the way down, has none."""
    project = configured(loaded, cycled=study(outputs=["volumes", "fatigue"], actuation=[0, "max", 0]))
    case, mesh = only_case(project, "cycled"), device_mesh()
    model, folder = build_model(case, mesh), tmp_path / case.case_id
    write_mesh(mesh, tmp_path / "mesh.vtu")
    states = {p: moved(model, p) for p in (0.0, 60.0)}
    wanted = wanted_cases(project)[case.case_id]
    for down in (None, 20.0, 0.0):
        cycle = {} if down is None else {1: [(case.ventricular_pressure, down, states[0.0])]}
        write_case(folder, model, states, cycle)
        found = measure_case(case, wanted, Fatigue(mean_correction="none"), tmp_path / "mesh.vtu", folder)
        assert found.attrs["status"] == "measured", found.attrs["reason"]
        for name, measure in MEASURES.items():
            if measure.output == CYCLE:
                assert bool(np.isfinite(found[name])) == (down == 0.0), name
    start, end = (strain_on_middle(model, u) for u in states.values())
    expected = strain_cycle(np.array([start, end]), np.zeros((2, *start.shape)))
    np.testing.assert_allclose(found.cycle_strain_amplitude, expected.amplitude, atol=1e-6)
    np.testing.assert_allclose(found.cycle_strain_mean, expected.mean, atol=1e-6)
    life, flags = cycles_to_failure(found.cycle_strain_amplitude.values, Fatigue())
    np.testing.assert_array_equal(found.cycle_fatigue_flag, flags)
    np.testing.assert_allclose(found.cycle_fatigue_cycles, life)


def strain_on_middle(model, displacement):
    """xx, yy, xy of the strain (m, 4, 3) on the middle surface."""
    middle = inside_out(model.mesh, surface_state(model, displacement.astype(np.float32).astype(float)).strain)[:, 1]
    return np.stack([middle[..., 0, 0], middle[..., 1, 1], middle[..., 0, 1]], axis=-1)


# --------------------------------------------------------------------------------------------------------------------
# the study


def test_a_study_holds_what_it_asks_for(solved):
    configuration, folder, _ = solved
    measured(solved)
    everything, plain = (gather_study(configuration, name, folder) for name in ("everything", "plain"))
    assert set(chosen_measures(ALL, is_cycled=False)) <= set(everything.variables)
    assert not set(MEASURES) & set(plain.variables)
    assert everything.frame.values.tolist() == ["0", "P_v + 10", "max"]
    assert everything.frame_pressure.squeeze().values.tolist() == PRESSURES
    assert everything.von_mises_peak.dims[-1] == "frame"
    assert everything.von_mises_peak.attrs["units"] == "MPa"
    assert everything.strain_peak.sizes["side"] == 2
    assert str(everything.measure_status.squeeze().values) == "measured"
    assert "origin" in everything.attrs["fatigue"]


@pytest.mark.parametrize(
    ("damage", "says"),
    [
        (lambda f, z: f.unlink(), "cannot|not the frames"),
        (lambda f, z: f.write_bytes(f.read_bytes()[:2000]), "not the frames"),
        (lambda f, z: f.write_bytes(b"    1C" + bytes(200)), "not the frames"),
        (lambda f, z: edit(f, lambda u: u.__setitem__((1, 100, 2), np.nan)), r"13.8 kPa.*no numbers.*element \d+"),
        (
            lambda f, z: edit(f, lambda u: u.__setitem__((2, slice(None), 2), -u[2, :, 2] - 3 * z)),
            r"60 kPa.*inside out.*element \d+",
        ),
        (lambda f, z: edit(f, None), "no frames"),
    ],
)
def test_a_damaged_case_has_a_status_and_the_others_do_not_notice(tmp_path, loaded, device_mesh, damage, says):
    configuration = configured(
        loaded,
        two=study(axes={"n_pouches": [8], "ventricular_pressure": [3.8, 5.0]}, frames=[0, 13.8, "max"], outputs=["stress"]),
    )
    mesh, mesh_file = device_mesh(), tmp_path / "mesh.vtu"
    write_mesh(mesh, mesh_file)
    for case in study_cases(configuration, "two").values():
        model = build_model(case, mesh)
        folder = tmp_path / case.case_id
        write_case(folder, model, {p: moved(model, p) for p in PRESSURES})
        if case.ventricular_pressure == 3.8:
            damage(folder / "frames.nc", model.expansion.nodes[:, 2])
        measure_case(case, wanted_cases(configuration)[case.case_id], Fatigue(), mesh_file, folder)
    found = gather_study(configuration, "two", tmp_path).squeeze(drop=True)
    assert found.measure_status.values.tolist() == ["failed", "measured"]
    reason = str(found.measure_reason.values[0])
    assert "frames.nc" in reason
    assert re.search(says, reason), reason
    assert np.isnan(found.von_mises_peak[0]).all()
    assert np.isfinite(found.von_mises_peak[1]).all()


def edit(file, change):
    with xr.open_dataset(file) as data:
        data = data.load()
    if change is None:
        data = data.isel(frame=slice(0, 0))
    else:
        change(data.displacement.values)
    data = data.drop_encoding()
    data.to_netcdf(file)


@pytest.mark.parametrize(("maximum", "events"), [(13.8, 0), (20.1, 0), (30.0, 1)])
def test_a_short_study_takes_its_measures_from_a_case_that_went_further(tmp_path, loaded, device_mesh, maximum, events):
    """Frames by their pressure; no event of buckling and no contact beyond the study's own maximum."""
    short = study(actuation_pressure_max=maximum, frames=[0, 13.8], outputs=["stress"])
    configuration = configured(loaded, long=study(frames=[0, 13.8, "max"], outputs=["stress"]), short=short)
    plan = make_plan(configuration, tmp_path)
    (case_id,) = plan.to_solve
    case, mesh_file, mesh = plan.cases[case_id], tmp_path / "mesh.vtu", device_mesh()
    write_mesh(mesh, mesh_file)
    model = build_model(case, mesh)
    write_case(tmp_path / case_id, model, {p: moved(model, p) for p in PRESSURES})
    measure_case(case, plan.wanted[case_id], Fatigue(), mesh_file, tmp_path / case_id)
    found = {
        n: gather_study(configuration, n, tmp_path, list(plan.served[n].values())).squeeze(drop=True) for n in ("long", "short")
    }
    assert (found["short"].measure_status == "measured").all()
    for frame in ("0", "13.8"):
        for name in ("von_mises_peak", "frame_pressure"):
            assert float(found["short"][name].sel(frame=frame)) == float(found["long"][name].sel(frame=frame))
    assert int(found["long"].buckling_jump.notnull().sum()) == 1
    for name in ("buckling_before", "buckling_jump", "buckling_displacement"):
        assert int(found["short"][name].notnull().sum()) == events
    for name in ("contact_front_back", "contact_endo_epi"):
        assert float(found["short"][f"{name}_clear"].fillna(0)) <= maximum
        assert float(found["short"][name].fillna(0)) <= maximum


def test_a_case_that_was_not_measured_is_missing(tmp_path, loaded):
    configuration = configured(loaded, s=study(outputs=["strain"]))
    found = gather_measures(configuration, "s", tmp_path)
    assert str(found.measure_status.squeeze().values) == "missing"
    assert np.isnan(found.strain_peak).all()


# --------------------------------------------------------------------------------------------------------------------
# ParaView


def test_fields_are_series_of_the_full_device(solved):
    pyvista = pytest.importorskip("pyvista")
    configuration, folder, mesh_file = solved
    case = only_case(configuration, "everything")
    wanted = wanted_cases(configuration)[case.case_id]
    fields = folder / case.case_id / "fields"
    assert write_fields(case, wanted, Fatigue(), mesh_file, fields) > 6
    count = None
    for geometry in ("reference", "deformed"):
        reader = pyvista.get_reader(fields / f"{geometry}.pvd")
        assert reader.time_values == [13.8, 60.0]
        reader.set_active_time_value(60.0)
        (grid,) = reader.read()
        assert set(grid.celltypes) == {int(pyvista.CellType.QUADRATIC_QUAD)}
        count = count or grid.n_cells
        assert grid.n_cells == count
        assert set(np.unique(grid["layer"])) == {0, 1, 2}
        assert set(np.unique(grid["copy"])) == {0, 1, 2, 3}
        for name in ("von_mises", "von_mises_inner", "E1_outer", "v1_inner", "log10_cycles", "near_seam", "displacement"):
            assert name in grid.point_data, name
        x = np.asarray(grid.bounds).reshape(3, 2)
        np.testing.assert_allclose(x[0, 0], -x[0, 1], rtol=1e-5)
        np.testing.assert_allclose(np.linalg.norm(grid["v1_inner"], axis=1), 1, rtol=1e-4)
        if geometry == "reference":
            assert np.abs(grid.points[:, 2]).max() == 0
        else:
            np.testing.assert_allclose(x[2, 0], -x[2, 1], rtol=1e-5)
            assert x[2, 1] > 5
    lines = pyvista.get_reader(fields / "streamlines_epicardial_deformed.pvd").read()[0]
    assert lines.n_cells > 100
    assert "E1" in lines.point_data


def test_fields_of_a_damaged_case_say_why(tmp_path, solved):
    configuration, _, mesh_file = solved
    case = only_case(configuration, "everything")
    wanted = wanted_cases(configuration)[case.case_id]
    write_fields(case, wanted, Fatigue(), mesh_file, tmp_path / case.case_id / "fields")
    assert "frames.nc" in (tmp_path / case.case_id / "fields" / "reason.txt").read_text()


def test_mirrored_quadrilaterals_keep_their_normals(make_case, device_mesh):
    model = build_model(make_case(), device_mesh())
    flat, _ = frame_fields(model, moved(model, 10.0), (), None, Fatigue(), "test")
    whole = mirrored(flat, "quarter")
    corner = whole.points[whole.quads[:, :4], :2]
    (a, b), (c, d) = (corner[:, 2] - corner[:, 0]).T, (corner[:, 3] - corner[:, 1]).T
    area = 0.5 * (a * d - b * c)
    assert (area > 0).all()
    assert len(whole.quads) == 4 * len(flat.quads)
    assert (whole.at_cells["face"] == 1).sum() == 2 * len(flat.quads)
    shift = whole.at_points["displacement"]
    quarter = len(flat.points)
    np.testing.assert_allclose(shift[quarter : 2 * quarter, 0], -shift[:quarter, 0])
