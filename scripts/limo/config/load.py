"""The configuration: what a device, a study, an airbag and a numerics preset may say, in which units and ranges.

``load_config`` reads ``config/config.yaml`` with the devices, studies and airbags beside it. It refuses every mistake in what is
asked for, in one message that names file, key, value, range and an example. The JSON schema in ``workflow/schemas`` is generated
from these models (``python -m limo.config.json_schemas``), never written by hand.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from limo.config.checks import Known, check_airbag, check_config, check_device_of, check_roles, check_study
from limo.config.project import Project
from limo.config.settings import Setting
from limo.config.yaml_file import parse, read_yaml
from limo.errors import ConfigError
from limo.schema.accuracy import Airbag
from limo.schema.config import PRESET_KEYS, Config
from limo.schema.device import Device
from limo.schema.section import FILE, NAME, Section
from limo.schema.study import Study

#: the rule of what the configuration runs, which stands for its studies
ALL = "all"
#: rules of the workflow, whose names a study cannot have because it becomes a rule itself
RULES = (
    *(ALL, "mesh_device", "solve_case", "measure_case", "write_fields", "gather_study", "gather_shapes", "draw_figure"),
    *("fit_material", "material", "check_paper", "paper", "stress_test", "export_study", "page"),
    *("accuracy", "solve_airbag", "gather_airbag", "draw_airbag", "keep_airbags", "gather_accuracy", "draw_accuracy"),
    *("keep_runs", "time_case", "measure_scaling", "propose_designs", "tell_designs", "report_exploration"),
)
_KINDS: dict[str, type[Section]] = {"devices": Device, "studies": Study, "airbags": Airbag}


def load_config(path: str | Path = "config/config.yaml", studies: Iterable[str] = (), *, strict: bool = False) -> Project:
    """Read ``path``, and ``devices/*.yaml``, ``studies/*.yaml`` and ``airbags/*.yaml`` beside it.

    ``studies`` are asked for, ``all`` of them being those that the configuration runs; names of others are no matter here. A file
    with a mistake that none of them uses is left out, and ``Project.broken`` says why. ``strict``: no file may have a mistake.

    Raises ``ConfigError`` for the first mistake in ``path`` itself and in what is asked for, and ``LimoError`` with a line for
    each mistake if ``strict``.
    """
    path = Path(path)
    config = _read_config(path)
    files: dict[str, Path] = {}
    broken: dict[str, ConfigError] = {}
    sound = {folder: dict(_read_all(path.parent / folder, model, files, broken)) for folder, model in _KINDS.items()}
    for name in config.studies:
        if name not in sound["studies"] and f"studies/{name}" not in broken:
            names = ", ".join(sound["studies"])
            raise ConfigError(path, "studies", name, f"a study in {path.parent}/studies: {names}", "studies: [pressure_volume]")
    check_config(path, config)
    known = Known(config, sound["devices"], files, _broken_in("devices", broken))
    config = _without_broken_devices(path, config, known, broken)
    settings = _checked_studies(known, sound["studies"], files, broken)
    chosen = {name: sound["studies"][name] for name in settings}
    project = Project(config, sound["devices"], chosen, files, sound["airbags"], broken=broken, checked=settings)
    if strict:
        project.require_all()
    for asked in studies:
        for name in config.studies if asked == ALL else [asked]:
            project.require_sound(f"studies/{name}")
    return project


def read_section(model: type[Section], path: Path) -> Any:
    """A file that is one section, such as an exploration. Raises ``ConfigError`` for a mistake in it or in its name."""
    _check_file_name(path, model, [path])
    return parse(model, read_yaml(path), path)


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


def _read_all(
    folder: Path, model: type[Section], files: dict[str, Path], broken: dict[str, ConfigError]
) -> Iterator[tuple[str, Any]]:
    """The sound files of a folder by their names; paths of all go into ``files``, mistakes into ``broken``."""
    paths = sorted(folder.glob("*.y*ml"))
    for path in paths:
        key = f"{folder.name}/{path.stem}"
        files[key] = path
        try:
            _check_file_name(path, model, paths)
            described = parse(model, read_yaml(path), path)
            if model is Airbag:
                check_airbag(path, described)
            yield path.stem, described
        except ConfigError as error:
            broken.setdefault(key, error)


def _check_file_name(path: Path, model: type[Section], paths: list[Path]) -> None:
    """The name of a file becomes that of what it describes, of rules and of folders, and it may stand there once."""
    if not re.fullmatch(NAME.strip("^$"), path.stem):
        raise ConfigError(path, "(file name)", path.stem, "letters, digits and _, a letter first", "my_study.yaml")
    if model is Study and path.stem in RULES:
        raise ConfigError(path, "(file name)", path.stem, "a name that no rule of the workflow has", "my_study.yaml")
    if [other.stem for other in paths].count(path.stem) > 1:
        raise ConfigError(path, "(file name)", path.stem, "one file for a name", "remove one of .yml and .yaml")


def _broken_in(folder: str, broken: dict[str, ConfigError]) -> dict[str, ConfigError]:
    return {key.partition("/")[2]: error for key, error in broken.items() if key.startswith(f"{folder}/")}


def _without_broken_devices(path: Path, config: Config, known: Known, broken: dict[str, ConfigError]) -> Config:
    """The configuration without its stress test and its scaling where the devices of these are broken."""
    for section in ("stress_test", "scaling"):
        wanted = getattr(config, section)
        if wanted is not None and (error := check_device_of(known, path, section, wanted.device)):
            broken[section] = error
            config = config.model_copy(update={section: None})
    return config


def _checked_studies(
    known: Known, studies: dict[str, Study], files: dict[str, Path], broken: dict[str, ConfigError]
) -> dict[str, dict[str, Setting]]:
    """The settings of the sound studies by their names; mistakes of others go into ``broken``."""
    settings = {}
    for name, error in check_roles(studies, files).items():
        broken[f"studies/{name}"] = error
    for name, study in studies.items():
        if f"studies/{name}" in broken:
            continue
        try:
            settings[name] = check_study(known, files[f"studies/{name}"], study)
        except ConfigError as error:
            broken[f"studies/{name}"] = error
    return settings
