"""Layers that touch: front and back, and the endocardium and the epicardium of a pouch, as a penalty with an energy.

Middle surfaces of layers that lie on each other in the flat state may part, slide and come back, but not pass each other. With
delta = x_upper - x_lower of the same point of the flat state and a_1, a_2 the tangents of the mean of both surfaces,

    g = delta . (a_1 x a_2) / A_0,   Pi_c = int psi(g) w(|delta|) dA_0

A_0 dxi is the flat area, so that g is the gap along the common normal times the stretch of the area, and a polynomial: forces
and tangent are exact. The contact acts as a pressure p = -psi'(g) on both layers. Sliding is free. It begins at a gap of r:

    p = k (r - g)^2 / (4 r) for |g| < r,   p = -k g below

so that the tangent has no jump: with one, layers that lie on each other open and close from iteration to iteration. Points that
are far from each other do not touch, whatever the mean of their tangents says: beside a seam that is wide open it vanishes. So w
falls smoothly from one to zero between three and six thicknesses, by a polynomial with two continuous slopes. Layers that touch
are nearer to each other (a test). Layers that have slid further pass each other. In models with the plane of symmetry z = 0 the
inner layers have it for their other surface: g = z, whatever they slide.

r is a stated share of the thickness, and k is 100 kPa over r, by which layers then pass each other. It is the same for all
P_a,max, so that a case that goes further passes through the same states. What is left of gap and penetration is proportional
to r; Wriggers (2006), *Computational contact mechanics*, section 5.2. Units: mm, N, MPa.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from limo.mesh.elements import gauss, quad8_shape
from limo.mesh.layers import FACES, LAYERS, DeviceMesh

#: points a direction of a quadrilateral, as of the elements with reduced integration
POINTS = 2


@dataclass(frozen=True)
class Contact:
    """Which quadrilaterals may not pass what, by nodes of the mesh.

    ``plane`` (p, 8): those that stay at z >= 0. ``lower``, ``upper`` (q, 8): pairs, node by node at the same place of the flat
    state. ``penalty``: k in MPa / mm; ``reach``: r, and ``span``: how far points that touch may be from each other, both in mm.
    """

    plane: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    penalty: float
    reach: float
    span: float

    def weight(self, square: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """w, and its slope in 1 / mm^2, of |delta|^2 (...) in mm^2: one up to half of the span, zero beyond it."""
        start, end = 0.25 * self.span**2, self.span**2
        q = np.clip((square - start) / (end - start), 0.0, 1.0)
        return 1 - q**3 * (10 - 15 * q + 6 * q**2), -30 * (q * (1 - q)) ** 2 / (end - start)

    def pressure(self, gap: np.ndarray) -> np.ndarray:
        """p in MPa of gaps (...) in mm."""
        near = np.maximum(self.reach - gap, 0.0)
        return self.penalty * np.where(gap < -self.reach, -gap, near**2 / (4 * self.reach))

    def stiffness(self, gap: np.ndarray) -> np.ndarray:
        """-dp/dg in MPa / mm."""
        return self.penalty * np.clip((self.reach - gap) / (2 * self.reach), 0.0, 1.0)

    def energy(self, gap: np.ndarray) -> np.ndarray:
        """psi in N / mm."""
        near = np.maximum(self.reach - gap, 0.0)
        passed = 0.5 * gap**2 + self.reach**2 / 6
        return self.penalty * np.where(gap < -self.reach, passed, near**3 / (12 * self.reach))


def contact_of(
    mesh: DeviceMesh, *, front_back: bool, endo_epi: bool, penalty: float, reach: float, span: float
) -> Contact | None:
    """The contact of a device's layers; None where none may touch."""
    inner = mesh.layer != LAYERS.index("epi")
    front, back = (mesh.face == FACES.index(face) for face in ("front", "back"))
    none = np.empty((0, 8), int)
    plane, pairs = none, [(none, none)]
    if front_back and mesh.symmetry != "full":
        plane = mesh.quads[inner & front]
    elif front_back:
        pairs.append(_paired(mesh, inner & back, inner & front))
    if endo_epi:
        endo, epi = (mesh.layer == LAYERS.index(layer) for layer in ("endo", "epi"))
        # the epicardium is the outer one: above on the front, below on the back
        pairs += [_paired(mesh, endo & front, epi & front), _paired(mesh, epi & back, endo & back)]
    lower, upper = (np.vstack(each) for each in zip(*pairs, strict=True))
    return Contact(plane, lower, upper, penalty, reach, span) if len(plane) + len(lower) else None


def _paired(mesh: DeviceMesh, lower: np.ndarray, upper: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Quadrilaterals of two masks (m,), each beside that at its place of the flat state."""
    places = np.round(mesh.nodes[mesh.quads[:, :4], :2].mean(axis=1) * 1e4).astype(np.int64)
    ordered = [np.flatnonzero(mask)[np.lexsort(places[mask].T)] for mask in (lower, upper)]
    return mesh.quads[ordered[0]], mesh.quads[ordered[1]]


class Touching:
    """Energy and forces of a contact between surfaces that are at ``rest`` (n, 3) in mm before they move.

    At ``POINTS`` squared points: ``values`` (g, 8) of shape functions, their two ``slopes`` (g, 8), ``weights`` (g,), A_0 of
    pairs ``pair_area`` (q, g) and A_0 times weights of the plane ``plane_area`` (p, g).
    """

    def __init__(self, contact: Contact, rest: np.ndarray):
        self.contact, self._rest = contact, rest
        local, weights = gauss(POINTS, 2)
        self.values, slopes = quad8_shape(local)
        self.slopes = np.ascontiguousarray(slopes[:, :, 0]), np.ascontiguousarray(slopes[:, :, 1])
        self.plane_area = self._areas(contact.plane) * weights
        self.pair_area = self._areas(contact.lower)
        self.weights = weights

    def _areas(self, quads: np.ndarray) -> np.ndarray:
        return np.linalg.norm(np.cross(*self._tangents(self._rest[quads])), axis=-1)

    def gaps(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """g in mm at places x (n, 3): of the plane (p, g), and of pairs (q, g)."""
        return self._of_plane(x), self._of_pairs(*self._parts(x))

    def _of_plane(self, x: np.ndarray) -> np.ndarray:
        return np.einsum("gn,mn->mg", self.values, x[self.contact.plane, 2])

    def _of_pairs(self, delta: np.ndarray, first: np.ndarray, second: np.ndarray) -> np.ndarray:
        return np.einsum("mgk,mgk->mg", delta, np.cross(first, second)) / self.pair_area

    def passed(self, x: np.ndarray, by: float) -> tuple[np.ndarray, np.ndarray]:
        """Which points of the plane (p, g) and of pairs (q, g) that face the same way have passed by more than ``by`` mm."""
        plane, pairs = self.gaps(x)
        return plane < -by, (pairs < -by) & self.facing(x)

    def facing(self, x: np.ndarray) -> np.ndarray:
        """Whether both layers of pairs (q, g) face the same way."""
        lower, upper = (np.cross(*self._tangents(x[quads])) for quads in (self.contact.lower, self.contact.upper))
        return np.einsum("mgk,mgk->mg", lower, upper) > 0

    def _tangents(self, nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """a_1 and a_2 (q, g, 3) of quadrilaterals with nodes (q, 8, 3)."""
        return tuple(np.einsum("gn,mnk->mgk", slope, nodes) for slope in self.slopes)

    def _parts(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """delta, a_1 and a_2 (q, g, 3) of pairs."""
        lower, upper = x[self.contact.lower], x[self.contact.upper]
        return np.einsum("gn,mnk->mgk", self.values, upper - lower), *self._tangents(0.5 * (lower + upper))

    def near(self, x: np.ndarray, beyond: float = 0.0) -> np.ndarray:
        """Pairs (q,) that touch at places x (n, 3), or have a gap of less than ``beyond`` mm above the reach of the contact."""
        parts = self._parts(x)
        weight, _ = self.contact.weight((parts[0] ** 2).sum(axis=-1))
        return self._touch(self._of_pairs(*parts), weight, beyond)

    def _touch(self, gaps: np.ndarray, weights: np.ndarray, beyond: float = 0.0) -> np.ndarray:
        """Pairs (q,) with gaps (q, g) below the reach at points that are not far from each other."""
        return ((gaps < self.contact.reach + beyond) & (weights > 0)).any(axis=1)

    def energy(self, x: np.ndarray) -> float:
        """Pi_c in N mm at places x (n, 3)."""
        contact, parts = self.contact, self._parts(x)
        weight, _ = contact.weight((parts[0] ** 2).sum(axis=-1))
        plane, pairs = self._of_plane(x), self._of_pairs(*parts)
        of_plane = self.plane_area * contact.energy(plane)
        return float(of_plane.sum() + (self.pair_area * self.weights * weight * contact.energy(pairs)).sum())

    def forces(self, x: np.ndarray) -> np.ndarray:
        """dPi_c / dx (n, 3) in N: what the contact adds to the internal forces."""
        total, contact, (delta, first, second) = self.forces_of_plane(x), self.contact, self._parts(x)
        pairs = self._of_pairs(delta, first, second)
        weight, slope = contact.weight((delta**2).sum(axis=-1))
        if (near := np.flatnonzero(self._touch(pairs, weight))).size:
            delta, gaps = delta[near], pairs[near]
            push = -self.weights * weight[near] * contact.pressure(gaps)
            found = np.einsum("mg,mgnk->mnk", push, self._gradients(delta, first[near], second[near]))
            apart = 2 * self.weights * self.pair_area[near] * slope[near] * contact.energy(gaps)
            pulled = np.einsum("mg,gn,mgk->mnk", apart, self.values, delta)
            found += np.concatenate([-pulled, pulled], axis=1)
            np.add.at(total, np.hstack([self.contact.lower[near], self.contact.upper[near]]), found)
        return total

    def forces_of_plane(self, x: np.ndarray) -> np.ndarray:
        """As ``forces``, of the plane of symmetry alone."""
        total = np.zeros(x.shape)
        pushed = -np.einsum("gn,mg->mn", self.values, self.plane_area * self.contact.pressure(self._of_plane(x)))
        np.add.at(total[:, 2], self.contact.plane, pushed)
        return total

    def _gradients(self, delta: np.ndarray, first: np.ndarray, second: np.ndarray) -> np.ndarray:
        """d(A_0 g) / dx (q, g, 16, 3) of the nodes below, then above."""
        across, one, two = np.cross(first, second), np.cross(second, delta), np.cross(delta, first)
        mean = 0.5 * sum(s[None, :, :, None] * v[:, :, None] for s, v in zip(self.slopes, (one, two), strict=True))
        apart = self.values[None, :, :, None] * across[:, :, None]
        return np.concatenate([mean - apart, mean + apart], axis=2)
