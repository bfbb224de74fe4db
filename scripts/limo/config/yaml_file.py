"""YAML files read strictly; the first mistake becomes one message with file, key, value, range and example."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import yaml
from pydantic import ValidationError

from limo.errors import ConfigError
from limo.schema.section import Section


class _UniqueKeyLoader(yaml.SafeLoader):
    """Refuses a key that stands twice in a mapping (plain YAML lets the last one win without a word)."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict:
        keys = [self.construct_object(k, deep=True) for k, _ in node.value if k.tag != "tag:yaml.org,2002:merge"]
        for k in keys:
            if keys.count(k) > 1:
                raise yaml.constructor.ConstructorError(None, None, f"key {k!r} stands twice", node.start_mark)
        return super().construct_mapping(node, deep)


# YAML 1.1 reads 1e6 as text: take it as the number it is
_UniqueKeyLoader.add_implicit_resolver(
    "tag:yaml.org,2002:float",
    re.compile(r"^[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)$"),
    list("-+0123456789."),
)


def read_yaml(path: Path) -> dict[str, Any]:
    """A YAML mapping. Raises ``ConfigError`` when it cannot be read or is not a mapping."""
    try:
        data = yaml.load(path.read_text(encoding="utf-8"), Loader=_UniqueKeyLoader)
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(path, "(file)", str(error), "a readable text file", "config/devices/limo.yaml") from None
    except (yaml.YAMLError, ValueError, RecursionError, TypeError) as error:
        where = getattr(error, "problem_mark", None)
        at = f"line {where.line + 1}" if where else "(file)"
        raise ConfigError(path, at, getattr(error, "problem", None) or str(error), "YAML", "key: value") from None
    if not isinstance(data, dict):
        raise ConfigError(path, "(file)", data, "a mapping of keys to values", "device: limo")
    return data


def parse(model: type[Section], data: dict[str, Any], path: Path) -> Any:
    """``model`` made from ``data``, or the first mistake as a ``ConfigError``."""
    try:
        return model.model_validate(data)
    except ValidationError as error:
        raise _explain(model, error, path) from None


def _explain(model: type[Section], error: ValidationError, path: Path) -> ConfigError:
    """One message for the first mistake pydantic found."""
    errors = error.errors()
    # of the branches of a union, the one that got furthest into the value says most
    first = max((e for e in errors if e["loc"][:1] == errors[0]["loc"][:1]), key=lambda e: len(e["loc"]))
    owner, field, name, keys = model, None, "", []
    for part in map(str, first["loc"]):
        fields = getattr(owner, "model_fields", {})
        if part in fields:
            field, name = fields[part], part
            owner = next(iter(_models(field.annotation)), None)
        elif first["type"] != "extra_forbidden" and _UNION_BRANCH.match(part):
            continue
        keys.append(part)
    key, value = ".".join(keys) or "(file)", first["input"]
    if isinstance(value, dict) and len(value) > 4:
        value = "{" + ", ".join(map(str, value))[:500] + "}"
    if first["type"] == "extra_forbidden":
        known = ", ".join(sorted(getattr(owner or model, "model_fields", {})))
        return ConfigError(path, key, value, f"no such key; known here: {known}", "see docs/configuration.md")
    message = first["msg"].removeprefix("Value error, ").removeprefix("Input should be ")
    if first["type"] == "missing":
        message, value = "a value (the key is missing)", None
    if field is None or not field.examples:
        return ConfigError(path, key, value, message, "see docs/configuration.md")
    expected = f"{message} ({field.description})" if field.description else message
    return ConfigError(path, key, value, expected, f"{name}: {json.dumps(field.examples[0])}")


# what pydantic calls the branches of a union, and validators, in the place of a mistake
_UNION_BRANCH = re.compile(r"^(float|str|int|dict\[.*|list\[.*|tuple\[.*|constrained-\w+|function-\w+.*)$")


def _models(annotation: Any) -> list[type[Section]]:
    """The sections inside a type such as ``dict[str, Numerics]``."""
    if isinstance(annotation, type) and issubclass(annotation, Section):
        return [annotation]
    return [m for a in getattr(annotation, "__args__", ()) for m in _models(a)]
