"""The discrete model of a layer of fabric: nodes, elements, constraints and loads by stage. It knows no solver and no case.

Units: mm, N, MPa, tonne, s.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import scipy  # its parts are imported when they are used

from limo.mechanics.contact import Contact, Touching
from limo.mesh.elements import HEX20_BOTTOM, HEX20_TOP
from limo.mesh.layers import LAYERS
from limo.schema.accuracy import AirbagNumerics
from limo.schema.element import Element
from limo.schema.numerics import Numerics

KPA = 1.0e-3  # MPa


class LayerMesh(Protocol):
    """What a model needs of a flat mesh: ``nodes`` (n, 3) in mm, ``quads`` (m, k), ``layer`` (m,), ``is_corner`` (n,)."""

    nodes: np.ndarray
    quads: np.ndarray

    @property
    def layer(self) -> np.ndarray:
        """Index into ``LAYERS`` of each element."""

    @property
    def is_corner(self) -> np.ndarray:
        """Which nodes are corners of elements."""


@dataclass(frozen=True)
class Expansion:
    """One layer of 20-node bricks over the quadrilaterals of a mesh.

    ``nodes`` (n, 3) mm; ``bricks`` (m, 20); ``bottom``, ``middle``, ``top`` (n_shell,): brick nodes of each node of the
    mesh (``middle`` is -1 at mid-side nodes, which have none). Layers that share a node of the mesh share all three.
    """

    nodes: np.ndarray
    bricks: np.ndarray
    bottom: np.ndarray
    middle: np.ndarray
    top: np.ndarray

    def midsurface(self, values: np.ndarray) -> np.ndarray:
        """Values (..., n, k) at brick nodes -> mean of bottom and top at the mesh's nodes (..., n_shell, k)."""
        return 0.5 * (values[..., self.bottom, :] + values[..., self.top, :])


def expand(mesh: LayerMesh, thickness: float) -> Expansion:
    """The expansion that CalculiX makes of S8R (one C3D20R through the thickness), written out.

    ``thickness`` in mm. Bottom nodes at z = -t/2, top at +t/2; corners have a third node between them.
    """
    count, corner = len(mesh.nodes), mesh.is_corner
    bottom = np.arange(count)
    top = bottom + count
    middle = np.full(count, -1)
    middle[corner] = 2 * count + np.arange(corner.sum())
    offset = np.array([0.0, 0.0, thickness / 2])
    nodes = np.vstack([mesh.nodes - offset, mesh.nodes + offset, mesh.nodes[corner]])
    bricks = np.empty((len(mesh.quads), 20), int)
    bricks[:, HEX20_BOTTOM], bricks[:, HEX20_TOP] = bottom[mesh.quads], top[mesh.quads]
    bricks[:, 16:] = middle[mesh.quads[:, :4]]
    return Expansion(nodes, bricks, bottom, middle, top)


@dataclass(frozen=True)
class Equation:
    """sum_i c_i u(node_i, direction_i) = 0, the first term being the dependent one. Directions 0, 1, 2."""

    terms: tuple[tuple[int, int, float], ...]


@dataclass(frozen=True)
class Pressure:
    """Follower pressure on one side of the quadrilaterals ``quads``, as weights of P_v and P_a.

    ``side`` is ``bottom`` or ``top``; the value (positive: pushes into the face) is
    ``ventricular`` P_v + ``actuation`` P_a.
    """

    surface: str
    quads: np.ndarray
    side: str
    ventricular: float
    actuation: float


@dataclass(frozen=True)
class Fabric:
    """A St. Venant-Kirchhoff fabric: E in MPa, nu, thickness in mm, mass per area in g / m^2.

    ``stiffness_ratio`` E_hat: E of the endocardium of the pouches over that of the rest.
    """

    youngs_modulus: float
    poisson_ratio: float
    thickness: float
    areal_density: float
    stiffness_ratio: float

    @property
    def density(self) -> float:
        """Mass density in tonne / mm^3 from the areal density: g / m^2 = 1e-12 tonne / mm^2."""
        return self.areal_density * 1e-12 / self.thickness


@dataclass(frozen=True)
class Loading:
    """Pressures in kPa: P_v, which the fit brings on, the P_a to which the ramp goes, and the P_a whose states are asked for."""

    ventricular_pressure: float
    actuation_pressure_max: float
    frames: tuple[float, ...]


@dataclass(frozen=True)
class Model:
    """What an engine solves.

    ``name`` is for people; ``length`` (mm) is that of the device. ``expansion``: the layer written out; of shells it is that
    which CalculiX makes, or None for one that is not made of ``HEX20``. ``prescribed`` maps (node, direction) to a final
    displacement (mm), ramped in the fitting stage; ``fixed`` lists (node, direction) held at zero. With shells all nodes are
    those of the mesh; with bricks those of ``expansion`` plus the reference nodes from ``reference_start`` on. ``contact``: which
    layers may not pass each other, None where all may.
    """

    name: str
    element: Element
    fabric: Fabric
    loading: Loading
    numerics: Numerics | AirbagNumerics
    length: float
    mesh: LayerMesh
    expansion: Expansion | None
    nodes: np.ndarray
    reference_start: int
    prescribed: dict[tuple[int, int], float]
    fixed: tuple[tuple[int, int], ...]
    equations: tuple[Equation, ...]
    pressures: tuple[Pressure, ...]
    contact: Contact | None = None

    @property
    def youngs_modulus(self) -> np.ndarray:
        """Young's modulus (m,) in MPa of every element: E, on the endocardium of the pouches E_hat E."""
        ratio = np.where(self.mesh.layer == LAYERS.index("endo"), self.fabric.stiffness_ratio, 1.0)
        return ratio * self.fabric.youngs_modulus

    def loaded(self, side: str) -> tuple[np.ndarray, ...]:
        """Nodes (n_shell,) whose mean is where a pressure on a side acts: that side, or the middle surface of shells."""
        shell = self.expansion
        if self.element.plane_stress:
            return shell.bottom, shell.top
        return (shell.bottom if side == "bottom" else shell.top,)

    def midsurface(self, displacements: np.ndarray) -> np.ndarray:
        """Displacements (n, 3) of the model's nodes -> those of the mesh's nodes, on the middle surface (n_shell, 3)."""
        return displacements if self.element.is_shell else self.expansion.midsurface(displacements)

    def middle(self, displacements: np.ndarray) -> np.ndarray:
        """Where the mesh's nodes (n_shell, 3) are on the middle surface, in mm, at displacements (n, 3) of the model's nodes."""
        return self.mesh.nodes + self.midsurface(displacements)

    @property
    def touching(self) -> Touching | None:
        """The contact of its layers from where they lie at first, made anew; None where all may pass."""
        return None if self.contact is None else Touching(self.contact, self.mesh.nodes)


def scatter(forces: np.ndarray, nodes: np.ndarray, count: int) -> np.ndarray:
    """Sum of element forces (m, k, 3) at nodes (m, k) -> (count, 3)."""
    index = nodes.ravel()
    return np.stack([np.bincount(index, forces[..., d].ravel(), minlength=count) for d in range(3)], axis=1)


def reduction(model: Model) -> scipy.sparse.csr_array:
    """T^T (free, 3 n): from forces on all displacements to those on the free ones, with u = T u_free + const.

    The dependent term of an equation, u_0 = -sum c_i / c_0 u_i, hands its force to the others; prescribed and fixed
    displacements take theirs away.
    """
    from scipy.sparse import csr_array, identity  # takes 0.1 s, and most processes solve nothing

    size = 3 * len(model.nodes)
    dependent, rows, columns, values = [], [], [], []
    for equation in model.equations:
        (node, direction, leading), *others = equation.terms
        target = 3 * node + direction
        dependent.append(target)
        for n, d, c in others:
            rows.append(target)
            columns.append(3 * n + d)
            values.append(-c / leading)
    keep = np.ones(size, bool)
    keep[dependent] = False
    transform = identity(size, format="csr").multiply(keep[:, None]) + csr_array((values, (rows, columns)), shape=(size, size))
    for n, d in (*model.prescribed, *model.fixed):
        keep[3 * n + d] = False
    used = np.unique(model.expansion.bricks)
    attached = np.zeros((len(model.nodes), 3), bool)
    attached[used] = True
    attached[model.reference_start :] = True
    return csr_array(transform.T.tocsr()[np.flatnonzero(keep & attached.ravel())])
