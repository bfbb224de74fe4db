"""Woven fabric and bending apart from stretching: closed forms, and both engines."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

from limo.cases.case import Case
from limo.measure.strain import fibre_aligned_share
from limo.mechanics.constitutive import condensed, orthotropic
from limo.mechanics.layer import layer_state, surface_state
from limo.mechanics.model import Equation, Model, Pressure
from limo.mesh.elements import gauss
from tests.helpers.calculix import handed_to_calculix
from tests.helpers.cases import with_, woven
from tests.helpers.patches import grid, patch_mesh, patch_model
from tests.physics.test_newton import solved, tight

YARNS = {"warp_modulus": 400.0, "weft_modulus": 100.0, "poisson_ratio": 0.3, "shear_modulus": 30.0}
SPAN = 20.0  # mm


def of_fabric(case: Case, **fabric) -> Case:
    material = woven(case.device.material, **{"weave": None, "bending_factor": None, "pouch_sheet": None, **fabric})
    return with_(case, device=case.device.model_copy(update={"material": material}))


def ribbon(case: Case, element: str, pressure: float, width: float = 0.3, elements: int = 24, *, clamped: bool = False) -> Model:
    """A flat ribbon along x, hinged or clamped at both ends and as wide as it was, under a pressure (kPa) from below."""
    points, quads = grid(elements, 1)
    mesh = patch_mesh(np.column_stack([points * (SPAN / 2, width / 2), 0 * points[:, 0]]), quads)
    changes = {"actuation_pressure_max": 0.0, "ventricular_pressure": pressure, "newton": {"factor_precision": "double"}}
    case = tight(case, element=element, **changes)
    model = patch_model(case, mesh)
    shell = model.expansion
    fixed, tied = {(int(n), 1) for n in range(len(model.nodes))}, []
    for k in np.flatnonzero(np.abs(mesh.nodes[:, 0]) > SPAN / 2 - 1e-9):
        low, middle, high = (int(nodes[k]) for nodes in (shell.bottom, shell.middle, shell.top))
        if middle >= 0:
            fixed |= {(middle, d) for d in (0, 2)}
        if clamped:
            fixed |= {(n, d) for n in (low, high) for d in (0, 2)}
        else:
            tied += [Equation(((low, d, 1.0), (high, d, 1.0))) for d in (0, 2)]
    load = (Pressure("wall_front", np.arange(len(quads)), "bottom", 1.0, 0.0),)
    return Model(**{**model.__dict__, "fixed": tuple(sorted(fixed)), "equations": tuple(tied), "pressures": load})


def height_of_arc(stiffness: float, thickness: float, pressure: float) -> float:
    """Height (mm) of the arc in which a ribbon without bending stiffness holds p (MPa).

    p R = t lambda S, S = Q (lambda^2 - 1) / 2. Its chord is the span, R = span / (2 sin(a)), and lambda = a / sin(a) with
    half the angle a of the arc.
    """

    def excess(a: float) -> float:
        stretch = a / np.sin(a)
        return pressure * SPAN / (2 * np.sin(a)) - thickness * stretch * stiffness * (stretch**2 - 1) / 2

    a = brentq(excess, 1e-3, np.pi / 2 - 1e-6)
    return SPAN / 2 * np.tan(a / 2)


@pytest.mark.parametrize("element", ["SHELL8R", "C3D20R"])
@pytest.mark.parametrize("angle", [0.0, 30.0, 90.0])
def test_a_ribbon_of_woven_fabric_is_inflated_to_the_arc_of_the_closed_form(case, element, angle):
    """Which its stiffness along x decides: four times as much along the warp; off the yarns it shears, as its sides are free."""
    material, pressure = case.device.material, 100.0
    q = condensed(orthotropic(*YARNS.values(), angle)[None])[0]
    stiffness = q[0] - q[2] ** 2 / q[5]
    expected = height_of_arc(stiffness, material.thickness, 1e-3 * pressure)
    model = ribbon(of_fabric(case, weave=YARNS | {"angle": angle}), element, pressure)
    _, u = solved(model)
    middle = model.middle(u)
    assert middle[:, 2].max() == pytest.approx(expected, rel=5e-3)
    other = height_of_arc(1.1 * stiffness, material.thickness, 1e-3 * pressure)
    assert abs(other / expected - 1) > 0.02, "a tenth more stiffness is seen"


@pytest.mark.parametrize(
    "fabric", [{"weave": YARNS | {"angle": 30.0}}, {"bending_factor": 0.2}, {"weave": YARNS, "bending_factor": 0.2}], ids=str
)
def test_calculix_stays_where_the_ribbon_is_inflated_to(case, tmp_path, fabric):
    """An arc of 30 to 60 degrees from end to end; of yarns that run straight it is far away from this state."""
    model = ribbon(of_fabric(case, **fabric), "C3D20R", 100.0)
    _, u = solved(model)
    _, (imposed, released, _) = handed_to_calculix(model, u, tmp_path / "same", 0.0, 0.0)
    assert np.abs(imposed - u).max() < 1e-5
    assert np.abs(released - u).max() < 1e-4


@pytest.mark.parametrize("element", ["SHELL8R", "C3D20R"])
def test_a_strip_off_its_yarns_shears(case, element):
    """Stretched along x with free sides, a strip between rollers that slide shears by Q^-1, and stays homogeneous."""
    angle, strain = 30.0, 1e-4
    points, quads = grid(4, 4)
    mesh = patch_mesh(np.column_stack([5 * points, 0 * points[:, 0]]), quads)
    here = tight(of_fabric(case, weave=YARNS | {"angle": angle}), element=element, actuation_pressure_max=0.0)
    model = patch_model(with_(here, ventricular_pressure=0.0), mesh)
    q = condensed(orthotropic(*YARNS.values(), angle)[None])[0]
    plane = np.array([[q[0], q[1], q[2]], [q[1], q[3], q[4]], [q[2], q[4], q[5]]])
    along = np.linalg.inv(plane) @ [1.0, 0.0, 0.0]
    xx, yy, xy = strain * along / along[0]
    x, y, _ = model.nodes.T
    moved = np.column_stack([xx * x + 0.5 * xy * y, yy * y + 0.5 * xy * x, 0 * x])
    edge = np.abs(model.mesh.nodes[:, :2]).max(axis=1) > 5 - 1e-9
    shell = model.expansion
    nodes = np.unique(np.concatenate([shell.bottom[edge], shell.top[edge], shell.middle[edge][shell.middle[edge] >= 0]]))
    held = {(int(n), d): moved[n, d] for n in nodes for d in (0, 1)}
    held |= {(int(n), 2): 0.0 for n in shell.middle[edge] if n >= 0}
    model = Model(**{**model.__dict__, "prescribed": held, "pressures": ()})
    _, u = solved(model)
    state = layer_state(model, u, gauss(2, 3)[0])
    np.testing.assert_allclose(state.strain[..., 0, 1], 0.5 * xy, rtol=2e-3)
    stress = state.second_piola
    assert np.abs(stress[..., 1, 1]).max() < 2e-3 * stress[..., 0, 0].mean(), "its sides bear nothing"
    assert np.abs(stress[..., 0, 1]).max() < 2e-3 * stress[..., 0, 0].mean()
    turned = np.full(len(quads), 90.0)  # the load runs along a warp that would be turned so
    assert fibre_aligned_share(mesh, stress[:, :4], turned) == pytest.approx(1.0, abs=1e-4)
    assert fibre_aligned_share(mesh, stress[:, :4], turned - 45.0) == pytest.approx(0.5, abs=2e-3)


@pytest.mark.parametrize("element", ["SHELL8R", "C3D20R"])
@pytest.mark.parametrize("factor", [0.25, 4.0])
def test_a_factor_of_bending_changes_bending_alone(case, element, factor):
    """A clamped strip under a pressure so small that nothing stretches: w is inverse to f. Under a large one f hardly matters."""
    soft, stiff = 1e-4, 200.0  # kPa
    plain, scaled = (of_fabric(case, bending_factor=f) for f in (1.0, factor))
    bent = [solved(ribbon(c, element, soft, elements=32, clamped=True)) for c in (plain, scaled)]
    heights = [ribbon(plain, element, soft, elements=32, clamped=True).middle(u)[:, 2].max() for _, u in bent]
    assert heights[0] / heights[1] == pytest.approx(factor, rel=0.02)
    blown = [ribbon(c, element, stiff).middle(solved(ribbon(c, element, stiff))[1])[:, 2].max() for c in (plain, scaled)]
    assert blown[1] == pytest.approx(blown[0], rel=0.012)


def height_of_strip(case: Case, factor: float, pressure: float) -> float:
    """Height (mm) of a hinged strip under p (kPa) that bends and stretches (Foeppl and von Karman; as wide as it was).

    D w'''' - N w'' = p with N = E t / (1 - nu^2) mean(w'^2 / 2) and D = f E t^3 / 12 / (1 - nu^2), along x from the middle:
    w' = p / N (sinh(k x) / (k cosh(k l / 2)) - x), k = sqrt(N / D).
    """
    of = case.device.material
    stretching = of.youngs_modulus * of.thickness / (1 - of.poisson_ratio**2)
    bending, load = factor * stretching * of.thickness**2 / 12, 1e-3 * pressure
    x = np.linspace(0, SPAN / 2, 4001)

    def slope(tension: float) -> np.ndarray:
        k = np.sqrt(tension / bending)
        return load / tension * (np.exp(k * (x - x[-1])) * (1 - np.exp(-2 * k * x)) / (1 + np.exp(-2 * k * x[-1])) / k - x)

    tension = brentq(lambda n: stretching * np.trapezoid(slope(n) ** 2, x) / SPAN - n, 1e-6, 1e2)
    return -float(np.trapezoid(slope(tension), x))


@pytest.mark.parametrize("element", ["SHELL8R", "C3D20R"])
def test_finer_meshes_come_to_a_strip_that_bends_and_stretches(case, element):
    """Errors of the height fall at least with the square of the elements' size, to what shallow theory leaves out."""
    pressure = 0.005  # kPa
    heights = [height_of_strip(case, f, pressure) for f in (0.05, 1.0)]
    assert heights[0] > 1.5 * heights[1], "bending counts"
    errors = []
    for elements in (2, 4, 16):
        models = [ribbon(of_fabric(case, bending_factor=f), element, pressure, elements=elements) for f in (0.05, 1.0)]
        found = np.array([m.middle(solved(m)[1])[:, 2].max() for m in models])
        errors.append(np.abs(found / heights - 1))
    assert (errors[0] > 4 * errors[1]).all()
    assert errors[-1].max() < 3e-4


def test_stress_and_strain_are_those_of_the_real_thickness(case):
    """Rolled to a cylinder: strain t / 2R on the surfaces whatever f, stress f E t / 2R; stretched: that of the moduli."""
    radius, factor = 20.0, 0.25
    material = case.device.material
    points, quads = grid(8, 1)
    mesh = patch_mesh(np.column_stack([points * (SPAN / 2, 0.5), 0 * points[:, 0]]), quads)
    values = []
    for f in (1.0, factor):
        model = patch_model(tight(of_fabric(case, bending_factor=f), element="SHELL8R"), mesh)
        x, y, z = model.nodes.T
        rolled = np.column_stack([(radius + z) * np.sin(x / radius), y, (radius + z) * np.cos(x / radius)])
        state = surface_state(model, rolled - model.nodes)
        values.append((state.strain[:, 8:, 0, 0].mean(), state.von_mises[:, 8:].mean(), state.von_mises[:, 4:8].mean()))
        stretched = surface_state(model, 0.01 * model.nodes * (1, 0, 0))
        values[-1] += (
            stretched.von_mises.mean(),
            stretched.second_piola[..., 0, 0].mean(),
            state.second_piola[:, 8:, 0, 0].mean(),
        )
    plain, scaled = values
    assert plain[0] == pytest.approx(material.thickness / (2 * radius), rel=0.01)
    assert scaled[0] == pytest.approx(plain[0], rel=1e-3)
    assert scaled[1] == pytest.approx(factor * plain[1], rel=0.01)
    assert scaled[3:5] == pytest.approx(plain[3:5], rel=1e-9)
    assert scaled[5] == pytest.approx(factor * plain[5], rel=0.01)
