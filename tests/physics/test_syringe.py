"""A device driven by V_a: states that P_a gives, and those behind a limit of P_a that no P_a holds."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from limo.datasets.cycles import cycle_of
from limo.engines.newton import iteration as newton
from limo.engines.newton import syringe
from limo.measure.cycles import leg_energies, legs_of, states_of_last_cycle
from limo.measure.frames import CaseFrames
from limo.mechanics.build import build_model
from limo.mechanics.energy import conjugate_volumes
from limo.mechanics.equilibrium import residual
from limo.mechanics.model import Model, Pressure
from limo.schema.section import STAGES
from limo.schema.solver import Solver
from limo.solve.harvest import harvest, middles
from tests.helpers.cases import small_mesh, with_
from tests.physics.test_newton import negative_pivots
from tests.physics.test_shell import strip

P_V, MAXIMUM = 3.8, 8.0


# --- an arch that snaps through: closed form ------------------------------------------------------------------------------


def arch(case, length: float, shorter: float) -> Model:
    """Half of a strip clamped at both ends, which come nearer by a share ``shorter``; P_a pushes it down.

    A tiny P_v says to which side it buckles.
    """
    width = length / 20
    model = strip(case, 16, length / 2, width, ventricular_pressure=1e-4)
    end = np.flatnonzero(model.nodes[:, 0] > length / 2 - 1e-9)
    held = {(int(n), 0): -shorter * length / 2 for n in end}
    fixed = {*model.fixed, *((int(n), 2) for n in end)}
    quads = model.pressures[0].quads
    loads = (Pressure("below", quads, "bottom", 1.0, 0.0), Pressure("above", quads, "top", 0.0, 1.0))
    return Model(**{**model.__dict__, "fixed": tuple(fixed), "prescribed": held, "pressures": loads})


def arch_curve(case, length: float, shorter: float) -> tuple[np.ndarray, np.ndarray]:
    """Pressure (kPa) over the mean deflection (mm) of the shallow arch, symmetric about its middle, from rest on.

    With w downwards, D w_xxxx + N w_xx = p, w = w_x = 0 at the ends, int w_x^2 dx / 2 = (shorter - N (1 - nu^2) / (E t)) L.
    With x of L,
    f = p L^3 / D and tau^2 = N L^2 / D: w = f x^2 / (2 tau^2) + A cos(tau x) + B, A = f / (2 tau^3 sin(tau / 2)).
    """
    material = case.device.material
    modulus, thickness = material.youngs_modulus / (1 - material.poisson_ratio**2), material.thickness
    tau = np.linspace(2 * np.pi, 3.9 * np.pi, 4001)[1:]  # from 2 pi on, buckled without load, the arch is pushed flat
    x = np.linspace(0, 0.5, 501)
    force = np.empty(len(tau))
    mean = np.empty(len(tau))
    for k, t in enumerate(tau):
        cosine = 1 / (2 * t**3 * np.sin(t / 2))
        slope = x / t**2 - cosine * t * np.sin(t * x)
        arc = np.trapezoid(slope**2, x)  # of both halves, over two
        left = shorter - t**2 * thickness**2 / (12 * length**2)
        force[k] = np.sqrt(left / arc)
        shape = (x**2 - 0.25) / (2 * t**2) + cosine * (np.cos(t * x) - np.cos(t / 2))
        mean[k] = 2 * np.trapezoid(shape, x) * force[k]
    rigidity = modulus * thickness**3 / 12
    return 1e3 * force * rigidity / length**3, mean * length


def of_an_open_strip(model: Model, displacements: np.ndarray) -> tuple[float, float]:
    """What lies under an arch in mm^3: the side at its width, through which x . n / 3 flows, does not close the surface."""
    return tuple(1.5 * volume for volume in conjugate_volumes(model, displacements))


def test_an_arch_follows_its_closed_form_through_the_snap(case, monkeypatch):
    """Within 1.5 % of the largest pressure. Behind that K has one negative pivot: no P_a holds the arch there."""
    monkeypatch.setattr(syringe, "conjugate_volumes", of_an_open_strip)
    length, shorter = 20.0, 0.002
    pressure, mean = arch_curve(case, length, shorter)
    model = arch(case, length, shorter)
    area = length * length / 20 / 2  # mm^2
    newton_settings = model.numerics.newton.model_copy(update={"load_step": 2e-5 * area})
    loading = replace(model.loading, syringe=(0.0,))
    model = replace(model, loading=loading, numerics=model.numerics.model_copy(update={"newton": newton_settings}))
    path = newton.solve(model, Solver())
    assert path.status == "converged", path.reason
    pushed = np.flatnonzero(path.leg == 1)
    held = np.array([of_an_open_strip(model, path.displacements(int(k)))[1] for k in pushed])
    exact = np.interp(held / area, mean, pressure)
    np.testing.assert_allclose(path.pressure[pushed], exact, atol=0.015 * pressure.max())
    behind = np.flatnonzero(np.diff(path.pressure[pushed]) < 0)
    assert 2 < len(behind) < len(pushed) - 2
    for k in (0, 1, behind[1], len(pushed) - 1):
        count = negative_pivots(model, path.displacements(int(pushed[k])), 1e-4, float(path.pressure[pushed[k]]))
        assert count == (k in behind or k == len(pushed) - 1), k


def test_a_volume_that_nothing_holds_ends_the_path_with_a_reason(case):
    """Two rigid ends hold no arch as high as it is long. What was found before is kept."""
    model = arch(case, 20.0, 0.002)
    loading = replace(model.loading, syringe=(1.0,))
    few = model.numerics.newton.model_copy(update={"load_step": 1.0, "iterations": 20})
    path = newton.solve(replace(model, loading=loading, numerics=model.numerics.model_copy(update={"newton": few})), Solver())
    assert path.status == "diverged"
    assert path.reason
    assert path.stage.max() == STAGES.index("hold")


# --- a device -------------------------------------------------------------------------------------------------------------


def solved(case, **load):
    """Model, path and history of a device of four pouches that snaps on its way to 8 kPa, to small residuals."""
    limits = case.numerics.newton.model_copy(update={"residual": 1e-6, "correction": 1e-4, "load_step": 1.0})
    numerics = case.numerics.model_copy(update={"newton": limits})
    case = with_(case, symmetry="quarter", n_pouches=4, ventricular_pressure=P_V, engine="newton", numerics=numerics)
    case = replace(case, **{"actuation_pressure_max": 0.0, "frames": (0.0,)} | load)
    model = build_model(case, small_mesh(case, 3000, "quarter"))
    path = newton.solve(model, Solver(time_limit=5))
    assert path.status == "converged", path.reason
    history, _, problem = harvest(model, path)
    assert not problem
    return model, path, history


@pytest.fixture(scope="module")
def driven(case):
    """The same device by P_a, and by V_a to what it holds at the largest P_a and back."""
    by_pressure = solved(case, actuation_pressure_max=MAXIMUM)
    largest = float(by_pressure[2].actuation_volume_conjugate[-1])
    return by_pressure, solved(case, syringe=(largest, None))


def test_it_arrives_where_pressure_does(driven):
    (_, _, up), (_, _, filled) = driven
    end = np.flatnonzero(filled.leg.values == 1)[-1]
    assert float(filled.actuation_pressure[end]) == pytest.approx(MAXIMUM, rel=1e-5)
    assert float(filled.ventricle_volume[end]) == pytest.approx(float(up.ventricle_volume[-1]), rel=1e-5)


def test_the_pressure_falls_in_snaps_that_pressure_jumps_over(driven):
    (_, _, up), (_, _, filled) = driven
    leg = legs_of(filled)[1]
    jump = np.diff(up.actuation_volume_conjugate.values).max()
    assert np.diff(leg.actuation_volume_conjugate.values).max() < 0.2 * jump
    assert (np.diff(leg.actuation_pressure.values) < 0).any()


def test_a_leg_that_did_not_arrive_closes_no_cycle(case, driven):
    _, (model, path, history) = driven
    case = replace(case, ventricular_pressure=P_V, syringe=model.loading.syringe)
    grid = np.linspace(0.0, MAXIMUM, 5), np.linspace(0.0, 10.0, 5)
    assert np.isfinite(cycle_of(history, case, *grid)["hysteresis_dissipated"])
    short = history.isel(increment=slice(None, -2))
    assert "hysteresis_dissipated" not in cycle_of(short, case, *grid)
    legs = np.flatnonzero(history.leg.values > 0)
    states = np.array([path.displacements(int(k))[: model.reference_start] for k in legs])
    rest = path.displacements(int(np.flatnonzero(history.leg.values == 0)[-1]))[None, : model.reference_start]
    for count, whole in ((len(legs), True), (len(legs) - 2, False)):
        of_legs = history.leg.values[legs][:count], states[:count]
        frames = CaseFrames(Path("frames.nc"), np.zeros(1), np.zeros(1), rest, None, np.empty((0, 2)), np.empty(0), 0.0, *of_legs)
        assert bool(states_of_last_cycle(model, frames)) == whole


def test_layers_are_looked_at_where_pouches_are_full_and_at_the_end(driven):
    (up, path, history), (filled, there_and_back, of_legs) = driven
    assert len(middles(up, path, history)) == 2
    rest, ramp, end = middles(filled, there_and_back, of_legs)
    np.testing.assert_array_equal(rest, ramp)
    assert np.abs(end - rest).max() > 0


def test_its_states_are_equilibria_at_their_pressure(driven):
    _, (model, path, history) = driven
    for k in np.flatnonzero(history.leg.values > 0)[::5]:
        assert residual(model, path.displacements(int(k)), float(path.pressure[k])).resultant < 1e-3


def test_it_comes_back_and_takes_less_than_by_pressure(case, driven):
    _, (_, _, history) = driven
    legs = legs_of(history)
    works = np.array([leg_energies(leg, P_V) for leg in legs[1:]])
    assert float(legs[-1].actuation_volume_conjugate[-1]) == pytest.approx(
        float(legs[0].actuation_volume_conjugate[-1]), abs=1e-6
    )
    _, _, both = solved(case, actuation_pressure_max=MAXIMUM, cycle=((P_V, 0.0),))
    by_pressure = sum(leg_energies(leg, P_V)[2] for leg in legs_of(both))
    assert 0 < works[:, 2].sum() < 0.5 * by_pressure
