"""Loops over pairs of layers that touch, as in ``kernels`` for bricks; equations as in ``limo.mechanics.contact``."""

from __future__ import annotations

import numpy as np

from limo.engines.newton.kernels import _compiled


@_compiled("void(f8[:,::1], i8[:,::1], i8[:,::1], f8[:,::1], f8[:,::1], f8[:,::1], f8[:,::1], f8[::1], f8, f8, f8[:,:,:,::1])")
def pair_tangents(x, lower, upper, values, first, second, area, weights, penalty, reach, found):
    """d^2 Pi_c / dx^2 (q, 16, 6, 16) of pairs (q, 8): slots, parts in the order of ``kernels.PAIRS``, slots.

    ``values``, ``first``, ``second`` (g, 8): shape functions and their slopes at the points; ``area`` (q, g): A_0.
    """
    a, b, c = np.empty(16), np.empty(16), np.empty(16)
    slope = np.empty((16, 3))
    for q in range(len(lower)):
        out = found[q]
        out[:] = 0.0
        for g in range(len(values)):
            d0 = d1 = d2 = u0 = u1 = u2 = v0 = v1 = v2 = 0.0
            # half of how far the tangents of the upper layer are from those of the lower one
            e0 = e1 = e2 = h0 = h1 = h2 = 0.0
            for n in range(8):
                low, high = x[lower[q, n]], x[upper[q, n]]
                f, s, t = values[g, n], 0.5 * first[g, n], 0.5 * second[g, n]
                a[n], a[8 + n] = -f, f
                b[n], b[8 + n] = s, s
                c[n], c[8 + n] = t, t
                d0 += f * (high[0] - low[0])
                d1 += f * (high[1] - low[1])
                d2 += f * (high[2] - low[2])
                u0 += s * (high[0] + low[0])
                u1 += s * (high[1] + low[1])
                u2 += s * (high[2] + low[2])
                v0 += t * (high[0] + low[0])
                v1 += t * (high[1] + low[1])
                v2 += t * (high[2] + low[2])
                e0 += s * (high[0] - low[0])
                e1 += s * (high[1] - low[1])
                e2 += s * (high[2] - low[2])
                h0 += t * (high[0] - low[0])
                h1 += t * (high[1] - low[1])
                h2 += t * (high[2] - low[2])
            across0, across1, across2 = u1 * v2 - u2 * v1, u2 * v0 - u0 * v2, u0 * v1 - u1 * v0
            gap = (d0 * across0 + d1 * across1 + d2 * across2) / area[q, g]
            # normals of both layers are across + e x h, plus and minus e x v + u x h
            p0, p1, p2 = across0 + e1 * h2 - e2 * h1, across1 + e2 * h0 - e0 * h2, across2 + e0 * h1 - e1 * h0
            w0 = e1 * v2 - e2 * v1 + u1 * h2 - u2 * h1
            w1 = e2 * v0 - e0 * v2 + u2 * h0 - u0 * h2
            w2 = e0 * v1 - e1 * v0 + u0 * h1 - u1 * h0
            facing = p0 * p0 + p1 * p1 + p2 * p2 - w0 * w0 - w1 * w1 - w2 * w2
            if gap >= reach or facing <= 0:
                continue
            if gap < -reach:
                pressure, stiff = -penalty * gap, penalty
            else:
                pressure, stiff = penalty * (reach - gap) ** 2 / (4 * reach), penalty * (reach - gap) / (2 * reach)
            stiff *= weights[g] / area[q, g]
            pressure *= weights[g]
            one0, one1, one2 = v1 * d2 - v2 * d1, v2 * d0 - v0 * d2, v0 * d1 - v1 * d0
            two0, two1, two2 = d1 * u2 - d2 * u1, d2 * u0 - d0 * u2, d0 * u1 - d1 * u0
            for n in range(16):
                slope[n, 0] = a[n] * across0 + b[n] * one0 + c[n] * two0
                slope[n, 1] = a[n] * across1 + b[n] * one1 + c[n] * two1
                slope[n, 2] = a[n] * across2 + b[n] * one2 + c[n] * two2
            for n in range(16):
                x0, x1, x2 = stiff * slope[n, 0], stiff * slope[n, 1], stiff * slope[n, 2]
                for m in range(16):
                    ab, ac, bc = a[n] * b[m] - b[n] * a[m], a[n] * c[m] - c[n] * a[m], b[n] * c[m] - c[n] * b[m]
                    out[n, 0, m] += x0 * slope[m, 0]
                    out[n, 1, m] += x1 * slope[m, 1]
                    out[n, 2, m] += x2 * slope[m, 2]
                    out[n, 3, m] += x0 * slope[m, 1] - pressure * (ab * v2 - ac * u2 + bc * d2)
                    out[n, 4, m] += x0 * slope[m, 2] + pressure * (ab * v1 - ac * u1 + bc * d1)
                    out[n, 5, m] += x1 * slope[m, 2] - pressure * (ab * v0 - ac * u0 + bc * d0)
