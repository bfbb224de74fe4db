"""Loops over shells with directors of fixed length and their integration points, as in ``kernels`` for bricks.

m elements of 16 slots (displacements of eight nodes, then of their directors), g integration points, s slots in all.
``gradient`` (m, 3 g, 16) is dN / dX_K with rows (g, K), K along the axes of a point. ``axes`` (m, g, 3, 3): these axes as
columns, the third one across the layer. ``law`` (m, 10): Q_11, Q_12, Q_16, Q_22, Q_26, Q_66 of plane stress in MPa, the shear
moduli G_44, G_45, G_55 of (yz, xz), and what resists a stretch across. Equations as in ``shell``.
"""

from __future__ import annotations

import numpy as np

from limo.engines.newton.kernels import _compiled

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


# The signature is stated: compiled for the types of its first call, it gave the process that compiled it a tangent with other
# last bits than those that took it from the cache, and so another path (numba 0.68.1).
@_compiled("void(f8[:,::1], f8[::1], f8[:,::1], f8[::1], f8, f8[:,:,::1])")
def _point(f, s, slopes, q, w, half):
    """J w A_iKjL dN_m/dX_L of one point: (3, 6, 16), K and pair (i, j) and m. ``f`` rows K, columns i."""
    q11, q12, q16, q22, q26, q66 = w * q[0], w * q[1], w * q[2], w * q[3], w * q[4], w * q[5]
    g44, g45, g55, q33 = w * q[6], w * q[7], w * q[8], w * q[9]
    for j in range(3):
        fx, fy, fz = f[0, j], f[1, j], f[2, j]
        for i in range(j + 1):
            p = i if i == j else (3 if j == 1 else 4 + i)
            ax, ay, az = f[0, i], f[1, i], f[2, i]
            same = 1.0 if i == j else 0.0
            for m in range(16):
                x, y, z = slopes[0, m], slopes[1, m], slopes[2, m]
                xx, yy, xy = fx * x, fy * y, fx * y + fy * x
                xz, yz = fx * z + fz * x, fy * z + fz * y
                sxx = q11 * xx + q12 * yy + q16 * xy
                syy = q12 * xx + q22 * yy + q26 * xy
                sxy = q16 * xx + q26 * yy + q66 * xy
                sxz = g55 * xz + g45 * yz
                syz = g45 * xz + g44 * yz
                half[0, p, m] = ax * sxx + ay * sxy + az * sxz + same * (s[0] * x + s[2] * y + s[3] * z)
                half[1, p, m] = ax * sxy + ay * syy + az * syz + same * (s[2] * x + s[1] * y + s[4] * z)
                half[2, p, m] = ax * sxz + ay * syz + az * q33 * fz * z + same * (s[3] * x + s[4] * y + s[5] * z)


@_compiled(
    "void(f8[:,:,::1], f8[:,:,::1], f8[:,:,::1], f8[:,:,:,::1], f8[:,::1], f8[:,::1], i4[:,::1], f8[:,:,::1],"
    " i4[::1], i4[:,::1], f8[::1])"
)
def tangent(slopes, stress, gradient, axes, volume, law, nodes, bases, sources, places, values):
    """Adds the shells' tangents to ``values``: entry ``sources[q]`` of a matrix (48, 48) to ``places[e, q]``.

    ``nodes`` (m, 8): of each element; ``bases`` (nodes, 2, 3): unit vectors along which directors move. Rows and columns of
    the last eight slots are turned to these; their third ones mean nothing.
    """
    points = volume.shape[1]
    half = np.empty((points, 3, 6, 16))
    rows = half.reshape(3 * points, 96)
    block = np.empty((16, 96))
    whole = np.empty((16, 3, 16, 3))
    entries = whole.reshape(2304)
    f = np.empty((3, 3))
    for e in range(len(gradient)):
        for g in range(points):
            k = 3 * g
            for a in range(3):
                for i in range(3):
                    f[a, i] = axes[e, g, i, a] + slopes[e, k + a, i]
            _point(f, stress[e, g], gradient[e, k : k + 3], law[e], volume[e, g], half[g])
        np.dot(gradient[e].T, rows, block)
        for n in range(16):
            for m in range(16):
                whole[n, 0, m, 0] = block[n, m]
                whole[n, 1, m, 1] = block[n, 16 + m]
                whole[n, 2, m, 2] = block[n, 32 + m]
                whole[n, 0, m, 1] = block[n, 48 + m]
                whole[m, 1, n, 0] = block[n, 48 + m]
                whole[n, 0, m, 2] = block[n, 64 + m]
                whole[m, 2, n, 0] = block[n, 64 + m]
                whole[n, 1, m, 2] = block[n, 80 + m]
                whole[m, 2, n, 1] = block[n, 80 + m]
        for m in range(8, 16):
            b = bases[nodes[e, m - 8]]
            for n in range(m + 1):
                for i in range(3):
                    x, y, z = whole[n, i, m, 0], whole[n, i, m, 1], whole[n, i, m, 2]
                    whole[n, i, m, 0] = x * b[0, 0] + y * b[0, 1] + z * b[0, 2]
                    whole[n, i, m, 1] = x * b[1, 0] + y * b[1, 1] + z * b[1, 2]
        for n in range(8, 16):
            b = bases[nodes[e, n - 8]]
            for m in range(n, 16):
                for j in range(2):
                    x, y, z = whole[n, 0, m, j], whole[n, 1, m, j], whole[n, 2, m, j]
                    whole[n, 0, m, j] = x * b[0, 0] + y * b[0, 1] + z * b[0, 2]
                    whole[n, 1, m, j] = x * b[1, 0] + y * b[1, 1] + z * b[1, 2]
        target = places[e]
        for q in range(len(sources)):
            values[target[q]] += entries[sources[q]]
