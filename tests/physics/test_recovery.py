"""The ladder on real solves of a very coarse device: what is climbed, what is kept, and where newton carries on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

from limo.cases.case import Case
from limo.cases.solved import solved_cases
from limo.cases.wanted import Wanted
from limo.engines.calculix import build as ccx_build
from limo.engines.engine import EngineSettings
from limo.engines.find import find_engine
from limo.engines.newton import iteration as newton
from limo.errors import MeshError
from limo.measure.case import measure_case
from limo.measure.frames import open_case
from limo.measure.ramp import ramp_of
from limo.mechanics.build import build_model
from limo.mechanics.volumes import volumes
from limo.mesh.device import mesh_device
from limo.mesh.file import write_mesh
from limo.schema.fatigue import Fatigue
from limo.schema.numerics import MeshLevel
from limo.schema.solver import Limits, Rung, Solver
from limo.solve import case as solution
from limo.solve.case import SolveSettings, follow, solve_case
from limo.solve.harvest import ML
from limo.store.files import read_json
from limo.store.results import OWN_MESH
from tests.helpers.cases import small_mesh, with_

MAXIMUM = 6.0  # kPa
#: without those on states that lock, as fabric does on so coarse meshes
LIMITS = Limits(compression_share=1.0, actuation_volume=1.0)


@pytest.fixture(scope="module")
def made(case, tmp_path_factory):
    """A case of newton, its mesh, and the file of it."""
    one = with_(case, n_pouches=4, engine="newton", actuation_pressure_max=MAXIMUM, frames=(0.0, 3.0, MAXIMUM))
    mesh = small_mesh(one, 3000, "quarter")
    file = tmp_path_factory.mktemp("mesh") / "mesh.vtu"
    write_mesh(mesh, file)
    return one, mesh, file


@pytest.fixture(scope="module")
def straight(made):
    """The path that needs no ladder."""
    case, mesh, _ = made
    return newton.solve(build_model(case, mesh), Solver())


def impatient(case, iterations):
    """The same case with few iterations at a load."""
    numerics = case.numerics
    return with_(
        case, numerics=numerics.model_copy(update={"newton": numerics.newton.model_copy(update={"iterations": iterations})})
    )


def test_a_path_is_carried_on_from_its_last_equilibrium(made, straight):
    case, mesh, _ = made
    first = newton.solve(build_model(with_(case, actuation_pressure_max=3.0, frames=()), mesh), Solver())
    carried = newton.solve(build_model(case, mesh), Solver(), after=first)
    assert carried.status == "converged"
    np.testing.assert_array_equal(carried.pressure, straight.pressure)
    np.testing.assert_array_equal(carried.stage, straight.stage)
    assert sum(carried.iterations.values()) < 0.5 * sum(straight.iterations.values()), "its costs are its own"
    for k in range(len(first.stage)):
        np.testing.assert_array_equal(carried.displacements(k), first.displacements(k))
    assert np.abs(carried.displacements(-1) - straight.displacements(-1)).max() < 0.5


def test_frames_between_steps_do_not_turn_the_path(made, straight):
    case, mesh, _ = made
    looked = newton.solve(build_model(with_(case, frames=(0.0, 2.5, 3.7, MAXIMUM)), mesh), Solver())
    assert looked.status == "converged"
    assert [p for p in looked.pressure if p not in straight.pressure] == [2.5, 3.7]
    assert (np.diff(looked.pressure) >= 0).all(), "kept in the order of P_a"
    for k, pressure in enumerate(straight.pressure[straight.stage == 2]):
        (same,) = np.flatnonzero((looked.pressure == pressure) & (looked.stage == 2))
        there = looked.displacements(same)
        np.testing.assert_array_equal(there, straight.displacements(int(np.flatnonzero(straight.stage == 2)[k])))


def test_a_failed_fit_is_not_carried_on(made):
    case, mesh, _ = made
    failed = newton.solve(build_model(impatient(case, 5), mesh), Solver())
    assert (failed.status, failed.ended_in) == ("diverged", "fit")
    again = newton.solve(build_model(case, mesh), Solver(), after=failed)
    assert again.status == "converged"


def test_rungs_are_climbed_until_one_succeeds_and_all_are_on_record(made, straight, tmp_path):
    case, _, file = made
    rungs = [Rung(name="a_little", multiply={"newton.iterations": 1.2}), Rung(name="enough", multiply={"newton.iterations": 100})]
    rungs.append(Rung(name="never", multiply={"newton.iterations": 2}))
    status = solve_case(impatient(case, 5), file, tmp_path, SolveSettings(limits=LIMITS, rungs=rungs, recovery="abc-0"))
    assert [a["rung"] for a in status["attempts"]] == ["as configured", "a_little", "enough"]
    assert [a["status"] for a in status["attempts"]] == ["diverged", "diverged", "converged"]
    assert status["status"] == "converged"
    assert status["iterations"] == sum(a["iterations"] for a in status["attempts"])
    assert status["solver_cpu_seconds"] == pytest.approx(sum(a["solver_cpu_seconds"] for a in status["attempts"]), abs=0.05)
    assert status["recovery"] == "abc-0"
    assert status["checks"]["residual"] < 1e-3
    with xr.open_dataset(tmp_path / "volumes.nc") as history:
        np.testing.assert_allclose(ramp_of(history).actuation_pressure, straight.pressure[straight.stage > 0])
    described = read_json(tmp_path / "case.json")["case"]
    assert described["numerics"]["newton"]["iterations"] == 5, "the case is what was asked for"
    assert sum(f.stat().st_size for f in (tmp_path / "run").iterdir()) < 10_000


def test_the_best_attempt_is_kept_where_none_succeeds(made, tmp_path):
    case, _, file = made
    rungs = [Rung(name="worse", multiply={"newton.iterations": 0.5})]
    status = solve_case(impatient(case, 12), file, tmp_path, SolveSettings(limits=LIMITS, rungs=rungs))
    first, second = status["attempts"]
    assert status["status"] == "diverged"
    assert not status["interrupted"]
    assert status["actuation_pressure_reached"] == max(a["actuation_pressure_reached"] for a in (first, second))


@pytest.mark.parametrize(
    "rung", [Rung(name="half", symmetry="front_back"), Rung(name="finer", multiply={"mesh.degrees_of_freedom": 6})]
)
def test_a_result_on_another_mesh_is_degraded_says_so_and_is_measured_there(case, tmp_path, monkeypatch, rung):
    """The first attempt fails by what no numerics change: it is put down to the mesh."""
    one = with_(case, n_pouches=4, engine="newton", actuation_pressure_max=MAXIMUM, frames=(0.0, MAXIMUM))
    one = replace(one, mesh_level=MeshLevel(degrees_of_freedom=3000))
    solved, own = newton.solve, mesh_device(one.mesh_content())
    write_mesh(own, tmp_path / "own.vtu")

    def fails_on_its_own_mesh(model, solver, start=None, after=None):
        path = solved(model, solver, start, after)
        return replace(path, status="diverged", reason="no") if len(model.mesh.quads) == len(own.quads) else path

    monkeypatch.setattr(newton, "solve", fails_on_its_own_mesh)
    status = solve_case(one, tmp_path / "own.vtu", tmp_path / "case", SolveSettings(limits=LIMITS, rungs=[rung]))
    assert [a["status"] for a in status["attempts"]] == ["diverged", "converged"]
    assert status["status"] == "degraded"
    assert f"another mesh: {rung.name}, {status['elements']} elements" in status["reason"]
    assert status["elements"] == status["attempts"][1]["elements"] > status["attempts"][0]["elements"] == len(own.quads)
    described = read_json(tmp_path / "case/case.json")
    assert Case.from_dict(described["case"]) == one, "the case is what was asked for"
    model, frames = open_case(one, tmp_path / "own.vtu", tmp_path / "case")
    assert len(model.mesh.quads) == status["elements"]
    with xr.open_dataset(tmp_path / "case/volumes.nc") as history:
        middle = model.expansion.midsurface(frames.displacement[-1].astype(float))
        ventricle, _ = volumes(model.mesh, model.mesh.nodes + middle)
        assert ventricle * ML == pytest.approx(float(history.ventricle_volume[-1]), rel=1e-5)
    wanted = Wanted({"stress": (0.0, MAXIMUM)})
    assert measure_case(one, wanted, Fatigue(), tmp_path / "own.vtu", tmp_path / "case").attrs["status"] == "measured"
    assert solved_cases(tmp_path)[1] == {}
    monkeypatch.setattr(newton, "solve", solved)
    again = solve_case(one, tmp_path / "own.vtu", tmp_path / "case", SolveSettings(limits=LIMITS, rungs=[rung]))
    assert again["status"] == "converged"
    assert not (tmp_path / "case" / OWN_MESH).exists()
    assert len(open_case(one, tmp_path / "own.vtu", tmp_path / "case")[0].mesh.quads) == len(own.quads)


def test_a_rung_whose_mesh_cannot_be_made_is_passed_over(made, tmp_path, monkeypatch):
    case, _, file = made

    def fails(content):
        raise MeshError("gmsh could not")

    monkeypatch.setattr(solution, "mesh_device", fails)
    rungs = [Rung(name="finer", multiply={"mesh.degrees_of_freedom": 2}), Rung(name="a", multiply={"newton.iterations": 1.2})]
    status = solve_case(impatient(case, 5), file, tmp_path, SolveSettings(limits=LIMITS, rungs=rungs))
    assert [a["rung"] for a in status["attempts"]] == ["as configured", "a"]
    assert status["status"] == "diverged"


def test_calculix_climbs_from_a_start_that_fails(made, tmp_path):
    """An increment of the whole fit, which may not be cut, and a rung that starts with a thousandth of it."""
    case, _, file = made
    numerics = case.numerics.model_copy(update={"first_increment": 0.5, "smallest_increment": 1e-2})
    numerics = numerics.model_copy(update={"controls": numerics.controls.model_copy(update={"cutbacks": 1})})
    short = with_(case, engine="calculix", numerics=numerics, actuation_pressure_max=0.5, frames=(0.0, 0.5))
    gentler = {"first_increment": 2e-3, "smallest_increment": 1e-5, "controls.cutbacks": 20}
    rung = Rung(name="smaller_start", multiply=gentler)
    status = solve_case(short, file, tmp_path, SolveSettings(limits=LIMITS, command=ccx_build.find_ccx(Solver()), rungs=[rung]))
    assert [a["status"] for a in status["attempts"]] == ["diverged", "converged"]
    assert status["attempts"][0]["ended_in"] == "fit"
    assert status["status"] == "converged", status["reason"]
    assert not list((tmp_path / "run").glob("*.frd"))
    assert {"deck.inp", "ccx.log", "numerics.json"} <= {f.name for f in (tmp_path / "run").iterdir()}


def test_the_same_case_twice_is_the_same_to_the_bit_and_perturbed_ones_are_not(made, tmp_path):
    case, mesh, _ = made
    volumes = []
    for branch in (0, 0, 1):
        status, history = follow(
            find_engine("newton"), build_model(replace(case, branch=branch), mesh), tmp_path, EngineSettings()
        )
        assert status == "converged"
        volumes.append(history.ventricle_volume.values.tobytes())
    assert volumes[0] == volumes[1]
    assert volumes[0] != volumes[2]
