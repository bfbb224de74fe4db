"""The discrete model of a layer of fabric: nodes, elements, constraints and loads by stage. It knows no solver and no case.

Units: mm, N, MPa, tonne, s.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import astuple, dataclass
from typing import Protocol

import numpy as np
import scipy  # its parts are imported when they are used

from limo.mechanics.constitutive import isotropic, orthotropic
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


def expand(mesh: LayerMesh, thickness: float | np.ndarray) -> Expansion:
    """The expansion that CalculiX makes of S8R (one C3D20R through the thickness), written out.

    ``thickness`` in mm, of the layer or (n,) at each node. Bottom nodes at z = -t/2, top at +t/2; corners have a third node
    between them.
    """
    count, corner = len(mesh.nodes), mesh.is_corner
    bottom = np.arange(count)
    top = bottom + count
    middle = np.full(count, -1)
    middle[corner] = 2 * count + np.arange(corner.sum())
    offset = np.multiply.outer(np.broadcast_to(thickness, count) / 2, [0.0, 0.0, 1.0])
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
class Weave:
    """Yarns of a fabric: E_1, E_2 and G_12 in MPa, nu_12, and the angle of the warp in degrees (``constitutive.orthotropic``)."""

    warp_modulus: float
    weft_modulus: float
    poisson_ratio: float
    shear_modulus: float
    angle: float


@dataclass(frozen=True)
class Fabric:
    """A St. Venant-Kirchhoff fabric: E in MPa, nu, thickness in mm, mass per area in g / m^2.

    ``stiffness_ratio`` E_hat: moduli of the endocardium of the pouches over those of the rest. ``weave``: yarns, which take the
    place of E and nu. ``epicardium``: the fabric of the outer layer of the pouches, where it is another one.

    ``bending_factor`` f scales the bending stiffness alone: a layer of thickness t sqrt(f) and moduli E / sqrt(f) has the same
    stiffness of its middle surface, and f times that of bending. That layer is what is solved.
    """

    youngs_modulus: float
    poisson_ratio: float
    thickness: float
    areal_density: float
    stiffness_ratio: float
    weave: Weave | None = None
    bending_factor: float = 1.0
    epicardium: Fabric | None = None

    @property
    def density(self) -> float:
        """Mass density in tonne / mm^3 from the areal density: g / m^2 = 1e-12 tonne / mm^2."""
        return self.areal_density * 1e-12 / self.layer

    @property
    def layer(self) -> float:
        """Thickness in mm of the layer that is solved, t sqrt(f)."""
        return self.thickness * self._share

    @property
    def stiffening(self) -> float:
        """Moduli of the layer that is solved over those of the fabric, 1 / sqrt(f)."""
        return 1.0 / self._share

    @property
    def _share(self) -> float:
        return self.bending_factor**0.5

    @property
    def is_isotropic(self) -> bool:
        """Whether no sheet has yarns."""
        return self.weave is None and (self.epicardium is None or self.epicardium.weave is None)

    @property
    def stiffness(self) -> np.ndarray:
        """C (6, 6) in MPa of this sheet alone, E_hat and the bending factor not in it."""
        if self.weave is None:
            return isotropic(self.youngs_modulus, self.poisson_ratio)
        return orthotropic(*astuple(self.weave))


def layer_thickness(mesh: LayerMesh, fabric: Fabric) -> float | np.ndarray:
    """Thickness in mm of the layer that is solved, (n,) where the pouches' outer sheet has its own: seams have the wall's."""
    if fabric.epicardium is None:
        return fabric.layer
    inner = np.zeros(len(mesh.nodes), bool)
    inner[mesh.quads[mesh.layer != LAYERS.index("epi")]] = True
    return np.where(inner, fabric.layer, fabric.epicardium.layer)


@dataclass(frozen=True)
class Loading:
    """Pressures in kPa: P_v, which the fit brings on, the P_a to which the ramp goes, and the P_a whose states are asked for.

    ``cycle``: P_v and P_a of the points to which the load goes after the ramp, in order, along straight lines. ``syringe``: V_a
    in ml of the points to which a syringe goes instead, P_v as it is; None for V_a at rest.
    """

    ventricular_pressure: float
    actuation_pressure_max: float
    frames: tuple[float, ...]
    cycle: tuple[tuple[float, float], ...] = ()
    syringe: tuple[float | None, ...] = ()

    @property
    def legs(self) -> int:
        """How many legs follow the ramp."""
        return len(self.cycle) + len(self.syringe)


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
    def stiffness_ratio(self) -> np.ndarray:
        """Moduli (m,) of every element's layer over those of its fabric: E_hat on the endocardium, and the bending factor's."""
        ratio = np.where(self.mesh.layer == LAYERS.index("endo"), self.fabric.stiffness_ratio, 1.0)
        return ratio * self.of_sheets(lambda sheet: sheet.stiffening)

    @property
    def youngs_modulus(self) -> np.ndarray:
        """Young's modulus (m,) in MPa of every element: E, on the endocardium of the pouches E_hat E; of yarns a mean one."""
        return self.stiffness_ratio * self.of_sheets(_modulus)

    @property
    def poisson_ratio(self) -> np.ndarray:
        """Poisson's ratio (m,) of every element without yarns."""
        return self.of_sheets(lambda sheet: sheet.poisson_ratio)

    @property
    def thickness(self) -> np.ndarray:
        """Thickness (m,) in mm of every element's layer, as it is solved."""
        return self.of_sheets(lambda sheet: sheet.layer)

    @property
    def density(self) -> np.ndarray:
        """Mass density (m,) in tonne / mm^3 of every element's layer."""
        return self.of_sheets(lambda sheet: sheet.density)

    @property
    def stiffness(self) -> np.ndarray | None:
        """C (m, 6, 6) in MPa of every element's layer, in the flat device's axes; None for isotropic fabric."""
        if self.fabric.is_isotropic:
            return None
        sheets = [sheet.stiffness for sheet in (self.fabric, self.fabric.epicardium or self.fabric)]
        return self.stiffness_ratio[:, None, None] * np.where(self._is_epicardium[:, None, None], sheets[1], sheets[0])

    @property
    def _is_epicardium(self) -> np.ndarray:
        return self.mesh.layer == LAYERS.index("epi")

    def of_sheets(self, value: Callable[[Fabric], float]) -> np.ndarray:
        """A number (m,) of every element from that of its sheet."""
        return np.where(self._is_epicardium, value(self.fabric.epicardium or self.fabric), value(self.fabric))

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


def _modulus(sheet: Fabric) -> float:
    """E in MPa, of yarns sqrt(E_1 E_2)."""
    yarns = sheet.weave
    return sheet.youngs_modulus if yarns is None else (yarns.warp_modulus * yarns.weft_modulus) ** 0.5


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
