"""Deformation, strain and stress of the brick layer from reference and displaced nodes (paper, Eqs. kinematics)."""

from __future__ import annotations

import numpy as np

from limo.mechanics.constitutive import stress_of
from limo.mesh.elements import gauss, hex20_shape


def deformation_gradient(
    nodes: np.ndarray, bricks: np.ndarray, displacements: np.ndarray, local: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """F = I + du/dX (m, g, 3, 3) and the reference Jacobian determinant (m, g) at local points (g, 3).

    ``nodes`` and ``displacements`` (n, 3) in mm, ``bricks`` (m, 20).
    """
    _, slopes = hex20_shape(local)
    jacobian = np.einsum("gnd,mnk->mgkd", slopes, nodes[bricks])  # dX_k / dxi_d
    gradient = np.einsum("gnd,mnk->mgkd", slopes, displacements[bricks])  # du_k / dxi_d
    return np.eye(3) + gradient @ np.linalg.inv(jacobian), np.linalg.det(jacobian)


def green_lagrange(deformation: np.ndarray) -> np.ndarray:
    """E = (F^T F - I) / 2, shapes (..., 3, 3)."""
    return 0.5 * (np.swapaxes(deformation, -1, -2) @ deformation - np.eye(3))


def lame(youngs_modulus: np.ndarray | float, poisson_ratio: np.ndarray | float) -> tuple[np.ndarray, np.ndarray]:
    """lambda = E nu / ((1 + nu)(1 - 2 nu)), mu = E / (2 (1 + nu)), in the unit of E."""
    modulus = np.asarray(youngs_modulus, float)
    return modulus * poisson_ratio / ((1 + poisson_ratio) * (1 - 2 * poisson_ratio)), modulus / (2 * (1 + poisson_ratio))


def energy_density(strain: np.ndarray, lame_lambda: np.ndarray, lame_mu: np.ndarray) -> np.ndarray:
    """St. Venant-Kirchhoff psi = lambda / 2 tr(E)^2 + mu tr(E^2) (paper, Eq. stvenantkirchhoff); MPa, shape of E less (3, 3)."""
    trace = np.trace(strain, axis1=-2, axis2=-1)
    return 0.5 * lame_lambda * trace**2 + lame_mu * np.einsum("...ij,...ij->...", strain, strain)


def energy_and_extremes(
    nodes: np.ndarray,
    bricks: np.ndarray,
    displacements: np.ndarray,
    youngs_modulus: np.ndarray,
    poisson_ratio: np.ndarray | float,
    points: int = 2,
    stiffness: np.ndarray | None = None,
) -> tuple[float, float, float]:
    """Strain energy of the bricks in N mm; of the points the smallest det F and the smallest stretch across the layer, |F e_z|.

    A det F that is not positive is that of an element turned inside out. Layers lie in planes of constant z.

    ``youngs_modulus`` (m,) in MPa, or C ``stiffness`` (m, 6, 6) in its place; ``points`` Gauss points a direction: two are
    those of C3D20R, three those of C3D20, with which the energy is that of the discrete model itself.
    """
    local, weights = gauss(points, 3)
    deformation, jacobian = deformation_gradient(nodes, bricks, displacements, local)
    strain = green_lagrange(deformation)
    if stiffness is None:
        lam, mu = lame(youngs_modulus, poisson_ratio)
        density = energy_density(strain, lam[:, None], mu[:, None])
    else:
        density = 0.5 * np.einsum("...ij,...ij->...", strain, stress_of(strain, stiffness))
    energy = float(np.einsum("mg,mg,g->", density, jacobian, weights))
    return energy, float(np.linalg.det(deformation).min()), float(np.linalg.norm(deformation[..., 2], axis=-1).min())
