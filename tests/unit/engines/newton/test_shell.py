"""Forces, tangent and unknowns of shells, against the energy, an independent assembly and finite differences."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from limo.engines.newton.assembly import Assembly
from limo.engines.newton.shell import Directors, ShellAssembly, ShellTangent
from limo.errors import ResultError
from limo.mechanics.energy import conjugate_volumes, stored_energy
from limo.mechanics.equilibrium import internal_forces, pressure_forces
from limo.mechanics.model import KPA, Equation, Model
from limo.schema.element import element
from tests.helpers.matrices import whole

ACTUATION = 20.0  # kPa
STEP = 1e-5  # mm


@pytest.fixture(params=["isotropic", "woven"])
def shells(request, make_model) -> ShellAssembly:
    return ShellAssembly(make_model("SHELL8R", fabric=request.param))


@pytest.fixture
def sheet(patch) -> Model:
    """A flat sheet of shells that nothing holds."""
    return Model(**{**patch.__dict__, "element": element("SHELL8R")})


def moved(assembly: ShellAssembly, size: float = 0.02, seed: int = 5) -> np.ndarray:
    """Free displacements (size,) away from the flat state: middle nodes by some mm, directors by some tenths of a radian."""
    unknowns, rng, free = Directors(assembly), np.random.default_rng(seed), np.zeros(assembly.size)
    for _ in range(3):
        unknowns.turn(assembly.directors(assembly.expand(free)))
        free = assembly.retracted(free + unknowns.expand(rng.normal(0.0, size, unknowns.size)))
    return free


def along(assembly: ShellAssembly, free: np.ndarray, y: np.ndarray, prescribed: float = 1.0):
    """Displacements (n, 3) a share of y (size of the unknowns) away from ``free``, as a function of the share."""
    unknowns = Directors(assembly)
    unknowns.turn(assembly.directors(assembly.expand(free) + prescribed * assembly.prescribed))
    step = unknowns.expand(y)
    return lambda share: assembly.expand(assembly.retracted(free + share * step)) + prescribed * assembly.prescribed


def potential(model: Model, u: np.ndarray, ventricular: float, actuation: float) -> float:
    """Strain energy less what pressures (kPa) did, in N mm of the full device."""
    swept = conjugate_volumes(model, u)
    return stored_energy(model, u) - KPA * (ventricular * swept[0] + actuation * swept[1])


def test_the_residual_is_the_slope_of_the_potential_energy(shells):
    """Without pressure of P_v, whose single edge at the valve sweeps a volume of its own."""
    free = moved(shells)
    unknowns = Directors(shells)
    u = shells.expand(free) + shells.prescribed
    unknowns.turn(shells.directors(u))
    inside, pressed = shells.forces(u, 0.0, ACTUATION)
    forces = unknowns.reduce(shells.reduce(inside - pressed, u))
    for y in np.random.default_rng(1).normal(size=(3, unknowns.size)):
        state = along(shells, free, y)
        energies = [potential(shells.model, state(share), 0.0, ACTUATION) for share in (-STEP, STEP)]
        slope = (energies[1] - energies[0]) / (2 * STEP)
        assert shells.model.mesh.copies * forces @ y == pytest.approx(slope, rel=1e-5)


@pytest.mark.parametrize("pressures", [(0.0, 0.0), (3.8, ACTUATION)], ids=["unloaded", "loaded"])
def test_the_tangent_is_the_second_slope_of_the_potential_energy(shells, pressures):
    """Turns of directors included: they leave a straight line, and the force along a director counts."""
    free = moved(shells)
    unknowns = Directors(shells)
    tangent = ShellTangent(shells, unknowns)
    u = shells.expand(free) + shells.prescribed
    matrix = whole(tangent, tangent.assemble(u, *pressures))

    def forces(y: np.ndarray, share: float) -> np.ndarray:
        """Derivative of the potential energy by y, at a share of it: the exact one of directors that are stretched back."""
        there = along(shells, free, y)(share)
        inside, pressed = shells.forces(there, *pressures)
        middle, director = np.split(inside - pressed, 2)
        straight = (free + share * unknowns.expand(y)).reshape(2, -1, 3)[1] + shells.rest
        size = np.linalg.norm(straight, axis=1, keepdims=True)
        unit = straight / size
        across = director - unit * (unit * director).sum(axis=1, keepdims=True)
        turned = shells.length[:, None] / size * across
        return unknowns.reduce(np.concatenate([middle.ravel(), turned.ravel()]))

    for y in np.random.default_rng(2).normal(size=(3, unknowns.size)):
        expected = (forces(y, STEP) - forces(y, -STEP)) / (2 * STEP)
        assert np.linalg.norm(matrix @ y - expected) < 1e-4 * np.linalg.norm(expected)
        if not any(pressures):
            assert np.linalg.norm(matrix @ y - expected) < 1e-6 * np.linalg.norm(expected)


@pytest.mark.parametrize("fabric", ["isotropic", "woven"])
@pytest.mark.parametrize(("symmetry", "branch"), [("quarter", 0), ("quarter", 1), ("front_back", 0), ("full", 2)])
def test_forces_are_those_of_the_equilibrium_check(make_model, symmetry, branch, fabric):
    """Of perturbed flat states, too, whose layers do not lie in a plane."""
    model = make_model("SHELL8R", symmetry, fabric, branch=branch)
    assembly = ShellAssembly(model)
    u = assembly.expand(moved(assembly)) + assembly.prescribed
    shell = model.expansion
    expected = internal_forces(model, u), pressure_forces(model, u, ACTUATION)
    for forces, of_bricks in zip(assembly.forces(u, model.loading.ventricular_pressure, ACTUATION), expected, strict=True):
        mean = of_bricks[shell.bottom] + of_bricks[shell.top]
        corner = shell.middle >= 0
        mean[corner] += of_bricks[shell.middle[corner]]
        reference = np.vstack([mean, of_bricks[shell.top] - of_bricks[shell.bottom]])
        assert np.abs(forces - reference).max() < 1e-12 * np.abs(reference).max()


def test_directors_keep_their_length_and_what_constraints_say(make_model):
    model = make_model("SHELL8R", "quarter")
    assembly = ShellAssembly(model)
    u = assembly.expand(moved(assembly, 0.05)) + assembly.prescribed
    np.testing.assert_allclose(np.linalg.norm(assembly.directors(u), axis=1), 0.5 * model.fabric.thickness, rtol=1e-12)
    for (n, d), value in model.prescribed.items():
        assert u[n, d] == pytest.approx(value, abs=1e-12)
    for n, d in model.fixed:
        assert abs(u[n, d]) < 1e-12
    for equation in model.equations:
        assert abs(sum(c * u[n, d] for n, d, c in equation.terms)) < 1e-12
    again = assembly.expand(assembly.gather_free(u)) + assembly.prescribed
    np.testing.assert_allclose(again, u, rtol=0, atol=1e-12)


def test_bricks_of_the_same_shape_are_taken_up_without_their_stretch(make_model):
    """A state of bricks may start shells."""
    model = make_model("SHELL8R")
    shells, bricks = ShellAssembly(model), Assembly(make_model("C3D20R"))
    u = bricks.expand(np.random.default_rng(4).normal(0.0, 0.01, bricks.size)) + bricks.prescribed
    taken = shells.expand(shells.gather_free(u)) + shells.prescribed
    free = shells.moves.all(axis=1)
    there, here = (model.midsurface(x)[free] for x in (u, taken))
    np.testing.assert_allclose(here, there, rtol=0, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(shells.directors(taken), axis=1), shells.length, rtol=1e-12)


def test_a_rigid_motion_needs_no_forces(sheet):
    assembly, rotation = ShellAssembly(sheet), Rotation.random(random_state=3).as_matrix()
    u = sheet.nodes @ rotation.T + (10.0, -20.0, 5.0) - sheet.nodes
    inside, _ = assembly.forces(u, 0.0, 0.0)
    modulus = sheet.fabric.youngs_modulus * sheet.fabric.thickness
    assert np.abs(inside).max() < 1e-10 * modulus
    assert stored_energy(sheet, u) < 1e-20 * modulus


def test_the_layer_along_itself_is_as_stiff_as_bricks_in_plane_stress(sheet):
    """A stretch of the sheet: the same forces as of bricks that thin as much as plane stress wants them to."""
    gradient = np.array([[0.05, 0.03], [0.01, -0.02]])
    strain = 0.5 * (gradient + gradient.T + gradient.T @ gradient)
    nu = sheet.fabric.poisson_ratio
    thin = np.sqrt(1 - 2 * nu / (1 - nu) * np.trace(strain))
    flat = np.zeros((3, 3))
    flat[:2, :2] = gradient
    u = sheet.nodes @ flat.T
    thinned = u + (0, 0, thin - 1) * sheet.nodes
    bricks = Assembly(Model(**{**sheet.__dict__, "element": element("C3D20R")})).forces(thinned, 0.0, 0.0)[0]
    shells = ShellAssembly(sheet).forces(u, 0.0, 0.0)[0]
    shell = sheet.expansion
    expected = bricks[shell.bottom] + bricks[shell.top]
    corner = shell.middle >= 0
    expected[corner] += bricks[shell.middle[corner]]
    found = shells[: len(expected)]
    assert np.abs(found - expected).max() < 1e-9 * np.abs(expected).max()


def test_what_moving_edges_drag_along_is_the_slope_of_the_internal_forces(shells):
    u = shells.expand(moved(shells)) + 0.5 * shells.prescribed
    step = 0.1 * shells.prescribed
    change = [shells.inside(u + share * step)[0] for share in (-1e-5, 1e-5)]
    expected = (change[1] - change[0]) / 2e-5
    dragged = shells.drag(u, step)
    assert np.linalg.norm(dragged - expected) < 1e-6 * np.linalg.norm(expected)


def test_the_mass_is_positive_and_what_moves_weighs_what_the_fabric_does(sheet):
    assembly = ShellAssembly(sheet)
    unknowns = Directors(assembly)
    tangent = ShellTangent(assembly, unknowns)
    unknowns.turn(assembly.directors(np.zeros_like(sheet.nodes)))
    mass = whole(tangent, tangent.mass)
    assert np.linalg.eigvalsh(mass.toarray()).min() > 0
    lifted = np.zeros((2, assembly.count, 3))
    lifted[0, :, 2] = 1.0
    y = unknowns.reduce(lifted.ravel())
    assert y @ mass @ y == pytest.approx(assembly.volume.sum() * sheet.fabric.density)


@pytest.mark.parametrize("kind", ["across", "apart"])
def test_equations_that_no_director_can_follow_are_an_error(sheet, kind):
    low, high, other = (int(n) for n in (sheet.expansion.bottom[0], sheet.expansion.top[0], sheet.expansion.bottom[1]))
    terms = {"across": ((low, 0, 1.0), (high, 1, 1.0)), "apart": ((low, 0, 1.0), (other, 0, 1.0))}[kind]
    with pytest.raises(ResultError, match="not followed"):
        ShellAssembly(Model(**{**sheet.__dict__, "equations": (Equation(terms),)}))
