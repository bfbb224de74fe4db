"""Loops over pairs of layers that touch, as in ``kernels`` for bricks; equations as in ``limo.mechanics.contact``."""

from __future__ import annotations

import numpy as np

from limo.engines.newton.kernels import _compiled


@_compiled()
def _placed(x, lower, upper, values, first, second):
    """delta, a_1 and a_2 of a pair with nodes (8,) at a point with shape functions and their slopes (8,)."""
    d0 = d1 = d2 = u0 = u1 = u2 = v0 = v1 = v2 = 0.0
    for n in range(8):
        low, high = x[lower[n]], x[upper[n]]
        f, s, t = values[n], 0.5 * first[n], 0.5 * second[n]
        d0 += f * (high[0] - low[0])
        d1 += f * (high[1] - low[1])
        d2 += f * (high[2] - low[2])
        u0 += s * (high[0] + low[0])
        u1 += s * (high[1] + low[1])
        u2 += s * (high[2] + low[2])
        v0 += t * (high[0] + low[0])
        v1 += t * (high[1] + low[1])
        v2 += t * (high[2] + low[2])
    return d0, d1, d2, u0, u1, u2, v0, v1, v2


@_compiled()
def _pressed(gap, penalty, reach):
    """p, -dp/dg and psi of a gap below the reach."""
    if gap < -reach:
        return -penalty * gap, penalty, penalty * (0.5 * gap * gap + reach * reach / 6)
    near = reach - gap
    return penalty * near**2 / (4 * reach), penalty * near / (2 * reach), penalty * near**3 / (12 * reach)


@_compiled(
    "void(f8[:,::1], i8[:,::1], i8[:,::1], f8[:,::1], f8[:,::1], f8[:,::1], f8[:,::1], f8[::1], f8, f8, f8, f8[:,:,:,::1])"
)
def pair_tangents(x, lower, upper, values, first, second, area, weights, penalty, reach, span, found):
    """d^2 Pi_c / dx^2 (q, 16, 6, 16) of pairs (q, 8): slots, parts in the order of ``kernels.PAIRS``, slots.

    ``values``, ``first``, ``second`` (g, 8): shape functions and their slopes at the points; ``area`` (q, g): A_0.
    """
    a, b, c = np.empty(16), np.empty(16), np.empty(16)
    start, width = 0.25 * span * span, 0.75 * span * span
    slope = np.empty((16, 3))
    for q in range(len(lower)):
        out = found[q]
        out[:] = 0.0
        for g in range(len(values)):
            d0, d1, d2, u0, u1, u2, v0, v1, v2 = _placed(x, lower[q], upper[q], values[g], first[g], second[g])
            across0, across1, across2 = u1 * v2 - u2 * v1, u2 * v0 - u0 * v2, u0 * v1 - u1 * v0
            gap = (d0 * across0 + d1 * across1 + d2 * across2) / area[q, g]
            far = (d0 * d0 + d1 * d1 + d2 * d2 - start) / width
            if gap >= reach or far >= 1:
                continue
            for n in range(8):
                a[n], a[8 + n] = -values[g, n], values[g, n]
                b[n] = b[8 + n] = 0.5 * first[g, n]
                c[n] = c[8 + n] = 0.5 * second[g, n]
            pressure, stiff, stored = _pressed(gap, penalty, reach)
            # w, and its slopes by |delta|^2, of which delta depends on nodes by 2 a_n delta
            w, w1, w2 = 1.0, 0.0, 0.0
            if far > 0:
                w = 1 - far**3 * (10 - 15 * far + 6 * far * far)
                w1 = -30 * (far * (1 - far)) ** 2 / width
                w2 = -60 * far * (1 - far) * (1 - 2 * far) / (width * width)
            same = 2 * w1 * stored * weights[g] * area[q, g]
            both = 4 * w2 * stored * weights[g] * area[q, g]
            mixed = -2 * w1 * pressure * weights[g]
            stiff *= w * weights[g] / area[q, g]
            pressure *= w * weights[g]
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
            if far <= 0:
                continue
            for n in range(16):
                for m in range(16):
                    own, f, h = both * a[n] * a[m], mixed * a[n], mixed * a[m]
                    out[n, 0, m] += (own * d0 + f * slope[m, 0] + h * slope[n, 0]) * d0 + same * a[n] * a[m]
                    out[n, 1, m] += (own * d1 + f * slope[m, 1] + h * slope[n, 1]) * d1 + same * a[n] * a[m]
                    out[n, 2, m] += (own * d2 + f * slope[m, 2] + h * slope[n, 2]) * d2 + same * a[n] * a[m]
                    out[n, 3, m] += own * d0 * d1 + f * d0 * slope[m, 1] + h * slope[n, 0] * d1
                    out[n, 4, m] += own * d0 * d2 + f * d0 * slope[m, 2] + h * slope[n, 0] * d2
                    out[n, 5, m] += own * d1 * d2 + f * d1 * slope[m, 2] + h * slope[n, 1] * d2


@_compiled("void(f8[:,::1], i8[:,::1], i8[:,::1], f8[:,::1], f8[:,::1], f8[:,::1], f8[:,::1], f8[::1], f8, f8, f8, f8[:,::1])")
def pair_forces(x, lower, upper, values, first, second, area, weights, penalty, reach, span, total):
    """Add d Pi_c / dx of pairs (q, 8) to ``total`` (n, 3). Others as above."""
    start, width = 0.25 * span * span, 0.75 * span * span
    for q in range(len(lower)):
        for g in range(len(values)):
            d0, d1, d2, u0, u1, u2, v0, v1, v2 = _placed(x, lower[q], upper[q], values[g], first[g], second[g])
            across0, across1, across2 = u1 * v2 - u2 * v1, u2 * v0 - u0 * v2, u0 * v1 - u1 * v0
            gap = (d0 * across0 + d1 * across1 + d2 * across2) / area[q, g]
            far = (d0 * d0 + d1 * d1 + d2 * d2 - start) / width
            if gap >= reach or far >= 1:
                continue
            pressure, _, stored = _pressed(gap, penalty, reach)
            w, apart = 1.0, 0.0
            if far > 0:
                w = 1 - far**3 * (10 - 15 * far + 6 * far * far)
                apart = -60 * (far * (1 - far)) ** 2 / width * stored * weights[g] * area[q, g]
            push = -w * weights[g] * pressure
            one0, one1, one2 = v1 * d2 - v2 * d1, v2 * d0 - v0 * d2, v0 * d1 - v1 * d0
            two0, two1, two2 = d1 * u2 - d2 * u1, d2 * u0 - d0 * u2, d0 * u1 - d1 * u0
            for n in range(8):
                f, s, t = values[g, n], 0.5 * first[g, n], 0.5 * second[g, n]
                mean0, mean1, mean2 = s * one0 + t * two0, s * one1 + t * two1, s * one2 + t * two2
                across = push * f
                total[lower[q, n], 0] += push * mean0 - across * across0 - apart * f * d0
                total[lower[q, n], 1] += push * mean1 - across * across1 - apart * f * d1
                total[lower[q, n], 2] += push * mean2 - across * across2 - apart * f * d2
                total[upper[q, n], 0] += push * mean0 + across * across0 + apart * f * d0
                total[upper[q, n], 1] += push * mean1 + across * across1 + apart * f * d1
                total[upper[q, n], 2] += push * mean2 + across * across2 + apart * f * d2


@_compiled("void(f8[:,::1], i8[:,::1], i8[:,::1], f8[:,::1], f8[:,::1], f8[:,::1], f8[:,::1], f8, f8, b1[::1])")
def pairs_near(x, lower, upper, values, first, second, area, below, span, near):
    """Which pairs (q, 8) have a gap of less than ``below`` at a point that is not further from its partner than the span."""
    for q in range(len(lower)):
        near[q] = False
        for g in range(len(values)):
            d0, d1, d2, u0, u1, u2, v0, v1, v2 = _placed(x, lower[q], upper[q], values[g], first[g], second[g])
            across0, across1, across2 = u1 * v2 - u2 * v1, u2 * v0 - u0 * v2, u0 * v1 - u1 * v0
            gap = (d0 * across0 + d1 * across1 + d2 * across2) / area[q, g]
            if gap < below and d0 * d0 + d1 * d1 + d2 * d2 < span * span:
                near[q] = True
