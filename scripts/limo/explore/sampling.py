"""Designs to begin with: scrambled Sobol points of a space (``scipy.stats.qmc``), those that cannot be made left out."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.stats import qmc

from limo.errors import LimoError
from limo.explore.space import Design, Space

#: points that are looked at for each that is wanted, before a space counts as empty
PATIENCE = 256


def sample(space: Space, count: int, seed: int, allowed: Callable[[Design], bool] = lambda _: True) -> np.ndarray:
    """Places (count, d) of allowed designs, the same for the same seed; the first of them are those of a smaller count.

    Raises ``LimoError`` where too few designs are allowed.
    """
    sobol = qmc.Sobol(len(space.inputs), scramble=True, rng=np.random.default_rng(seed))
    found: list[np.ndarray] = []
    block = 1 << max(3, int(np.ceil(np.log2(count))))
    for _ in range(max(1, PATIENCE * count // block)):
        places = space.snapped(sobol.random(block))
        found += [place for place, design in zip(places, space.from_unit(places), strict=True) if allowed(design)]
        if len(found) >= count:
            return np.array(found[:count])
    raise LimoError(f"{len(found)} of {PATIENCE * count} samples can be made, and {count} are wanted: widen the space")
