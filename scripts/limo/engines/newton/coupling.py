"""Which pairs of layers the factors of a path couple: those that touch, and not all that ever may.

Two layers that touch share one block of a factor, which costs up to four times as much as that of two apart. At rest all pairs
of a pouch touch; when it is full, those beside its seams do. A pattern with fewer entries is the same matrix: the tangent of
layers that are apart is zero.
"""

from __future__ import annotations

from collections import deque

import numpy as np

from limo.mechanics.contact import Touching

#: states at rest in all of which pairs were apart, before they lose their entries
LOOKED_BACK = 5
#: a pattern is narrowed where it keeps at most this share of its pairs
WORTH = 0.6


class Coupling:
    """Says when a pattern is to change. ``margin``: gap in mm up to which layers that part stay coupled.

    ``missed``: whether pairs that touch were missing since the last state at rest.
    """

    def __init__(self, touching: Touching, margin: float):
        self._touching, self._margin = touching, margin
        self._recent: deque[np.ndarray] = deque(maxlen=LOOKED_BACK)
        self.missed = False

    def wanted(self, x: np.ndarray, known: np.ndarray) -> np.ndarray | None:
        """Pairs (q,) of a pattern for places x (n, 3), None where all that touch are among the ``known`` ones (q,).

        The first time from one state at rest to the next those that are near join; the second time all do: layers are in motion.
        """
        if not (self._touching.near(x) & ~known).any():
            return None
        again, self.missed = self.missed, True
        return np.ones(len(known), bool) if again else known | self._touching.near(x, self._margin)

    def at_rest(self, x: np.ndarray, known: np.ndarray) -> np.ndarray | None:
        """Pairs (q,) of a narrower pattern after a state at rest at places x (n, 3), None where that does not pay."""
        self.missed = False
        self._recent.append(self._touching.near(x, self._margin))
        if len(self._recent) < LOOKED_BACK or not known.any():
            return None
        kept = np.logical_or.reduce(self._recent)
        return kept if kept.sum() <= WORTH * known.sum() else None
