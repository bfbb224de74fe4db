"""Whether an exploration can be at all, before anything is solved: its device, presets, outputs, elements and bounds."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from limo.config.checks import Known, check_preset, check_study
from limo.config.project import Project
from limo.datasets.variables import VARIABLES
from limo.errors import ConfigError
from limo.explore.designs import QUANTITIES, study_of
from limo.schema.device import Pattern
from limo.schema.exploration import BOUND, Exploration

#: by how much the fabric's area may grow: beyond what it does at any pressure of the paper
STRETCH = 0.1


def largest_volume(pattern: Pattern, pouches: int) -> float:
    """What no device of a flat pattern can hold, in ml: a sphere of its fabric's area A, (A (1 + STRETCH))^1.5 / (6 sqrt(pi))."""
    from limo.geometry.pattern import flat_pattern

    flat = flat_pattern(pattern, pouches)
    area = 4.0 * sum(flat.polygon(region).area for region in flat.regions)  # the right half of one of two faces
    return 1e-3 * (area * (1.0 + STRETCH)) ** 1.5 / (6.0 * np.sqrt(np.pi))


def _check_bounds(project: Project, exploration: Exploration, file: Path) -> None:
    """Whether bounds can be met at all: no volume beyond what the fabric can hold, no efficiency beyond one."""
    for name, text in exploration.constraints.items():
        if not (match := BOUND.match(text)) or match[1] != ">=":
            continue
        bound, example = float(match[2]), f'constraints: {{{name}: ">= '
        if name.startswith("efficiency") and bound >= 1:
            raise ConfigError(
                file, f"constraints.{name}", text, "below 1: no device gives more work than it takes", f'{example}0.7"}}'
            )
        if name in VARIABLES and VARIABLES[name].units == "ml":
            widest = exploration.space.width_scale or [project.devices[exploration.device].pattern.width_scale]
            pattern = project.devices[exploration.device].pattern.model_copy(update={"width_scale": max(widest)})
            most = largest_volume(pattern, exploration.space.numbers[0])
            if bound >= most:
                expected = f"below {most:.0f} ml: a sphere of the device's fabric holds no more"
                raise ConfigError(file, f"constraints.{name}", text, expected, f'{example}90"}}')


def check_designs(project: Project, exploration: Exploration, file: Path) -> None:
    """Whether studies of this exploration can be: its device, presets, outputs and elements. Raises ``ConfigError``."""
    known = Known(project.config, project.devices, project.files, {})
    known.check_device(file, "device", exploration.device)
    examples = {"goals": "goals: {efficiency_90ml: maximise}", "constraints": 'constraints: {stroke_volume: ">= 90"}'}
    for key, example in examples.items():
        for name, wanted in getattr(exploration, key).items():
            if name not in QUANTITIES:
                raise ConfigError(file, f"{key}.{name}", wanted, f"one of: {', '.join(QUANTITIES)}", example)
    _check_bounds(project, exploration, file)
    for preset in exploration.budget:
        check_preset(file, preset, project.config)
    middle = {name: 0.5 * sum(ends) for name, ends in exploration.space.continuous.items()}
    design = {"n_pouches": exploration.space.numbers[0]} | middle
    for preset in exploration.budget:
        check_study(known, file, study_of(exploration, design, preset, project.devices[exploration.device]))
