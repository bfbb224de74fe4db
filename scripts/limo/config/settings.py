"""What the cases of a study are solved with: the study's own keys, those of its variant, and the defaults behind them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from limo.schema.config import Config, Preset
from limo.schema.device import Device, Material, Pattern
from limo.schema.numerics import Mesh, Numerics
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


def variants_of(study: Study) -> Mapping[str, Variant]:
    """The variants of a study by their names; without any one that changes nothing, by an empty name."""
    return study.variants or {"": Variant()}


def default_of(config: Config, preset: str | None = None) -> Config | Preset:
    """What has mesh, numerics, engine, branches where nothing else is said: a preset, else the configuration's, or itself.

    Raises ``KeyError`` for a name that is not there.
    """
    name = preset or config.preset
    return config.presets[name] if name else config


def setting_of(config: Config, devices: Mapping[str, Device], study: Study, variant: Variant) -> Setting:
    """What one variant of a study uses.

    Raises pydantic's ``ValidationError`` if the overridden numerics, pattern or material are invalid, ``KeyError`` for an unknown
    name.
    """
    default = default_of(config, study.preset)
    mesh = study.mesh or default.mesh
    if variant.mesh:
        mesh = mesh.model_copy(update={k: getattr(variant.mesh, k) for k in variant.mesh.model_fields_set})
    preset, numerics = _numerics(config, default.numerics, study, variant)
    device_name = variant.device or study.device
    device = devices[device_name]
    if change := _merged(study.pattern, variant.pattern):
        plain = device.pattern.model_dump(exclude_none=True)
        device = device.model_copy(update={"pattern": Pattern.model_validate(_merged(plain, change))})
    if change := study.material | variant.material:
        device = device.model_copy(update={"material": Material.model_validate(device.material.model_dump() | change)})
    return Setting(device_name, device, mesh, preset, numerics, variant.engine or study.engine or default.engine)


def _numerics(config: Config, preset: str, study: Study, variant: Variant) -> tuple[str, Numerics]:
    """A preset of numerics by its name, and the same with the changes of a study and a variant."""
    changes: dict[str, Any] = {}
    for stated in (study.numerics, variant.numerics):
        preset, changes = (stated, {}) if isinstance(stated, str) else (preset, _merged(changes, stated or {}))
    numerics = config.numerics_presets[preset]
    if changes:
        numerics = Numerics.model_validate(_merged(numerics.model_dump(exclude_unset=True), changes))
    return preset, numerics


def _merged(data: dict[str, Any], change: dict[str, Any]) -> dict[str, Any]:
    """Nested ``data`` with the values of ``change`` in their places."""
    both = {k: _merged(data[k], v) for k, v in change.items() if isinstance(v, dict) and isinstance(data.get(k), dict)}
    return data | change | both
