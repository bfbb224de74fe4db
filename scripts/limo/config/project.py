"""A configuration with its devices, studies and airbags: checked, immutable, each study resolved once."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import InitVar, dataclass, field, replace
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from limo.config.settings import Setting, default_of, setting_of, variants_of
from limo.errors import ConfigError, LimoError
from limo.schema.accuracy import Airbag
from limo.schema.config import Config, Preset
from limo.schema.device import Device
from limo.schema.fatigue import Fatigue
from limo.schema.numerics import Numerics
from limo.schema.section import ENGINES
from limo.schema.study import Study

Value = TypeVar("Value")


class Sound(dict[str, Value]):
    """The sound files of a folder by their names. To ask for a broken one raises the mistake that is in it."""

    def __init__(self, values: Mapping[str, Value], broken: Mapping[str, ConfigError]):
        super().__init__(values)
        self.broken = broken

    def __missing__(self, name: str) -> Value:
        raise self.broken.get(name) or KeyError(name)


@dataclass(frozen=True, eq=False)
class Project:
    """A configuration with its devices, studies and airbags, resolved and checked against each other.

    ``files`` are paths by ``devices/<name>``, ``studies/<name>`` and ``airbags/<name>``. ``builds``: which build of each engine
    would solve, as it was handed in; names of cases contain it. ``broken``: the mistakes of files that were left out, by the
    same names, and of ``stress_test`` and ``scaling`` where their device is broken. ``checked``: settings that are known already.
    """

    config: Config
    devices: Mapping[str, Device]
    studies: Mapping[str, Study]
    files: Mapping[str, Path]
    airbags: Mapping[str, Airbag] = field(default_factory=dict)
    builds: Mapping[str, str] = field(default_factory=dict)
    broken: Mapping[str, ConfigError] = field(default_factory=dict)
    checked: InitVar[Mapping[str, Mapping[str, Setting]] | None] = None

    def __post_init__(self, checked: Mapping[str, Mapping[str, Setting]] | None) -> None:
        for folder in ("devices", "studies", "airbags"):
            sound = Sound(getattr(self, folder), self._broken_in(folder))
            object.__setattr__(self, folder, MappingProxyType(sound))
        for name in ("files", "builds", "broken"):
            object.__setattr__(self, name, MappingProxyType(dict(getattr(self, name))))
        self._settings.update(checked or {})

    def with_builds(self, builds: Mapping[str, str]) -> Project:
        """The same project with other builds of engines."""
        return replace(self, builds=builds, checked=self._settings)  # no build is part of a setting

    # ----------------------------------------------------------------------------------------------------------------
    # what was left out

    def _broken_in(self, folder: str) -> dict[str, ConfigError]:
        return {key.partition("/")[2]: error for key, error in self.broken.items() if key.startswith(f"{folder}/")}

    def require_sound(self, key: str) -> None:
        """Raise the mistake of what was left out under a key of ``broken``, if it was."""
        if error := self.broken.get(key):
            raise error

    def require(self, names: Iterable[str], file: object, example: str) -> None:
        """Raise ``ConfigError`` for the first of ``names`` that is no study of ``file``; ``example`` is a command that works.

        For a broken study it is the mistake in its file.
        """
        for name in names:
            self.require_sound(f"studies/{name}")
            if name not in self.studies:
                raise ConfigError(file, "STUDY", name, f"one of: {', '.join(self.studies)}", example)

    def require_device(self, name: str, file: object, key: str, example: str) -> None:
        """Raise ``ConfigError`` if ``key`` of ``file`` names no device; for a broken one it is the mistake in its file."""
        self.require_sound(f"devices/{name}")
        if name not in self.devices:
            raise ConfigError(file, key, name, f"one of: {', '.join(self.devices)}", example)

    def require_all(self) -> None:
        """Raise ``LimoError`` with one line for each mistake in a file that was left out; a single one is raised itself."""
        mistakes = {str(error): error for error in self.broken.values()}
        if len(mistakes) == 1:
            raise next(iter(mistakes.values()))
        if mistakes:
            raise LimoError("\n".join(mistakes))

    @property
    def warnings(self) -> list[str]:
        """A sentence for each mistake in a file that was left out."""
        mistakes: dict[str, list[str]] = {}
        for key, error in self.broken.items():
            mistakes.setdefault(str(error), []).append(key.rpartition("/")[2])
        left_out = "left out, as nothing that was asked for uses it"
        return [f"{left_out}: {', '.join(names)}; {text}" for text, names in mistakes.items()]

    # ----------------------------------------------------------------------------------------------------------------
    # studies

    @cached_property
    def _settings(self) -> dict[str, Mapping[str, Setting]]:
        return {}

    @cached_property
    def resolved(self) -> dict[str, Any]:
        """What rooms above have made of studies, by their names, so that each study is resolved once (``cases.grid``)."""
        return {}

    def settings(self, name: str) -> Mapping[str, Setting]:
        """What a study uses, by the names of its variants; without variants by an empty name.

        Raises pydantic's ``ValidationError`` if overridden numerics, pattern or material are invalid, and ``KeyError`` for an
        unknown name.
        """
        if name not in self._settings:
            study = self.studies[name]
            made = {n: setting_of(self.config, self.devices, study, variant) for n, variant in variants_of(study).items()}
            self._settings[name] = MappingProxyType(made)
        return self._settings[name]

    def default(self, preset: str | None = None) -> Config | Preset:
        """What has mesh, numerics, engine, branches where nothing else is said (``settings.default_of``)."""
        return default_of(self.config, preset)

    def branches_of(self, study: Study) -> int:
        """How many solutions each case of a study has."""
        return study.branches or self.default(study.preset).branches

    def engines_of(self, name: str) -> list[str]:
        """The engines that a study uses, of ``ENGINES``."""
        used = {setting.engine for setting in self.settings(name).values()}
        return [engine for engine in ENGINES if engine in used or self.studies[name].cross_check]

    @property
    def engines(self) -> list[str]:
        """The engines that the studies and the stress test use, of ``ENGINES``."""
        used = {engine for name in self.studies for engine in self.engines_of(name)}
        used.update(self.config.stress_test.engines if self.config.stress_test else ())
        return [engine for engine in ENGINES if engine in used]

    def content(self, name: str) -> dict[str, Any]:
        """The resolved configuration of a study: what its dataset depends on besides the results of its cases."""
        study = self.studies[name]
        # what is drawn of a dataset, and what it serves for, is no part of it
        sections = {"study": study.model_dump(mode="json", exclude={"figures", "measured", "role", "subject"})}
        sections["study"]["branches"] = self.branches_of(study)
        sections["settings"] = {
            name: {
                "device": setting.device.model_dump(mode="json"),
                **({"modulus_origin": origin} if (origin := setting.device.material.modulus_origin) else {}),
                "mesh": setting.mesh.model_dump(mode="json"),
                "mesh_level": self.config.mesh_levels[setting.mesh.level].model_dump(mode="json"),
                "numerics": setting.numerics.model_dump(mode="json"),
                "engine": setting.engine,
            }
            for name, setting in self.settings(name).items()
        }
        if "fatigue" in study.measures:
            sections["fatigue"] = self.config.fatigue.model_dump(mode="json")
        return sections


def same_content(one: Mapping[str, Any], other: Mapping[str, Any]) -> bool:
    """Whether two of ``Project.content`` mean the same: a key that one of them lacks, as of an older version, has its default."""
    try:
        return _filled(one) == _filled(other)
    except (ValidationError, KeyError):
        return False


def _filled(content: Mapping[str, Any]) -> dict[str, Any]:
    """Content in which keys of the study, its devices, numerics and fatigue that are missing have their defaults."""

    def whole(schema: type[BaseModel], values: Mapping[str, Any]) -> dict[str, Any]:
        return schema.model_validate(values).model_dump(mode="json")

    settings = {
        name: {**one, "device": whole(Device, one["device"]), "numerics": whole(Numerics, one["numerics"])}
        for name, one in content["settings"].items()
    }
    fatigue = {"fatigue": whole(Fatigue, content["fatigue"])} if "fatigue" in content else {}
    return {**content, "study": whole(Study, content["study"]), "settings": settings, **fatigue}
