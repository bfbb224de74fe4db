"""The unknowns of a tangent: free displacements as they are, or means and half differences of bottom and top nodes.

    q = Q y,   K_y = Q^T K_q Q

q are the free displacements of an ``Assembly``. The bottom and the top node of a thin layer move nearly alike: its bending is a
small difference of large stiffnesses, and a factor in single precision loses it. It is an entry of its own in the mean m of
both, their half difference d, and c of the node between them:

    u_bottom = m - d,   u_top = m + d,   u_middle = m + c

m, d and c have the places of the displacements of the bottom, top and middle node, the slots v. So u_n = v_a(n) + s_n v_b(n), and
each component of a slot is a multiple of one unknown, v_k = f_k y_j(k), or held. Element matrices for slots come from the
same kernels with other gradients of the shape functions, without a difference of large numbers.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import csr_array

from limo.mesh.elements import HEX20_BOTTOM, HEX20_TOP

if TYPE_CHECKING:
    from limo.engines.newton.assembly import Assembly

#: nodes of a brick between the first four of bottom and top
_MIDDLE = np.array([16, 17, 18, 19])
#: (m, d, c) of (u_bottom, u_top, u_middle)
_TO_SLOTS = np.array([[0.5, 0.5, 0.0], [-0.5, 0.5, 0.0], [-0.5, -0.5, 1.0]])
#: smaller numbers than this are rounding: entries of the matrices here are of order one
_NOTHING = 1e-12


@dataclass(frozen=True)
class Unknowns:
    """How the displacements of n nodes are made of unknowns y.

    ``first``, ``second``, ``sign`` (n,): u_n = v_first + sign v_second, the sign 0 where a node is its own slot. ``free`` (3 n,):
    the unknown of each component of the slots, or -1 where it is held; ``factor`` (3 n,) its multiple. ``groups`` (size,):
    unknowns that share their neighbours. ``transform``: Q (size, size), None for the identity.
    """

    free: np.ndarray
    factor: np.ndarray
    first: np.ndarray
    second: np.ndarray
    sign: np.ndarray
    groups: np.ndarray
    transform: csr_array | None = None

    @property
    def size(self) -> int:
        """How many unknowns there are."""
        return len(self.groups)

    def expand(self, values: np.ndarray) -> np.ndarray:
        """q = Q y (size,)."""
        return values if self.transform is None else self.transform @ values

    def reduce(self, forces: np.ndarray) -> np.ndarray:
        """Q^T r (size,): forces on the free displacements -> those on the unknowns."""
        return forces if self.transform is None else self.transform.T @ forces

    def slots_of(self, nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The slots of nodes (m, k) and their shares in each node: (m, 2 k), first slots first. Once where all are their own."""
        if self.transform is None:
            return nodes, np.ones(nodes.shape)
        return np.hstack([self.first[nodes], self.second[nodes]]), np.hstack([np.ones(nodes.shape), self.sign[nodes]])

    def of_elements(self, values: np.ndarray, bricks: np.ndarray) -> np.ndarray:
        """What multiplies u_n of bricks (m, 20), (m, ..., 20) -> what multiplies the slots, by the sum over n of du_n/dv."""
        if self.transform is None:
            return values
        changed = values.copy()
        for k, (bottom, top) in enumerate(zip(HEX20_BOTTOM, HEX20_TOP, strict=True)):
            mixed = np.abs(self.sign[bricks[:, bottom]]).reshape(-1, *(1,) * (values.ndim - 2))
            changed[..., bottom] += mixed * values[..., top]
            changed[..., top] -= mixed * values[..., bottom]
            if k < len(_MIDDLE):
                changed[..., bottom] += mixed * values[..., _MIDDLE[k]]
        return changed


def displacements(assembly: Assembly) -> Unknowns:
    """The free displacements themselves: y = q."""
    nodes = np.arange(len(assembly.model.nodes))
    return Unknowns(assembly.free, assembly.factor, nodes, nodes, np.zeros(len(nodes)), assembly.nodes)


def means(assembly: Assembly) -> Unknowns:
    """Means and half differences of bottom and top nodes, with the constraints that an assembly has.

    A node of the mesh keeps its displacements where constraints tie them to another node or direction. It does so, too, where
    m, d or c would depend on two unknowns.
    """
    shell, count = assembly.model.expansion, len(assembly.model.nodes)
    # a mid-side node has nothing between: as if it were held
    slots = np.stack([shell.bottom, shell.top, np.where(shell.middle >= 0, shell.middle, count)], axis=1)
    free = np.vstack([assembly.free.reshape(-1, 3), np.full((1, 3), -1)])
    factor = np.vstack([assembly.factor.reshape(-1, 3), np.zeros((1, 3))])
    cells = _Cells.of(free[slots].swapaxes(1, 2).reshape(-1, 3), factor[slots].swapaxes(1, 2).reshape(-1, 3))
    owner = np.arange(len(shell.bottom), len(shell.bottom) + count + 1)
    owner[slots] = np.arange(len(slots))[:, None]
    changes = (cells.fits & _alone(cells.free, assembly.free, owner[:-1])).reshape(-1, 3).all(axis=1)
    of_slots, of_factors = (x.reshape(-1, 3, 3).swapaxes(1, 2) for x in (cells.unknown, cells.multiple))
    free[slots[changes]], factor[slots[changes]] = of_slots[changes], of_factors[changes]
    first, second, sign = np.arange(count + 1), np.arange(count + 1), np.zeros(count + 1)
    bottom, top, middle = slots[changes].T
    for node, other, s in ((bottom, top, -1.0), (top, top, 1.0), (middle, middle, 1.0)):
        first[node], second[node], sign[node] = bottom, other, s
    return Unknowns(
        free[:-1].ravel(),
        factor[:-1].ravel(),
        first[:-1],
        second[:-1],
        sign[:-1],
        owner[assembly.nodes],
        cells.transform(np.repeat(changes, 3), assembly.size),
    )


def _alone(cells: np.ndarray, free: np.ndarray, owner: np.ndarray) -> np.ndarray:
    """Which cells (c, 3) of free displacements no other cell and no other node depends on.

    ``free`` (3 n,) is that of all nodes; ``owner`` (n,): the node of the mesh of each node. A cell is one of its directions.
    """
    size = free.max(initial=-1) + 1
    low, high = np.full(size, np.iinfo(int).max), np.full(size, -1)
    place = (3 * owner[:, None] + np.arange(3)).ravel()
    taken = free >= 0
    np.minimum.at(low, free[taken], place[taken])
    np.maximum.at(high, free[taken], place[taken])
    shared = np.append(low != high, False)  # -1: held
    return ~shared[cells].any(axis=1)


@dataclass(frozen=True)
class _Cells:
    """Bottom, top and middle of nodes in one direction: c cells.

    ``free`` (c, 3): their free displacements, or -1. ``unknown``, ``multiple`` (c, 3): those of the slots. ``inverse``
    (c, 3, 3): q of y, both in the places where a free displacement comes first. ``fits`` (c,): whether each slot depends on one
    unknown.
    """

    free: np.ndarray
    unknown: np.ndarray
    multiple: np.ndarray
    inverse: np.ndarray
    fits: np.ndarray

    @classmethod
    def of(cls, free: np.ndarray, factor: np.ndarray) -> _Cells:
        """Those of free displacements (c, 3) and factors (c, 3): each kind of cell is thought through once."""
        same = (free[:, :, None] == free[:, None, :]) & (free >= 0)[:, :, None]
        place = np.where(free >= 0, same.argmax(axis=2), -1)
        kinds, kind = np.unique(np.hstack([place, factor]), axis=0, return_inverse=True)
        found = [_slots(k[:3].astype(int), k[3:]) for k in kinds]
        source, multiple, inverse, fits = (np.array(x)[kind.ravel()] for x in zip(*found, strict=True))
        unknown = np.where(source >= 0, np.take_along_axis(free, np.maximum(source, 0), axis=1), -1)
        return cls(free, unknown, multiple, inverse, fits)

    def transform(self, changes: np.ndarray, size: int) -> csr_array:
        """Q (size, size): ``inverse`` where a cell ``changes`` (c,), else the identity."""
        same = np.ones(size, bool)
        same[self.free[changes][self.free[changes] >= 0]] = False
        cell, row, column = np.nonzero((np.abs(self.inverse) > _NOTHING) & changes[:, None, None])
        kept = np.flatnonzero(same)
        rows, columns = (np.concatenate([self.free[cell, k], kept]) for k in (row, column))
        return csr_array(
            (np.concatenate([self.inverse[cell, row, column], np.ones(len(kept))]), (rows, columns)), shape=(size,) * 2
        )


def _slots(place: np.ndarray, factor: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, bool]:
    """How the slots of a cell depend on unknowns, each of which has the place of a free displacement.

    u_k = factor_k q_place(k), with ``place`` (3,) the first of those with the same q, -1 where held. Returns for each slot
    the place of its unknown or -1 and its multiple, q of the unknowns (3, 3), and whether that is all.
    """
    names = [k for k in range(3) if place[k] == k]
    if not names:
        return np.full(3, -1), np.zeros(3), np.zeros((3, 3)), True
    moved = np.zeros((3, len(names)))
    for k in range(3):
        if place[k] >= 0:
            moved[k, names.index(place[k])] = factor[k]
    slots = _TO_SLOTS @ moved
    chosen: list[int] = []
    for k in range(3):
        if np.linalg.matrix_rank(slots[[*chosen, k]], tol=_NOTHING) > len(chosen):
            chosen.append(k)
    source, multiple, inverse = np.full(3, -1), np.zeros(3), np.zeros((3, 3))
    if len(chosen) < len(names):
        return source, multiple, inverse, False
    of_slots = np.linalg.inv(slots[chosen])
    inverse[np.ix_(names, names)] = of_slots
    shares = slots @ of_slots
    for k in range(3):
        for j in np.flatnonzero(np.abs(shares[k]) > _NOTHING):
            source[k], multiple[k] = names[j], shares[k, j]
    return source, multiple, inverse, bool(((np.abs(shares) > _NOTHING).sum(axis=1) <= 1).all())
