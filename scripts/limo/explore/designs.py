"""Designs as ordinary studies: each one is solved, measured and gathered as any device is, and told by its numbers.

A design is a study of one device with the branches of its preset. So its cases have names, are shared, and fail as others do.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from limo.config.project import Project
from limo.config.settings import setting_of
from limo.datasets.variables import VARIABLES
from limo.errors import ConfigError
from limo.explore.space import Design, Input, Space
from limo.measure.quantities import MEASURES
from limo.schema.device import Device, Pattern
from limo.schema.exploration import ON_AXIS, Exploration
from limo.schema.study import Study, Variant

#: decimals of inputs: designs are written down, made again and named by them
DECIMALS = 6
#: what goals and constraints may be: numbers of a case, curves over P_a, and measures of a case or of its frames
QUANTITIES = {
    **dict.fromkeys(VARIABLES, ""),
    **{name: measure.output for name, measure in MEASURES.items() if measure.units and measure.per in ((), ("frame",))},
}


def own_design(exploration: Exploration, device: Device) -> dict[str, float] | None:
    """The device as it is, with the number of pouches of ``baseline``, as a design; None where it lies outside of the space."""
    ends = exploration.space.continuous
    own = {
        "aspect_ratio": 2.0,
        "stiffness_ratio": 1.0,
        "thickness": device.material.thickness,
        "seam_shift": 0.0,
        "width_scale": device.pattern.width_scale,
    }
    inside = all(low <= own[name] <= high for name, (low, high) in ends.items())
    if exploration.baseline is None or not inside:
        return None
    return {"n_pouches": exploration.baseline} | {name: own[name] for name in ends}


def space_of(exploration: Exploration) -> Space:
    """The inputs of an exploration: numbers of pouches first, of one alone nothing."""
    numbers = tuple(float(n) for n in exploration.space.numbers)
    first = (Input("n_pouches", values=numbers),) if len(numbers) > 1 else ()
    moved = tuple(n for n in numbers if n > ON_AXIS) if min(numbers) <= ON_AXIS else ()
    ranges = exploration.space.continuous.items()
    return Space(first + tuple(Input(n, *ends, acts_with=moved if n == "seam_shift" else ()) for n, ends in ranges))


def written(exploration: Exploration, design: Design) -> dict[str, float]:
    """A design as it is kept: rounded, with its number of pouches."""
    plain = {name: round(float(value), DECIMALS) for name, value in design.items() if name != "n_pouches"}
    return {"n_pouches": int(design.get("n_pouches", exploration.space.numbers[0]))} | plain


def study_of(exploration: Exploration, design: Mapping[str, float], preset: str, device: Device) -> Study:
    """The study of one design (``written``) of a device by a preset, with what goals and constraints need."""
    pouches = int(design["n_pouches"])
    axes: dict[str, Any] = {"n_pouches": [pouches], "ventricular_pressure": exploration.at.ventricular_pressure}
    axes |= {name: [design[name]] for name in ("aspect_ratio", "stiffness_ratio", "width_scale") if name in design}
    outputs = {"volumes", "contact", *(QUANTITIES[name] for name in (*exploration.goals, *exploration.constraints))} - {""}
    study: dict[str, Any] = {
        "description": f"a design of an exploration: {exploration.description}",
        "device": exploration.device,
        "preset": preset,
        "axes": axes,
        "actuation_pressure_max": exploration.at.actuation_pressure_max,
        "outputs": sorted(outputs),
    }
    if "thickness" in design:
        density = device.material.areal_density * design["thickness"] / device.material.thickness
        study["material"] = {"thickness": design["thickness"], "areal_density": round(density, DECIMALS)}
    if design.get("seam_shift"):
        from limo.geometry.pattern import seam_fractions

        moved = [round(f * (1 + design["seam_shift"]), DECIMALS) for f in seam_fractions(device.pattern, pouches)]
        study["pattern"] = {"seams": {"fractions": {pouches: moved}}}
    return Study.model_validate(study)


def pattern_of(project: Project, exploration: Exploration, design: Mapping[str, float]) -> Pattern:
    """The flat pattern of a design (``written``)."""
    study = study_of(exploration, design, exploration.cheap, project.devices[exploration.device])
    pattern = setting_of(project.config, project.devices, study, Variant()).device.pattern
    return pattern.model_copy(update={"width_scale": design["width_scale"]}) if "width_scale" in design else pattern


def can_be_made(project: Project, exploration: Exploration) -> Callable[[Design], bool]:
    """Whether the layout of a design can be cut, which is looked at before anything is meshed."""
    from limo.geometry.pattern import flat_pattern

    def allowed(design: Design) -> bool:
        plain = written(exploration, design)
        try:
            flat_pattern(pattern_of(project, exploration, plain), plain["n_pouches"])
        except (ConfigError, ValueError):
            return False
        return True

    return allowed


def project_of(project: Project, exploration: Exploration, designs: Mapping[str, Mapping[str, float]], preset: str) -> Project:
    """A project whose studies are designs, by their names. Raises pydantic's ``ValidationError`` for one that is no study."""
    return with_studies(project, studies_of(project, exploration, designs, preset))


def studies_of(
    project: Project, exploration: Exploration, designs: Mapping[str, Mapping[str, float]], preset: str
) -> dict[str, Study]:
    """Designs as studies, by their names."""
    device = project.devices[exploration.device]
    return {name: study_of(exploration, design, preset, device) for name, design in designs.items()}


def with_studies(project: Project, studies: Mapping[str, Study]) -> Project:
    """The project with other studies alone."""
    return replace(project, studies=dict(studies), broken={}, checked=None)
