"""Von Mises stress of a frame and how the paper sums it up (paper, *Local stress concentration and fatigue risk*).

Quantiles over the area are taken here: numpy's weighted ones have no tolerance where rounding decides which value it is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from limo.measure.zones import ZONES
from limo.mechanics.layer import SIDES, flat_areas, flat_points, inside_out, surface_state
from limo.mechanics.model import Model

TOP = 0.05  # share of the area whose average is the paper's peak stress


def top_average(values: np.ndarray, areas: np.ndarray, fraction: float = TOP) -> float:
    """Area average of the largest ``values`` over ``fraction`` of the area; shapes alike, the unit of the values.

    The value at the border of that area counts with the part that still fits, so the average changes smoothly.
    """
    value, area = np.ravel(values), np.ravel(areas)
    order = np.argsort(-value, kind="stable")
    value, area = value[order], area[order]
    before = np.cumsum(area) - area
    taken = np.clip(fraction * area.sum() - before, 0.0, area)
    return float(taken @ value / taken.sum())


def area_quantile(values: np.ndarray, areas: np.ndarray, level: float) -> float:
    """Smallest value that is not exceeded on the share ``level`` of the area; shapes alike."""
    value, area = np.ravel(values), np.ravel(areas)
    order = np.argsort(value, kind="stable")
    share = np.cumsum(area[order]) / area.sum()
    return float(value[order][min(np.searchsorted(share, level * (1 - 1e-12)), len(value) - 1)])


def top_share(values: np.ndarray, areas: np.ndarray, zone: np.ndarray, fraction: float = TOP) -> np.ndarray:
    """Share (len(ZONES),) of the area with the largest ``values`` (``fraction`` of all) that lies in each zone."""
    limit = area_quantile(values, areas, 1.0 - fraction)
    top = values >= limit
    share = np.bincount(zone[top], areas[top], minlength=len(ZONES))
    return share / share.sum()


def von_mises_map(model: Model, displacements: np.ndarray, source: object = "frame") -> np.ndarray:
    """Von Mises stress (m, 3, 4) in MPa: element, inner/middle/outer surface, 2 x 2 Gauss point."""
    return inside_out(model.mesh, surface_state(model, displacements, source).von_mises)


@dataclass(frozen=True)
class StressSummary:
    """Von Mises stress of a frame, in MPa over the flat area.

    ``top``, ``largest``, ``p99``: of the largest value through the thickness (inner, middle, outer); ``top_middle``: of the
    middle surface alone, where bending adds nothing. ``share`` (len(ZONES),): where the top 5 % of the area lie.
    ``x``, ``y`` (mm, flat), ``zone`` and ``surface``: where the largest value is.
    """

    top: float
    top_middle: float
    largest: float
    p99: float
    share: np.ndarray
    x: float
    y: float
    zone: str
    surface: str


def summarise(model: Model, stress: np.ndarray, zone: np.ndarray) -> StressSummary:
    """Sum up a map (m, 3, 4) of von Mises stress; ``zone`` (m, 4) as indices into ``ZONES``."""
    areas = flat_areas(model.mesh)
    envelope = stress.max(axis=1)
    element, point = np.unravel_index(int(envelope.argmax()), envelope.shape)
    where = flat_points(model.mesh)[element, point]
    return StressSummary(
        top=top_average(envelope, areas),
        top_middle=top_average(stress[:, 1], areas),
        largest=float(envelope.max()),
        p99=area_quantile(envelope, areas, 0.99),
        share=top_share(envelope, areas, zone),
        x=float(where[0]),
        y=float(where[1]),
        zone=ZONES[zone[element, point]],
        surface=SIDES[int(stress[element, :, point].argmax())],
    )
