"""Loops over loaded faces and their integration points, as in ``kernels`` for bricks; equations as in ``faces``.

``places`` (n, 3) in mm of all nodes, ``nodes`` (f, 8) of faces, ``pressure`` (f,) in MPa. ``slopes`` (2 g, 8): dN / dxi_1 at g
points, then dN / dxi_2.
"""

from __future__ import annotations

import numpy as np

from limo.engines.newton.kernels import _compiled


@_compiled("void(f8[:,::1], i4[::1], f8[:,::1], f8[:,::1])")
def _tangents(places, nodes, slopes, found):
    """x_,1 at the points of a face, then x_,2: (2 g, 3)."""
    for k in range(len(slopes)):
        x = y = z = 0.0
        for n in range(8):
            slope, node = slopes[k, n], nodes[n]
            x += slope * places[node, 0]
            y += slope * places[node, 1]
            z += slope * places[node, 2]
        found[k, 0], found[k, 1], found[k, 2] = x, y, z


@_compiled("void(f8[:,::1], i4[:,::1], f8[:,::1], f8[:,::1], f8[::1], f8[:,::1])")
def forces(places, nodes, values, slopes, pressure, total):
    """Adds int N p (x_,1 x x_,2) dxi to ``total`` (n, 3); ``values`` (8, g) are weighted."""
    points = len(slopes) // 2
    along, normal = np.empty((2 * points, 3)), np.empty((points, 3))
    for f in range(len(nodes)):
        _tangents(places, nodes[f], slopes, along)
        for g in range(points):
            x, y, z = along[g, 0], along[g, 1], along[g, 2]
            r, s, t = along[points + g, 0], along[points + g, 1], along[points + g, 2]
            normal[g, 0] = pressure[f] * (y * t - z * s)
            normal[g, 1] = pressure[f] * (z * r - x * t)
            normal[g, 2] = pressure[f] * (x * s - y * r)
        for n in range(8):
            x = y = z = 0.0
            for g in range(points):
                x += values[n, g] * normal[g, 0]
                y += values[n, g] * normal[g, 1]
                z += values[n, g] * normal[g, 2]
            node = nodes[f, n]
            total[node, 0] += x
            total[node, 1] += y
            total[node, 2] += z


@_compiled("void(f8[:,::1], i4[:,::1], f8[:,::1], f8[:,::1], f8[::1], f8[:,:,::1])")
def tangents(places, nodes, turned, slopes, pressure, found):
    """``Faces.tangent`` (f, 28, 3) of ``turned`` (28, 2 g), what multiplies x_,1 and x_,2 in each pair of nodes."""
    along = np.empty((len(slopes), 3))
    for f in range(len(nodes)):
        _tangents(places, nodes[f], slopes, along)
        for p in range(len(turned)):
            x = y = z = 0.0
            for k in range(len(along)):
                x += turned[p, k] * along[k, 0]
                y += turned[p, k] * along[k, 1]
                z += turned[p, k] * along[k, 2]
            # eps_012 = 1, eps_021 = -1, eps_120 = 1
            found[f, p, 0], found[f, p, 1], found[f, p, 2] = pressure[f] * z, -pressure[f] * y, pressure[f] * x
