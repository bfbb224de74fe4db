"""The discrete model: brick layer, valve targets, constraints, and the balance of the pressures."""

import numpy as np
import pytest
from scipy.integrate import quad

from limo.mechanics.build import build_model, pressures
from limo.mechanics.energy import conjugate_volumes
from limo.mechanics.kinematics import deformation_gradient
from limo.mechanics.model import expand
from limo.mesh.elements import gauss, quad8_shape
from limo.schema.numerics import Mesh

SYMMETRIES = ("full", "front_back", "quarter")
QUARTER_PERIMETER = 0.3966 * 125.0


@pytest.fixture
def model_of(device_mesh, make_case):
    def make(symmetry="quarter", element="C3D20R", n_pouches=8, like_shells=None, **changes):
        case = make_case(n_pouches=n_pouches, mesh=Mesh(symmetry=symmetry, element=element), **changes)
        return build_model(case, device_mesh("limo", n_pouches, symmetry), like_shells=like_shells)

    return make


def admissible_field(model, seed):
    """A displacement (n, 3) in mm that meets every homogeneous constraint: even in x and z, edges pinned without rotation.

    Middle surface: polynomials, u_z opposite on front and back and zero on the outer edge and the valve; the bottom-to-top
    director turns at random, but not on the outer edge, the valve or the plane x = 0.
    """
    rng, mesh, shell = np.random.default_rng(seed), model.mesh, model.expansion
    x, y = mesh.nodes[:, 0] / 60, mesh.nodes[:, 1] / 140
    face = np.ones(len(mesh.nodes))
    face[mesh.quads[mesh.face == 1]] = -1
    face[mesh.on_outer | mesh.on_valve] = 0
    c = rng.normal(size=8)
    epi = np.zeros(len(mesh.nodes))
    epi[mesh.quads[mesh.layer == 2]] = 1
    epi[mesh.on_seam] = 0
    middle = np.column_stack([4 * x * y * (c[0] + c[1] * y), 4 * y * (c[2] + c[3] * x**2),
                              face * (20 * y * (1 + 0.3 * c[4] * x**2) + epi * (5 + c[5]))])  # fmt: skip
    director = 0.05 * rng.normal(size=middle.shape)
    director[mesh.on_outer | mesh.on_valve | np.isclose(x, 0.0)] = 0
    u = np.zeros_like(model.nodes)
    u[shell.bottom], u[shell.top] = middle - director, middle + director
    corner = shell.middle >= 0
    u[shell.middle[corner]] = middle[corner]
    return u


# --------------------------------------------------------------------------------------------------------------------
# bricks


@pytest.mark.parametrize("symmetry", SYMMETRIES)
def test_volume_of_the_bricks_is_area_times_thickness(device_mesh, quad_areas, symmetry):
    mesh = device_mesh("limo", 8, symmetry)
    layer = expand(mesh, 0.19)
    local, weights = gauss(3, 3)
    _, jacobian = deformation_gradient(layer.nodes, layer.bricks, np.zeros_like(layer.nodes), local)
    assert jacobian.min() > 0
    np.testing.assert_allclose(jacobian @ weights, 0.19 * quad_areas(mesh.nodes, mesh.quads), rtol=1e-9)


def test_midsurface_of_the_bricks_is_the_mesh(device_mesh):
    mesh = device_mesh("limo", 8, "full")
    layer = expand(mesh, 0.19)
    np.testing.assert_allclose(layer.midsurface(layer.nodes), mesh.nodes, atol=1e-12)
    frames = np.stack([layer.nodes, 2 * layer.nodes])
    np.testing.assert_allclose(layer.midsurface(frames)[1], 2 * mesh.nodes, atol=1e-12)
    corner = layer.middle >= 0
    np.testing.assert_array_equal(layer.nodes[layer.middle[corner]], mesh.nodes[corner])


# --------------------------------------------------------------------------------------------------------------------
# the valve


@pytest.mark.parametrize("aspect_ratio", [1.0, 2.0, 3.0])
@pytest.mark.parametrize(("symmetry", "element"), [("full", "C3D20R"), ("full", "S8R"), ("quarter", "C3D20R")])
def test_valve_nodes_go_to_the_ellipse_and_keep_their_arc_length(model_of, symmetry, element, aspect_ratio):
    model = model_of(symmetry, element, aspect_ratio=aspect_ratio)
    targets = {}
    for (node, direction), u in model.prescribed.items():
        targets.setdefault(node, np.zeros(3))[direction] = u
    start = model.nodes[list(targets)]
    x, y, z = (start + np.array(list(targets.values()))).T
    np.testing.assert_allclose(y, 0.0, atol=1e-12)
    b = np.abs(z).max()
    a = aspect_ratio * b
    np.testing.assert_allclose((x / a) ** 2 + (z / b) ** 2, 1.0, rtol=1e-9)
    arcs = [quad(lambda t: np.hypot(a * np.cos(t), b * np.sin(t)), 0, p)[0] for p in np.arctan2(np.abs(x) / a, np.abs(z) / b)]
    np.testing.assert_allclose(arcs, np.abs(start[:, 0]), atol=1e-6)
    assert max(arcs) == pytest.approx(QUARTER_PERIMETER, rel=1e-3)
    np.testing.assert_array_equal(np.sign(x), np.sign(start[:, 0]))
    assert len(targets) == model.mesh.on_valve.sum(), "one target a node of the valve edge"
    inside = np.abs(start[:, 0]) < start[:, 0].max() - 1e-9
    assert (z[~inside] == 0).all()
    if symmetry == "full":
        assert (z[inside] > 0).sum() == (z[inside] < 0).sum() == inside.sum() / 2
    else:
        assert (z[inside] > 0).all()


# --------------------------------------------------------------------------------------------------------------------
# constraints


@pytest.mark.parametrize("n_pouches", [6, 8])
@pytest.mark.parametrize("symmetry", SYMMETRIES)
def test_no_displacement_is_constrained_twice(model_of, symmetry, n_pouches):
    model = model_of(symmetry, n_pouches=n_pouches)
    dependent = [e.terms[0][:2] for e in model.equations]
    assert len(set(dependent)) == len(dependent)
    held = [*model.prescribed, *model.fixed]
    assert len(set(held)) == len(held)
    assert not set(dependent) & set(held)
    assert not set(dependent) & {t[:2] for e in model.equations for t in e.terms[1:]}, "an equation on a dependent term"
    for equation in model.equations:
        assert abs(equation.terms[0][2]) > 0
        assert len({t[:2] for t in equation.terms}) == len(equation.terms)


@pytest.mark.parametrize("symmetry", SYMMETRIES)
def test_a_symmetric_motion_meets_every_constraint_and_an_asymmetric_one_does_not(model_of, symmetry):
    model = model_of(symmetry)

    def residuals(u):
        pairs = [sum(c * u[n, d] for n, d, c in e.terms) for e in model.equations]
        return np.array([*pairs, *(u[n, d] for n, d in model.fixed)])

    symmetric, edge = admissible_field(model, 4), np.flatnonzero(model.mesh.on_outer)
    opening = np.random.default_rng(5).uniform(0.1, 0.2, len(edge))
    symmetric[model.expansion.bottom[edge], 2] -= opening
    symmetric[model.expansion.top[edge], 2] += opening
    assert np.abs(residuals(symmetric)).max(initial=0.0) < 1e-12
    # a rigid translation along x or z, or a turn about z, breaks the planes that the model uses
    broken = {"full": [], "front_back": [2], "quarter": [0, 2]}[symmetry]
    for direction in range(3):
        shift = np.zeros_like(model.nodes)
        shift[:, direction] = 1.0
        assert (np.abs(residuals(shift)).max() > 0.5) == (direction in broken)


def test_the_whole_outer_edge_and_axis_are_held(model_of):
    """z = 0 and x = 0 as planes: edge nodes pair bottom with top in three directions, axis nodes lose u_x."""
    model = model_of("quarter")
    mesh, shell = model.mesh, model.expansion
    tied = {t[:2] for e in model.equations for t in e.terms} | set(model.fixed) | set(model.prescribed)
    for node in np.flatnonzero(mesh.on_outer):
        assert {(int(shell.bottom[node]), d) for d in range(3)} <= tied
        if shell.middle[node] >= 0:
            assert (int(shell.middle[node]), 2) in tied
    held = set(model.fixed) | set(model.prescribed)
    for node in np.flatnonzero(mesh.on_axis):
        triple = [int(n[node]) for n in (shell.bottom, shell.middle, shell.top) if n[node] >= 0]
        assert {(n, 0) for n in triple} <= held


# --------------------------------------------------------------------------------------------------------------------
# pressures


def flat_forces(mesh, quad_areas, ventricular, actuation, like_shells):
    """Force along z (N) of each loaded surface on the flat device: its pressure times area, up on the bottom side."""
    areas = quad_areas(mesh.nodes, mesh.quads)
    loads = pressures(mesh, like_shells=like_shells)
    return {p.surface: (p.ventricular * ventricular + p.actuation * actuation) * areas[p.quads].sum()
            * (1 if p.side == "bottom" else -1) for p in loads}  # fmt: skip


@pytest.mark.parametrize("like_shells", [False, True])
@pytest.mark.parametrize("actuation", [0.0, 0.0038, 0.06])
def test_flat_forces_are_those_of_the_two_fluids(device_mesh, quad_areas, actuation, like_shells):
    """Front: P_v on the walls, P_v - P_a on the endocardium, P_a on the epicardium, all upwards; the back mirrors it."""
    ventricular = 0.0038
    mesh = device_mesh("limo", 8, "full")
    forces = flat_forces(mesh, quad_areas, ventricular, actuation, like_shells)
    areas = quad_areas(mesh.nodes, mesh.quads)
    wall, array = (areas[(mesh.layer == k) & (mesh.face == 0)].sum() for k in (0, 1))
    assert forces["wall_front"] == pytest.approx(ventricular * wall)
    assert forces["endo_front"] == pytest.approx((ventricular - actuation) * array, abs=1e-12)
    assert forces["epi_front"] == pytest.approx(actuation * array)
    assert forces["endo_front"] + forces["epi_front"] == pytest.approx(ventricular * array)
    for layer in ("wall", "endo", "epi"):
        assert forces[f"{layer}_back"] == pytest.approx(-forces[f"{layer}_front"], abs=1e-12)


@pytest.mark.parametrize("symmetry", SYMMETRIES)
def test_conjugate_volumes_change_by_the_virtual_work_of_the_pressures(model_of, symmetry):
    """d(volume) along an admissible motion is the integral of du . n over the loaded faces, per unit pressure."""
    model = model_of(symmetry)
    u, du, step = admissible_field(model, 5), admissible_field(model, 6), 1e-5
    change = np.subtract(conjugate_volumes(model, u + step * du), conjugate_volumes(model, u - step * du)) / (2 * step)

    (local, weights), work = gauss(3, 2), np.zeros(2)
    values, slopes = quad8_shape(local)
    for load in model.pressures:
        side, sign = (model.expansion.bottom, 1) if load.side == "bottom" else (model.expansion.top, -1)
        quads = side[model.mesh.quads[load.quads]]
        tangents = np.einsum("gnd,mnk->mgdk", slopes, (model.nodes + u)[quads])
        motion = np.einsum("gn,mnk->mgk", values, du[quads])
        swept = np.einsum("mgk,mgk,g->", motion, np.cross(tangents[:, :, 0], tangents[:, :, 1]), weights)
        work += sign * swept * np.array([load.ventricular, load.actuation])
    work *= model.mesh.copies
    assert np.abs(work).min() > 1e4, "the motion must do work on both fluids"
    assert change[1] == pytest.approx(work[1], rel=1e-8), "pouches are closed surfaces"
    assert change[0] == pytest.approx(work[0], rel=1e-4), "the loaded face ends half a thickness off the plane z = 0"


def test_density_of_the_bricks_carries_the_areal_mass(model_of, quad_areas):
    """170 g/m^2 over 0.19 mm = 8.947e-10 t/mm^3."""
    model = model_of()
    assert model.fabric.density == pytest.approx(8.947e-10, rel=1e-4)
    thickness = model.fabric.thickness
    assert model.fabric.density * thickness * 1e6 == pytest.approx(170e-6), "tonne a square metre"


def test_a_branch_is_a_tiny_perturbation_that_keeps_edges_and_repeats(make_case, device_mesh):
    mesh = device_mesh("limo", 8, "quarter")
    plain, one, again, two = (build_model(make_case(branch=b), mesh) for b in (0, 1, 1, 2))
    assert np.array_equal(one.nodes, again.nodes)
    assert not np.array_equal(one.nodes, two.nodes)
    moved = one.mesh.nodes - plain.mesh.nodes
    held = mesh.on_outer | mesh.on_valve
    assert not moved[held].any()
    assert not moved[:, :2].any()
    assert np.std(moved[~held, 2]) == pytest.approx(0.05 * 0.19, rel=0.1)
    assert one.prescribed == plain.prescribed
    thickness = one.nodes[one.expansion.top] - one.nodes[one.expansion.bottom]
    np.testing.assert_allclose(thickness, [[0, 0, 0.19]] * len(thickness), atol=1e-12)
