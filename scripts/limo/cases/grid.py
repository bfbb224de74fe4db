"""The grid of a study: its axes, its cases, and those that another engine solves too."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

from limo.cases.case import Case
from limo.config.project import Loaded
from limo.schema.device import Device
from limo.schema.numerics import Numerics
from limo.schema.section import ENGINES


def study_cases(loaded: Loaded, name: str) -> dict[tuple, Case]:
    """The cases of a study by their places along ``study_axes``."""
    study, config = loaded.studies[name], loaded.config
    settings = loaded.settings(study)
    devices = {
        (variant, scale): _scaled(setting.device, scale)
        for variant, setting in settings.items()
        for scale in study.axes.width_scale or [None]
    }
    # what the engine does not look at is no part of a case: changing it must change nothing that a case is compared by
    numerics = {name: s.numerics.for_engine(s.engine) for name, s in settings.items()}
    cases = {}
    for key in product(*study_axes(loaded, name).values()):
        n_pouches, pressure, aspect, stiffness, scale, variant, branch = key
        setting = settings[variant]
        cases[key] = Case(
            device=devices[variant, scale if study.axes.width_scale else None],
            device_name=setting.device_name,
            n_pouches=n_pouches,
            ventricular_pressure=pressure,
            actuation_pressure_max=study.maximum_for(pressure),
            aspect_ratio=aspect,
            stiffness_ratio=stiffness,
            mesh=setting.mesh,
            mesh_level=config.mesh_levels[setting.mesh.level],
            numerics=numerics[variant],
            numerics_name=setting.preset,
            frames=tuple(study.frames_for(pressure)),
            engine=setting.engine,
            build=loaded.builds.get(setting.engine, ""),
            branch=branch,
        )
    return cases


def study_axes(loaded: Loaded, name: str) -> dict[str, list]:
    """The dimensions of a study's grid and their values; those that it does not vary have one.

    Without ``width_scale`` devices have their own; the one of the study's device stands for it.
    """
    study = loaded.studies[name]
    axes = study.axes
    return {
        "n_pouches": axes.n_pouches,
        "ventricular_pressure": axes.ventricular_pressure,
        "aspect_ratio": axes.aspect_ratio,
        "stiffness_ratio": axes.stiffness_ratio,
        "width_scale": axes.width_scale or [loaded.devices[study.device].pattern.width_scale],
        "variant": list(study.variants) or [""],
        "branch": list(range(loaded.branches_of(study))),
    }


def _scaled(device: Device, scale: float | None) -> Device:
    """The device with other widths; with None the device."""
    if scale is None:
        return device
    return device.model_copy(update={"pattern": device.pattern.model_copy(update={"width_scale": scale})})


def cross_checks(loaded: Loaded, name: str) -> dict[tuple, Case]:
    """The cases of a study that another engine solves too, by their place in the study's grid: ``cross_check`` of them.

    They are spread evenly over the grid, the first and the last among them, and none is perturbed.
    """
    study = loaded.studies[name]
    cases = {key: case for key, case in study_cases(loaded, name).items() if not case.branch}
    settings = loaded.settings(study)
    count, keys = min(study.cross_check, len(cases)), list(cases)
    places = [round(k * (len(keys) - 1) / max(count - 1, 1)) for k in range(count)]
    return {keys[k]: _by_other_engine(loaded, cases[keys[k]], settings[keys[k][-2]].numerics) for k in places}


def _by_other_engine(loaded: Loaded, case: Case, numerics: Numerics) -> Case:
    other = next(e for e in ENGINES if e != case.engine)
    return replace(case, engine=other, build=loaded.builds.get(other, ""), numerics=numerics.for_engine(other))
