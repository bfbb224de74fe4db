"""How far the numbers of a beat depend on the few P_v that a surface was solved at.

Each inner P_v is left out in turn, and the potentials are fitted to the others (the jackknife of Quenouille and Tukey). The range
of a number over these surfaces and the whole one holds what lies between two P_v, and what a fold at a single one changes. The
error of the mesh that the study was solved on is not in it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from limo.beat.periodic import NUMBERS, PERIODIC_STATE, beating
from limo.beat.surface import Surface
from limo.schema.beat import Beat


@dataclass(frozen=True)
class Members:
    """A surface and those that lack one of its inner P_v each."""

    surface: Surface

    @cached_property
    def surfaces(self) -> list[Surface]:
        """All of them, the whole one first; the others take a fit of some seconds each."""
        inner = range(1, len(self.surface.ventricular) - 1)
        return [self.surface, *(self.surface.without(k) for k in inner)]

    def bands(self, beat: Beat) -> dict[str, tuple[float, float]]:
        """Smallest and largest value of each of ``NUMBERS`` of the left device; NaN where one surface has no periodic state."""
        found = [beating(surface, beat) for surface in self.surfaces]
        bands = {}
        for name in NUMBERS:
            values = np.array([one.numbers[name][0] if one.status == PERIODIC_STATE else np.nan for one in found])
            bands[name] = float(values.min()), float(values.max())
        return bands
