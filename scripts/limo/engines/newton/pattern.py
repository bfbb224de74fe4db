"""The pattern of a tangent, which takes the entries of those layers that touch, or are about to."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import csr_array

from limo.engines.newton import kernels

if TYPE_CHECKING:
    from limo.engines.newton.contact import ContactTangent


def widened(keys: np.ndarray, more: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rising ``keys`` (n,) with those of ``more`` that they lack, and where each of the n is then (n,)."""
    if not more.size:
        return keys, np.arange(len(keys))
    more = np.unique(more, return_index=True)[0]  # sorts, which is faster here than numpy's hashing
    before = np.searchsorted(keys, more)  # as many keys are smaller
    new = keys[np.minimum(before, len(keys) - 1)] != more
    lacking, before = more[new], before[new]
    places = np.arange(len(keys)) + np.cumsum(np.bincount(before, minlength=len(keys) + 1)[: len(keys)])
    whole = np.empty(len(keys) + len(lacking), keys.dtype)
    whole[places] = keys
    whole[before + np.arange(len(lacking))] = lacking
    return whole, places


@dataclass(frozen=True)
class Additions:
    """Sums of ``factors`` times entries ``columns`` of a source, each from ``starts`` on, that are added to values at ``rows``.

    A sparse matrix without its empty rows, which are most: its product would have the size of all values.
    """

    rows: np.ndarray
    starts: np.ndarray
    columns: np.ndarray
    factors: np.ndarray

    @classmethod
    def of(cls, places: np.ndarray, sources: np.ndarray, factors: np.ndarray) -> Additions:
        """Those of entries (k,) that go from ``sources`` to ``places``."""
        rows, numbers = np.unique(places, return_inverse=True)
        shape = len(rows), sources.max(initial=-1) + 1
        matrix = csr_array((factors, (numbers.astype(np.int32), sources)), shape=shape)
        matrix.sort_indices()
        return cls(rows.astype(np.int32), *(each.astype(np.int32) for each in (matrix.indptr, matrix.indices)), matrix.data)

    def moved(self, places: np.ndarray) -> Additions:
        """The same where values have gone to other ``places`` (n,), in their order."""
        return replace(self, rows=places[self.rows])

    def add(self, source: np.ndarray, values: np.ndarray) -> None:
        """Add them to ``values``."""
        kernels.add_rows(self.rows, self.starts, self.columns, self.factors, source, values)


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
    _from_faces: Additions
    _own_mass: np.ndarray
    _contact: ContactTangent

    def _begin(self, keys: np.ndarray, places: np.ndarray, faces: tuple[np.ndarray, ...]) -> None:
        """Take the pattern without contact.

        ``keys``: row times size plus column of its entries, rising. ``places``: where those of elements go, what goes nowhere
        behind the last. ``faces``: keys, factors and sources of those of faces.
        """
        entries, factors, sources = faces
        self._own = keys, places, Additions.of(np.searchsorted(keys, entries), sources, factors)
        self._places = places
        self._index(keys)

    def _index(self, keys: np.ndarray) -> None:
        self.indices = (keys % self.size).astype(np.int32)
        self.indptr = np.searchsorted(keys, np.arange(self.size + 1) * self.size).astype(np.int32)

    def touch(self, chosen: np.ndarray | None = None) -> None:
        """Take the entries of pairs ``chosen`` (q,), by default of all, into the pattern, and no others."""
        own, of_elements, of_faces = self._own
        keys, moved = widened(own, self._contact.choose(chosen))
        self._index(keys)
        if len(keys) > len(own):
            moved = moved.astype(np.int32)
            self._places = np.append(moved, np.int32(len(keys)))[of_elements]
            self._from_faces = of_faces.moved(moved)
            self.mass = np.zeros(len(keys))
            self.mass[moved] = self._own_mass
        else:
            self._places, self._from_faces, self.mass = of_elements, of_faces, self._own_mass
        self._contact.place(keys)

    def _shifted(self, shift: float) -> np.ndarray:
        """Values of shift M, and behind them a place for what goes nowhere."""
        values = np.empty(len(self.indices) + 1)
        np.multiply(self.mass, shift, out=values[:-1])
        values[-1] = 0.0
        return values

    @property
    def pairs(self) -> np.ndarray:
        """Which pairs (q,) of layers the pattern has the entries of."""
        return self._contact.chosen
