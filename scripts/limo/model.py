"""The discrete model of a case: nodes, elements, constraints and loads by stage. It knows no solver.

Units: mm, N, MPa, tonne, s.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_array, identity

from limo.case import Case
from limo.elements import HEX20_BOTTOM, HEX20_TOP
from limo.geometry import ValveEllipse
from limo.mesh import FACES, LAYERS, DeviceMesh

KPA = 1.0e-3  # MPa
#: heights of the perturbed flat states of branches, over the thickness of the fabric
PERTURBATION = 0.05


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


def pressures(mesh: DeviceMesh, *, like_shells: bool) -> tuple[Pressure, ...]:
    """Wall P_v, endocardium P_v - P_a, epicardium P_a, all pushing away from the fluid (paper, boundary conditions).

    On the front the fluid is below (bottom side), on the back above. CalculiX puts the pressure of a shell on its bottom
    side whatever its sign: ``like_shells`` does the same on the back, which costs the exact mirror symmetry of the two.
    """
    weights = {"wall": (1.0, 0.0), "endo": (1.0, -1.0), "epi": (0.0, 1.0)}
    loads = []
    for face in FACES:
        for layer in LAYERS:
            name = f"{layer}_{face}"
            if name not in mesh.surfaces:
                continue
            ventricular, actuation = weights[layer]
            side, sign = "bottom", 1.0
            if face == "back":
                side, sign = ("bottom", -1.0) if like_shells else ("top", 1.0)
            loads.append(Pressure(name, mesh.surfaces[name], side, sign * ventricular, sign * actuation))
    return tuple(loads)


def valve_displacements(case: Case, mesh: DeviceMesh) -> dict[int, np.ndarray]:
    """Displacements (3,) in mm that move each valve node onto the ellipse, its arc length along the edge kept.

    Front nodes go to z > 0, back nodes to z < 0, nodes shared by both to z = 0; v = 0 (paper, Eqs. valve).
    """
    nodes = np.flatnonzero(mesh.on_valve)
    x = mesh.nodes[nodes, 0]
    half_width = np.abs(x).max()
    ellipse = ValveEllipse.from_perimeter(half_width, case.aspect_ratio)
    placed = ellipse.place(np.abs(x))
    back = np.zeros(len(mesh.nodes), bool)
    back[mesh.quads[mesh.face == 1]] = True
    side = np.where(back[nodes] & ~mesh.on_outer[nodes], -1.0, 1.0)
    z = np.where(mesh.on_outer[nodes], 0.0, placed[:, 1] * side)
    return {int(n): np.array([np.sign(xi) * p[0] - xi, 0.0, zi]) for n, xi, p, zi in zip(nodes, x, placed, z, strict=True)}


def perturbed(mesh: DeviceMesh, seed: int, amplitude: float) -> DeviceMesh:
    """The mesh with random heights (standard deviation ``amplitude`` in mm), but on the outer and the valve edge."""
    heights = np.random.default_rng(seed).normal(0.0, amplitude, len(mesh.nodes))
    nodes = mesh.nodes.copy()
    nodes[:, 2] += np.where(mesh.on_outer | mesh.on_valve, 0.0, heights)
    return replace(mesh, nodes=nodes)


def build_model(case: Case, mesh: DeviceMesh, *, like_shells: bool | None = None) -> Model:
    """Constraints and loads of a case on a mesh.

    ``like_shells`` (default: whether the element is a shell) puts pressures where CalculiX puts those of shells.

    Bricks: x = 0: u_x = 0 on all nodes; z = 0 at the outer edge: u_z = 0 on middle nodes, and u_x, u_y equal and u_z
    opposite on bottom and top. Valve: middle nodes prescribed at corners, bottom + top - 2 reference = 0 at mid-sides,
    so that the edge may rotate. Shells: the nodes of the mesh are prescribed.
    """
    shell = case.mesh.element.startswith("S8")
    if case.branch:
        mesh = perturbed(mesh, case.branch, PERTURBATION * case.device.material.thickness)
    expansion = expand(mesh, case.device.material.thickness)
    displacements = valve_displacements(case, mesh)
    loads = pressures(mesh, like_shells=shell if like_shells is None else like_shells)
    if shell:
        prescribed = {(n, d): float(u[d]) for n, u in displacements.items() for d in range(3)}
        return Model(case, mesh, expansion, mesh.nodes, len(mesh.nodes), prescribed, (), (), loads)

    bottom, middle, top = expansion.bottom, expansion.middle, expansion.top
    prescribed, fixed, equations, references = {}, [], [], []
    for node, u in displacements.items():
        if middle[node] >= 0:
            prescribed |= {(int(middle[node]), d): float(u[d]) for d in range(3)}
            continue
        reference = len(expansion.nodes) + len(references)
        references.append(mesh.nodes[node])
        prescribed |= {(reference, d): float(u[d]) for d in range(3)}
        equations += [Equation(((int(bottom[node]), d, 1.0), (int(top[node]), d, 1.0), (reference, d, -2.0))) for d in range(3)]
    taken = set(prescribed)
    for node in np.flatnonzero(mesh.on_axis):
        triple = (bottom[node], middle[node], top[node])
        fixed += [(int(n), 0) for n in triple if n >= 0 and (int(n), 0) not in taken]
    taken |= set(fixed)
    if mesh.symmetry != "full":
        for node in np.flatnonzero(mesh.on_outer):
            low, mid, high = int(bottom[node]), int(middle[node]), int(top[node])
            if mid >= 0 and (mid, 2) not in taken:
                fixed.append((mid, 2))
            signs = (-1.0, -1.0, 1.0)
            equations += [Equation(((low, d, 1.0), (high, d, signs[d]))) for d in range(3) if (low, d) not in taken]
    nodes = np.vstack([expansion.nodes, *references]) if references else expansion.nodes
    return Model(case, mesh, expansion, nodes, len(expansion.nodes), prescribed, tuple(fixed), tuple(equations), loads)


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
