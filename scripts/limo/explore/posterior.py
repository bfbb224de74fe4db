"""What is believed of inputs that nobody knows, once penalties say how well each place explains what is known.

A penalty is no density, so the belief is a Gibbs posterior (Bissiri, Holmes, Walker 2016),

    p(x | known) = p(x) exp(-s(x)) / Z,

with the prior p and the penalty s: a place whose penalty is one higher is believed e times less. Places are Sobol points of the
space with weights, so that means, intervals and chances are weighted sums.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from limo.explore.space import Space

#: share of a belief that its interval holds
WITHIN = 0.9


@dataclass(frozen=True)
class Posterior:
    """Places (n, d) of a space in its own units, with weights (n,) before and after; each adds up to one."""

    space: Space
    values: np.ndarray
    before: np.ndarray
    after: np.ndarray

    @property
    def mean(self) -> np.ndarray:
        """Mean (d,) of each input."""
        return self.after @ self.values

    @property
    def deviation(self) -> np.ndarray:
        """Standard deviation (d,) of each input."""
        return np.sqrt(self.after @ (self.values - self.mean) ** 2)

    @property
    def interval(self) -> np.ndarray:
        """Ends (2, d) of the interval that holds ``WITHIN`` of the belief, as much left out on either side."""
        return np.stack([self.quantile(0.5 * (1 - WITHIN)), self.quantile(0.5 * (1 + WITHIN))])

    def quantile(self, share: float) -> np.ndarray:
        """The value (d,) of each input below which a share of the belief lies."""
        found = []
        for column in self.values.T:
            order = np.argsort(column)
            reached = np.cumsum(self.after[order]) - 0.5 * self.after[order]
            found.append(np.interp(share, reached, column[order]))
        return np.array(found)

    def chance(self, holds: np.ndarray) -> tuple[float, float]:
        """How likely something is that holds at some places (n,), before and after."""
        return float(self.before @ holds), float(self.after @ holds)

    @property
    def effective(self) -> float:
        """How many places carry the belief: (sum w)^2 / sum w^2. Few of them make means uncertain."""
        return float(1.0 / np.sum(self.after**2))


def posterior(space: Space, places: np.ndarray, prior: np.ndarray, penalty: np.ndarray) -> Posterior:
    """The belief at places (n, d) of a space, from penalties (n,) and the logarithm of a prior density (n,), up to a constant.

    Raises ``ValueError`` for penalties that are no numbers.
    """
    if not (np.isfinite(prior).all() and np.isfinite(penalty).all()):
        raise ValueError("a prior and a penalty at every place")
    values = np.array([list(design.values()) for design in space.from_unit(places)])
    return Posterior(space, values, _shares(prior), _shares(prior - penalty))


def _shares(logarithm: np.ndarray) -> np.ndarray:
    weights = np.exp(logarithm - logarithm.max())
    return weights / weights.sum()
