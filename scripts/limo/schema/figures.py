"""The catalogue of figures: names, what each needs and which shapes it draws."""

from __future__ import annotations

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
)


#: figures that measured curves of a study are laid over (``bench.curves``)
MEASURED = ("pressure_volume", "afterload", "buckling", "design")


#: figures of an airbag, drawn from its dataset (``limo.airbag.solve.gather``)
AIRBAG_FIGURES = ("airbag_convergence", "airbag_shapes")


#: figures of the errors of the device's settings, drawn from ``docs/gallery/data/accuracy.nc`` (``limo.accuracy.errors``)
DEVICE_FIGURES = ("accuracy_cost", "accuracy_convergence", "accuracy_sections", "accuracy_scaling")


#: figures that need an output of their study beyond volumes
NEEDS = {"strain_life": "fatigue", "cycles": "fatigue", "afterload": "contact"}


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
