"""Loops over bricks and their integration points, compiled on first use and kept beside this file.

A St. Venant-Kirchhoff layer's displacement gradients, internal forces and consistent tangent, as in ``assembly`` and
``tangent``, whose equations and units hold; and what a solver does with a tangent. m elements, g integration points, n nodes.
``gradient`` (m, 3 g, 20) is dN_n / dX_K with rows (g, K). ``volume`` (m, g) is what a point stands for; ``lame`` (m, 2) are
lambda and mu. Products of 20 x 3 g matrices are BLAS's. Long loops take indices as numbers without a sign (``_at``), and rows as
slices: an index that could count from the end is looked at each time, which costs a fifth to a half of a loop.
"""

from __future__ import annotations

import numpy as np
from numba import njit


def _compiled(signature: str | None = None):
    """Compile for the types of a signature now, or for those of each call; no rearrangement hides what is no number."""
    return njit(signature, cache=True, fastmath={"contract", "reassoc", "nsz"}, error_model="numpy")


#: an index that does not count from the end
_at = np.uint32

#: pairs of directions of a block's six parts: the second one of a pair counts the last axis
PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))


@_compiled("void(f8[:,::1], i4[:,::1], f8[:,:,::1], f8[:,:,::1], f8[:,::1])")
def displacement_gradients(u, bricks, gradient, found, ratios):
    """Du (m, 3 g, 3), rows (g, K), of displacements (n, 3), and det F (m, g)."""
    moved = np.empty((20, 3))
    for e in range(len(bricks)):
        for n in range(20):
            for i in range(3):
                moved[n, i] = u[bricks[e, n], i]
        d = found[e]
        np.dot(gradient[e], moved, d)
        for g in range(ratios.shape[1]):
            k = 3 * g
            a, b, c = 1.0 + d[k, 0], d[k, 1], d[k, 2]
            p, q, r = d[k + 1, 0], 1.0 + d[k + 1, 1], d[k + 1, 2]
            x, y, z = d[k + 2, 0], d[k + 2, 1], 1.0 + d[k + 2, 2]
            ratios[e, g] = a * (q * z - r * y) - b * (p * z - r * x) + c * (p * y - q * x)


@_compiled("void(f8[:,:,::1], i4[:,::1], f8[:,:,::1], f8[:,::1], f8[:,::1], f8[:,:,::1], f8[:,::1])")
def internal_forces(slopes, bricks, gradient, volume, lame, stress, forces):
    """Adds int P Grad N dV_0 to ``forces`` (n, 3), P = F S; ``stress`` (m, g, 6) becomes J w S (xx, yy, zz, xy, xz, yz).

    Strains come from the displacement gradient: no difference of nearly equal numbers in thin layers.
    """
    points = volume.shape[1]
    piola, found = np.empty((3 * points, 3)), np.empty((20, 3))
    for e in range(len(bricks)):
        for g in range(points):
            d, s = slopes[e, 3 * g : 3 * g + 3], stress[e, g]
            xx = d[0, 0] + 0.5 * (d[0, 0] * d[0, 0] + d[0, 1] * d[0, 1] + d[0, 2] * d[0, 2])
            yy = d[1, 1] + 0.5 * (d[1, 0] * d[1, 0] + d[1, 1] * d[1, 1] + d[1, 2] * d[1, 2])
            zz = d[2, 2] + 0.5 * (d[2, 0] * d[2, 0] + d[2, 1] * d[2, 1] + d[2, 2] * d[2, 2])
            xy = d[0, 1] + d[1, 0] + d[0, 0] * d[1, 0] + d[0, 1] * d[1, 1] + d[0, 2] * d[1, 2]
            xz = d[0, 2] + d[2, 0] + d[0, 0] * d[2, 0] + d[0, 1] * d[2, 1] + d[0, 2] * d[2, 2]
            yz = d[1, 2] + d[2, 1] + d[1, 0] * d[2, 0] + d[1, 1] * d[2, 1] + d[1, 2] * d[2, 2]
            mu = lame[e, 1] * volume[e, g]
            trace = lame[e, 0] * volume[e, g] * (xx + yy + zz)
            s[0], s[1], s[2] = trace + 2 * mu * xx, trace + 2 * mu * yy, trace + 2 * mu * zz
            s[3], s[4], s[5] = mu * xy, mu * xz, mu * yz
            for i in range(3):
                fx, fy, fz = d[0, i] + (i == 0), d[1, i] + (i == 1), d[2, i] + (i == 2)
                piola[3 * g, i] = fx * s[0] + fy * s[3] + fz * s[4]
                piola[3 * g + 1, i] = fx * s[3] + fy * s[1] + fz * s[5]
                piola[3 * g + 2, i] = fx * s[4] + fy * s[5] + fz * s[2]
        np.dot(gradient[e].T, piola, found)
        for n in range(20):
            for i in range(3):
                forces[bricks[e, n], i] += found[n, i]


@_compiled()
def _point(d, s, slopes, lam, mu, half):
    """J w A_iKjL dN_m/dX_L of one point: (3, 6, 20), K and pair (i, j) and m."""
    f00, f01, f02 = 1.0 + d[0, 0], d[1, 0], d[2, 0]
    f10, f11, f12 = d[0, 1], 1.0 + d[1, 1], d[2, 1]
    f20, f21, f22 = d[0, 2], d[1, 2], 1.0 + d[2, 2]
    b00 = mu * (f00 * f00 + f01 * f01 + f02 * f02)
    b11 = mu * (f10 * f10 + f11 * f11 + f12 * f12)
    b22 = mu * (f20 * f20 + f21 * f21 + f22 * f22)
    b01 = mu * (f00 * f10 + f01 * f11 + f02 * f12)
    b02 = mu * (f00 * f20 + f01 * f21 + f02 * f22)
    b12 = mu * (f10 * f20 + f11 * f21 + f12 * f22)
    for k in range(3):
        # branches, not indices: the compiler takes them apart into three loops, and is measurably faster
        if k == 0:
            f0, f1, f2, s0, s1, s2 = f00, f10, f20, s[0], s[3], s[4]
        elif k == 1:
            f0, f1, f2, s0, s1, s2 = f01, f11, f21, s[3], s[1], s[5]
        else:
            f0, f1, f2, s0, s1, s2 = f02, f12, f22, s[4], s[5], s[2]
        l0, l1, m1, m2 = lam * f0, lam * f1, mu * f1, mu * f2
        n0, n1, n2 = (lam + mu) * f0, (lam + mu) * f1, (lam + mu) * f2
        rows = half[k]
        for m in range(20):
            x, y, z, own = slopes[0, m], slopes[1, m], slopes[2, m], slopes[k, m]
            a0 = f00 * x + f01 * y + f02 * z
            a1 = f10 * x + f11 * y + f12 * z
            a2 = f20 * x + f21 * y + f22 * z
            carried = s0 * x + s1 * y + s2 * z
            rows[0, m] = n0 * a0 + b00 * own + carried
            rows[1, m] = n1 * a1 + b11 * own + carried
            rows[2, m] = n2 * a2 + b22 * own + carried
            rows[3, m] = l0 * a1 + m1 * a0 + b01 * own
            rows[4, m] = l0 * a2 + m2 * a0 + b02 * own
            rows[5, m] = l1 * a2 + m2 * a1 + b12 * own


@_compiled("void(f8[:,:,::1], f8[:,:,::1], f8[:,:,::1], f8[:,::1], f8[:,::1], i4[::1], i4[:,::1], i4[::1], f8[:,::1], f8[::1])")
def tangent(slopes, stress, gradient, volume, lame, sources, places, special, weights, values):
    """Adds the bricks' tangents to ``values``: entry ``sources[q]`` of a block (20, 6, 20) to ``places[e, q]``.

    Entries of the elements that ``special`` numbers (others: -1) count ``weights[special[e], q]`` times.
    """
    points = volume.shape[1]
    half = np.empty((points, 3, 6, 20))
    rows = half.reshape(3 * points, 120)
    block = np.empty((20, 120))
    entries = block.reshape(2400)
    for e in range(len(gradient)):
        for g in range(points):
            k = 3 * g
            w = volume[e, g]
            _point(slopes[e, k : k + 3], stress[e, g], gradient[e, k : k + 3], lame[e, 0] * w, lame[e, 1] * w, half[g])
        np.dot(gradient[e].T, rows, block)
        if special[e] >= 0:
            for q in range(len(sources)):
                entries[sources[q]] *= weights[special[e], q]
        target = places[e]
        for q in range(len(sources)):
            values[_at(target[q])] += entries[_at(sources[q])]


@njit("void(i4[::1], i4[::1], i4[::1], f8[::1], f8[::1], f8[::1])", cache=True)
def add_rows(rows, starts, columns, factors, source, values):
    """Adds the product of a sparse matrix in rows with ``source`` to ``values`` at ``rows``; its sums are not rearranged."""
    for i in range(len(rows)):
        first, last = np.int64(starts[i]), np.int64(starts[i + 1])
        taken, times = columns[first:last], factors[first:last]
        total = 0.0
        for k in range(len(taken)):
            total += times[k] * source[_at(taken[k])]
        values[_at(rows[i])] += total


@njit("void(f8[::1], f8, f8[::1])", cache=True)
def add_times(added, factor, values):
    """Adds ``factor`` times ``added`` to ``values``, each product rounded first."""
    for i in range(len(values)):
        values[i] += factor * added[i]


@_compiled("i8(f8[::1], i4[::1], i4[::1], f8[::1], f4[::1])")
def scale_upper(values, indptr, indices, scale, found):
    """d_i K_ij d_j in single precision, of the upper triangle in rows with its ``values``; ``scale`` (n,) is d.

    Returns how many entries beside the diagonal, which is the first of a row, are not below one; -1 where any is not finite.
    """
    count, total = 0, 0.0
    for i in range(len(indptr) - 1):
        first, last = np.int64(indptr[i]), np.int64(indptr[i + 1])
        own, row, columns, scaled = scale[i], values[first:last], indices[first:last], found[first:last]
        scaled[0] = row[0] * own * own
        for k in range(1, len(row)):
            entry = row[k] * own * scale[_at(columns[k])]
            scaled[k] = entry
            count += abs(entry) >= 1
            total += abs(entry)
    return count if np.isfinite(total) else -1


@_compiled("void(f8[::1], i4[::1], i4[::1], f8[::1], f8[::1])")
def symmetric_product(values, indptr, indices, vector, found):
    """K x (n,) of a symmetric matrix by its upper triangle in rows, the diagonal first in each."""
    found[:] = 0.0
    for i in range(len(indptr) - 1):
        first, last = np.int64(indptr[i]), np.int64(indptr[i + 1])
        own, row, columns = vector[i], values[first:last], indices[first:last]
        total = row[0] * own
        for k in range(1, len(row)):
            j = _at(columns[k])
            total += row[k] * vector[j]
            found[j] += row[k] * own
        found[i] += total


@_compiled("void(f8[:,:,::1], f8[:,:,::1], f8[:,:,::1], f8[:,::1], f8[:,::1], f8[:,:,::1])")
def predicted_stress(stress, slopes, before, volume, lame, predicted):
    """J w (S - C : d d^T / 2), (m, g, 6): the stress at displacement gradients as a linear strain predicts it from ``before``.

    ``stress`` is J w S at ``slopes`` (m, 3 g, 3), rows K, columns i. A step added d = ``slopes`` - ``before``. The strain grows
    by the symmetric part of F^T d, which is linear in d, and by d d^T / 2, which is left out.
    """
    d = np.empty((3, 3))
    for e in range(len(stress)):
        for g in range(stress.shape[1]):
            for k in range(3):
                for i in range(3):
                    d[k, i] = slopes[e, 3 * g + k, i] - before[e, 3 * g + k, i]
            xx = 0.5 * (d[0, 0] * d[0, 0] + d[0, 1] * d[0, 1] + d[0, 2] * d[0, 2])
            yy = 0.5 * (d[1, 0] * d[1, 0] + d[1, 1] * d[1, 1] + d[1, 2] * d[1, 2])
            zz = 0.5 * (d[2, 0] * d[2, 0] + d[2, 1] * d[2, 1] + d[2, 2] * d[2, 2])
            xy = d[0, 0] * d[1, 0] + d[0, 1] * d[1, 1] + d[0, 2] * d[1, 2]
            xz = d[0, 0] * d[2, 0] + d[0, 1] * d[2, 1] + d[0, 2] * d[2, 2]
            yz = d[1, 0] * d[2, 0] + d[1, 1] * d[2, 1] + d[1, 2] * d[2, 2]
            mu = lame[e, 1] * volume[e, g]
            trace = lame[e, 0] * volume[e, g] * (xx + yy + zz)
            s, p = stress[e, g], predicted[e, g]
            p[0], p[1], p[2] = s[0] - trace - 2 * mu * xx, s[1] - trace - 2 * mu * yy, s[2] - trace - 2 * mu * zz
            p[3], p[4], p[5] = s[3] - mu * xy, s[4] - mu * xz, s[5] - mu * yz
