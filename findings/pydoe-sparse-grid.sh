#!/usr/bin/env bash
# pyDOE3 1.6.2 and pydoe 1.6.0: the sparse grid is none. Number of points right, places wrong: all crowd at one side.
# doe_sparse_grid promises Smolyak's construction and the point counts of the Matlab toolbox spinterp; it keeps the counts.
# Beyond the axes it fills up with the first points of a full grid, in the order of counting, and stops at the promised number.
#   - five factors, level 4, 801 runs: 12 points are those of a sparse grid; four factors exceed their middle in 3 runs each;
#   - a full quadratic fitted to these runs has a mean variance 118 times that of the true grid, 81 times that of lhs;
#   - with two factors and level 2, 6 of 13 points are right, and three of the four corners are missing;
#   - clenshaw_curtis, chebyshev and gauss_patterson give the same points: the argument is not used.
# A sparse grid of 20 lines below has the promised number of points, is symmetric, and agrees with spinterp's printed example.
# The documentation explains Smolyak's formula and three grids to choose from. No issue on the points was found.
# Why it matters: one run of a soft heart takes minutes to hours. 801 runs then know nothing of thick fabric at high pressure.
# What to do: lhs or sobol_sequence of the same package, or a sparse grid of chaospy; look at the mean of every column, 0.5.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"

python3 -m venv venv
venv/bin/pip install -qq --no-compile --disable-pip-version-check numpy==2.4.6 scipy==1.17.1 pyDOE3==1.6.2 pydoe==1.6.0

cat > grid.py <<'END'
import itertools
import sys

import numpy as np
import pydoe
import pyDOE3


def line(level, chebyshev):
    """Points that a level adds on a line from 0 to 1: even spacing (spinterp's Clenshaw-Curtis) or extrema of Chebyshev."""
    if level < 2:
        return ([0.5], [0.0, 1.0])[level]
    odd = np.arange(1, 2**level, 2) / 2**level
    return list((1 - np.cos(np.pi * odd)) / 2 if chebyshev else odd)


def smolyak(level, factors, chebyshev=False):
    """All products of lines whose levels sum up to no more than the level."""
    points = []
    for levels in itertools.product(range(level + 1), repeat=factors):
        if sum(levels) <= level:
            points += itertools.product(*(line(one, chebyshev) for one in levels))
    return np.array(points)


def quadratic(x):
    z = 2 * x - 1
    pairs = itertools.combinations_with_replacement(range(x.shape[1]), 2)
    return np.column_stack([np.ones(len(z)), z, *(z[:, i] * z[:, j] for i, j in pairs)])


def variance(design):
    """Mean over the box of the variance of a fitted full quadratic, noise of one run = 1 (3-point Gauss: exact here)."""
    nodes, weights = np.polynomial.legendre.leggauss(3)
    box = np.array(list(itertools.product((nodes + 1) / 2, repeat=design.shape[1])))
    mass = np.prod(list(itertools.product(weights / 2, repeat=design.shape[1])), axis=1)
    terms, at = quadratic(design), quadratic(box)
    return mass @ np.einsum("ij,jk,ik->i", at, np.linalg.inv(terms.T @ terms), at)


def common(one, other):
    return len({tuple(p) for p in one.round(8)} & {tuple(p) for p in other.round(8)})


seen = True
flat = {(a, b) for a in (0, 0.5, 1) for b in (0, 0.5, 1)} | {(0.25, 0.5), (0.75, 0.5), (0.5, 0.25), (0.5, 0.75)}
seen &= {tuple(p) for p in smolyak(2, 2)} == flat  # levels 0 to 2 with two factors, in the toolbox's description of spgrid
corners = sum(tuple(p) in {(0, 0), (0, 1), (1, 0), (1, 1)} for p in pydoe.doe_sparse_grid(2, 2))
print(f"two factors, level 2: {common(pydoe.doe_sparse_grid(2, 2), smolyak(2, 2))} of 13 points right, {corners} of 4 corners")
print("factors level  runs  right even, Chebyshev  runs above the middle, by factor  mean variance: here  true   lhs")
result = {}
for factors, level in ((2, 2), (3, 3), (3, 4), (5, 3), (5, 4)):
    design = pyDOE3.doe_sparse_grid(level, factors)
    for package in (pyDOE3, pydoe):
        for kind in ("clenshaw_curtis", "chebyshev", "gauss_patterson"):
            seen &= np.array_equal(design, package.doe_sparse_grid(level, factors, kind))
    true, chebyshev = smolyak(level, factors), smolyak(level, factors, chebyshev=True)
    for grid in (true, chebyshev):
        seen &= len(grid) == len(np.unique(grid, axis=0)) == pyDOE3.sparse_grid_dimension(level, factors) == len(design)
        seen &= bool(np.allclose(grid.mean(axis=0), 0.5)) and common(grid, 1 - grid) == len(grid)
    above = (design > 0.5).sum(axis=0)
    spread = [variance(d) for d in (design, true, pyDOE3.lhs(factors, len(design), seed=1))]
    result[factors, level] = common(design, true), above[0], spread[0] / spread[1], spread[0] / spread[2]
    print(f"{factors:7d}{level:6d}{len(design):6d}{common(design, true):12d}{common(design, chebyshev):11d}  {str(above):>32s}"
          f"{spread[0]:21.3f}{spread[1]:6.3f}{spread[2]:6.3f}")
seen &= corners == 1 and result[2, 2][0] == 6
seen &= np.allclose(result[5, 4], (12, 3, 117.5, 81), rtol=0.05)
print("as described" if seen else "CHANGED: other points")
sys.exit(not seen)
END
venv/bin/python grid.py
