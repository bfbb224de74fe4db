"""The pattern of a tangent, which takes the entries of those layers that touch, or are about to."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import csc_array

if TYPE_CHECKING:
    from limo.engines.newton.contact import ContactTangent


def widened(keys: np.ndarray, more: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rising ``keys`` (n,) with those of ``more`` that they lack, and where each of the n is then (n,)."""
    lacking = np.setdiff1d(more, keys)
    places = np.arange(len(keys)) + np.searchsorted(lacking, keys)
    return np.insert(keys, np.searchsorted(keys, lacking), lacking), places


class Patterned:
    """A tangent on a pattern of its own entries and of those of pairs of layers.

    ``indptr`` (size + 1,), ``indices``: the upper triangle in rows, columns rising, the diagonal first. ``mass``: the values of
    M on it, in tonne.
    """

    size: int
    indptr: np.ndarray
    indices: np.ndarray
    mass: np.ndarray
    _places: np.ndarray
    _from_faces: csc_array
    _contact: ContactTangent

    def _begin(self, keys: np.ndarray, places: np.ndarray, faces: tuple[np.ndarray, ...], count: int) -> None:
        """Take the pattern without contact.

        ``keys``: row times size plus column of its entries, rising. ``places``: where those of elements go, what goes nowhere
        behind the last. ``faces``: rows, columns, factors and sources of those of faces, of ``count``.
        """
        rows, columns, factors, sources = faces
        self._places = places.astype(np.int32)
        self._own = (
            keys,
            self._places,
            factors,
            np.searchsorted(keys, rows * self.size + columns),
            sources.astype(np.int32),
            count,
        )
        self._index(keys)

    def _index(self, keys: np.ndarray) -> None:
        self.indices = (keys % self.size).astype(np.int32)
        self.indptr = np.searchsorted(keys // self.size, np.arange(self.size + 1)).astype(np.int32)

    def touch(self, chosen: np.ndarray | None = None) -> None:
        """Take the entries of pairs ``chosen`` (q,), by default of all, into the pattern, and no others."""
        own, of_elements, factors, of_faces, sources, count = self._own
        keys, moved = widened(own, self._contact.choose(chosen))
        self._index(keys)
        self._places = np.append(moved, len(keys)).astype(np.int32)[of_elements]
        # by columns: element matrices are read in order
        self._from_faces = csc_array((factors, (moved[of_faces].astype(np.int32), sources)), shape=(len(keys), count))
        self.mass = np.zeros(len(keys))
        self.mass[moved] = self._own_mass
        self._contact.place(keys)

    @property
    def pairs(self) -> np.ndarray:
        """Which pairs (q,) of layers the pattern has the entries of."""
        return self._contact.chosen
