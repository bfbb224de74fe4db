"""The discrete model of a case: nodes, elements, constraints and loads by stage. It knows no solver.

Units: mm, N, MPa, tonne, s.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array, identity

from limo.cases.case import Case
from limo.mesh.elements import HEX20_BOTTOM, HEX20_TOP
from limo.mesh.layers import LAYERS, DeviceMesh

KPA = 1.0e-3  # MPa


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


def expand(mesh: DeviceMesh, thickness: float) -> Expansion:
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
class Model:
    """A case ready for an engine.

    ``prescribed`` maps (node, direction) to a final displacement (mm), ramped in the fitting stage; ``fixed`` lists
    (node, direction) held at zero. With shells (``element`` S8, S8R) all nodes are those of the mesh; with bricks
    those of ``expansion`` plus the reference nodes from ``reference_start`` on.
    """

    case: Case
    mesh: DeviceMesh
    expansion: Expansion
    nodes: np.ndarray
    reference_start: int
    prescribed: dict[tuple[int, int], float]
    fixed: tuple[tuple[int, int], ...]
    equations: tuple[Equation, ...]
    pressures: tuple[Pressure, ...]

    @property
    def is_shell(self) -> bool:
        """Whether CalculiX makes the expansion itself."""
        return self.case.mesh.element.startswith("S8")

    @property
    def gauss_points(self) -> int:
        """Gauss points a direction: 2 in C3D20R and S8R, 3 in C3D20 and S8; CalculiX gives the loaded faces as many."""
        return 2 if self.case.mesh.element.endswith("R") else 3

    @property
    def youngs_modulus(self) -> np.ndarray:
        """Young's modulus (m,) in MPa of every element: E, on the endocardium of the pouches E_hat E."""
        ratio = np.where(self.mesh.layer == LAYERS.index("endo"), self.case.stiffness_ratio, 1.0)
        return ratio * self.case.device.material.youngs_modulus

    @property
    def density(self) -> float:
        """Mass density in tonne / mm^3 from the areal density: g / m^2 = 1e-12 tonne / mm^2."""
        material = self.case.device.material
        return material.areal_density * 1e-12 / material.thickness


def scatter(forces: np.ndarray, nodes: np.ndarray, count: int) -> np.ndarray:
    """Sum of element forces (m, k, 3) at nodes (m, k) -> (count, 3)."""
    index = nodes.ravel()
    return np.stack([np.bincount(index, forces[..., d].ravel(), minlength=count) for d in range(3)], axis=1)


def reduction(model: Model) -> csr_array:
    """T^T (free, 3 n): from forces on all displacements to those on the free ones, with u = T u_free + const.

    The dependent term of an equation, u_0 = -sum c_i / c_0 u_i, hands its force to the others; prescribed and fixed
    displacements take theirs away.
    """
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
