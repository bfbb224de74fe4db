"""Bricks, constraints and loads; deformation, stress, volumes, energy and equilibrium."""
