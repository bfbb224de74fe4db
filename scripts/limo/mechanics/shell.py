"""The layer as a shell without stress across it, whose directors keep their length: element ``SHELL8R``.

Its kinematics are those of the bricks with u_bottom = m - d, u_top = m + d and the node between them at m. Along the layer

    S_ab = Q_abcd E_cd,   Q of plane stress, E_ab as of the bricks

Two terms hold directors in place, so that folds narrower than an element neither turn against them nor make them vanish
between nodes:

    psi = E_ab Q_abcd E_cd / 2 + s (2 G E_a3 E_a3 + E E_33^2 / 2),   s = 1 / (1 + c A / t^2)

with the area A of an element. Thin layers have E_a3 = E_33 = 0 in the limit, whatever s is, and elements no larger than the
layer is thick have nearly s = 1. With s = 1 on larger ones, folds that the mesh does not resolve lock: Lyly, Stenberg and
Vihinen (1993), *Comput. Methods Appl. Mech. Eng.* 110, 343-357, weaken the shear of plates like this.

Units: mm, N, MPa. Layers need not be flat: strains and stresses are taken along axes of each point.
"""

from __future__ import annotations

import numpy as np

from limo.mechanics.constitutive import condensed, plane_stress
from limo.mechanics.model import Model
from limo.mesh.elements import gauss, hex20_shape, quad8_shape

#: c
WEAKENING = 0.05
#: least square of a stretch across the layer: plane stress has none where the layer grows without bounds
_THINNEST = 1e-6


def stiffness(model: Model) -> np.ndarray:
    """Q_11, Q_12, Q_16, Q_22, Q_26, Q_66, s G_44, s G_45, s G_55 and s E (m, 10) in MPa of a model's elements."""
    modulus, law = model.youngs_modulus, model.stiffness
    along = plane_stress(modulus, model.poisson_ratio) if law is None else condensed(law)
    law = np.ascontiguousarray(np.column_stack([along, modulus]))
    law[:, 6:] /= 1 + WEAKENING * _areas(model)[:, None] / model.thickness[:, None] ** 2
    return law


def _areas(model: Model) -> np.ndarray:
    """Area (m,) in mm^2 of every element before it is loaded."""
    local, weights = gauss(2, 2)
    _, slopes = quad8_shape(local)
    tangents = np.einsum("gnd,mnk->mgdk", slopes, model.mesh.nodes[model.mesh.quads])
    return np.linalg.norm(np.cross(tangents[:, :, 0], tangents[:, :, 1]), axis=-1) @ weights


def axes_of(jacobian: np.ndarray) -> np.ndarray:
    """Axes (m, g, 3, 3), as columns, of layers with dX_k / dxi_d (m, g, 3, 3): x as it lies in the layer, and its normal."""
    normal = np.cross(jacobian[..., 0], jacobian[..., 1])
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    first = np.eye(3)[0] - normal * normal[..., :1]
    steep = np.abs(normal[..., 0]) > 0.9  # there y
    first[steep] = (np.eye(3)[1] - normal * normal[..., 1:2])[steep]
    first /= np.linalg.norm(first, axis=-1, keepdims=True)
    return np.ascontiguousarray(np.stack([first, np.cross(normal, first), normal], axis=-1))


def layer_axes(model: Model, local: np.ndarray) -> np.ndarray:
    """The same of a model's elements at local points (g, 3)."""
    layer = model.expansion
    _, slopes = hex20_shape(local)
    return axes_of(np.einsum("gnd,mnk->mgkd", slopes, layer.nodes[layer.bricks]))


def second_piola_kirchhoff(strain: np.ndarray, law: np.ndarray) -> np.ndarray:
    """S (m, g, 3, 3) in MPa of strains (m, g, 3, 3) along the layer's axes by ``stiffness`` (m, 10); what holds directors too."""
    xx, yy, xy = strain[..., 0, 0], strain[..., 1, 1], 2 * strain[..., 0, 1]
    xz, yz, zz = 2 * strain[..., 0, 2], 2 * strain[..., 1, 2], strain[..., 2, 2]
    q = law.T[:, :, None]
    stress = np.empty(strain.shape)
    stress[..., 0, 0] = q[0] * xx + q[1] * yy + q[2] * xy
    stress[..., 1, 1] = q[1] * xx + q[3] * yy + q[4] * xy
    stress[..., 0, 1] = stress[..., 1, 0] = q[2] * xx + q[4] * yy + q[5] * xy
    stress[..., 0, 2] = stress[..., 2, 0] = q[8] * xz + q[7] * yz
    stress[..., 1, 2] = stress[..., 2, 1] = q[7] * xz + q[6] * yz
    stress[..., 2, 2] = q[9] * zz
    return stress


def energy_density(strain: np.ndarray, law: np.ndarray) -> np.ndarray:
    """psi = E : S / 2 (m, g) in MPa; arguments as above."""
    return 0.5 * np.einsum("...ij,...ij->...", strain, second_piola_kirchhoff(strain, law))


def thinned(model: Model, deformation: np.ndarray) -> np.ndarray:
    """F (m, g, 3, 3), columns along the layer's axes, of a layer at right angles to itself and thinned by plane stress.

    The first two columns stay. The third one is the normal times sqrt(1 + 2 E_33), with which the law in three dimensions gives
    S_33 = 0 and S_ab as ``second_piola_kirchhoff``: E_33 = -nu / (1 - nu) (E_11 + E_22), of yarns -C_33ab E_ab / C_3333.
    """
    first, second = deformation[..., 0], deformation[..., 1]
    normal = np.cross(first, second)
    size = np.linalg.norm(normal, axis=-1, keepdims=True)
    squares = (first**2).sum(axis=-1), (second**2).sum(axis=-1)
    if (law := model.stiffness) is None:
        ratio = model.poisson_ratio[:, None]
        across = 1 - 2 * ratio / (1 - ratio) * (0.5 * (squares[0] + squares[1] - 2))
    else:
        one, two, both = (law[:, 2, k] / law[:, 2, 2] for k in (0, 1, 3))
        shear = (first * second).sum(axis=-1)
        across = 1 - one[:, None] * (squares[0] - 1) - two[:, None] * (squares[1] - 1) - 2 * both[:, None] * shear
    stretch = np.sqrt(np.maximum(across, _THINNEST))[..., None]
    return np.stack([first, second, stretch * normal / np.maximum(size, np.finfo(float).tiny)], axis=-1)


def along_layer(model: Model, forces: np.ndarray, displacements: np.ndarray) -> np.ndarray:
    """Forces (n, 3) in N at brick nodes without those that the shell's ties take, at displacements (n, 3) in mm.

    Nodes between bottom and top stay halfway and hand their forces to both. Directors keep their length.
    """
    layer, forces = model.expansion, forces.copy()
    corner = np.flatnonzero(layer.middle >= 0)
    bottom, middle, top = layer.bottom[corner], layer.middle[corner], layer.top[corner]
    forces[bottom] += 0.5 * forces[middle]
    forces[top] += 0.5 * forces[middle]
    forces[middle] = 0.0
    held = np.zeros((len(forces), 3), bool)
    for node, direction in (*model.prescribed, *model.fixed):
        held[node, direction] = True
    mean = np.where(held[middle], 0.5 * (forces[bottom] + forces[top]), 0.0)
    forces[bottom] -= mean
    forces[top] -= mean
    placed = model.nodes + displacements
    director = placed[layer.top] - placed[layer.bottom]
    director /= np.linalg.norm(director, axis=1, keepdims=True)
    stretch = director * np.einsum("nk,nk->n", director, 0.5 * (forces[layer.top] - forces[layer.bottom]))[:, None]
    forces[layer.top] -= stretch
    forces[layer.bottom] += stretch
    return forces
