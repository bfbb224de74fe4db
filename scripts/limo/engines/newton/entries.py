"""Where the entries of element matrices go in the upper triangle of a tangent."""

from __future__ import annotations

import numpy as np

from limo.engines.newton.unknowns import Unknowns


def entries_of(
    slots: np.ndarray, unknowns: Unknowns, pairs: tuple[tuple[int, int], ...], shares: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Entries of blocks (m, k, p, k) of elements with ``slots`` (m, k): rows, columns, factors, flat sources.

    ``pairs``: p pairs of directions. ``shares`` (m, k) multiply a slot's rows and columns; those of zero are left out.

    Of a block on the diagonal only one triangle is taken, of the others all; an off-diagonal entry that constraints bring
    onto the diagonal stands for its mirror image too.
    """
    count, per = slots.shape
    free, factor = unknowns.free, unknowns.factor
    shape = (count, per, len(pairs), per)
    sources = np.arange(np.prod(shape)).reshape(shape)
    rows, columns, values, taken = [], [], [], []
    upper = np.triu(np.ones((per, per), bool))
    for k, (i, j) in enumerate(pairs):
        a = np.broadcast_to((3 * slots + i)[:, :, None], (count, per, per))
        b = np.broadcast_to((3 * slots + j)[:, None, :], (count, per, per))
        keep = (free[a] >= 0) & (free[b] >= 0)
        if i == j:
            keep &= upper
        if shares is not None:
            keep &= (shares[:, :, None] != 0) & (shares[:, None, :] != 0)
        a, b = a[keep], b[keep]
        value = factor[a] * factor[b] * np.where((a != b) & (free[a] == free[b]), 2.0, 1.0)
        if shares is not None:
            value *= (shares[:, :, None] * shares[:, None, :])[keep]
        rows.append(np.minimum(free[a], free[b]))
        columns.append(np.maximum(free[a], free[b]))
        values.append(value)
        taken.append(sources[:, :, k][keep])
    return tuple(np.concatenate(x) for x in (rows, columns, values, taken))
