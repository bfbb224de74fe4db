"""Where the entries of element matrices go in the upper triangle of a tangent."""

from __future__ import annotations

import numpy as np

from limo.engines.newton.unknowns import Unknowns


def entries_of(
    slots: np.ndarray, unknowns: Unknowns, pairs: tuple[tuple[int, int], ...], shares: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Entries of blocks (m, k, p, k) of elements with ``slots`` (m, k): keys, factors, flat sources.

    An entry's key is its row times the number of unknowns plus its column.

    ``pairs``: p pairs of directions. ``shares`` (m, k) multiply a slot's rows and columns; those of zero are left out.

    Of a block on the diagonal only one triangle is taken, of the others all; an off-diagonal entry that constraints bring
    onto the diagonal stands for its mirror image too.
    """
    count, per = slots.shape
    free, factor = unknowns.free.astype(np.int64), unknowns.factor
    shape = (count, per, len(pairs), per)
    sources = np.arange(np.prod(shape), dtype=np.int32).reshape(shape)
    keys, values, taken = [], [], []
    upper = np.triu(np.ones((per, per), bool))
    for k, (i, j) in enumerate(pairs):
        first, second = free[3 * slots + i][:, :, None], free[3 * slots + j][:, None, :]
        keep = (first >= 0) & (second >= 0)
        if i == j:
            keep &= upper
        if shares is not None:
            keep &= (shares[:, :, None] != 0) & (shares[:, None, :] != 0)
        # of an element that has a node twice, too
        doubled = first == second
        if i == j:
            doubled = doubled & ~np.eye(per, dtype=bool)
        value = factor[3 * slots + i][:, :, None] * factor[3 * slots + j][:, None, :]
        value[doubled] *= 2.0
        if shares is not None:
            value *= shares[:, :, None] * shares[:, None, :]
        keys.append((np.minimum(first, second) * unknowns.size + np.maximum(first, second))[keep])
        values.append(value[keep])
        taken.append(sources[:, :, k][keep])
    return tuple(np.concatenate(x) for x in (keys, values, taken))
