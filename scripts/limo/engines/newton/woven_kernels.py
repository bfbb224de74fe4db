"""Loops over bricks of woven fabric, as ``internal_forces`` and ``tangent`` in ``kernels`` for isotropic ones.

``law`` (m, 13) in MPa: of C in the order xx, yy, zz, xy, xz, yz with engineering shear, C_11, C_12, C_13, C_14, C_22, C_23,
C_24, C_33, C_34, C_44 and C_55, C_56, C_66. Layers lie in planes of constant z, which are planes of symmetry of their fabric.
"""

from __future__ import annotations

import numpy as np

from limo.engines.newton.kernels import _at, _compiled

#: places of the numbers of a law in C
ROWS, COLUMNS = (0, 0, 0, 0, 1, 1, 1, 2, 2, 3, 4, 4, 5), (0, 1, 2, 3, 1, 2, 3, 2, 3, 3, 4, 5, 5)


def law_of(stiffness: np.ndarray) -> np.ndarray:
    """The laws (m, 13) of C (m, 6, 6)."""
    return np.ascontiguousarray(stiffness[:, ROWS, COLUMNS])


@_compiled("void(f8[:,:,::1], i4[:,::1], f8[:,:,::1], f8[:,::1], f8[:,::1], f8[:,:,::1], f8[:,::1])")
def internal_forces(slopes, bricks, gradient, volume, law, stress, forces):
    """Adds int P Grad N dV_0 to ``forces`` (n, 3), P = F S; ``stress`` (m, g, 6) becomes J w S (xx, yy, zz, xy, xz, yz)."""
    points = volume.shape[1]
    piola, found = np.empty((3 * points, 3)), np.empty((20, 3))
    for e in range(len(bricks)):
        c = law[e]
        for g in range(points):
            d, s, w = slopes[e, 3 * g : 3 * g + 3], stress[e, g], volume[e, g]
            xx = d[0, 0] + 0.5 * (d[0, 0] * d[0, 0] + d[0, 1] * d[0, 1] + d[0, 2] * d[0, 2])
            yy = d[1, 1] + 0.5 * (d[1, 0] * d[1, 0] + d[1, 1] * d[1, 1] + d[1, 2] * d[1, 2])
            zz = d[2, 2] + 0.5 * (d[2, 0] * d[2, 0] + d[2, 1] * d[2, 1] + d[2, 2] * d[2, 2])
            xy = d[0, 1] + d[1, 0] + d[0, 0] * d[1, 0] + d[0, 1] * d[1, 1] + d[0, 2] * d[1, 2]
            xz = d[0, 2] + d[2, 0] + d[0, 0] * d[2, 0] + d[0, 1] * d[2, 1] + d[0, 2] * d[2, 2]
            yz = d[1, 2] + d[2, 1] + d[1, 0] * d[2, 0] + d[1, 1] * d[2, 1] + d[1, 2] * d[2, 2]
            s[0] = w * (c[0] * xx + c[1] * yy + c[2] * zz + c[3] * xy)
            s[1] = w * (c[1] * xx + c[4] * yy + c[5] * zz + c[6] * xy)
            s[2] = w * (c[2] * xx + c[5] * yy + c[7] * zz + c[8] * xy)
            s[3] = w * (c[3] * xx + c[6] * yy + c[8] * zz + c[9] * xy)
            s[4] = w * (c[10] * xz + c[11] * yz)
            s[5] = w * (c[11] * xz + c[12] * yz)
            for i in range(3):
                fx, fy, fz = d[0, i] + (i == 0), d[1, i] + (i == 1), d[2, i] + (i == 2)
                piola[3 * g, i] = fx * s[0] + fy * s[3] + fz * s[4]
                piola[3 * g + 1, i] = fx * s[3] + fy * s[1] + fz * s[5]
                piola[3 * g + 2, i] = fx * s[4] + fy * s[5] + fz * s[2]
        np.dot(gradient[e].T, piola, found)
        for n in range(20):
            for i in range(3):
                forces[bricks[e, n], i] += found[n, i]


@_compiled("void(f8[:,::1], f8[::1], f8[:,::1], f8[::1], f8, f8[:,:,::1])")
def _point(d, s, slopes, c, w, half):
    """J w A_iKjL dN_m/dX_L of one point: (3, 6, 20), K and pair (i, j) and m."""
    for j in range(3):
        fx, fy, fz = d[0, j] + (j == 0), d[1, j] + (j == 1), d[2, j] + (j == 2)
        for i in range(j + 1):
            p = i if i == j else (3 if j == 1 else 4 + i)
            ax, ay, az = w * (d[0, i] + (i == 0)), w * (d[1, i] + (i == 1)), w * (d[2, i] + (i == 2))
            same = 1.0 if i == j else 0.0
            for m in range(20):
                x, y, z = slopes[0, m], slopes[1, m], slopes[2, m]
                xx, yy, zz, xy = fx * x, fy * y, fz * z, fx * y + fy * x
                xz, yz = fx * z + fz * x, fy * z + fz * y
                sxx = c[0] * xx + c[1] * yy + c[2] * zz + c[3] * xy
                syy = c[1] * xx + c[4] * yy + c[5] * zz + c[6] * xy
                szz = c[2] * xx + c[5] * yy + c[7] * zz + c[8] * xy
                sxy = c[3] * xx + c[6] * yy + c[8] * zz + c[9] * xy
                sxz = c[10] * xz + c[11] * yz
                syz = c[11] * xz + c[12] * yz
                half[0, p, m] = ax * sxx + ay * sxy + az * sxz + same * (s[0] * x + s[3] * y + s[4] * z)
                half[1, p, m] = ax * sxy + ay * syy + az * syz + same * (s[3] * x + s[1] * y + s[5] * z)
                half[2, p, m] = ax * sxz + ay * syz + az * szz + same * (s[4] * x + s[5] * y + s[2] * z)


@_compiled("void(f8[:,:,::1], f8[:,:,::1], f8[:,:,::1], f8[:,::1], f8[:,::1], i4[::1], i4[:,::1], i4[::1], f8[:,::1], f8[::1])")
def tangent(slopes, stress, gradient, volume, law, sources, places, special, weights, values):
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
            _point(slopes[e, k : k + 3], stress[e, g], gradient[e, k : k + 3], law[e], volume[e, g], half[g])
        np.dot(gradient[e].T, rows, block)
        if special[e] >= 0:
            for q in range(len(sources)):
                entries[sources[q]] *= weights[special[e], q]
        target = places[e]
        for q in range(len(sources)):
            values[_at(target[q])] += entries[_at(sources[q])]
