"""What the contact of layers adds to forces and to a tangent, by compiled loops."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from limo.engines.newton import contact_kernels
from limo.engines.newton.entries import entries_of
from limo.engines.newton.kernels import PAIRS
from limo.engines.newton.pattern import Additions
from limo.mechanics.contact import Contact, Touching

if TYPE_CHECKING:
    from limo.engines.newton.assembly import Assembly
    from limo.engines.newton.shell import Directors, ShellAssembly
    from limo.engines.newton.unknowns import Unknowns
    from limo.mechanics.model import Model


class CompiledTouching(Touching):
    """As ``Touching``, with its loops over pairs compiled."""

    def __init__(self, contact: Contact, rest: np.ndarray):
        super().__init__(contact, rest)
        self._pairs = tuple(np.ascontiguousarray(each, np.int64) for each in (contact.lower, contact.upper))
        points = self.values, *self.slopes, self.pair_area
        self._points = tuple(np.ascontiguousarray(each) for each in points)

    @classmethod
    def of(cls, model: Model) -> CompiledTouching | None:
        """As ``Model.touching``."""
        return None if model.contact is None else cls(model.contact, model.mesh.nodes)

    def forces(self, x: np.ndarray) -> np.ndarray:
        contact, total = self.contact, self.forces_of_plane(x)
        law = contact.penalty, contact.reach, contact.span
        contact_kernels.pair_forces(np.ascontiguousarray(x), *self._pairs, *self._points, self.weights, *law, total)
        return total

    def near(self, x: np.ndarray, beyond: float = 0.0) -> np.ndarray:
        found, law = np.empty(len(self.contact.lower), bool), (self.contact.reach + beyond, self.contact.span)
        contact_kernels.pairs_near(np.ascontiguousarray(x), *self._pairs, *self._points, *law, found)
        return found


class ContactTangent:
    """The tangent of an assembly's contact on unknowns, of all pairs of layers or of some; nothing where no layers touch."""

    def __init__(self, assembly: Assembly | ShellAssembly, unknowns: Unknowns | Directors):
        self._additions: Additions | None = None
        self._assembly = assembly
        self.chosen = np.empty(0, bool)
        if assembly.touching is None:
            return
        contact = assembly.touching.contact
        pairs = np.hstack([contact.lower, contact.upper])
        self._per = 16 * len(PAIRS) * 16
        self._of_plane = self._entries(contact.plane, ((2, 2),), unknowns)
        self._of_pairs = self._entries(pairs, PAIRS, unknowns)
        self.chosen = np.ones(len(pairs), bool)

    def _entries(self, nodes: np.ndarray, directions: tuple, unknowns: Unknowns | Directors) -> tuple[np.ndarray, ...]:
        """As ``entries_of``, of the tangents of quadrilaterals or of pairs."""
        slots, shares = unknowns.middle(nodes, self._assembly.model.expansion)
        keys, factors, found = entries_of(slots, unknowns, directions, shares)
        per, count = nodes.shape[1], len(directions)
        element, n, part, m = np.unravel_index(found, (len(nodes), slots.shape[1], count, slots.shape[1]))
        sources = ((element * per + n % per) * count + part) * per + m % per
        return keys, factors, sources.astype(np.int32)

    def choose(self, chosen: np.ndarray | None = None) -> np.ndarray:
        """Keep the entries of pairs ``chosen`` (q,), by default of all; their places in a pattern, row times size plus column."""
        if self._assembly.touching is None:
            return np.empty(0, np.int64)
        keys, factors, sources = self._of_pairs
        self.chosen = np.ones(len(self.chosen), bool) if chosen is None else chosen
        kept = self.chosen[sources // self._per]
        number = np.cumsum(self.chosen) - 1
        source = sources[kept]
        source = number[source // self._per] * self._per + source % self._per
        before = self._count_of_plane
        self._keys = np.concatenate([self._of_plane[0], keys[kept]])
        self._kept = np.concatenate([self._of_plane[1], factors[kept]]), np.concatenate([self._of_plane[2], before + source])
        return self._keys

    @property
    def _count_of_plane(self) -> int:
        return 64 * len(self._assembly.touching.contact.plane)

    def place(self, unique: np.ndarray) -> None:
        """Look up where the entries that are kept go in a pattern with rising keys ``unique``."""
        if self._assembly.touching is not None:
            factors, sources = self._kept
            self._additions = Additions.of(np.searchsorted(unique, self._keys), sources, factors)

    def add(self, values: np.ndarray, u: np.ndarray) -> None:
        """Add the tangent at displacements u (n, 3) to the values of a pattern."""
        if self._additions is not None:
            tangents = tangent_of(self._assembly.touching, self._assembly.model.middle(u), self.chosen)
            self._additions.add(np.concatenate([each.ravel() for each in tangents]), values)


def tangent_of(touching: Touching, x: np.ndarray, chosen: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """d^2 Pi_c / dx^2 in N/mm at places x (n, 3): of the plane (p, 8, 8), directions z and z, and of pairs (q, 16, 6, 16).

    ``chosen``: which pairs, by default all.

    The six: directions (0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2), the second of each with the last axis.
    """
    contact, values = touching.contact, touching.values
    plane = np.einsum("gn,mn->mg", values, x[contact.plane, 2])
    stiff = touching.plane_area * contact.stiffness(plane)
    of_plane = np.einsum("gn,gp,mg->mnp", values, values, stiff, optimize=True)
    chosen = slice(None) if chosen is None else chosen
    pairs = tuple(np.ascontiguousarray(each[chosen], np.int64) for each in (contact.lower, contact.upper))
    of_pairs = np.empty((len(pairs[0]), 16, len(PAIRS), 16))
    points = values, *touching.slopes, np.ascontiguousarray(touching.pair_area[chosen]), touching.weights
    contact_kernels.pair_tangents(
        np.ascontiguousarray(x), *pairs, *points, contact.penalty, contact.reach, contact.span, of_pairs
    )
    return of_plane, of_pairs
