"""Keys that a command sets beside those of a file: KEY=VALUE, and SECTION.KEY=VALUE."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import yaml

from limo.errors import ConfigError


def with_settings(data: dict[str, Any], settings: Iterable[str], command: str, example: str) -> dict[str, Any]:
    """Keys with settings put in their places. Raises ``ConfigError`` of a command for one without a value."""
    data = dict(data)
    for setting in settings:
        name, equals, text = setting.partition("=")
        if not equals:
            raise ConfigError(command, "--set", setting, "KEY=VALUE", example)
        first, _, inner = name.strip().partition(".")
        value = _value(text)
        if inner:
            data[first] = (data[first] if isinstance(data.get(first), dict) else {}) | {inner: value}
        else:
            data[first] = value
    return data


def _value(text: str) -> Any:
    try:
        value = yaml.safe_load(text)
    except yaml.YAMLError:
        return text
    return text if value is None or isinstance(value, bool) else value
