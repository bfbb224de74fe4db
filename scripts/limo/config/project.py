"""A configuration with its devices, studies and airbags, each study resolved into its settings."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from limo.errors import ConfigError
from limo.schema.accuracy import Airbag
from limo.schema.config import Config, Preset
from limo.schema.device import Device, Material
from limo.schema.numerics import Mesh, Numerics
from limo.schema.section import ENGINES
from limo.schema.study import Study, Variant


@dataclass(frozen=True)
class Setting:
    """What the cases of a study, or of one of its variants, are solved with; ``device_name`` and ``preset`` are names."""

    device_name: str
    device: Device
    mesh: Mesh
    preset: str
    numerics: Numerics
    engine: str


def _merged(data: dict[str, Any], change: dict[str, Any]) -> dict[str, Any]:
    """Nested ``data`` with the values of ``change`` in their places."""
    both = {k: _merged(data[k], v) for k, v in change.items() if isinstance(v, dict) and isinstance(data.get(k), dict)}
    return data | change | both


class Loaded:
    """A configuration with its devices and studies resolved and checked against each other.

    ``config`` (``Config``), ``devices``, ``studies`` and ``airbags`` (by name), ``files`` (path of each of them), ``builds``
    (which build of each engine would solve; empty until someone looks).
    """

    def __init__(
        self,
        config: Config,
        devices: dict[str, Device],
        studies: dict[str, Study],
        files: dict[str, Path],
        airbags: dict[str, Airbag] | None = None,
    ):
        self.config, self.devices, self.studies, self.files, self.airbags = config, devices, studies, files, airbags or {}
        self.builds: dict[str, str] = {}

    def require(self, names: Iterable[str], file: object, example: str) -> None:
        """Raise ``ConfigError`` for the first of ``names`` that is no study of ``file``; ``example`` is a command that works."""
        for name in names:
            if name not in self.studies:
                raise ConfigError(file, "STUDY", name, f"one of: {', '.join(self.studies)}", example)

    def settings(self, study: Study) -> dict[str, Setting]:
        """What a study uses, by the names of its variants; without variants by an empty name.

        Raises pydantic's ``ValidationError`` if the overridden numerics or material are invalid, ``KeyError`` for an unknown
        name.
        """
        return {name: self._setting(study, variant) for name, variant in (study.variants or {"": Variant()}).items()}

    def default(self, preset: str | None = None) -> Config | Preset:
        """What has mesh, numerics, engine, branches where nothing else is said: a preset, else the configuration's, or itself.

        Raises ``KeyError`` for a name that is not there.
        """
        name = preset or self.config.preset
        return self.config.presets[name] if name else self.config

    def branches_of(self, study: Study) -> int:
        """How many solutions each case of a study has."""
        return study.branches or self.default(study.preset).branches

    def _setting(self, study: Study, variant: Variant) -> Setting:
        default = self.default(study.preset)
        mesh = study.mesh or default.mesh
        if variant.mesh:
            mesh = mesh.model_copy(update={k: getattr(variant.mesh, k) for k in variant.mesh.model_fields_set})
        preset, change = default.numerics, {}
        for own in (study.numerics, variant.numerics):
            preset, change = (own, {}) if isinstance(own, str) else (preset, _merged(change, own or {}))
        numerics = self.config.numerics_presets[preset]
        if change:
            numerics = Numerics.model_validate(_merged(numerics.model_dump(exclude_unset=True), change))
        device_name = variant.device or study.device
        device = self.devices[device_name]
        if change := study.material | variant.material:
            device = device.model_copy(update={"material": Material.model_validate(device.material.model_dump() | change)})
        return Setting(device_name, device, mesh, preset, numerics, variant.engine or study.engine or default.engine)

    def engines_of(self, study: Study) -> list[str]:
        """The engines that a study uses, of ``ENGINES``."""
        used = {setting.engine for setting in self.settings(study).values()}
        return [engine for engine in ENGINES if engine in used or study.cross_check]

    def content(self, name: str) -> dict[str, Any]:
        """The resolved configuration of a study: what its dataset depends on besides the results of its cases."""
        study = self.studies[name]
        # what is drawn of a dataset is no part of it
        sections = {"study": study.model_dump(mode="json", exclude={"figures", "measured"})}
        sections["study"]["branches"] = self.branches_of(study)
        sections["settings"] = {
            name: {
                "device": setting.device.model_dump(mode="json"),
                "mesh": setting.mesh.model_dump(mode="json"),
                "mesh_level": self.config.mesh_levels[setting.mesh.level].model_dump(mode="json"),
                "numerics": setting.numerics.model_dump(mode="json"),
                "engine": setting.engine,
            }
            for name, setting in self.settings(study).items()
        }
        if "fatigue" in study.measures:
            sections["fatigue"] = self.config.fatigue.model_dump(mode="json")
        return sections
