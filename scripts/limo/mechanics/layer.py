"""Deformation, strain and stress of the fabric layer at its integration points and on its bottom, middle and top surfaces.

The layer is one quadratic brick thick. Over its area the points are the 2 x 2 Gauss points: there, not at its corners, the
strains of a brick with reduced integration are most accurate. Through its thickness the points are where they are wanted.

Stored frames are single precision, as CalculiX's own results are. A displacement of 32 to 64 mm is then rounded by up to
2e-6 mm. Over a thickness of 0.19 mm this is a strain of 1e-5 to 4e-5 across the layer. Along the layer the same rounding
is a hundred times less. docs/stress.md says what that means for stresses.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from limo.errors import ResultError
from limo.mechanics import shell
from limo.mechanics.constitutive import cauchy, second_piola_kirchhoff, stress_of, von_mises
from limo.mechanics.kinematics import deformation_gradient, green_lagrange, lame
from limo.mechanics.model import Model
from limo.mesh.elements import gauss, quad8_shape
from limo.mesh.layers import FACES, LAYERS, DeviceMesh

#: the surfaces in the order of ``surface_points``, and their local coordinate through the thickness
SURFACES = ("bottom", "middle", "top")
HEIGHTS = {"bottom": -1.0, "middle": 0.0, "top": 1.0}


def surface_points(height: float = 1.0) -> np.ndarray:
    """Local points (12, 3): the 2 x 2 Gauss points on the bottom, then on the middle, then on the top surface.

    ``height``: of the surfaces over the middle, in half thicknesses of the layer that is solved.
    """
    flat, _ = gauss(2, 2)
    return np.vstack([np.column_stack([flat, np.full(4, height * HEIGHTS[s])]) for s in SURFACES])


def moduli(model: Model) -> tuple[np.ndarray, np.ndarray]:
    """Lame constants lambda and mu (m,) in MPa of every element; the endocardium is E_hat times as stiff."""
    return lame(model.youngs_modulus, model.poisson_ratio)


def element_label(mesh: DeviceMesh, element: int) -> str:
    """An element as a person finds it: its number in the deck, layer, face and pouch."""
    pouch = f", pouch {mesh.pouch[element]}" if mesh.pouch[element] >= 0 else ""
    return f"element {element + 1} ({LAYERS[mesh.layer[element]]}, {FACES[mesh.face[element]]}{pouch})"


@dataclass(frozen=True)
class LayerState:
    """Deformation gradient F (m, g, 3, 3) of m elements at g local points, and what follows from it.

    Tensors refer to the Cartesian axes of the flat state; stresses in MPa. ``stiffness``: C (m, 6, 6) of yarns, in the place of
    Lame's constants; None without.
    """

    deformation: np.ndarray
    lame_lambda: np.ndarray
    lame_mu: np.ndarray
    stiffness: np.ndarray | None = None

    @cached_property
    def strain(self) -> np.ndarray:
        """Green-Lagrange strain E = (F^T F - I) / 2."""
        return green_lagrange(self.deformation)

    @cached_property
    def second_piola(self) -> np.ndarray:
        """Second Piola-Kirchhoff stress S in MPa."""
        if self.stiffness is not None:
            return stress_of(self.strain, self.stiffness)
        return second_piola_kirchhoff(self.strain, self.lame_lambda[:, None], self.lame_mu[:, None])

    @cached_property
    def cauchy(self) -> np.ndarray:
        """Cauchy stress sigma in MPa."""
        return cauchy(self.deformation, self.second_piola)

    @cached_property
    def von_mises(self) -> np.ndarray:
        """Von Mises stress (m, g) in MPa of the Cauchy stress."""
        return von_mises(self.cauchy)


def layer_state(
    model: Model, displacements: np.ndarray, local: np.ndarray, source: object = "frame", *, checked: bool = True
) -> LayerState:
    """The layer under ``displacements`` (n, 3) in mm at local points (g, 3).

    ``n`` is at least the number of brick nodes; ``source`` is the file that errors name. Raises ``ResultError`` for
    displacements that are missing or not numbers and, if ``checked``, for elements turned inside out (det F <= 0), naming the
    first.
    """
    layer = model.expansion
    count = len(layer.nodes)
    if displacements.ndim != 2 or displacements.shape[1] != 3 or len(displacements) < count:
        raise ResultError(f"{source}: displacements of shape {displacements.shape}, the mesh has {count} nodes")
    u = np.asarray(displacements[:count], float)
    broken = ~np.isfinite(u).all(axis=1)
    if broken.any():
        element = int(np.flatnonzero(broken[layer.bricks].any(axis=1))[0])
        raise ResultError(
            f"{source}: {broken.sum()} nodes with displacements that are no numbers, first in "
            f"{element_label(model.mesh, element)}"
        )
    deformation, _ = deformation_gradient(layer.nodes, layer.bricks, u, local)
    if model.element.plane_stress:
        axes = shell.layer_axes(model, local)
        deformation = shell.thinned(model, deformation @ axes) @ np.swapaxes(axes, -1, -2)
    determinant = np.linalg.det(deformation).min(axis=1)
    if checked and (determinant <= 0).any():
        element = int(np.argmin(determinant))
        raise ResultError(
            f"{source}: {int((determinant <= 0).sum())} elements turned inside out, worst {element_label(model.mesh, element)} "
            f"with det F = {determinant[element]:.3g}"
        )
    return LayerState(deformation, *moduli(model), model.stiffness)


@dataclass(frozen=True)
class BentState(LayerState):
    """A layer that was solved in the place of a fabric of other bending stiffness: what the fabric's own surfaces bear.

    Of a fabric whose bending stiffness is scaled by f, the layer that is solved is sqrt(f) times as thick, and its moduli are
    1 / sqrt(f) times as large. ``deformation`` and strain are those of the fabric's own surfaces, at 1 / sqrt(f) half
    thicknesses of the layer. The stress has the fabric's resultants, N / t and +-6 M / t^2: by its own moduli, of the strain at
    sqrt(f) half thicknesses. ``loaded``: the layer there; ``root`` (m,): sqrt(f).
    """

    loaded: LayerState | None = None
    root: np.ndarray | None = None

    @cached_property
    def second_piola(self) -> np.ndarray:
        """Second Piola-Kirchhoff stress (m, g, 3, 3) in MPa of the fabric."""
        return self.root[:, None, None, None] * self.loaded.second_piola

    @cached_property
    def cauchy(self) -> np.ndarray:
        """Cauchy stress (m, g, 3, 3) in MPa of the fabric."""
        return self.root[:, None, None, None] * self.loaded.cauchy


def surface_state(model: Model, displacements: np.ndarray, source: object = "frame") -> LayerState:
    """The fabric at ``surface_points`` of its own bottom, middle and top; raises as ``layer_state``."""
    state = layer_state(model, displacements, surface_points(), source)
    factors = model.of_sheets(lambda sheet: sheet.bending_factor)
    scaled = np.unique(factors[factors != 1.0])
    if not len(scaled):
        return state
    outside, inside = state.deformation.copy(), state.deformation.copy()
    for factor in scaled:
        own, root = factors == factor, float(factor) ** 0.5
        for deformation, height in ((outside, 1 / root), (inside, root)):
            there = layer_state(model, displacements, surface_points(height), source, checked=False)
            deformation[own] = there.deformation[own]
    law = *moduli(model), model.stiffness
    return BentState(outside, *law, LayerState(inside, *law), np.sqrt(factors))


def flat_areas(mesh: DeviceMesh) -> np.ndarray:
    """Area (m, 4) in mm^2 of the flat state that each of the 2 x 2 Gauss points of an element stands for."""
    local, weights = gauss(2, 2)
    _, slopes = quad8_shape(local)
    tangents = np.einsum("gnd,mnk->mgdk", slopes, mesh.nodes[mesh.quads])
    return np.linalg.norm(np.cross(tangents[:, :, 0], tangents[:, :, 1]), axis=-1) * weights


def flat_points(mesh: DeviceMesh) -> np.ndarray:
    """Where the 2 x 2 Gauss points of every element lie in the flat state (m, 4, 3), in mm."""
    values, _ = quad8_shape(gauss(2, 2)[0])
    return np.einsum("gn,mnk->mgk", values, mesh.nodes[mesh.quads])


#: order of the three surfaces wherever results are stored: the inner one faces the ventricle
SIDES = ("inner", "middle", "outer")


def inside_out(mesh: DeviceMesh, values: np.ndarray) -> np.ndarray:
    """Values (m, 12, ...) at ``surface_points`` as (m, 3, 4, ...): element, inner/middle/outer surface, point.

    The ventricle lies below the fabric on the front and above it on the back.
    """
    split = values.reshape(len(values), 3, 4, *values.shape[2:])
    front = (mesh.face == 0).reshape(-1, *[1] * (split.ndim - 1))
    return np.where(front, split, split[:, ::-1])


def nodal(mesh: DeviceMesh, values: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Values (m, 4, ...) at the 2 x 2 Gauss points -> values at nodes, layer by layer, for drawing.

    Values go bilinearly from the Gauss points to the nodes of each element. Elements of the same layer and face that meet at a
    node are averaged. Returns the values (p, ...), the mesh's node (p,) of each, and the quadrilaterals (m, 8) as indices
    into them: a node where layers are sealed together appears once for each.
    """
    matrix = _to_nodes()
    at_nodes = np.einsum("ng,mg...->mn...", matrix, values)
    group = mesh.layer + len(LAYERS) * mesh.face
    key = mesh.quads + len(mesh.nodes) * group[:, None]
    unique, inverse = np.unique(key, return_inverse=True)
    inverse = inverse.reshape(key.shape)
    flat = at_nodes.reshape(inverse.size, -1)
    counts = np.bincount(inverse.ravel(), minlength=len(unique))
    sums = np.stack([np.bincount(inverse.ravel(), column, minlength=len(unique)) for column in flat.T], axis=1)
    means = (sums / counts[:, None]).reshape(len(unique), *values.shape[2:])
    return means, unique % len(mesh.nodes), inverse


def _to_nodes() -> np.ndarray:
    """Matrix (8, 4) that carries values at the 2 x 2 Gauss points to the nodes of the quadrilateral."""
    from limo.mesh.elements import QUAD8

    scaled = QUAD8 * np.sqrt(3.0)
    points = np.sign(gauss(2, 2)[0])
    return 0.25 * (1 + scaled[:, None, 0] * points[:, 0]) * (1 + scaled[:, None, 1] * points[:, 1])
