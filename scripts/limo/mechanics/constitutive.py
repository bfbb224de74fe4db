"""Stress from strain: St. Venant-Kirchhoff, its push forward to the deformed device, and scalars of both (paper)."""

from __future__ import annotations

import numpy as np


def second_piola_kirchhoff(strain: np.ndarray, lame_lambda: np.ndarray | float, lame_mu: np.ndarray | float) -> np.ndarray:
    """S = lambda tr(E) I + 2 mu E (paper, Eq. stvenantkirchhoff), shapes (..., 3, 3), in the unit of the moduli.

    The moduli have the shape of the strain less (3, 3), or broadcast to it.
    """
    trace = np.trace(strain, axis1=-2, axis2=-1)
    lam, mu = np.asarray(lame_lambda, float), np.asarray(lame_mu, float)
    return (lam * trace)[..., None, None] * np.eye(3) + 2.0 * mu[..., None, None] * strain


def plane_stress(youngs_modulus: np.ndarray, poisson_ratio: float) -> np.ndarray:
    """Q_11, Q_12, Q_16, Q_22, Q_26, Q_66 and G_44, G_45, G_55 (m, 9) of fabric without stress across it, in the unit of E (m,).

    S_ab = Q_abcd E_cd follows from S = lambda tr(E) I + 2 mu E with E_33 such that S_33 = 0: Q_11 = E / (1 - nu^2).
    """
    modulus = np.asarray(youngs_modulus, float)
    stiff, none = modulus / (1 - poisson_ratio**2), np.zeros_like(modulus)
    shear = modulus / (2 * (1 + poisson_ratio))
    return np.stack([stiff, poisson_ratio * stiff, none, stiff, none, shear, shear, none, shear], axis=-1)


def cauchy(deformation: np.ndarray, second_piola: np.ndarray) -> np.ndarray:
    """sigma = F S F^T / det F, shapes (..., 3, 3), in the unit of S: the paper's pull-back S = J F^-1 sigma F^-T inverted."""
    pushed = deformation @ second_piola @ np.swapaxes(deformation, -1, -2)
    return pushed / np.linalg.det(deformation)[..., None, None]


def von_mises(stress: np.ndarray) -> np.ndarray:
    """sqrt(3/2 s : s) with s = sigma - tr(sigma) / 3 I, shape of ``stress`` (..., 3, 3) less (3, 3), in its unit."""
    mean = np.trace(stress, axis1=-2, axis2=-1) / 3.0
    deviator = stress - mean[..., None, None] * np.eye(3)
    return np.sqrt(1.5 * np.einsum("...ij,...ij->...", deviator, deviator))


def principal(tensor: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Principal values (..., n), largest first, and unit directions (..., n, n) of symmetric tensors (..., n, n).

    ``directions[..., i, :]`` belongs to ``values[..., i]``: E v_i = E_i v_i (paper, *Principal strain fields*). The sign of
    a direction means nothing.
    """
    values, vectors = np.linalg.eigh(0.5 * (tensor + np.swapaxes(tensor, -1, -2)))
    return values[..., ::-1], np.swapaxes(vectors[..., ::-1], -1, -2)
