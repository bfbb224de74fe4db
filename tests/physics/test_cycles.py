"""Load cycles by both engines: what comes back, what is conserved, and that both follow the same load."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from limo.engines.calculix import build as ccx_build
from limo.engines.calculix import run as calculix
from limo.engines.newton import iteration as newton
from limo.measure.cycles import leg_energies, legs_of
from limo.mechanics.build import build_model
from limo.mechanics.equilibrium import residual
from limo.mechanics.model import Model
from limo.schema.section import STAGES
from limo.schema.solver import Solver
from limo.solve.harvest import harvest
from tests.helpers.cases import small_mesh, with_

P_V, MAXIMUM = 3.8, 8.0
BACK, AGAIN = ((P_V, 0.0),), ((P_V, 0.0), (P_V, MAXIMUM), (P_V, 0.0))


def device(case, cycle, **changes) -> Model:
    case = with_(case, symmetry="quarter", n_pouches=4, ventricular_pressure=P_V, actuation_pressure_max=MAXIMUM, **changes)
    case = replace(case, frames=(0.0, 4.0, MAXIMUM), cycle=cycle)
    return build_model(case, small_mesh(case, 3000, "quarter"))


def cycled(case, cycle):
    """Path and history of engine newton, to small residuals."""
    limits = case.numerics.newton.model_copy(update={"residual": 1e-6, "correction": 1e-4})
    numerics = case.numerics.model_copy(update={"newton": limits})
    model = device(case, cycle, engine="newton", numerics=numerics)
    path = newton.solve(model, Solver(time_limit=2))
    assert path.status == "converged", path.reason
    history, frames, problem = harvest(model, path)
    assert not problem
    return path, history, frames


def test_the_second_cycle_repeats_the_first(case):
    """This device snaps between 4 and 5 kPa on the way up and lower on the way down, so that every cycle takes energy."""
    path, history, _ = cycled(case, AGAIN)
    legs = legs_of(history)
    assert [float(leg.actuation_pressure[-1]) for leg in legs] == [MAXIMUM, 0.0, MAXIMUM, 0.0]
    energies = np.array([leg_energies(leg, P_V) for leg in legs])
    assert (energies[:, 2] > 0).all()
    assert energies[:2, 0].sum() == pytest.approx(energies[:2, 2].sum(), rel=1e-3), "the loop of V_a has the area that is taken"
    np.testing.assert_allclose(energies[2:], energies[:2], rtol=1e-3)
    ends = [path.displacements(int(np.flatnonzero(history.leg.values == k)[-1])) for k in range(4)]
    assert np.abs(ends[3] - ends[1]).max() < 1e-3
    assert np.abs(ends[2] - ends[0]).max() < 1e-3


def test_no_leg_creates_energy_where_other_wrinkles_stay_behind(case):
    """On so few shells the wrinkles of the first cycle are not those of the second."""
    _, history, _ = cycled(with_(case, element="SHELL8R"), AGAIN)
    energies = np.array([leg_energies(leg, P_V) for leg in legs_of(history)])
    assert (energies[:, 2] > 0).all()
    stored = float(history.strain_energy[-1] - history.strain_energy.values[history.stage.values == STAGES.index("hold")][-1])
    assert energies.sum(axis=0) @ [1, 1, -1] == pytest.approx(stored, rel=1e-6)


def test_a_load_along_a_closed_way_conserves_energy(case):
    """Around a rectangle of P_v and P_a within which nothing snaps, the work of both is what is stored: nothing at the end."""
    limits = case.numerics.newton.model_copy(update={"load_step": 0.25, "easy_steps": 1})
    case = with_(case, numerics=case.numerics.model_copy(update={"newton": limits}))
    way = ((P_V + 1, MAXIMUM), (P_V + 1, MAXIMUM - 2), (P_V, MAXIMUM - 2), (P_V, MAXIMUM))
    _, history, _ = cycled(case, way)
    legs = legs_of(history)
    energies = np.array([leg_energies(leg, P_V) for leg in legs])
    assert abs(energies[1:, 2].sum()) < 1e-3 * np.abs(energies[1:, :2]).sum()
    np.testing.assert_allclose(energies[1:, 2], 0, atol=5e-3 * np.abs(energies[1:, :2]).max())
    start, end = (float(leg.ventricle_volume[-1]) for leg in (legs[0], legs[4]))
    assert end == pytest.approx(start, rel=1e-5)
    assert history.ventricular_pressure.values[history.leg.values == 2][-1] == pytest.approx(P_V + 1)


def test_states_along_the_legs_are_kept_at_the_frames_and_at_their_ends(case):
    path, _, frames = cycled(case, AGAIN)
    assert frames.requested_pressure.values.tolist() == [0.0, 4.0, MAXIMUM]
    assert frames.cycle_leg.values.tolist() == [1, 1, 2, 2, 3, 3]
    np.testing.assert_allclose(frames.cycle_actuation_pressure, [4.0, 0.0, 4.0, MAXIMUM, 4.0, 0.0])
    last = path.displacements(len(path.stage) - 1)
    np.testing.assert_array_equal(frames.cycle_displacement[-1], last[: frames.sizes["node"]])


def test_calculix_goes_the_same_way(case, tmp_path):
    """Its state at the end of every leg is an equilibrium at that leg's pressures."""
    stages = {
        "fit": {"duration": 5.0, "damping": 1e7},
        "hold": {"duration": 10.0, "damping": 1e6},
        "ramp": {"rate": 0.25, "damping": 1e6},
    }
    numerics = case.numerics.model_copy(
        update={name: getattr(case.numerics, name).model_copy(update=values) for name, values in stages.items()}
    )
    way = ((P_V, 0.0), (P_V + 2, 0.0))
    model = device(case, way, numerics=numerics, engine="calculix")
    with calculix.solve(model, tmp_path, Solver(), ccx_build.find_ccx(Solver())) as path:
        assert path.status == "converged", path.reason
        assert sorted(set(path.stage.tolist())) == list(range(len(STAGES)))
        ends = [int(np.flatnonzero(path.leg == k)[-1]) for k in range(3)]
        np.testing.assert_allclose(path.pressure[ends], [MAXIMUM, 0.0, 0.0], atol=1e-6)
        np.testing.assert_allclose(path.ventricular[ends], [P_V, P_V, P_V + 2], rtol=1e-6)
        for k in ends:
            at_end = replace(model, loading=replace(model.loading, ventricular_pressure=float(path.ventricular[k])))
            assert residual(at_end, path.displacements(k), float(path.pressure[k])).resultant < 0.02
