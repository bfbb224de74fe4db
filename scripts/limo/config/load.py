"""The configuration: what a device, a study, an airbag and a numerics preset may say, in which units and ranges.

``load_config`` reads ``config/config.yaml`` with the devices, studies and airbags beside it and refuses every mistake in one
message that names file, key, value, range and an example. The JSON schema in ``workflow/schemas`` is generated from
these models (``python -m limo.config.json_schemas``), never written by hand.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from limo.config.checks import (
    _check_airbag,
    _check_engine,
    _check_names,
    _check_preset,
    _check_recovery,
    _check_stress_test,
    _check_study,
)
from limo.config.project import Loaded
from limo.config.yaml_file import parse, read_yaml
from limo.errors import ConfigError
from limo.schema.accuracy import Airbag
from limo.schema.config import PRESET_KEYS, Config
from limo.schema.device import Device
from limo.schema.section import FILE, NAME, Section
from limo.schema.study import Study

#: rules of the workflow, whose names a study cannot have because it becomes a rule itself
RULES = (
    *("all", "mesh_device", "solve_case", "measure_case", "write_fields", "gather_study", "gather_shapes", "draw_figure"),
    *("fit_material", "material", "check_paper", "paper", "stress_test", "export_study", "page"),
    *("accuracy", "solve_airbag", "gather_airbag", "draw_airbag", "keep_airbags", "gather_accuracy", "draw_accuracy"),
)


def _read_config(path: Path) -> Config:
    """A configuration, and where it extends another one the keys of that; ``preset`` here takes the place of what it stands for.

    Raises ``ConfigError`` for a mistake in either, and for one that extends one that extends another.
    """
    data = read_yaml(path)
    if isinstance(name := data.get("extends"), str) and re.search(FILE, name):
        base = read_yaml(path.with_name(name))
        if "extends" in base or path.with_name(name) == path:
            expected = "a configuration that extends none itself"
            raise ConfigError(path, "extends", name, expected, "extends: config.yaml")
        parse(Config, base, path.with_name(name))
        taken = PRESET_KEYS if data.get("preset") else ()
        data = {key: value for key, value in base.items() if key not in taken} | data
    return parse(Config, data, path)


def load_config(path: str | Path = "config/config.yaml") -> Loaded:
    """Read ``path``, and ``devices/*.yaml``, ``studies/*.yaml`` and ``airbags/*.yaml`` beside it.

    Raises ``ConfigError`` for the first mistake found in any of them.
    """
    path = Path(path)
    config = _read_config(path)
    files: dict[str, Path] = {}

    def read_all(folder: str, model: type[Section]) -> dict[str, Any]:
        found = {}
        for file in sorted((path.parent / folder).glob("*.y*ml")):
            if not re.fullmatch(NAME.strip("^$"), file.stem):
                raise ConfigError(file, "(file name)", file.stem, "letters, digits and _, a letter first", "my_study.yaml")
            if model is Study and file.stem in RULES:
                raise ConfigError(file, "(file name)", file.stem, "a name that no rule of the workflow has", "my_study.yaml")
            if file.stem in found:
                raise ConfigError(file, "(file name)", file.stem, "one file for a name", "remove one of .yml and .yaml")
            found[file.stem] = parse(model, read_yaml(file), file)
            files[f"{folder}/{file.stem}"] = file
        return found

    devices, studies, airbags = (read_all(*kind) for kind in (("devices", Device), ("studies", Study), ("airbags", Airbag)))
    loaded = Loaded(config, devices, studies, files, airbags)
    for name in config.studies:
        if name not in studies:
            names = ", ".join(studies)
            raise ConfigError(path, "studies", name, f"a study in {path.parent}/studies: {names}", "studies: [pressure_volume]")
    _check_names(path, "mesh.level", config.mesh.level, config.mesh_levels)
    _check_names(path, "numerics", config.numerics, config.numerics_presets)
    for name, preset in config.presets.items():
        _check_names(path, f"presets.{name}.mesh.level", preset.mesh.level, config.mesh_levels)
        _check_names(path, f"presets.{name}.numerics", preset.numerics, config.numerics_presets)
        _check_engine(path, f"presets.{name}.engine", preset.engine, preset.mesh.element)
    if config.preset:
        _check_preset(path, config.preset, config)
        if stated := [n for n in PRESET_KEYS if n in config.model_fields_set]:
            expected = f"no {', '.join(stated)} beside it, for which it stands"
            raise ConfigError(path, "preset", config.preset, expected, f"preset: {config.preset}")
    _check_recovery(path, config)
    if config.stress_test:
        _check_stress_test(path, loaded, config.stress_test)
    if config.scaling:
        _check_names(path, "scaling.device", config.scaling.device, devices)
    for name, airbag in airbags.items():
        _check_airbag(files[f"airbags/{name}"], airbag)
    cut: set[tuple[str, float, int]] = set()
    for name, study in studies.items():
        _check_study(loaded, files[f"studies/{name}"], study, cut)
    return loaded
