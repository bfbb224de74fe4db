"""What the contact of layers adds to a tangent."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import csc_array

from limo.engines.newton import contact_kernels
from limo.engines.newton.entries import entries_of
from limo.engines.newton.kernels import PAIRS

if TYPE_CHECKING:
    from limo.engines.newton.assembly import Assembly
    from limo.engines.newton.shell import Directors, ShellAssembly
    from limo.engines.newton.unknowns import Unknowns
    from limo.mechanics.contact import Touching


class ContactTangent:
    """The tangent of an assembly's contact on unknowns; nothing where no layers touch.

    ``keys``: row times size plus column of each entry that it needs in a pattern.
    """

    def __init__(self, assembly: Assembly | ShellAssembly, unknowns: Unknowns | Directors):
        self._matrix: csc_array | None = None
        self.keys = np.empty(0, np.int64)
        if assembly.touching is None:
            return
        contact = assembly.touching.contact
        pairs = np.hstack([contact.lower, contact.upper])
        rows, columns, factors, sources, before = [], [], [], [], 0
        for nodes, directions in ((contact.plane, ((2, 2),)), (pairs, PAIRS)):
            slots, shares = unknowns.middle(nodes, assembly.model.expansion)
            found = entries_of(slots, unknowns, directions, shares)
            per, count = nodes.shape[1], len(directions)
            element, n, part, m = np.unravel_index(found[3], (len(nodes), slots.shape[1], count, slots.shape[1]))
            rows.append(found[0])
            columns.append(found[1])
            factors.append(found[2])
            sources.append(before + ((element * per + n % per) * count + part) * per + m % per)
            before += len(nodes) * per * count * per
        self.keys = np.concatenate(rows).astype(np.int64) * unknowns.size + np.concatenate(columns)
        self._entries = np.concatenate(factors), np.concatenate(sources), before

    def place(self, unique: np.ndarray) -> None:
        """Look up where entries go in a pattern with rising keys ``unique``."""
        if len(self.keys):
            factors, sources, count = self._entries
            places = np.searchsorted(unique, self.keys).astype(np.int32)
            self._matrix = csc_array((factors, (places, sources.astype(np.int32))), shape=(len(unique), count))

    def add(self, values: np.ndarray, assembly: Assembly | ShellAssembly, u: np.ndarray) -> None:
        """Add the tangent at displacements u (n, 3) to the values of a pattern."""
        if self._matrix is not None:
            tangents = tangent_of(assembly.touching, assembly.model.middle(u))
            values[: self._matrix.shape[0]] += self._matrix @ np.concatenate([each.ravel() for each in tangents])


def tangent_of(touching: Touching, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """d^2 Pi_c / dx^2 in N/mm at places x (n, 3): of the plane (p, 8, 8), directions z and z, and of pairs (q, 16, 6, 16).

    The six: directions (0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2), the second of each with the last axis.
    """
    contact, values = touching.contact, touching.values
    plane = np.einsum("gn,mn->mg", values, x[contact.plane, 2])
    stiff = touching.plane_area * contact.stiffness(plane)
    of_plane = np.einsum("gn,gp,mg->mnp", values, values, stiff, optimize=True)
    of_pairs = np.empty((len(contact.lower), 16, len(PAIRS), 16))
    pairs = np.ascontiguousarray(contact.lower, np.int64), np.ascontiguousarray(contact.upper, np.int64)
    points = values, *touching.slopes, touching.pair_area, touching.weights
    contact_kernels.pair_tangents(
        np.ascontiguousarray(x), *pairs, *points, contact.penalty, contact.reach, contact.span, of_pairs
    )
    return of_plane, of_pairs
