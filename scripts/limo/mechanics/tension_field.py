"""What a sheet carries in compression that wrinkles would not carry: a tension field's energy beside that of a state.

Thin fabric hardly resists compression: it wrinkles. Of the principal Green-Lagrange strains E_1 >= E_2 of its middle surface and

    W = E / (2 (1 - nu^2)) (E_1^2 + E_2^2 + 2 nu E_1 E_2)

a sheet with wrinkles as fine as it likes keeps (Pipkin 1986, *IMA J. Appl. Math.* 36, 85-99)

    W_r = W          taut,      E_2 >= -nu E_1
    W_r = E E_1^2/2  wrinkled,  E_2 < -nu E_1 and E_1 > 0
    W_r = 0          slack,     E_1 <= 0

Yarns count as isotropic fabric of the same mean modulus: what is compared is of the order of one.

A mesh that follows its wrinkles has strains of both signs from crest to crest, which cancel over a few elements. One that rests
flat against its own compression, locked, has not. So strains are averaged over neighbouring elements before they are compared.

Thick fabric carries compression by its bending stiffness D. Under a tension T wrinkles of the length l are

    lambda = 2 sqrt(pi l) (D / T)^(1/4)

wide (Cerda, Mahadevan 2003, *Phys. Rev. Lett.* 90, 074302). Only meshes that do not follow waves of this width can lock.
"""

from __future__ import annotations

import numpy as np

from limo.mechanics.layer import flat_areas
from limo.mechanics.model import KPA, Model
from limo.mechanics.shell import axes_of
from limo.mesh.elements import gauss, quad8_shape

#: how often strains are averaged over an element and those that share a corner with it
AVERAGED = 2


def membrane_strain(model: Model, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean Green-Lagrange strain (m, 2, 2) of every element's middle surface at nodes (n, 3) in mm, and its area (m,) in mm^2.

    At the 2 x 2 Gauss points, along two axes in the sheet before it is loaded; x first.
    """
    _, slopes = quad8_shape(gauss(2, 2)[0])
    before, now = (np.einsum("gnd,mnk->mgkd", slopes, x[model.mesh.quads]) for x in (model.mesh.nodes, points))
    along = np.swapaxes(axes_of(before)[..., :2], -1, -2)
    gradient = now @ np.linalg.inv(along @ before)
    strain = 0.5 * (np.swapaxes(gradient, -1, -2) @ gradient - np.eye(2))
    area = flat_areas(model.mesh)
    return np.einsum("mgij,mg->mij", strain, area) / area.sum(axis=1)[:, None, None], area.sum(axis=1)


def averaged(model: Model, values: np.ndarray, area: np.ndarray, times: int = AVERAGED) -> np.ndarray:
    """Values (m, ...) of elements averaged over those of the same layer and face that share a corner with each, by area (m,)."""
    mesh = model.mesh
    part = mesh.layer + (mesh.layer.max() + 1) * getattr(mesh, "face", 0)
    corners, count = mesh.quads[:, : model.element.corners], len(mesh.nodes)
    _, corner = np.unique(corners + count * part[:, None], return_inverse=True)
    corner = corner.reshape(corners.shape)
    total = np.bincount(corner.ravel(), np.repeat(area, corners.shape[1]))
    flat = values.reshape(len(values), -1)
    for _ in range(times):
        weighted = np.repeat(flat * area[:, None], corners.shape[1], axis=0).T
        means = np.stack([np.bincount(corner.ravel(), column) for column in weighted], axis=1) / total[:, None]
        flat = means[corner].mean(axis=1)
    return flat.reshape(values.shape)


def energies(strain: np.ndarray, modulus: np.ndarray, poisson_ratio: np.ndarray | float) -> tuple[np.ndarray, np.ndarray]:
    """W and W_r (m,) in MPa of strains (m, 2, 2) and E (m,) in MPa."""
    mean, half = 0.5 * (strain[:, 0, 0] + strain[:, 1, 1]), 0.5 * (strain[:, 0, 0] - strain[:, 1, 1])
    radius = np.hypot(half, strain[:, 0, 1])
    first, second = mean + radius, mean - radius
    whole = modulus / (2 * (1 - poisson_ratio**2)) * (first**2 + second**2 + 2 * poisson_ratio * first * second)
    wrinkled = np.where(first > 0, 0.5 * modulus * first**2, 0.0)
    return whole, np.where((first > 0) & (second >= -poisson_ratio * first), whole, wrinkled)


def compression_share(model: Model, points: np.ndarray) -> float:
    """int (W - W_r) dA / int W dA of strains averaged over neighbours, nodes at ``points`` (n, 3) in mm; 0 without any strain.

    0: all that is stored a tension field stores, too. 1: all of it is compression that wrinkles would take away.
    """
    strain, area = membrane_strain(model, points)
    whole, relaxed = energies(averaged(model, strain, area), model.youngs_modulus, model.poisson_ratio)
    stored = float(whole @ area)
    return float((whole - relaxed) @ area) / stored if stored > 0 else 0.0


def elements_a_wrinkle(model: Model) -> float:
    """lambda of a device under P_v over the mean size of its elements.

    With the area A of a face: l = sqrt(A) / 2 and T = P_v sqrt(A) / 4, as of a sphere of that size.
    """
    areas, fabric = flat_areas(model.mesh).sum(axis=1), model.fabric
    side = np.sqrt(areas[model.mesh.layer <= 1].sum() * model.mesh.copies / 2)
    modulus, thickness = model.youngs_modulus.min(), fabric.layer
    bending = modulus * thickness**3 / (12 * (1 - fabric.poisson_ratio**2))
    tension = KPA * model.loading.ventricular_pressure * side / 4
    width = 2 * np.sqrt(np.pi * side / 2) * (bending / tension) ** 0.25
    return float(width / np.sqrt(areas.mean()))
