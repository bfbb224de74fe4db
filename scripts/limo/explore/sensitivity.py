"""What each input explains of a result: first-order and total Sobol indices of a surrogate, with confidence (``SALib``).

    S_i = Var(E(y | x_i)) / Var(y),   T_i = 1 - Var(E(y | x_~i)) / Var(y)

Saltelli's samples and Jansen's estimator of totals. A single value that is no number makes ``SALib`` return zeros or NaN for
every input without a word, so values are looked at before.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from SALib.analyze import sobol as analysis
from SALib.sample import sobol as samples

from limo.explore.space import Space

#: base samples, a power of two
SAMPLES = 1024


@dataclass(frozen=True)
class Indices:
    """First-order and total indices (d,) and the half widths (d,) of their intervals of 95 %; interactions (d, d) of pairs."""

    names: list[str]
    first: np.ndarray
    first_within: np.ndarray
    total: np.ndarray
    total_within: np.ndarray
    second: np.ndarray


def indices(space: Space, value: Callable[[np.ndarray], np.ndarray], seed: int = 0) -> Indices:
    """Indices of ``value``, which gives (m,) at places (m, d). Raises ``ValueError`` where it is no number or always the same."""
    problem = {"num_vars": len(space.inputs), "names": space.names, "bounds": [[0.0, 1.0]] * len(space.inputs)}
    places = space.snapped(samples.sample(problem, SAMPLES, calc_second_order=True, seed=seed))
    values = np.asarray(value(places), float)
    if not np.isfinite(values).all():
        raise ValueError(f"{(~np.isfinite(values)).sum()} of {len(values)} values are no numbers: no index would be one")
    if np.ptp(values) <= 1e-12 * max(1.0, float(np.abs(values).max())):
        raise ValueError("the value is the same everywhere: nothing explains it")
    found = analysis.analyze(problem, (values - values.mean()) / values.std(), calc_second_order=True, seed=seed)
    second = np.nan_to_num(found["S2"])
    return Indices(space.names, found["S1"], found["S1_conf"], found["ST"], found["ST_conf"], second + second.T)
