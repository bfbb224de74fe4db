"""Whether a frame is in equilibrium, said independently of the solver that made it (paper, Eq. dynamic).

    r = f_int - f_p + alpha M v (+ M a)

with f_int = int P : Grad N dV_0 (P = F S), f_p the pressures on the deformed faces, and M v the viscous forces of the
mass-proportional damping. What the constraints take is removed: prescribed and fixed displacements, and what *EQUATIONs
carry over to their other nodes.

The layer is so thin that the rounding of stored displacements (single precision) disturbs the forces across it. These
are self-equilibrated, so the residual is also given for the sum of the forces over the thickness (``resultant``). Every residual
comes with the part that rounding alone explains (``floor``).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from limo.mechanics import shell
from limo.mechanics.kinematics import deformation_gradient, green_lagrange
from limo.mechanics.layer import LayerState, layer_state
from limo.mechanics.model import KPA, Model, reduction, scatter
from limo.mesh.elements import gauss, hex20_shape, quad8_shape


def internal_forces(model: Model, displacements: np.ndarray, source: object = "frame") -> np.ndarray:
    """f_int (n, 3) in N: sum over the element's own integration points of P Grad N J w, P = F S.

    C3D20R and S8R have 2 x 2 x 2 points, C3D20 and S8 have 3 x 3 x 3. ``displacements`` (n, 3) in mm.
    """
    local, weights = gauss(model.element.gauss_points, 3)
    layer = model.expansion
    if model.element.plane_stress:
        deformation, _ = deformation_gradient(layer.nodes, layer.bricks, displacements, local)
        axes = shell.layer_axes(model, local)
        along = shell.second_piola_kirchhoff(green_lagrange(deformation @ axes), shell.stiffness(model))
        stress = axes @ along @ np.swapaxes(axes, -1, -2)
    else:
        state: LayerState = layer_state(model, displacements, local, source)
        deformation, stress = state.deformation, state.second_piola
    _, slopes = hex20_shape(local)
    jacobian = np.einsum("gnd,mnk->mgkd", slopes, layer.nodes[layer.bricks])
    gradient = np.einsum("gnd,mgdk->mgnk", slopes, np.linalg.inv(jacobian))  # dN_n / dX_k
    volume = np.linalg.det(jacobian) * weights
    first_piola = deformation @ stress * volume[..., None, None]
    forces = np.einsum("mgik,mgnk->mni", first_piola, gradient, optimize=True)
    return scatter(forces, layer.bricks, len(model.nodes)) + contact_forces(model, displacements)


def contact_forces(model: Model, displacements: np.ndarray) -> np.ndarray:
    """What the contact of layers adds to f_int (n, 3) in N: half on the bottom and half on the top node of each."""
    total = np.zeros((len(model.nodes), 3))
    if (touching := model.touching) is not None:
        forces = 0.5 * touching.forces(model.middle(displacements))
        total[model.expansion.bottom], total[model.expansion.top] = forces, forces
    return total


def pressure_forces(model: Model, displacements: np.ndarray, actuation_pressure: float) -> np.ndarray:
    """f_p (n, 3) in N of P_v and P_a (kPa) on the deformed faces, of shells on the middle surface: int N p n da, pushing in.

    With the points of CalculiX: 2 x 2 on faces of C3D20R and S8R, 3 x 3 on those of C3D20 and S8.
    """
    x = model.nodes + displacements
    local, weights = gauss(model.element.gauss_points, 2)
    values, slopes = quad8_shape(local)
    total = np.zeros((len(model.nodes), 3))
    for load in model.pressures:
        value = KPA * (load.ventricular * model.loading.ventricular_pressure + load.actuation * actuation_pressure)
        sign = 1.0 if load.side == "bottom" else -1.0
        quads, surfaces = model.mesh.quads[load.quads], model.loaded(load.side)
        tangents = np.einsum("gnd,mnk->mgdk", slopes, np.mean([x[nodes] for nodes in surfaces], axis=0)[quads])
        normal = np.cross(tangents[:, :, 0], tangents[:, :, 1])
        forces = sign * value * np.einsum("gn,mgk,g->mnk", values, normal, weights)
        for nodes in surfaces:
            total += scatter(forces / len(surfaces), nodes[quads], len(total))
    return total


def mass_forces(model: Model, field: np.ndarray) -> np.ndarray:
    """M ``field`` (n, 3) with the consistent mass (3 x 3 x 3 points): N for an acceleration in mm/s^2."""
    local, weights = gauss(3, 3)
    values, slopes = hex20_shape(local)
    layer = model.expansion
    jacobian = np.einsum("gnd,mnk->mgkd", slopes, layer.nodes[layer.bricks])
    volume = np.linalg.det(jacobian) * weights
    at_points = np.einsum("gn,mnk->mgk", values, field[layer.bricks])
    forces = model.density[:, None, None] * np.einsum("gn,mgk,mg->mnk", values, at_points, volume, optimize=True)
    return scatter(forces, layer.bricks, len(model.nodes))


def through_thickness(model: Model, forces: np.ndarray) -> np.ndarray:
    """Forces (n, 3) at brick nodes -> their sums over the thickness at the nodes of the mesh (n_shell, 3)."""
    layer = model.expansion
    total = forces[layer.bottom] + forces[layer.top]
    corner = layer.middle >= 0
    total[corner] += forces[layer.middle[corner]]
    return total


@dataclass(frozen=True)
class Residual:
    """Residual of a frame over the applied load, both as 2-norms over the free displacements.

    ``full``: all nodal forces; ``resultant``: their sums over the thickness, where nothing is constrained; ``floor`` and
    ``resultant_floor``: what rounding of the displacements to single precision alone amounts to. ``viscous``: the
    damping and inertia forces over the applied load, NaN where no motion is known: the residual then contains them.
    """

    full: float
    resultant: float
    floor: float
    resultant_floor: float
    viscous: float


def residual(
    model: Model,
    displacements: np.ndarray,
    actuation_pressure: float,
    motion: np.ndarray | None = None,
    damping: float = 0.0,
    source: object = "frame",
    precision: np.dtype | str = "float32",
) -> Residual:
    """Residual of a frame: ``displacements`` (n, 3) in mm at P_a in kPa, stored in ``precision``.

    ``motion`` (2, n, 3), velocity in mm/s and acceleration in mm/s^2 on the solver's clock, and ``damping`` in 1/s give the
    viscous forces and inertia.
    """
    u = with_references(model, np.asarray(displacements, float))
    project = reduction(model)
    loaded = pressure_forces(model, u, actuation_pressure)
    inside = internal_forces(model, u, source)
    viscous = np.zeros_like(inside)
    if motion is not None:
        viscous = mass_forces(model, damping * with_references(model, motion[0]) + with_references(model, motion[1]))
    free = unconstrained(model)

    def held(forces: np.ndarray) -> np.ndarray:
        return shell.along_layer(model, forces, u) if model.element.plane_stress else forces

    load = np.linalg.norm(project @ held(loaded).ravel()) or 1.0
    load_sum = np.linalg.norm(through_thickness(model, loaded)[free]) or 1.0

    def norms(forces: np.ndarray) -> tuple[float, float]:
        whole = float(np.linalg.norm(project @ held(forces).ravel()) / load)
        return whole, float(np.linalg.norm(through_thickness(model, forces)[free]) / load_sum)

    shaken = internal_forces(model, with_references(model, u + rounding_noise(u, precision)), source)
    return Residual(
        *norms(inside - loaded + viscous),
        *norms(shaken - inside),
        viscous=float("nan") if motion is None else norms(viscous)[0],
    )


def rounding_noise(displacements: np.ndarray, precision: np.dtype | str = "float32", seed: int = 1) -> np.ndarray:
    """Random errors (mm) of the size that rounding to ``precision`` makes: uniform within half a spacing of the value."""
    spacing = np.spacing(np.abs(displacements).astype(precision)).astype(float)
    return np.random.default_rng(seed).uniform(-0.5, 0.5, displacements.shape) * spacing


def with_references(model: Model, displacements: np.ndarray) -> np.ndarray:
    """Displacements of all of the model's nodes: the reference nodes, which frames leave out, carry no force."""
    u = np.zeros((len(model.nodes), 3))
    count = min(len(u), len(displacements))
    u[:count] = displacements[:count]
    return u


def unconstrained(model: Model) -> np.ndarray:
    """Mask (n_shell, 3) of the displacements of the mesh's nodes of which no brick node is constrained."""
    taken = np.zeros((len(model.nodes), 3), bool)
    for n, d in (*model.prescribed, *model.fixed):
        taken[n, d] = True
    for equation in model.equations:
        for n, d, _ in equation.terms:
            taken[n, d] = True
    return through_thickness(model, taken.astype(float)) == 0
