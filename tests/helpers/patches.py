"""Patches of the fabric layer with known deformations: flat, cylindrical and spherical, as models without constraints."""

from __future__ import annotations

import numpy as np

from limo.cases.case import Case
from limo.mechanics.build import described
from limo.mechanics.model import Model, Pressure, expand
from limo.mesh.layers import DeviceMesh


def grid(nx: int, ny: int) -> tuple[np.ndarray, np.ndarray]:
    """Quadrilaterals of 8 nodes on the square [-1, 1]^2: nodes (n, 2) and quads (nx ny, 8)."""
    number, points = {}, []

    def node(i: int, j: int) -> int:  # half steps
        if (i, j) not in number:
            number[i, j] = len(points)
            points.append((i / nx - 1.0, j / ny - 1.0))
        return number[i, j]

    around = ((0, 0), (2, 0), (2, 2), (0, 2), (1, 0), (2, 1), (1, 2), (0, 1))
    quads = [[node(2 * a + i, 2 * b + j) for i, j in around] for b in range(ny) for a in range(nx)]
    return np.array(points), np.array(quads)


def crooked(n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The same, n by n, with straight sides and corners within moved at random; and which nodes are within (n,)."""
    points, quads = grid(n, n)
    corner = np.zeros(len(points), bool)
    corner[quads[:, :4]] = True
    inner = (np.abs(points) < 1 - 1e-9).all(axis=1)
    moves = np.random.default_rng(1).uniform(-0.15, 0.15, points.shape)
    points = points + np.where((corner & inner)[:, None], moves, 0.0)
    for k in range(4):
        points[quads[:, 4 + k]] = 0.5 * (points[quads[:, k]] + points[quads[:, (k + 1) % 4]])
    return points, quads, inner


def patch_mesh(points: np.ndarray, quads: np.ndarray, layer: int = 2) -> DeviceMesh:
    """A mesh of one layer without edges or seams from ``points`` (n, 3)."""
    none = np.zeros(len(points), bool)
    m = len(quads)
    return DeviceMesh(
        points, quads, np.full(m, layer), np.zeros(m, int), np.zeros(m, int), none, none, none, none, symmetry="full"
    )


def patch_model(case: Case, mesh: DeviceMesh, nodes: np.ndarray | None = None) -> Model:
    """A model of the patch, loaded by P_a from below, with other brick nodes (n, 3) in mm if given."""
    shell = expand(mesh, described(case)["fabric"].layer)
    if nodes is not None:
        shell = type(shell)(nodes, shell.bricks, shell.bottom, shell.middle, shell.top)
    load = Pressure("epi_front", np.arange(len(mesh.quads)), "bottom", 0.0, 1.0)
    return Model(
        **described(case),
        mesh=mesh,
        expansion=shell,
        nodes=shell.nodes,
        reference_start=len(shell.nodes),
        prescribed={},
        fixed=(),
        equations=(),
        pressures=(load,),
    )


def curved_patch(case: Case, kind: str, radius: float, stretch: float, elements: int, angle: float = 0.3):
    """A patch of a cylinder (axis y, no axial strain) or a sphere of ``radius`` mm, inflated by ``stretch`` in plane stress.

    Returns the model, the displacements (n, 3), and the closed forms: Cauchy stress (MPa) around the axis and along
    the axis, and the pressure (kPa) inside that holds them: t / r times the stress in each curved direction.
    """
    flat, quads = grid(elements, elements)
    a = flat * angle / 2
    if kind == "cylinder":
        normal = np.stack([np.sin(a[:, 0]), 0 * a[:, 0], np.cos(a[:, 0])], axis=1)
        base = radius * normal + np.stack([0 * a[:, 0], radius * a[:, 1], 0 * a[:, 0]], axis=1)
        curved = 1
    else:
        normal = np.stack([np.tan(a[:, 0]), np.tan(a[:, 1]), np.ones(len(a))], axis=1)
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        base, curved = radius * normal, 2
    material = case.device.material
    e, nu, t = material.youngs_modulus, material.poisson_ratio, material.thickness
    strain = 0.5 * (stretch**2 - 1)
    thin = np.sqrt(1 - 2 * nu / (1 - nu) * curved * strain)  # E_33 = -nu / (1 - nu) (E_11 + E_22)
    mesh = patch_mesh(base, quads)
    shell = expand(mesh, t)
    height = np.empty(len(shell.nodes))
    owner = np.empty(len(shell.nodes), int)
    for numbers, z in ((shell.bottom, -t / 2), (shell.top, t / 2), (shell.middle[mesh.is_corner], 0.0)):
        height[numbers] = z
    owner[shell.bottom] = owner[shell.top] = np.arange(len(base))
    owner[shell.middle[mesh.is_corner]] = np.flatnonzero(mesh.is_corner)
    model = patch_model(case, mesh, base[owner] + height[:, None] * normal[owner])
    moved = ((stretch - 1) * radius + (thin - 1) * height)[:, None] * normal[owner]
    second = e / (1 - nu**2) * (strain + (nu * strain if curved == 2 else 0.0))
    across = e / (1 - nu**2) * (nu * strain + (strain if curved == 2 else 0.0))
    hoop = stretch**2 * second / (stretch**curved * thin)
    other = hoop if curved == 2 else across / (stretch * thin)
    r, t_now = stretch * radius, t * thin
    pressure = 1e3 * curved * hoop * t_now / r * (r / (r - t_now / 2)) ** curved  # it acts on the inner surface
    return model, moved, hoop, other, pressure
