"""Loops over shells with directors of fixed length and their integration points, as in ``kernels`` for bricks.

m elements of 16 slots (displacements of eight nodes, then of their directors), g integration points, s slots in all.
``gradient`` (m, 3 g, 16) is dN / dX_K with rows (g, K), K along the axes of a point. ``axes`` (m, g, 3, 3): these axes as
columns, the third one across the layer. ``law`` (m, 10): Q_11, Q_12, Q_16, Q_22, Q_26, Q_66 of plane stress in MPa, the shear
moduli G_44, G_45, G_55 of (yz, xz), and what resists a stretch across. Equations as in ``shell``.
"""

from __future__ import annotations

import numpy as np

from limo.engines.newton.kernels import _at, _compiled

#: slots of an element, and its displacements
SLOTS = 16


@_compiled("void(f8[:,::1], i4[:,::1], f8[:,:,::1], f8[:,:,:,::1], f8[:,:,::1], f8[:,::1])")
def displacement_gradients(values, slots, gradient, axes, found, ratios):
    """Du (m, 3 g, 3), rows (g, K), of slots' values (s, 3), and det F (m, g)."""
    moved = np.empty((16, 3))
    f = np.empty((3, 3))
    for e in range(len(slots)):
        for n in range(16):
            for i in range(3):
                moved[n, i] = values[slots[e, n], i]
        d = found[e]
        np.dot(gradient[e], moved, d)
        for g in range(ratios.shape[1]):
            for k in range(3):
                for i in range(3):
                    f[k, i] = axes[e, g, i, k] + d[3 * g + k, i]
            x = f[0, 1] * f[1, 2] - f[0, 2] * f[1, 1]
            y = f[0, 2] * f[1, 0] - f[0, 0] * f[1, 2]
            z = f[0, 0] * f[1, 1] - f[0, 1] * f[1, 0]
            area = np.sqrt(x * x + y * y + z * z)
            ratios[e, g] = area


@_compiled("void(f8[:,:,::1], i4[:,::1], f8[:,:,::1], f8[:,:,:,::1], f8[:,::1], f8[:,::1], f8[:,:,::1], f8[:,::1])")
def internal_forces(slopes, slots, gradient, axes, volume, law, stress, forces):
    """Adds int P Grad N dV_0 to ``forces`` (s, 3), P = F S; ``stress`` (m, g, 6) becomes J w S (xx, yy, xy, xz, yz, zz)."""
    points = volume.shape[1]
    piola, found = np.empty((3 * points, 3)), np.empty((16, 3))
    h, f = np.empty((3, 3)), np.empty((3, 3))
    for e in range(len(slots)):
        q = law[e]
        for g in range(points):
            s = stress[e, g]
            for k in range(3):
                for j in range(3):
                    h[k, j] = 0.0
                    for i in range(3):
                        h[k, j] += slopes[e, 3 * g + k, i] * axes[e, g, i, j]
                for i in range(3):
                    f[k, i] = axes[e, g, i, k] + slopes[e, 3 * g + k, i]
            xx = h[0, 0] + 0.5 * (h[0, 0] * h[0, 0] + h[0, 1] * h[0, 1] + h[0, 2] * h[0, 2])
            yy = h[1, 1] + 0.5 * (h[1, 0] * h[1, 0] + h[1, 1] * h[1, 1] + h[1, 2] * h[1, 2])
            xy = h[0, 1] + h[1, 0] + h[0, 0] * h[1, 0] + h[0, 1] * h[1, 1] + h[0, 2] * h[1, 2]
            xz = h[0, 2] + h[2, 0] + h[0, 0] * h[2, 0] + h[0, 1] * h[2, 1] + h[0, 2] * h[2, 2]
            yz = h[1, 2] + h[2, 1] + h[1, 0] * h[2, 0] + h[1, 1] * h[2, 1] + h[1, 2] * h[2, 2]
            zz = h[2, 2] + 0.5 * (h[2, 0] * h[2, 0] + h[2, 1] * h[2, 1] + h[2, 2] * h[2, 2])
            w = volume[e, g]
            s[5] = w * q[9] * zz
            s[0] = w * (q[0] * xx + q[1] * yy + q[2] * xy)
            s[1] = w * (q[1] * xx + q[3] * yy + q[4] * xy)
            s[2] = w * (q[2] * xx + q[4] * yy + q[5] * xy)
            s[3] = w * (q[8] * xz + q[7] * yz)
            s[4] = w * (q[7] * xz + q[6] * yz)
            for i in range(3):
                piola[3 * g, i] = f[0, i] * s[0] + f[1, i] * s[2] + f[2, i] * s[3]
                piola[3 * g + 1, i] = f[0, i] * s[2] + f[1, i] * s[1] + f[2, i] * s[4]
                piola[3 * g + 2, i] = f[0, i] * s[3] + f[1, i] * s[4] + f[2, i] * s[5]
        np.dot(gradient[e].T, piola, found)
        for n in range(16):
            for i in range(3):
                forces[slots[e, n], i] += found[n, i]


@_compiled("void(f8[:,::1], b1[::1], i8[::1], f8[:,:,::1])")
def bases_of(directors, tilts, axis, found):
    """Unit vectors (N, 2, 3) at right angles to directors (N, 3), the first to an axis, too.

    That is ``axis`` (N,) where a director ``tilts`` (N,), else the one that it is furthest from.
    """
    for n in range(len(directors)):
        d, first, second = directors[n], found[n, 0], found[n, 1]
        i = axis[n]
        if not tilts[n]:
            i = 0
            for k in range(1, 3):
                if abs(d[k]) < abs(d[i]):
                    i = k
        j, k = (i + 1) % 3, (i + 2) % 3
        size = np.sqrt(d[j] * d[j] + d[k] * d[k])
        length = np.sqrt(size * size + d[i] * d[i])
        first[i], first[j], first[k] = 0.0, -d[k] / size, d[j] / size
        for m in range(3):
            p, q = (m + 1) % 3, (m + 2) % 3
            second[m] = (d[p] * first[q] - d[q] * first[p]) / length


def source_of(n: np.ndarray, i: np.ndarray, m: np.ndarray, j: np.ndarray) -> np.ndarray:
    """Where a block of ``tangent``, flat, has the entry of directions i of slots n and j of m, n no more than m.

    A block is (16, 6, 16): slot n, then a pair of directions (``kernels.PAIRS``), or 2 i + j where m is a director, then m.
    Directions of a director are 0 and 1, along its bases.
    """
    half, pair = SLOTS // 2, np.array([[0, 3, 4], [3, 1, 5], [4, 5, 2]])[i, j]
    turned = (n < half) & (m < half) & (i > j)  # stands where its mirror image is
    row, last = np.where(turned, m, n), np.where(turned, n, m)
    return (row * 6 + np.where(m < half, pair, 2 * i + j)) * SLOTS + last


# The signature is stated: without it, the process that compiles gets a tangent with other last bits than those that read the
# cache, and so another path (numba 0.68.1). Arrays are flat and their offsets plain
# numbers, so that the compiler sees what does not overlap, and takes several slots at once.
@_compiled("void(f8[:,::1], f8[::1], f8[::1], f8[::1], f8, f8[::1], f8[::1])")
def _point(f, s, slopes, q, w, turns, half):
    """J w A_iKjL dN_m/dX_L of one point along direction j, or along a base of a director m: (3, 6, 16), K and column and m.

    ``f`` rows K, columns i; ``slopes`` (3, 16); ``turns`` (2, 3, 8): the bases' components.
    """
    q11, q12, q16, q22, q26, q66 = w * q[0], w * q[1], w * q[2], w * q[3], w * q[4], w * q[5]
    g44, g45, g55, q33 = w * q[6], w * q[7], w * q[8], w * q[9]
    f00, f01, f02 = f[0, 0], f[0, 1], f[0, 2]
    f10, f11, f12 = f[1, 0], f[1, 1], f[1, 2]
    f20, f21, f22 = f[2, 0], f[2, 1], f[2, 2]
    count = len(turns) // 6  # eight; loops of a known length are unrolled instead
    s0, s1, s2, s3, s4, s5 = s[0], s[1], s[2], s[3], s[4], s[5]
    for j in range(3):
        if j == 0:
            fx, fy, fz = f00, f10, f20
        elif j == 1:
            fx, fy, fz = f01, f11, f21
        else:
            fx, fy, fz = f02, f12, f22
        # J w S of the strain along direction j by (x, y, z); of yz and xz the third
        xx0, xx1 = q11 * fx + q16 * fy, q12 * fy + q16 * fx
        yy0, yy1 = q12 * fx + q26 * fy, q22 * fy + q26 * fx
        xy0, xy1 = q16 * fx + q66 * fy, q26 * fy + q66 * fx
        xz2, yz2 = g55 * fx + g45 * fy, g45 * fx + g44 * fy
        for i in range(j + 1):
            ax, ay, az = f[0, i], f[1, i], f[2, i]
            own = 1.0 if i == j else 0.0
            k00 = ax * xx0 + ay * xy0 + az * g55 * fz + own * s0
            k01 = ax * xx1 + ay * xy1 + az * g45 * fz + own * s2
            k02 = az * xz2 + own * s3
            k10 = ax * xy0 + ay * yy0 + az * g45 * fz + own * s2
            k11 = ax * xy1 + ay * yy1 + az * g44 * fz + own * s1
            k12 = az * yz2 + own * s4
            k20 = (ax * g55 + ay * g45) * fz + own * s3
            k21 = (ax * g45 + ay * g44) * fz + own * s4
            k22 = ax * xz2 + ay * yz2 + az * q33 * fz + own * s5
            p = 16 * (i if i == j else (3 if j == 1 else 4 + i))
            for m in range(count):
                x, y, z = slopes[m], slopes[16 + m], slopes[32 + m]
                half[p + m] = k00 * x + k01 * y + k02 * z
                half[96 + p + m] = k10 * x + k11 * y + k12 * z
                half[192 + p + m] = k20 * x + k21 * y + k22 * z
    for b in range(2):
        p, c = 16 * b + 8, 24 * b
        for m in range(count):
            x, y, z = slopes[8 + m], slopes[24 + m], slopes[40 + m]
            b0, b1, b2 = turns[c + m], turns[c + 8 + m], turns[c + 16 + m]
            fx, fy, fz = f00 * b0 + f01 * b1 + f02 * b2, f10 * b0 + f11 * b1 + f12 * b2, f20 * b0 + f21 * b1 + f22 * b2
            xx, yy, xy = fx * x, fy * y, fx * y + fy * x
            xz, yz = fx * z + fz * x, fy * z + fz * y
            sxx = q11 * xx + q12 * yy + q16 * xy
            syy = q12 * xx + q22 * yy + q26 * xy
            sxy = q16 * xx + q26 * yy + q66 * xy
            sxz = g55 * xz + g45 * yz
            syz = g45 * xz + g44 * yz
            szz = q33 * fz * z
            tx, ty, tz = s0 * x + s2 * y + s3 * z, s2 * x + s1 * y + s4 * z, s3 * x + s4 * y + s5 * z
            half[p + m] = f00 * sxx + f10 * sxy + f20 * sxz + b0 * tx
            half[96 + p + m] = f00 * sxy + f10 * syy + f20 * syz + b0 * ty
            half[192 + p + m] = f00 * sxz + f10 * syz + f20 * szz + b0 * tz
            half[32 + p + m] = f01 * sxx + f11 * sxy + f21 * sxz + b1 * tx
            half[128 + p + m] = f01 * sxy + f11 * syy + f21 * syz + b1 * ty
            half[224 + p + m] = f01 * sxz + f11 * syz + f21 * szz + b1 * tz
            half[64 + p + m] = f02 * sxx + f12 * sxy + f22 * sxz + b2 * tx
            half[160 + p + m] = f02 * sxy + f12 * syy + f22 * syz + b2 * ty
            half[256 + p + m] = f02 * sxz + f12 * syz + f22 * szz + b2 * tz


@_compiled(
    "void(f8[:,:,::1], f8[:,:,::1], f8[:,:,::1], f8[:,:,:,::1], f8[:,::1], f8[:,::1], i4[:,::1], f8[:,:,::1],"
    " i4[::1], i4[:,::1], f8[::1])"
)
def tangent(slopes, stress, gradient, axes, volume, law, nodes, bases, sources, places, values):
    """Adds the shells' tangents to ``values``: entry ``sources[q]`` (``source_of``) of a block to ``places[e, q]``.

    ``nodes`` (m, 8): of each element; ``bases`` (nodes, 2, 3): unit vectors along which directors move.
    """
    points = volume.shape[1]
    half = np.empty((points, 288))
    rows = half.reshape(3 * points, 96)
    block = np.empty((16, 6, 16))
    product, entries = block.reshape(16, 96), block.reshape(1536)
    f, turns = np.empty((3, 3)), np.empty((2, 3, 8))
    along = turns.reshape(48)
    for e in range(len(gradient)):
        for m in range(8):
            for b in range(2):
                for i in range(3):
                    turns[b, i, m] = bases[nodes[e, m], b, i]
        own_slopes = gradient[e].reshape(points, 48)
        for g in range(points):
            for a in range(3):
                for i in range(3):
                    f[a, i] = axes[e, g, i, a] + slopes[e, 3 * g + a, i]
            _point(f, stress[e, g], own_slopes[g], law[e], volume[e, g], along, half[g])
        np.dot(gradient[e].T, rows, product)
        for n in range(8):  # rows of directors along their bases, too
            own = block[8 + n]
            a0, a1, a2 = turns[0, 0, n], turns[0, 1, n], turns[0, 2, n]
            b0, b1, b2 = turns[1, 0, n], turns[1, 1, n], turns[1, 2, n]
            for m in range(8, 16):
                x, y, z = own[0, m], own[2, m], own[4, m]
                r, s, t = own[1, m], own[3, m], own[5, m]
                own[0, m], own[2, m] = a0 * x + a1 * y + a2 * z, b0 * x + b1 * y + b2 * z
                own[1, m], own[3, m] = a0 * r + a1 * s + a2 * t, b0 * r + b1 * s + b2 * t
        target = places[e]
        for q in range(len(sources)):
            values[_at(target[q])] += entries[_at(sources[q])]
