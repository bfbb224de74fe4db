"""Mechanics of *Less In More Out* soft artificial hearts: mesh, solve, measure, draw.

The package knows nothing of Snakemake; ``scripts/*.py`` are the doors between the two.
Lengths are in mm, forces in N, stresses in MPa, masses in tonne and time in s wherever a solver sees them.
"""

__version__ = "0.1.0"
