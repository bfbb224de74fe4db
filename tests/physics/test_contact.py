"""Layers that touch: closed forms, the device with and without contact, and how what is left of it vanishes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from limo.cases.case import Case
from limo.engines.newton import iteration as newton
from limo.mechanics.contact import Contact, Touching
from limo.mechanics.energy import conjugate_volumes, ramp_balance, stored_energy
from limo.mechanics.equilibrium import residual
from limo.mechanics.model import Model, Pressure
from limo.mechanics.volumes import volumes
from limo.schema.numerics import Touch
from limo.schema.solver import Solver
from tests.helpers.patches import crooked, patch_mesh, patch_model
from tests.physics.test_newton import device, solved, tight
from tests.physics.test_shell import strip

NONE = np.empty((0, 8), int)


def touching(case: Case, element: str = "SHELL8R", n_pouches: int = 4, penetration: float = 0.05, **changes) -> Model:
    """A coarse device whose layers touch."""
    contact = Touch(front_back=True, endo_epi=True, penetration=penetration)
    numerics = case.numerics.model_copy(update={"contact": contact})
    return device(replace(case, numerics=numerics), n_pouches, element=element, **changes)


def volume(model: Model, u: np.ndarray) -> np.ndarray:
    """V_v and V_a in ml."""
    return np.array(volumes(model.mesh, model.mesh.nodes + model.midsurface(u))) / 1000


@pytest.mark.parametrize("elements", [20, 40])
def test_a_sheet_blown_onto_a_plane_lies_on_it_as_the_closed_form_says(case, elements):
    """Pinned at x = L and z = h it is an arc of radius R = T / p that meets the plane in x = c, with one tension T all along:
    R (1 - cos a) = h, R sin a = L - c, c + R a = L (1 + T / (E' t))."""
    material, half, height, pressure = case.device.material, 20.0, 1.0, 30.0
    stiff = material.youngs_modulus / (1 - material.poisson_ratio**2) * material.thickness  # N/mm

    def shape(tension: float) -> tuple[float, float]:
        radius = tension / (1e-3 * pressure)
        angle = np.arccos(1 - height / radius)
        return half - radius * np.sin(angle), radius * angle

    def excess(tension: float) -> float:
        flat, arc = shape(tension)
        return flat + arc - half * (1 + tension / stiff)

    exact, _ = shape(brentq(excess, 0.6e-3 * pressure * height, 1e-3 * pressure * half**2))
    model = strip(case, elements, half, half / elements, ventricular_pressure=pressure)
    up = np.array([0.0, 0.0, height])
    mesh = replace(model.mesh, nodes=model.mesh.nodes + up)
    loads = (replace(model.pressures[0], ventricular=-1.0),)
    pinned = [(int(n), d) for n in np.flatnonzero(np.abs(model.nodes[:, 0] - half) < 1e-9) for d in (0, 2)]
    reach = 0.002
    model = replace(
        model,
        mesh=mesh,
        nodes=model.nodes + up,
        expansion=replace(model.expansion, nodes=model.expansion.nodes + up),
        fixed=(*model.fixed, *pinned),
        pressures=loads,
        contact=Contact(mesh.quads, NONE, NONE, 1e-3 * pressure / reach, reach, span=1.0),
    )
    _, u = solved(model)
    placed = mesh.nodes + model.midsurface(u)
    push = Touching(model.contact, mesh.nodes).forces(placed)[:, 2]
    width = half / elements
    assert placed[:, 2].min() > -2 * reach
    # the plane carries p c: what the arc does not
    assert -push.sum() / (1e-3 * pressure * width) == pytest.approx(exact, rel=0.03)
    assert residual(model, u, 0.0, precision="float64").full < 1e-6


@pytest.mark.parametrize("element", ["SHELL8R", "C3D20R"])
def test_two_pressed_plates_pass_on_a_uniform_pressure(case, element):
    """A patch test: crooked quadrilaterals, one plate on the plane z = 0 and one on that, both free to bend and to slide. Each
    comes to lie level, at the gap where contact carries the pressure, and without a stress in its plane."""
    pressure, reach = 30.0, 0.002
    points, quads, _ = crooked(3)
    flat = np.column_stack([10 * points, np.zeros(len(points))])
    mesh = patch_mesh(np.vstack([flat, flat]), np.vstack([quads, quads + len(flat)]))
    loaded = tight(case, element=element, ventricular_pressure=pressure, actuation_pressure_max=0.0, newton={"residual": 1e-9})
    model = patch_model(loaded, mesh)
    held = [(int(n), axis) for axis in (0, 1) for n in np.flatnonzero(model.nodes[:, axis] < 1e-9 - 10)]
    above = np.arange(len(quads), 2 * len(quads))
    model = replace(
        model,
        fixed=tuple(held),
        pressures=(Pressure("epi_front", above, "top", 1.0, 0.0),),
        contact=Contact(quads, quads, quads + len(flat), 1e-3 * pressure / reach, reach, span=1.0),
    )
    _, u = solved(model)
    moved = model.midsurface(u)
    gap = brentq(lambda g: model.contact.pressure(np.array(g)) - 1e-3 * pressure, -2 * reach, reach)
    assert gap == pytest.approx(-reach)
    # bricks are pressed between their middle surface and the face that is loaded, shells have no thickness that changes
    tolerance = {"SHELL8R": 1e-6, "C3D20R": 1e-2}[element]
    assert np.abs(moved[:, 2] - np.repeat([gap, 2 * gap], len(flat))).max() < tolerance * reach
    if element == "SHELL8R":  # the gap times the stretch of the area: a tension p g of the gap itself is left
        material = case.device.material
        strain = 1e-3 * pressure * reach / (material.youngs_modulus * material.thickness)
        assert np.abs(moved[:, :2]).max() < 20 * strain


@pytest.mark.parametrize("element", ["SHELL8R", "C3D20R"])
def test_empty_pouches_open_when_the_pressure_in_them_takes_over_what_the_layers_pass_on(case, element):
    """Two equal layers share the tension that holds P_v, so they press on each other with P_v / 2 and part from P_a = P_v / 2
    on: nothing moves before, and little until P_v. Without contact they lie in each other by millilitres."""
    model = touching(case, element, maximum=13.0)
    path = newton.solve(model, Solver(time_limit=3))
    assert path.status == "converged", path.reason
    ramp = np.flatnonzero(path.stage >= 1)
    ventricle, pouches = np.array([volume(model, path.displacements(k)) for k in ramp]).T
    free = volume(model, solved(device(case, element=element, maximum=0.0))[1])
    assert free[1] < -0.01 * free[0]
    closed = path.pressure[ramp] < 0.45 * model.loading.ventricular_pressure
    assert np.abs(pouches[closed]).max() < 1e-3 * ventricle[0]
    assert np.abs(ventricle[closed] - ventricle[0]).max() < 1e-3 * ventricle[0]
    assert pouches.max() < 0.03 * ventricle[0]


@pytest.mark.parametrize("element", ["SHELL8R", "C3D20R"])
@pytest.mark.parametrize("symmetry", ["quarter", "full"])
def test_layers_pass_each_other_by_less_than_a_twentieth_of_the_thickness(case, element, symmetry):
    model = touching(case, element, maximum=6.0, symmetry=symmetry)
    path, u = solved(model)
    contact = Touching(model.contact, model.mesh.nodes)
    places = model.middle(u)
    plane, pairs = contact.gaps(places)
    thickness = case.device.material.thickness
    # a crease on so coarse a mesh folds single elements of the edge inside themselves, and then their points face all ways
    whole = contact.facing(places).all(axis=1)
    assert min(plane.min(initial=0.0), pairs[whole].min()) > -0.05 * thickness
    near = pairs[whole] < model.contact.reach
    assert near.mean() > 0.3, "most layers touch"
    lower, upper = (np.einsum("gn,mnk->mgk", contact.values, places[q]) for q in (model.contact.lower, model.contact.upper))
    apart = np.linalg.norm(upper - lower, axis=-1)[whole][near]
    assert np.quantile(apart, 0.99) < 0.5 * model.contact.span, "where layers touch, contact does not fade"
    assert residual(model, u, path.pressure[-1], precision="float64").full < 1e-3, "said by the independent check"


@pytest.mark.parametrize(("n_pouches", "ventricular"), [(4, 13.8), (8, 3.8)])
def test_inflated_layers_pass_each_other_further_in_few_creases_alone(case, n_pouches, ventricular):
    """N_p = 4 presses front against back, N_p = 8 creases its pouches beside the seams."""
    model = touching(case, n_pouches=n_pouches, ventricular=ventricular, maximum=60.0)
    _, u = solved(model)
    contact = Touching(model.contact, model.mesh.nodes)
    places = model.middle(u)
    gaps = np.concatenate([g.ravel() for g in contact.gaps(places)])
    facing = np.concatenate([np.ones(contact.plane_area.size, bool), contact.facing(places).ravel()])
    passed = gaps[facing] / case.device.material.thickness
    assert passed.min() < 0, "some layers are pressed into each other"
    assert np.quantile(passed, 0.01) > -0.05
    assert passed.min() > -0.5


def test_factors_that_couple_what_touches_follow_the_same_path_with_frames_or_without(case):
    """Pouches open at P_v and lose their entries; a look at states beside the path leaves it as it is, to the bit."""
    paths = []
    for coupling, frames in (("all", ()), ("near", ()), ("near", (17.5, 20.5, 23.5))):
        contact = Touch(front_back=True, endo_epi=True, coupling=coupling)
        numerics = case.numerics.model_copy(update={"contact": contact})
        model = device(replace(case, numerics=numerics), element="SHELL8R", maximum=24.0)
        model = replace(model, loading=replace(model.loading, frames=frames))
        path, _ = solved(model)
        kept = [k for k, p in enumerate(path.pressure) if p not in frames]
        paths.append((path, np.array([volume(model, path.displacements(k)) for k in kept]), path.displacements(kept[-1])))
    (whole, volumes_of, _), (narrow, others, last), (looked, _, same) = paths
    assert whole.details["patterns"] == 1
    assert narrow.details["patterns"] > 1
    np.testing.assert_allclose(others, volumes_of, rtol=1e-4, atol=0.01)
    assert len(looked.pressure) == len(narrow.pressure) + 3
    np.testing.assert_array_equal(same, last)


def test_what_is_left_between_layers_halves_with_the_reach(case):
    left = []
    for penetration in (0.2, 0.1, 0.05):
        _, u = solved(touching(case, maximum=0.0, penetration=penetration))
        left.append(volume(touching(case, maximum=0.0, penetration=penetration), u)[1])
    assert left[0] > left[1] > left[2] > 0
    assert np.log2(np.array(left[:-1]) / left[1:]) == pytest.approx(1.0, abs=0.15)


def test_contact_is_part_of_the_energy_balance(case):
    """A ramp without snaps stores what the pressures put in; contact's own energy included."""
    model = touching(case, n_pouches=8, ventricular=3.8, maximum=3.0, newton={"load_step": 0.25})
    path, _ = solved(model)
    ramp = np.flatnonzero(path.stage >= 1)
    states = [path.displacements(int(k)) for k in ramp]
    conjugate = np.array([conjugate_volumes(model, u) for u in states])
    stored = stored_energy(model, states[-1]) - stored_energy(model, states[0])
    balance = ramp_balance(path.pressure[ramp], model.loading.ventricular_pressure, conjugate, stored)
    assert abs(balance.dissipated) < 0.05 * abs(balance.actuation_work)
