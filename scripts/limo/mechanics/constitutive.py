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


def plane_stress(youngs_modulus: np.ndarray, poisson_ratio: np.ndarray | float) -> np.ndarray:
    """Q_11, Q_12, Q_16, Q_22, Q_26, Q_66 and G_44, G_45, G_55 (m, 9) of fabric without stress across it, in the unit of E (m,).

    S_ab = Q_abcd E_cd follows from S = lambda tr(E) I + 2 mu E with E_33 such that S_33 = 0: Q_11 = E / (1 - nu^2).
    """
    modulus = np.asarray(youngs_modulus, float)
    stiff, none = modulus / (1 - poisson_ratio**2), np.zeros_like(modulus)
    shear = modulus / (2 * (1 + poisson_ratio))
    return np.stack([stiff, poisson_ratio * stiff, none, stiff, none, shear, shear, none, shear], axis=-1)


#: order of components of strains (with twice the shear) and stresses as vectors
COMPONENTS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))


def isotropic(youngs_modulus: float, poisson_ratio: float) -> np.ndarray:
    """C (6, 6) of S = lambda tr(E) I + 2 mu E in the order of ``COMPONENTS``, in the unit of E."""
    shear = youngs_modulus / (2 * (1 + poisson_ratio))
    found = np.diag([2 * shear] * 3 + [shear] * 3)
    found[:3, :3] += youngs_modulus * poisson_ratio / ((1 + poisson_ratio) * (1 - 2 * poisson_ratio))
    return found


def orthotropic(warp: float, weft: float, poisson_ratio: float, shear: float, angle: float) -> np.ndarray:
    """C (6, 6) of a woven layer in the flat device's axes x, y, z: S = C : E, in the order of ``COMPONENTS``, in the unit of E_1.

    E_1 and E_2 along warp and weft, nu_12, G_12, and the ``angle`` in degrees of the warp to y, positive towards x. Along the
    yarns

        E_11 = S_11 / E_1 - nu_12 S_22 / E_1,   E_22 = S_22 / E_2 - nu_12 S_11 / E_1,   E_12 = S_12 / (2 G_12)

    A layer without stress across it feels nothing else. Across it, where a fabric has no measured moduli, E_3 = sqrt(E_1 E_2),
    nu_ij = nu sqrt(E_i / E_j) with the nu of nu_12, and G_13 = G_23 = G_12: equal moduli are those of an isotropic layer.
    """
    e1, e2, e3, n12, n13, n23, *shears = engineering_constants(warp, weft, poisson_ratio, shear)
    compliance = np.diag([1 / e1, 1 / e2, 1 / e3, *(1 / g for g in shears)])
    for (i, j), value in {(0, 1): -n12 / e1, (0, 2): -n13 / e1, (1, 2): -n23 / e2}.items():
        compliance[i, j] = compliance[j, i] = value
    turned = strain_along(angle)
    return turned.T @ np.linalg.inv(compliance) @ turned


def engineering_constants(warp: float, weft: float, poisson_ratio: float, shear: float) -> tuple[float, ...]:
    """E_1, E_2, E_3, nu_12, nu_13, nu_23, G_12, G_13, G_23 of yarns, as ``orthotropic`` has them."""
    across = (warp * weft) ** 0.5
    mean = poisson_ratio * (weft / warp) ** 0.5
    ratios = (poisson_ratio, mean * (warp / across) ** 0.5, mean * (weft / across) ** 0.5)
    return (warp, weft, across, *ratios, shear, shear, shear)


def warp_and_weft(angle: float) -> np.ndarray:
    """Unit vectors (3, 3) along warp, weft and the layer's normal, as rows; ``angle`` in degrees as of ``orthotropic``."""
    sine, cosine = np.sin(np.radians(angle)), np.cos(np.radians(angle))
    return np.array([[sine, cosine, 0.0], [-cosine, sine, 0.0], [0.0, 0.0, 1.0]])


def strain_along(angle: float) -> np.ndarray:
    """(6, 6): strains as vectors along x, y, z -> along warp, weft and normal; its transpose takes stresses back."""
    r = warp_and_weft(angle)
    found = np.empty((6, 6))
    for a, (i, j) in enumerate(COMPONENTS):
        for b, (k, m) in enumerate(COMPONENTS):
            both = r[i, k] * r[j, m] if k == m else r[i, k] * r[j, m] + r[i, m] * r[j, k]
            found[a, b] = both * (1 if i == j else 2) / (1 if k == m else 2)
    return found


def condensed(stiffness: np.ndarray) -> np.ndarray:
    """Q_11 to Q_66 and G_44, G_45, G_55 (m, 9) as of ``plane_stress``, of layers with C (m, 6, 6) and no stress across them."""
    along, third = [0, 1, 3], stiffness[:, 2, 2][:, None, None]
    plane = stiffness[:, along][:, :, along]
    plane = plane - stiffness[:, along][:, :, [2]] * stiffness[:, [2]][:, :, along] / third
    rows, columns = np.array([0, 0, 0, 1, 1, 2]), np.array([0, 1, 2, 1, 2, 2])
    across = stiffness[:, [5, 5, 4], [5, 4, 4]]
    return np.ascontiguousarray(np.column_stack([plane[:, rows, columns], across]))


def stress_of(strain: np.ndarray, stiffness: np.ndarray) -> np.ndarray:
    """S = C : E (m, g, 3, 3) of strains (m, g, 3, 3) with C (m, 6, 6), in the unit of C."""
    vector = np.stack([strain[..., i, j] * (1 if i == j else 2) for i, j in COMPONENTS], axis=-1)
    found, along = np.empty(strain.shape), np.einsum("mab,mgb->mga", stiffness, vector)
    for a, (i, j) in enumerate(COMPONENTS):
        found[..., i, j] = found[..., j, i] = along[..., a]
    return found


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
