"""From a solver's files to volumes, frames and a status; the solver is a script that hands out prepared files."""

import json

import numpy as np
import pytest
import xarray as xr

from limo.engines.calculix import run as calculix
from limo.engines.calculix.deck import stage_times
from limo.errors import ResultError
from limo.measure.ramp import read_ramp
from limo.mechanics.build import build_model
from limo.mechanics.energy import stored_energy
from limo.mechanics.volumes import volumes
from limo.mesh.file import write_mesh
from limo.schema.solver import Solver
from limo.solve import case as solve_module
from limo.solve import harvest
from limo.solve.case import SolveSettings, solve_case
from limo.solve.judge import Checks

FRAMES = (0.0, 20.0, 60.0)


def field(model, level):
    """A symmetric displacement of the bricks that grows with ``level``; every layer is lifted, the epicardium further."""
    mesh, shell = model.mesh, model.expansion
    x, y = mesh.nodes[:, 0] / 60, mesh.nodes[:, 1] / 140
    epi = np.zeros(len(x))
    epi[np.setdiff1d(mesh.quads[mesh.layer == 2], mesh.quads[mesh.layer == 1])] = 1
    middle = np.column_stack([-x * y * level, 0 * x, (30 * ~mesh.on_outer + level * (epi - 0.3)) * y])
    u = np.zeros_like(model.nodes)
    u[shell.bottom] = u[shell.top] = middle
    u[shell.middle[shell.middle >= 0]] = middle[shell.middle >= 0]
    return u


@pytest.fixture
def solved(make_case, device_mesh, frd_bytes, tmp_path, monkeypatch):
    """``solved(...)``: (status, folder, model, times, pressures) of a case whose solver accepts increments at those pressures."""
    monkeypatch.setattr(calculix, "_POLL", 0.01)
    # these displacements are no equilibria and fold bricks: the judge has tests of its own
    monkeypatch.setattr(harvest, "energy_and_extremes_of", lambda model, u: (stored_energy(model, u), 1.0, 1.0))
    monkeypatch.setattr(solve_module, "measure", lambda *_: Checks())
    case = make_case(frames=FRAMES)
    mesh = device_mesh("limo", 8, "quarter")
    model = build_model(case, mesh)
    times = stage_times(case.numerics, case.actuation_pressure_max)
    write_mesh(mesh, tmp_path / "mesh.vtu")

    def run(pressures, *, last="echo Job finished", spoil=lambda u: u, limits=None):
        ramp = times[2].start + np.array(pressures) / case.actuation_pressure_max * times[2].duration
        clock = [0.5 * times[0].end, times[0].end, 0.5 * (times[1].start + times[1].end), times[1].end, *ramp]
        levels = [0.0, 0.0, 0.0, 0.0, *pressures]
        sta = ["SUMMARY OF JOB INFORMATION\n", "     1          3     1U    9  0.100000E+02  0.100000E+02  0.500000E+00\n"]
        frames = []
        numbers = np.arange(1, len(model.nodes) + 1)
        for k, (time, level) in enumerate(zip(clock, levels, strict=True), 1):
            size = time - (clock[k - 2] if k > 1 else 0.0)
            sta.append(f"     1{k:11d}     1     3 {time:13.6E} {time:13.6E} {size:13.6E}\n")
            frames.append((1, k, time, numbers, field(model, level)))
        # what CalculiX writes of the increment at which it gives up
        frames.append((1, len(clock) + 1, clock[-1] + 1.0, numbers, field(model, 1e3)))
        frames[-2] = (*frames[-2][:4], spoil(frames[-2][4]))
        (tmp_path / "prepared.sta").write_text("".join(sta))
        (tmp_path / "prepared.frd").write_bytes(frd_bytes(frames))
        script = tmp_path / "ccx"
        script.write_text(f"#!/bin/sh\ncp ../../prepared.sta deck.sta\ncp ../../prepared.frd deck.frd\n{last}\n")
        script.chmod(0o755)
        status = solve_case(case, tmp_path / "mesh.vtu", tmp_path / "case", SolveSettings(Solver(**(limits or {})), script))
        return status, tmp_path / "case", model, times

    return run


def test_every_accepted_increment_becomes_a_row_of_volumes(solved):
    pressures = [10.0, 20.5, 59.0, 60.0]
    status, folder, model, _ = solved(pressures)
    assert (status["status"], status["reason"]) == ("converged", "")
    with xr.open_dataset(folder / "volumes.nc") as history:
        assert history.sizes["increment"] == 8, "not the frame of an increment that was given up"
        np.testing.assert_allclose(history.actuation_pressure, [0, 0, 0, 0, *pressures], atol=1e-6)
        np.testing.assert_array_equal(history.stage, [0, 0, 1, 1, 2, 2, 2, 2])
        for k, level in enumerate([0, 0, 0, 0, *pressures]):
            surface = model.mesh.nodes + model.expansion.midsurface(field(model, level))
            expected = np.array(volumes(model.mesh, surface)) * 1e-3
            np.testing.assert_allclose([history.ventricle_volume[k], history.actuation_volume[k]], expected, rtol=1e-5, atol=1e-3)
        assert all(v.attrs["units"] == "ml" for n, v in history.data_vars.items() if "volume_" in n and "ratio" not in n)
        assert (history.strain_energy.attrs["units"], history.largest_displacement.attrs["units"]) == ("mJ", "mm")
    assert status["iterations"] == 9 + 8 * 3
    assert status["iterations_by_stage"] == {"fit": 9 + 6, "hold": 6, "ramp": 12, "cycle": 0}
    assert status["rejected_attempts"] == 1
    assert status["actuation_pressure_reached"] == pytest.approx(60.0)
    assert status["rested"]
    assert json.loads((folder / "status.json").read_text()) == json.loads(json.dumps(status))


def test_frames_are_those_nearest_to_the_pressures_asked_for(solved):
    _, folder, model, _ = solved([10.0, 20.5, 59.0])
    with xr.open_dataset(folder / "frames.nc") as frames:
        np.testing.assert_allclose(frames.requested_pressure, [0.0, 20.0])
        np.testing.assert_allclose(frames.actuation_pressure, [0.0, 20.5], atol=1e-6)
        for k, level in enumerate((0.0, 20.5)):
            np.testing.assert_allclose(frames.displacement[k], field(model, level)[: len(model.expansion.nodes)], atol=1e-4)


def test_large_files_of_the_solver_are_removed_and_the_deck_stays(solved):
    _, folder, _, _ = solved([60.0])
    left = {p.name for p in (folder / "run").iterdir()}
    assert {"deck.inp", "deck.sta", "ccx.log"} <= left
    assert not {"deck.frd", "deck.dat"} & left


def test_divergence_keeps_what_was_accepted(solved):
    status, folder, _, _ = solved([10.0, 20.0], last="echo ' *ERROR: too many cutbacks'; exit 201")
    assert status["status"] == "diverged"
    assert "too many cutbacks" in status["reason"]
    assert status["actuation_pressure_reached"] == pytest.approx(20.0)
    with xr.open_dataset(folder / "volumes.nc") as history:
        assert history.sizes["increment"] == 6
        assert history.attrs["status"] == "diverged"


@pytest.mark.parametrize("spoil", [lambda u: u * 1e6, lambda u: u * np.nan], ids=["huge", "nan"])
def test_displacements_beyond_belief_are_not_taken_for_a_result(solved, spoil):
    status, folder, _, _ = solved([10.0, 20.0, 60.0], spoil=spoil)
    assert status["status"] == "diverged"
    assert "displacements beyond" in status["reason"]
    with xr.open_dataset(folder / "volumes.nc") as history:
        assert float(history.actuation_pressure[-1]) == pytest.approx(20.0)
        assert np.isfinite(history.ventricle_volume).all()


def test_nothing_accepted_is_an_empty_result_with_a_reason(solved):
    status, folder, _, _ = solved([10.0], last="rm deck.sta deck.frd; echo '*ERROR reading *STEP'; exit 201")
    assert (status["status"], status["reason"]) == ("crashed", "*ERROR reading *STEP")
    assert status["actuation_pressure_reached"] == 0.0
    with xr.open_dataset(folder / "volumes.nc") as history, xr.open_dataset(folder / "frames.nc") as frames:
        assert history.sizes["increment"] == frames.sizes["frame"] == 0


def test_second_run_starts_from_an_empty_folder(solved):
    first, folder, _, _ = solved([10.0, 60.0])
    (folder / "run/deck.sta").write_text("     1        999     1     3  0.9E+09  0.9E+09  0.1E+01\n")
    second, _, _, _ = solved([10.0, 60.0], last="rm deck.sta deck.frd; echo nothing")
    assert first["status"] == "converged"
    assert second["status"] == "crashed"
    assert second["increments"] == 0


def test_energy_balance_spans_the_kept_frames(solved):
    """Work of P_a from the curve that was stored, strain energy from the two frames, and the rest taken by damping."""
    status, folder, model, _ = solved([float(p) for p in range(5, 61, 5)])
    with xr.open_dataset(folder / "volumes.nc") as history:
        ramp = history.isel(increment=slice(3, None))
        work = np.trapezoid(ramp.actuation_pressure, ramp.actuation_volume_conjugate)
        change = ramp.ventricle_volume_conjugate[-1] - ramp.ventricle_volume_conjugate[0]
    assert status["actuation_work_mj"] == pytest.approx(work, rel=1e-4)
    assert status["ventricular_work_mj"] == pytest.approx(3.8 * float(change), rel=1e-4)
    stored = [stored_energy(model, field(model, level)) for level in (0.0, 60.0)]
    assert status["strain_energy_change_mj"] == pytest.approx(stored[1] - stored[0], rel=1e-3)
    parts = status["actuation_work_mj"] + status["ventricular_work_mj"] - status["strain_energy_change_mj"]
    assert status["dissipated_mj"] == pytest.approx(parts, abs=1e-3)
    assert (status["energy_from_kpa"], status["energy_to_kpa"]) == pytest.approx((0.0, 60.0))


def test_a_ramp_starts_at_rest_and_files_without_one_are_result_errors(tmp_path):
    file = tmp_path / "volumes.nc"
    stages = {"stage": ("increment", [0, 1, 1, 2, 2])}
    xr.Dataset(coords=stages | {"actuation_pressure": ("increment", [0.0, 0.0, 0.0, 30.0, 60.0])}).to_netcdf(file)
    assert list(read_ramp(tmp_path).actuation_pressure) == [0.0, 30.0, 60.0]
    whole = file.read_bytes()
    xr.Dataset({"ventricle_volume": ("increment", [400.0])}).to_netcdf(tmp_path / "other.nc")
    for content in (whole[: len(whole) // 2], b"", (tmp_path / "other.nc").read_bytes()):
        file.write_bytes(content)
        with pytest.raises(ResultError, match=r"volumes\.nc: not the volumes"):
            read_ramp(tmp_path)
    with pytest.raises(ResultError, match=r"volumes\.nc: not the volumes"):
        read_ramp(tmp_path / "absent")


def test_motion_is_exact_for_a_constant_acceleration_over_unequal_increments():
    """u = a t^2 / 2: backward differences give a at once, and the velocity at the middle of the last increment."""
    times = [1.0, 1.5, 1.7]
    states = [0.5 * t**2 * np.array([[3.0, 0.0, -1.0]]) for t in times]
    motion = harvest._motion(states, times)
    np.testing.assert_allclose(motion[1], [[3.0, 0.0, -1.0]])
    np.testing.assert_allclose(motion[0], 1.6 * np.array([[3.0, 0.0, -1.0]]))
    assert np.isnan(harvest._motion(states[:1], times[:1])).all()
    assert np.isnan(harvest._motion(states[:2], times[:2])[1]).all()
