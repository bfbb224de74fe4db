"""A closed form in the place of a device: two goals that turn against each other, five inputs, one of them a category."""

from __future__ import annotations

import numpy as np

from limo.explore.space import Input, Space

SPACE = Space(
    (
        Input("n_pouches", values=(4.0, 6.0, 8.0, 10.0)),
        Input("aspect_ratio", 1.0, 3.0),
        Input("stiffness_ratio", 0.5, 1.5),
        Input("thickness", 0.12, 0.3),
        Input("seam_shift", -0.15, 0.15),
    )
)
#: goals beyond which nothing counts: a fair design by chance
REFERENCE = np.array([1.3, 1.3])


def goals(places: np.ndarray) -> np.ndarray:
    """(n, 2): a quarter of a circle for the best of the other inputs, which move along it; more pouches cost."""
    pouches, turn, *rest = np.asarray(places, float).T
    away = 0.4 * (pouches - 0.375) ** 2
    for k, each in enumerate(rest):
        away = away + 1.6 * (each - 0.5 - 0.25 * np.sin(2 * np.pi * turn + k)) ** 2
    angle = 0.5 * np.pi * turn
    return np.stack([(1 + away) * np.cos(angle), (1 + away) * np.sin(angle)], axis=1)
