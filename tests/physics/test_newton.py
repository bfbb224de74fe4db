"""The engine newton: patch tests, closed forms, a classical airbag, CalculiX on the same mesh, and how it fails."""

from __future__ import annotations

import itertools
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from limo.cases.case import Case
from limo.engines.newton import iteration as newton
from limo.engines.newton.assembly import Assembly
from limo.engines.newton.pardiso import SymmetricSolver
from limo.engines.newton.refined import RefinedSolver
from limo.mechanics.build import build_model, described
from limo.mechanics.energy import conjugate_volumes, stored_energy
from limo.mechanics.equilibrium import residual
from limo.mechanics.model import Equation, Model, Pressure
from limo.mechanics.transfer import carried
from limo.mechanics.volumes import volumes
from limo.schema.numerics import Touch
from limo.schema.solver import Solver
from tests.helpers.calculix import handed_to_calculix
from tests.helpers.cases import small_mesh, with_, woven
from tests.helpers.patches import crooked, curved_patch, grid, patch_mesh, patch_model


def tight(case: Case, **changes) -> Case:
    """The case with small residuals; ``newton`` holds other limits of the engine, the rest goes to ``with_``."""
    limits = {"residual": 1e-6, "correction": 1e-4, **changes.pop("newton", {})}
    numerics = case.numerics.model_copy(update={"newton": case.numerics.newton.model_copy(update=limits)})
    return with_(case, numerics=numerics, frames=(), engine="newton", **changes)


def material(case: Case, **values) -> Case:
    return with_(case, device=case.device.model_copy(update={"material": case.device.material.model_copy(update=values)}))


def solved(model: Model) -> tuple[newton.Path, np.ndarray]:
    """The engine's path and its last state (n, 3)."""
    path = newton.solve(model, Solver(time_limit=20))
    assert path.status == "converged", path.reason
    return path, path.displacements(len(path.stage) - 1)


def negative_pivots(model: Model, displacements: np.ndarray, ventricular: float, actuation: float) -> int:
    *_, tangent = newton._discrete(model, single=False)
    solver = SymmetricSolver(tangent.indptr, tangent.indices)
    count = solver.factorise(tangent.assemble(displacements, ventricular, actuation))
    solver.close()
    return count


# --- patch tests ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("element", ["C3D20R", "C3D20"])
def test_a_patch_takes_a_constant_strain(case, element):
    """On crooked bricks with straight edges; large strains, the outer nodes displaced and all others free."""
    points, quads, inner = crooked(3)
    mesh = patch_mesh(np.column_stack([10 * points, 0 * points[:, 0]]), quads)
    case = tight(case, element=element, ventricular_pressure=0.0, actuation_pressure_max=0.0, newton={"residual": 1e-9})
    free = patch_model(case, mesh)
    gradient = np.array([[0.05, 0.03, 0.0], [0.01, -0.02, 0.0], [0.0, 0.0, 0.0]])
    strain = 0.5 * (gradient + gradient.T + gradient.T @ gradient)
    nu = case.device.material.poisson_ratio
    gradient[2, 2] = np.sqrt(1 - 2 * nu / (1 - nu) * (strain[0, 0] + strain[1, 1])) - 1  # plane stress
    exact = free.nodes @ gradient.T
    shell, outer = free.expansion, np.flatnonzero(~inner)
    held = np.concatenate([shell.bottom[outer], shell.top[outer], shell.middle[outer][shell.middle[outer] >= 0]])
    model = Model(**{**free.__dict__, "prescribed": {(int(n), d): exact[n, d] for n in held for d in range(3)}, "pressures": ()})
    assert 20 < len(exact) - len(held) < len(exact) / 2
    _, found = solved(model)
    assert np.abs(found - exact).max() < 1e-8 * np.abs(exact).max()


# --- closed forms ---------------------------------------------------------------------------------------------------------


def inflated(case: Case, kind: str, radius: float, stretch: float, elements: int) -> tuple[Model, np.ndarray]:
    """A curved patch between symmetry planes, loaded from below by the closed form's pressure as P_v.

    The planes go through the axis y of a cylinder, which does not stretch along it, and through the centre of a sphere.
    Returns the closed form's displacements too.
    """
    model, exact, _, _, pressure = curved_patch(case, kind, radius, stretch, elements)
    case = tight(case, ventricular_pressure=pressure, actuation_pressure_max=0.0, newton={"residual": 1e-8})
    load = (Pressure("wall_front", model.pressures[0].quads, "bottom", 1.0, 0.0),)
    half = 0.15
    fixed, equations = [], []
    for n, (x, y, z) in enumerate(model.nodes):
        if kind == "cylinder":
            fixed.append((n, 1))
        for d, across in ((0, x), (1, y)):
            if d == 1 and kind == "cylinder":
                continue
            angle = np.arctan2(across, z)
            if abs(abs(angle) - half) < 1e-9:
                # no motion out of the plane: cos u_d -+ sin u_z = 0
                equations.append(Equation(((n, d, np.cos(half)), (n, 2, -np.sign(angle) * np.sin(half)))))
    return Model(
        **{**model.__dict__, **described(case), "fixed": tuple(fixed), "equations": tuple(equations), "pressures": load}
    ), exact


@pytest.mark.parametrize("kind", ["cylinder", "sphere"])
def test_pressurised_patches_take_the_radius_of_the_closed_form(case, kind):
    """Growth of the radius within 0.5 % of the thin fabric's, and better than third order with the mesh."""
    radius, stretch, growth = 40.0, 1.03, []
    for elements in (1, 2, 4):
        model, exact = inflated(case, kind, radius, stretch, elements)
        _, found = solved(model)
        place, moved, target = (model.expansion.midsurface(x[: len(exact)]) for x in (model.nodes, found, exact))
        outward = place * ([1, 0, 1] if kind == "cylinder" else [1, 1, 1])
        outward /= np.linalg.norm(outward, axis=1, keepdims=True)
        growth.append((moved * outward).sum(axis=1).mean())
        assert growth[-1] == pytest.approx((stretch - 1) * radius, rel=5e-3)
        assert np.abs(moved - target).max() < 5e-3 * np.abs(target).max()
    coarse, fine = np.abs(np.diff(growth))
    assert np.log2(coarse / fine) > 3


def airbag(case: Case, elements: int, thinner: float) -> Model:
    """A quarter of the upper sheet of a square airbag: side 1.2 m / sqrt(2), 0.6 mm, E = 588 MPa, nu = 0.4, 5 kPa.

    ``thinner`` divides the thickness at the same E t: the published values are those of membranes, which do not bend.
    """
    side = 1200 / np.sqrt(2)
    case = material(case, thickness=0.6 / thinner, youngs_modulus=588.0 * thinner, poisson_ratio=0.4)
    case = tight(case, ventricular_pressure=5.0, actuation_pressure_max=0.0, newton={"residual": 1e-4})
    pattern = case.device.pattern.model_copy(update={"length": side})
    case = with_(case, device=case.device.model_copy(update={"pattern": pattern}))
    points, quads = grid(elements, elements)
    mesh = patch_mesh(np.column_stack([(points + 1) * side / 4, 0 * points[:, 0]]), quads)
    free = patch_model(case, mesh)
    shell, fixed, equations = free.expansion, [], []
    for n, (x, y, _) in enumerate(mesh.nodes):
        low, middle, high = int(shell.bottom[n]), int(shell.middle[n]), int(shell.top[n])
        fixed += [(k, d) for d, across in ((0, x), (1, y)) for k in (low, middle, high) if k >= 0 and across < 1e-9]
        if max(x, y) > side / 2 - 1e-6:  # the edge stays in the plane of the other sheet and is free to turn
            if middle >= 0:
                fixed.append((middle, 2))
            equations.append(Equation(((low, 2, 1.0), (high, 2, 1.0))))
    load = (Pressure("wall_front", np.arange(len(quads)), "bottom", 1.0, 0.0),)
    return Model(**{**free.__dict__, "fixed": tuple(fixed), "equations": tuple(equations), "pressures": load})


@pytest.mark.parametrize("elements", [8, 10])
def test_the_square_airbag_rises_as_high_as_published(case, elements):
    """Between 0.2140 m (Kang and Im 1999) and 0.2167 m (Jarasjarungkiat et al. 2009) at the centre, both of membranes.

    A membrane rests in many wrinkled states: 6 x 6 to 14 x 14 elements reach 0.2142 to 0.2159 m, in no order.

    The bending stiffness of sheets of the full thickness costs such coarse meshes some per cent: their wrinkles are too short.
    """
    model = airbag(case, elements, thinner=10.0)
    _, u = solved(model)
    middle, centre = model.expansion.midsurface(u), int(np.abs(model.mesh.nodes).sum(axis=1).argmin())
    assert 214.0 * 0.99 < middle[centre, 2] < 216.7 * 1.01
    thick = airbag(case, elements, thinner=1.0)
    assert 0.8 < thick.expansion.midsurface(solved(thick)[1])[centre, 2] / middle[centre, 2] < 1.0


# --- stability ------------------------------------------------------------------------------------------------------------


def strut(case: Case, shortening: float) -> Model:
    """A strip 20 mm long and 2 mm wide, clamped at both ends, which come nearer by ``shortening`` mm along its axis x."""
    points, quads = grid(8, 1)
    mesh = patch_mesh(np.column_stack([10 * points[:, 0], points[:, 1], 0 * points[:, 0]]), quads)
    case = tight(case, element="C3D20", ventricular_pressure=0.0, actuation_pressure_max=0.0)
    free = patch_model(case, mesh)
    ends = np.abs(np.abs(free.nodes[:, 0]) - 10) < 1e-9
    prescribed = {(int(n), 0): -np.sign(free.nodes[n, 0]) * shortening / 2 for n in np.flatnonzero(ends)}
    fixed = [(int(n), 2) for n in np.flatnonzero(ends & (np.abs(free.nodes[:, 2]) < 1e-9))]
    fixed += [(int(n), 1) for n in np.flatnonzero(np.abs(free.nodes[:, 1]) < 1e-9)]
    return Model(**{**free.__dict__, "prescribed": prescribed, "fixed": tuple(fixed), "pressures": ()})


def test_no_unstable_equilibrium_is_accepted(case):
    """A straight strut stays in equilibrium beyond Euler's load; it buckles into (1 + cos(2 pi x / l)) / 2 all the same."""
    model = strut(case, 0.1)
    path, u = solved(model)
    for k in range(len(path.stage)):
        assert negative_pivots(model, path.displacements(k), 0.0, 0.0) == 0
    thickness = model.fabric.thickness
    euler = np.pi**2 * thickness**2 / (3 * 20)  # mm of shortening at Euler's load, 4 pi^2 E I / l^2
    height = 2 / np.pi * np.sqrt(20 * (0.1 - euler))
    middle = model.expansion.midsurface(u)[np.abs(model.mesh.nodes[:, 0]) < 1e-9, 2]
    assert np.abs(middle).mean() == pytest.approx(height, rel=0.01)


# --- the device, and CalculiX on the same mesh ----------------------------------------------------------------------------


def device(case: Case, n_pouches: int = 4, ventricular: float = 13.8, maximum: float = 2.0, dofs: int = 3000, **changes) -> Model:
    values = {"symmetry": "quarter", "n_pouches": n_pouches, "ventricular_pressure": ventricular, **changes}
    case = tight(case, actuation_pressure_max=maximum, **values)
    return build_model(case, small_mesh(case, dofs, case.mesh.symmetry))


@pytest.mark.parametrize("n_pouches", [4, 12])
def test_no_element_turns_inside_out_while_fitting_under_a_high_pressure(case, n_pouches):
    """St. Venant-Kirchhoff fabric does not resist it: full steps from the flat state leave the valve edge mirrored."""
    model = device(case, n_pouches, ventricular=23.8, maximum=0.0, dofs=8000)
    path, _ = solved(model)
    assembly = Assembly(model)
    assert min(assembly.smallest_volume(path.displacements(k)) for k in range(len(path.stage))) > 0.8


@pytest.mark.parametrize(
    "changes",
    [
        {"ventricular": 0.0},
        {"stiffness_ratio": 0.1},
        {"element": "C3D20"},
        {"element": "SHELL8R"},
        {"symmetry": "front_back"},
        {"n_pouches": 8},
    ],
    ids=str,
)
def test_devices_of_all_kinds_come_to_rest(case, changes):
    model = device(case, **changes)
    path, u = solved(model)
    found = residual(model, u, path.pressure[-1])
    assert path.pressure[-1] == 2.0
    assert found.full < 1e-3
    assert found.resultant < 1e-4
    assert negative_pivots(model, u, model.loading.ventricular_pressure, 2.0) == 0


def test_steps_that_would_crush_elements_are_refused():
    one = np.ones((2, 3))
    assert newton._whole(one, 0.9 * one, 0.7, 0.25)
    assert not newton._whole(one, 0.69 * one, 0.7, 1.0), "too little is left"
    assert newton._whole(one, 0.69 * one, 0.5, 1.0), "unless there is no other way"
    assert not newton._whole(one, 1.5 * one, 0.7, 0.25), "too much at once"
    assert newton._whole(1.5 * one, one, 0.7, 0.25), "back to where it was is no harm"
    assert newton._whole(0.6 * one, 0.6 * one, 0.7, 0.25), "what is crushed already may stay"
    assert not newton._whole(one, -one, 0.7, np.inf), "turned inside out"


def test_a_start_takes_the_place_of_the_fit(case):
    """Frames leave out the reference nodes."""
    model = device(case)
    path, u = solved(model)
    fitted = path.displacements(int(np.flatnonzero(path.stage == newton.HOLD)[-1]))
    again = newton.solve(model, Solver(), start=fitted[: model.reference_start])
    assert again.status == "converged"
    assert again.iterations["fit"] == 0
    assert np.abs(again.displacements(len(again.stage) - 1) - u).max() < 1e-4


@pytest.mark.parametrize(
    ("n_pouches", "dofs", "element", "fabric"),
    [
        (4, 3000, "C3D20R", "isotropic"),
        (4, 3000, "C3D20R", "woven"),  # of two weaves and thicknesses, softer in bending
        (8, 8000, "C3D20R", "isotropic"),
        (4, 3000, "C3D20", "isotropic"),
    ],
)
def test_calculix_stays_where_newton_rests_and_goes_where_it_goes(loaded, case, tmp_path, n_pouches, dofs, element, fabric):
    """The state at P_a = 0 is an equilibrium of CalculiX too, and under 2 kPa more both change the volumes alike."""
    # one whose wrinkles on so coarse a mesh do not snap under 2 kPa, woven under half of one
    of, maximum = loaded.devices["limo_2025"], 2.0
    if fabric == "woven":
        of, maximum = of.model_copy(update={"material": woven(of.material)}), 0.5
    model = device(replace(case, device=of), n_pouches, dofs=dofs, element=element, maximum=maximum)
    path, last = solved(model)
    first = path.displacements(int(np.flatnonzero(path.stage == newton.HOLD)[-1]))
    assert residual(model, first, 0.0).full < 1e-5
    log, (imposed, released, raised) = handed_to_calculix(model, first, tmp_path / "ccx", 0.0, maximum)
    bricks = slice(model.reference_start)
    assert np.abs(imposed - first[bricks]).max() < 1e-5  # single precision
    assert np.abs(released - first[bricks]).max() < 1e-5
    step = log.split("increment 1 attempt 1")[2]  # of the second step: what its first iteration found
    force, left, correction = (
        float(re.search(rf"{name}=\s*(\S+)", step).group(1))
        for name in ("average force", "largest residual force", "largest correction to disp")
    )
    assert force > 1.0
    assert left < 1e-4 * force
    assert correction < 1e-5 * np.abs(first).max()

    def cavities(u: np.ndarray) -> np.ndarray:
        return np.array(volumes(model.mesh, model.mesh.nodes + model.expansion.midsurface(u)))

    ours, theirs = (cavities(u[bricks]) - cavities(first[bricks]) for u in (last, raised))
    assert (np.abs(ours) > 100).all()  # mm^3
    np.testing.assert_allclose(theirs, ours, rtol=1e-3)


# --- other factors and tangents -------------------------------------------------------------------------------------------


def levers(**keys: str) -> dict:
    """Changes of a case with keys of the engine."""
    return {"newton": keys}


@pytest.mark.parametrize(
    "changes",
    [{}, {"n_pouches": 8}, {"element": "C3D20"}, {"element": "SHELL8R"}, {"symmetry": "front_back"}, {"symmetry": "full"}],
    ids=str,
)
def test_single_precision_rests_where_double_does(case, changes):
    """Both to a residual of 1e-6, so that states differ by as much as rounding leaves open."""
    double, single = (solved(device(case, **changes, **levers(factor_precision=p))) for p in ("double", "single"))
    assert np.abs(single[1] - double[1]).max() < 1e-4
    assert (double[0].pressure == single[0].pressure).all()
    counts = [sum(path.iterations.values()) for path, _ in (double, single)]
    assert counts[1] < 1.25 * counts[0]
    assert double[0].details["refinements"] == 0
    assert single[0].details["solutions"] <= single[0].details["refinements"] <= 2 * single[0].details["solutions"]


@pytest.mark.parametrize(
    ("keys", "element", "contact"),
    [
        ({"factor_precision": "single"}, "C3D20R", False),
        ({"geometric_stiffness": "mixed"}, "C3D20R", False),
        ({}, "SHELL8R", False),
        ({"fit_via": [1, 3]}, "SHELL8R", True),
        ({"fit_via": [1, 3]}, "C3D20R", True),
    ],
)
def test_paths_repeat_to_the_bit(case, keys, element, contact):
    touch = Touch(front_back=contact, endo_epi=contact)
    case = replace(case, numerics=case.numerics.model_copy(update={"contact": touch}))
    first, again = (solved(device(case, element=element, **levers(**keys))) for _ in range(2))
    assert np.array_equal(first[1], again[1])
    assert first[0].details["factorisations"] == again[0].details["factorisations"]


def test_a_factor_that_hides_a_negative_eigenvalue_raises_the_shift(case, monkeypatch):
    """Never a step of nothing: what the conjugate gradients refuse is tried again as after a negative pivot."""
    found = RefinedSolver.solve
    refused = itertools.chain([True, True], itertools.repeat(False))
    monkeypatch.setattr(RefinedSolver, "solve", lambda self, right: None if next(refused) else found(self, right))
    model = device(case, **levers(factor_precision="single"))
    path, u = solved(model)
    assert path.rejected >= 2
    assert residual(model, u, path.pressure[-1]).full < 1e-3


def test_the_mixed_stress_rests_where_the_consistent_one_does_in_other_steps(case):
    consistent, mixed = (solved(device(case, 8, **levers(geometric_stiffness=g))) for g in ("consistent", "mixed"))
    assert np.abs(mixed[1] - consistent[1]).max() < 1e-3
    assert mixed[0].details["solutions"] <= mixed[0].details["factorisations"], "each has its own factor"
    assert mixed[0].iterations != consistent[0].iterations


def test_shells_go_on_with_mixed_stress_as_with_the_consistent_one(case):
    """From one state at rest, as their fits end in different wrinkles on so coarse a mesh."""
    path, _ = solved(device(case, element="SHELL8R"))
    fitted = path.displacements(int(np.flatnonzero(path.stage == newton.HOLD)[-1]))
    models = [device(case, element="SHELL8R", **levers(geometric_stiffness=g)) for g in ("consistent", "mixed")]
    consistent, mixed = (newton.solve(model, Solver(), start=fitted) for model in models)
    assert consistent.status == mixed.status == "converged"
    last = [each.displacements(len(each.stage) - 1) for each in (consistent, mixed)]
    assert 0.0 < np.abs(last[1] - last[0]).max() < 1e-3, "by another way"
    assert mixed.details["solutions"] <= mixed.details["factorisations"], "each has its own factor"
    assert consistent.details["solutions"] > consistent.details["factorisations"] - consistent.rejected


def test_a_path_with_mixed_stress_is_carried_on_as_if_it_had_not_ended(case):
    """At a new load the stress is that of the state: nothing is remembered that a path does not keep."""
    short, whole = (device(case, maximum=m, **levers(geometric_stiffness="mixed")) for m in (1.0, 3.0))
    begun = newton.solve(short, Solver())
    carried, straight = newton.solve(whole, Solver(), after=begun), newton.solve(whole, Solver())
    assert np.abs(carried.displacements(len(carried.stage) - 1) - straight.displacements(len(straight.stage) - 1)).max() < 1e-4


# --- where a path begins --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("element", ["C3D20R", "SHELL8R"])
def test_from_the_state_of_a_coarser_mesh_a_device_comes_to_rest_in_fewer_steps(case, loaded, element):
    """At an equilibrium of its own mesh, as deep as the one that is found from the flat state or deeper."""
    case = replace(case, device=loaded.devices["limo_2025"])  # whose elements are good on so coarse a mesh
    coarse, fine = (device(case, 8, 3.8, maximum=1.0, dofs=size, element=element) for size in (6000, 12000))
    flat = newton.solve(fine, Solver())
    begun = newton.solve(fine, Solver(), start=carried(coarse, solved(coarse)[1], fine))
    assert (flat.status, begun.status, begun.details.get("not_begun_at")) == ("converged", "converged", None)
    assert begun.iterations["fit"] == 0
    assert begun.iterations["hold"] < 0.5 * flat.iterations["fit"]
    energies = [path_energy(fine, path) for path in (flat, begun)]
    assert energies[1] < energies[0] + 0.01 * abs(energies[0])
    assert residual(fine, begun.displacements(0), 0.0, precision="float64").full < 1e-3
    # iterations at one load; to rest from another mesh it may take three times as many
    fewer = {"iterations": begun.iterations["hold"] // 2}
    impatient = device(case, 8, 3.8, maximum=1.0, dofs=12000, element=element, newton=fewer)
    again = newton.solve(impatient, Solver(), start=carried(coarse, solved(coarse)[1], fine))
    assert again.details.get("not_begun_at") is None
    assert np.array_equal(again.displacements(0), begun.displacements(0))


def test_where_no_rest_is_found_from_a_state_the_fit_begins_flat(case):
    """With the path that it has without one."""
    model = device(case, 8, maximum=1.0)
    broken = np.random.default_rng(2).normal(0.0, 0.2 * model.length, model.nodes.shape)
    begun, flat = newton.solve(model, Solver(), start=broken), newton.solve(model, Solver())
    assert begun.status == "converged"
    assert begun.details["not_begun_at"]
    assert np.array_equal(begun.displacements(0), flat.displacements(0))
    assert (begun.pressure == flat.pressure).all()


def test_of_several_ways_to_rest_the_lowest_is_kept(case):
    ways = (1.0, 3.0, 10.0)
    alone = {via: newton.solve(device(case, 6, maximum=0.5, newton={"fit_via": [via]}), Solver()) for via in ways}
    model = device(case, 6, maximum=0.5, newton={"fit_via": list(ways)})
    together = newton.solve(model, Solver())
    energies = {via: path_energy(model, path) for via, path in alone.items()}
    assert {w["via"]: w["potential_energy_mj"] for w in together.details["ways"]} == pytest.approx(energies, rel=1e-6)
    lowest = alone[min(energies, key=energies.get)]
    assert together.stage.tolist() == lowest.stage.tolist()
    np.testing.assert_allclose(together.displacements(0), lowest.displacements(0), atol=1e-6)


def test_ways_that_fail_leave_nothing_in_the_path(case, monkeypatch):
    model = device(case, 6, maximum=0.5, newton={"fit_via": [1.0, 3.0, 10.0]})
    alone = newton.solve(device(case, 6, maximum=0.5, newton={"fit_via": [10.0]}), Solver())
    advance = newton.Run.advance

    def failing(run, stage, *load):
        if stage == newton.HOLD and len(run.ways) < 2:
            raise newton.PathEndedError("diverged", "made up")
        advance(run, stage, *load)

    monkeypatch.setattr(newton.Run, "advance", failing)
    path = newton.solve(model, Solver())
    assert [w["potential_energy_mj"] is None for w in path.details["ways"]] == [True, True, False]
    assert path.stage.tolist() == alone.stage.tolist()
    assert path.pressure.tolist() == alone.pressure.tolist()


def path_energy(model: Model, path) -> float:
    """Pi = U - P_v V_v (mJ) of the state at rest of a path."""
    u = path.displacements(int(np.flatnonzero(path.stage == 1)[-1]))
    return stored_energy(model, u) - 1e-3 * model.loading.ventricular_pressure * conjugate_volumes(model, u)[0]


# --- failure --------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "changes", [{"ventricular": 1e4}, {"ventricular": 1e6}, {"maximum": 1e4, "newton": {"load_step": 100.0}}]
)
def test_absurd_pressures_end_the_path_with_a_reason(case, changes):
    model = device(case, **changes)
    path = newton.solve(model, Solver(time_limit=20))
    assert path.status == "diverged"
    assert "no downhill step" in path.reason
    assert len(path.stage) == len(path.pressure)
    assert path.wall_seconds < 60
    assembly = Assembly(model)
    assert all(assembly.smallest_volume(path.displacements(k)) > 0 for k in range(len(path.stage)))


def test_a_frame_without_an_equilibrium_is_left_out(case, monkeypatch):
    """And one that is found changes nothing: the path is that without frames, to the bit."""
    frames = (0.35, 0.7)
    plain, wanted = (device(case, 6, maximum=1.0, newton={"load_step": 0.5, "easy_steps": 1}) for _ in range(2))
    wanted = replace(wanted, loading=replace(wanted.loading, frames=frames))
    advance = newton.Run.advance

    def failing(run, stage, share, ventricular, actuation, *patience):
        if actuation == frames[0]:
            raise newton.PathEndedError("diverged", "made up")
        advance(run, stage, share, ventricular, actuation, *patience)

    alone = newton.solve(plain, Solver())
    monkeypatch.setattr(newton.Run, "advance", failing)
    path = newton.solve(wanted, Solver())
    assert path.status == "converged", path.reason
    assert path.pressure.tolist() == sorted([*alone.pressure.tolist(), frames[1]])
    kept = np.flatnonzero(path.pressure != frames[1])
    for k, own in enumerate(kept):
        np.testing.assert_array_equal(path.displacements(int(own)), alone.displacements(k))


@pytest.mark.parametrize("where", ["_discrete", "RefinedSolver"])
def test_no_memory_for_a_model_is_a_crash_that_may_be_tried_again(case, monkeypatch, where):
    def none(*arguments, **options):
        raise MemoryError

    monkeypatch.setattr(newton, where, none)
    path = newton.solve(device(case, 6, maximum=0.5), Solver())
    assert (path.status, path.interrupted, len(path.stage)) == ("crashed", True, 0)
    assert path.details["factorisations"] == 0


def test_a_path_that_does_not_settle_says_how_far_it_was(case):
    path = newton.solve(device(case, newton={"iterations": 5}), Solver())
    assert path.status == "diverged"
    assert re.search(r"no equilibrium at P_a = 0 kPa of the fit in 5 iterations: residual \S+ of the load", path.reason)


def test_the_time_limit_ends_the_path_with_what_was_accepted(case, monkeypatch):
    ticks = itertools.count()  # a clock of a second an iteration
    monkeypatch.setattr(newton, "time", SimpleNamespace(monotonic=lambda: float(next(ticks))))
    path = newton.solve(device(case, 8, dofs=8000), Solver(time_limit=1))
    assert path.status == "timed_out"
    assert "time limit" in path.reason
    assert 0 < len(path.stage) < 12
    assert sum(path.iterations.values()) < 60
    assert np.isfinite(path.displacements(len(path.stage) - 1)).all()
