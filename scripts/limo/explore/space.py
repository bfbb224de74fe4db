"""A space of designs: inputs within ranges or of a few categories, as places in the unit cube.

A continuous input u lies at (u - low) / (high - low). A category k of K lies at (k + 1/2) / K, in the order of its values, as
numbers of pouches have one. A Gaussian process with a length of its own for each input makes of it what the results say.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

Design = Mapping[str, float]


@dataclass(frozen=True)
class Input:
    """One input: ``values`` of a category in rising order, or ``low`` and ``high`` of a range.

    ``acts_with``: the numbers of pouches with which it does something; without any it always does.
    """

    name: str
    low: float = 0.0
    high: float = 0.0
    values: tuple[float, ...] = ()
    acts_with: tuple[float, ...] = ()

    def to_unit(self, value: float) -> float:
        """Where a value lies between 0 and 1. Raises ``ValueError`` for no value of a category."""
        if self.values:
            return (self.values.index(value) + 0.5) / len(self.values)
        return (value - self.low) / (self.high - self.low)

    def from_unit(self, place: float) -> float:
        """The value at a place between 0 and 1; of a category that whose share of the interval it is in."""
        if self.values:
            return self.values[min(int(place * len(self.values)), len(self.values) - 1)]
        return self.low + (self.high - self.low) * place


@dataclass(frozen=True)
class Space:
    """Inputs in their order; places in it are (n, d) between 0 and 1."""

    inputs: tuple[Input, ...]

    @property
    def names(self) -> list[str]:
        return [each.name for each in self.inputs]

    def to_unit(self, designs: Sequence[Design]) -> np.ndarray:
        """Places (n, d) of designs."""
        return np.array([[each.to_unit(design[each.name]) for each in self.inputs] for design in designs])

    def from_unit(self, places: np.ndarray) -> list[dict[str, float]]:
        """Designs at places (n, d)."""
        return [{each.name: each.from_unit(float(x)) for each, x in zip(self.inputs, row, strict=True)} for row in places]

    def snapped(self, places: np.ndarray) -> np.ndarray:
        """Places (n, d) with categories in the middle of their share: those of designs that can be made.

        An input that does nothing with a number of pouches is 0 there, or in its middle, so that no device has two places.
        """
        result = np.array(places, float)
        for k, each in enumerate(self.inputs):
            if each.values:
                count = len(each.values)
                result[:, k] = (np.minimum((result[:, k] * count).astype(int), count - 1) + 0.5) / count
        for k, each in enumerate(self.inputs):
            if each.acts_with and "n_pouches" in self.names:
                pouches = self.inputs[self.names.index("n_pouches")]
                acts = np.isin([pouches.from_unit(x) for x in result[:, self.names.index("n_pouches")]], each.acts_with)
                result[~acts, k] = each.to_unit(0.0) if each.low <= 0 <= each.high else 0.5
        return result
