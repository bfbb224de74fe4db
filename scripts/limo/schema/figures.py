"""The catalogue of figures: names, what each needs and which shapes it draws."""

from __future__ import annotations

from collections.abc import Mapping
from math import prod

#: cases that a figure can tell apart; of more, so many are drawn at most
MOST_CASES = 40

#: figures a study may name
FIGURES = (
    "pressure_volume",
    "strain_life",
    "afterload",
    "deformation",
    "kinematics",
    "von_mises",
    "cycles",
    "strain_paths",
    "buckling",
    "design",
    "trends",
    "loops",
)


#: figures that measured curves of a study are laid over (``bench.curves``)
MEASURED = ("pressure_volume", "afterload", "buckling", "design")


#: figures of an airbag, drawn from its dataset (``limo.airbag.solve.gather``)
AIRBAG_FIGURES = ("airbag_convergence", "airbag_shapes")


#: figures of the errors of the device's settings, drawn from ``docs/gallery/data/accuracy.nc`` (``limo.accuracy.errors``)
DEVICE_FIGURES = ("accuracy_cost", "accuracy_convergence", "accuracy_sections", "accuracy_scaling")


#: figures that need an output of their study beyond volumes
NEEDS = {"strain_life": "fatigue", "cycles": "fatigue", "afterload": "contact"}


#: figures of what follows the first ramp, which their study's ``actuation`` says
OF_CYCLES = ("loops",)


#: what may be drawn of the shapes of a study (``datasets.shapes``): displacements at all of its frames or at the pressures of its
#: maps, stress, strain amplitudes and lines along v_1 there, and displacements across the largest buckling event
ITEMS = ("frames", "maps", "von_mises", "fatigue", "lines", "event")


#: what figures draw of them
SHAPES = {
    "deformation": ("frames",),
    "kinematics": ("frames",),
    "von_mises": ("maps", "von_mises"),
    "strain_life": ("maps", "fatigue"),
    "cycles": ("maps", "fatigue"),
    "strain_paths": ("maps", "lines"),
    "buckling": ("maps", "event"),
    "design": ("maps", "von_mises"),
}


def items_of(figures: list[str]) -> tuple[str, ...]:
    """What some figures together draw beyond curves, of ``ITEMS``."""
    asked = {item for figure in figures for item in SHAPES.get(figure, ())}
    return tuple(item for item in ITEMS if item in asked)


def shown_places(sizes: Mapping[str, int], most: int = MOST_CASES) -> dict[str, list[int]]:
    """Places along each axis of a grid of ``sizes`` that figures show: evenly spread, ``most`` cases in all at most.

    The longest axis is thinned first; its ends stay. Branches of a case are one curve with a band: they do not count.
    """
    counts = dict(sizes)
    while prod(n for name, n in counts.items() if name != "branch") > most:
        counts[max((name for name in counts if name != "branch"), key=counts.__getitem__)] -= 1
    return {name: _spread(size, counts[name]) for name, size in sizes.items()}


def _spread(count: int, most: int) -> list[int]:
    if most >= count:
        return list(range(count))
    return sorted({round(k * (count - 1) / max(most - 1, 1)) for k in range(most)})
