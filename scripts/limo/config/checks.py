"""What the files of a configuration say about each other must fit together."""

from __future__ import annotations

from collections.abc import Collection
from itertools import product
from pathlib import Path
from typing import Any, get_args

from pydantic import ValidationError

from limo.config.project import Loaded, Setting
from limo.config.rungs import check_ladder
from limo.config.yaml_file import _explain
from limo.engines.find import find_engine
from limo.errors import ConfigError
from limo.geometry.pattern import flat_pattern
from limo.schema.accuracy import Airbag
from limo.schema.config import Config
from limo.schema.device import Material
from limo.schema.element import element as find_element
from limo.schema.figures import FIGURES, NEEDS
from limo.schema.numerics import Numerics
from limo.schema.reliability import StressTest
from limo.schema.section import ENGINES, ElementName
from limo.schema.solver import Rung
from limo.schema.study import Study, Variant


def _check_recovery(path: Path, config: Config) -> None:
    """Every rung must be possible with every preset and mesh level."""

    for engine in ENGINES:
        rungs: list[Rung] = getattr(config.recovery, engine)
        names = [rung.name for rung in rungs]
        example = "recovery: {newton: [{name: smaller_load_steps, multiply: {newton.load_step: 0.25}}]}"
        if len(set(names)) < len(names):
            raise ConfigError(path, f"recovery.{engine}", names, "no name twice", example)
        for (preset, numerics), (level, size) in product(config.numerics_presets.items(), config.mesh_levels.items()):
            try:
                check_ladder(rungs, numerics, size)
            except ValueError as error:
                expected = f"factors that leave the preset {preset} and the mesh level {level} in their ranges ({error})"
                raise ConfigError(path, f"recovery.{engine}", names, expected, example) from None


def _check_stress_test(path: Path, loaded: Loaded, test: StressTest) -> None:
    """What a stress test names must exist; layouts that cannot be cut are found when it is run."""
    _check_names(path, "stress_test.device", test.device, loaded.devices)
    _check_names(path, "stress_test.mesh.level", test.mesh.level, loaded.config.mesh_levels)
    if test.numerics:
        _check_names(path, "stress_test.numerics", test.numerics, loaded.config.numerics_presets)
    if usable := _other_elements(test.engines, test.mesh.element):
        raise ConfigError(path, "stress_test.mesh.element", test.mesh.element, " or ".join(usable), f"element: {usable[0]}")


def _check_names(path: Path, key: str, value: str, known: dict[str, Any], *, listed: bool = False) -> None:
    """``value`` of a key (``listed``: one of several) must be a name in ``known``."""
    if value not in known:
        names = ", ".join(known)
        section, _, last = key.rpartition(".")
        example = f"{last}: {[next(iter(known))] if listed else next(iter(known))}".replace("'", "")
        raise ConfigError(path, key, value, f"one of: {names}", f"{section}: {{{example}}}" if section else example)


def _check_preset(path: Path, name: str, config: Config) -> None:
    if not config.presets:
        expected = "no preset, for the configuration has no presets"
        raise ConfigError(path, "preset", name, expected, "presets: {preview: {mesh: {level: preview}}}")
    _check_names(path, "preset", name, config.presets)


def _check_study(loaded: Loaded, path: Path, study: Study, cut: set[tuple[str, float, int]]) -> None:
    """What a study names must exist, and its pressures must fit together.

    ``cut``: the (device, width_scale, N_p) whose layout other studies have tried; those of this study are added.
    """

    if study.preset:
        _check_preset(path, study.preset, loaded.config)
    for name, variant in (study.variants or {"": Variant()}).items():
        prefix = f"variants.{name}." if name else ""
        for where, numerics in (("", study.numerics), (prefix, variant.numerics)):
            if isinstance(numerics, str):
                _check_names(path, f"{where}numerics", numerics, loaded.config.numerics_presets)
        _check_names(path, f"{prefix}device", variant.device or study.device, loaded.devices)
        try:
            setting = loaded._setting(study, variant)
        except ValidationError as error:
            model, key = (Material, "material") if error.title == "Material" else (Numerics, "numerics")
            prefix = prefix if getattr(variant, key) else ""
            found = _explain(model, error, path)
            raise ConfigError(path, f"{prefix}{key}.{found.key}", found.value, found.expected, found.example) from None
        _check_setting(loaded, path, study, prefix, setting)
    for figure in study.figures:
        _check_names(path, "figures", figure, dict.fromkeys(FIGURES), listed=True)
        if (needed := NEEDS.get(figure, "volumes")) not in ("volumes", *study.outputs):
            expected = f"{needed} among them, which the figure {figure} shows"
            raise ConfigError(path, "outputs", study.outputs, expected, f"outputs: [volumes, {needed}]")
    if study.measured and not Path(study.measured).is_file():
        raise ConfigError(path, "measured", study.measured, "a readable CSV file", "measured: config/measured/arfaee2025.csv")
    for pressure in study.axes.ventricular_pressure:
        try:
            maximum = study.maximum_for(pressure)
        except KeyError:
            raise ConfigError(
                path,
                "actuation_pressure_max",
                study.actuation_pressure_max,
                f"a maximum for P_v = {pressure} kPa",
                f"actuation_pressure_max: {{{pressure}: {pressure + 60:g}}}",
            ) from None
        if maximum <= pressure:
            raise ConfigError(
                path,
                "actuation_pressure_max",
                maximum,
                f"more than P_v = {pressure} kPa, or nothing inflates",
                f"actuation_pressure_max: {pressure + 60:g}",
            )
        for key in ("frames", "fields_at"):
            if beyond := [f for f in getattr(study, key) if not isinstance(f, str) and f > maximum]:
                raise ConfigError(
                    path, key, beyond[0], f"pressures up to actuation_pressure_max = {maximum:g} kPa", f"{key}: [0, max]"
                )
    for name in {setting.device_name for setting in loaded.settings(study).values()}:
        device = loaded.devices[name]
        for scale in study.axes.width_scale or [device.pattern.width_scale]:
            for n_pouches in study.axes.n_pouches:
                if (name, scale, n_pouches) not in cut:
                    pattern = device.pattern.model_copy(update={"width_scale": scale})
                    flat_pattern(pattern, n_pouches, loaded.files[f"devices/{name}"])
                    cut.add((name, scale, n_pouches))


def _check_setting(loaded: Loaded, path: Path, study: Study, prefix: str, setting: Setting) -> None:
    """What a study or a variant (its keys after ``prefix``) names must exist, and element and engine must fit together."""
    _check_names(path, f"{prefix}mesh.level", setting.mesh.level, loaded.config.mesh_levels)
    element = setting.mesh.element
    if not find_element(element).is_shell:
        return
    if setting.mesh.symmetry != "full":
        raise ConfigError(
            path, f"{prefix}mesh.symmetry", setting.mesh.symmetry, f"full with element {element}", "mesh: {symmetry: full}"
        )
    if study.measures:
        raise ConfigError(
            path,
            "outputs",
            study.outputs,
            f"volumes only with element {element}, which keeps no displacements through the thickness",
            "mesh: {level: preview, symmetry: quarter, element: C3D20R}",
        )
    if usable := _other_elements(ENGINES if study.cross_check else [setting.engine], element):
        key, value = ("cross_check", study.cross_check) if study.cross_check else (f"{prefix}engine", setting.engine)
        expected = f"element {' or '.join(usable)}, which the engines that are used take"
        raise ConfigError(path, key, value, expected, f"mesh: {{element: {usable[0]}}}")


def _other_elements(engines: Collection[str], element: str) -> list[str]:
    """The elements of device meshes that all engines take, where one does not take ``element``; none where all do."""
    if all(find_engine(engine).takes(find_element(element)) for engine in engines):
        return []
    return [name for name in get_args(ElementName) if all(find_engine(e).takes(find_element(name)) for e in engines)]


def _check_engine(path: Path, key: str, engine: str, element: str) -> None:
    """The engine of a key must take an element."""
    if not find_engine(engine).takes(find_element(element)):
        other = next(name for name in ENGINES if find_engine(name).takes(find_element(element)))
        raise ConfigError(path, key, engine, f"engine: {other} for element {element}", f"engine: {other}")


def _check_airbag(path: Path, airbag: Airbag) -> None:
    """The engine of every series must take its element."""
    for k, series in enumerate(airbag.series):
        _check_engine(path, f"series.{k}.engine", series.engine, series.element)
