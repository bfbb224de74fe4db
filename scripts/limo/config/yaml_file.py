"""YAML files read strictly; the first mistake becomes one message with file, key, value, range and example."""

from __future__ import annotations

import contextlib
import json
import re
from difflib import SequenceMatcher
from pathlib import Path
from typing import Any

import yaml
from pydantic import ValidationError
from pydantic.fields import FieldInfo

from limo.errors import ConfigError
from limo.schema.section import Section


class _UniqueKeys:
    """Refuses a key that stands twice in a mapping (plain YAML lets the last one win without a word)."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict:
        keys = [self.construct_object(k, deep=True) for k, _ in node.value if k.tag != "tag:yaml.org,2002:merge"]
        for k in keys:
            if keys.count(k) > 1:
                raise yaml.constructor.ConstructorError(None, None, f"key {k!r} stands twice", node.start_mark)
        return super().construct_mapping(node, deep)


class _Loader(_UniqueKeys, yaml.SafeLoader):
    """Reads any text, or says what is wrong with it."""


class _FastLoader(_UniqueKeys, getattr(yaml, "CSafeLoader", yaml.SafeLoader)):
    """The same by libyaml, ten times as fast, which ends the process where a text is nested too deeply."""


#: brackets and length of a line together up to which a text cannot be nested too deeply
_SHALLOW = 2000
for _loader in (_Loader, _FastLoader):
    # YAML 1.1 reads 1e6 as text: take it as the number it is
    _loader.add_implicit_resolver(
        "tag:yaml.org,2002:float",
        re.compile(r"^[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)$"),
        list("-+0123456789."),
    )


def _load(text: str) -> Any:
    """The content of a text. What libyaml refuses is read again, because the other loader's messages say more.

    Tabs, question marks and tags are left to the other loader, because libyaml takes some that it does not.
    """
    depth = text.count("[") + text.count("{") + max(map(len, text.splitlines()), default=0)
    if depth < _SHALLOW and not {*"\t?!"} & {*text}:
        with contextlib.suppress(yaml.YAMLError, ValueError, RecursionError, TypeError):
            return yaml.load(text, Loader=_FastLoader)
    return yaml.load(text, Loader=_Loader)


def read_yaml(path: Path) -> dict[str, Any]:
    """A YAML mapping. Raises ``ConfigError`` when it cannot be read or is not a mapping."""
    try:
        data = _load(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(path, "(file)", str(error), "a readable text file", "config/devices/limo.yaml") from None
    except (yaml.YAMLError, ValueError, RecursionError, TypeError) as error:
        mark = getattr(error, "problem_mark", None)
        place = f"line {mark.line + 1}" if mark else "(file)"
        raise ConfigError(path, place, getattr(error, "problem", None) or str(error), "YAML", "key: value") from None
    if not isinstance(data, dict):
        raise ConfigError(path, "(file)", data, "a mapping of keys to values", "device: limo")
    return data


def parse(model: type[Section], data: dict[str, Any], path: Path) -> Any:
    """``model`` made from ``data``, or the first mistake as a ``ConfigError``."""
    try:
        return model.model_validate(data)
    except ValidationError as error:
        raise explain(model, error, path) from None


def explain(model: type[Section], error: ValidationError, path: Path) -> ConfigError:
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
        fields = getattr(owner or model, "model_fields", {})
        return ConfigError(path, key, value, f"no such key; known here: {', '.join(sorted(fields))}", _like(keys[-1], fields))
    message = first["msg"].removeprefix("Value error, ").removeprefix("Input should be ")
    if first["type"] == "missing":
        message, value = "a value (the key is missing)", None
    if field is None or not field.examples:
        return ConfigError(path, key, value, message, "see docs/configuration.md")
    expected = f"{message} ({field.description})" if field.description else message
    return ConfigError(path, key, value, expected, f"{name}: {json.dumps(field.examples[0])}")


def _like(key: str, fields: dict[str, FieldInfo]) -> str:
    """An example of the field that is spelt most like ``key``."""
    described = [name for name, field in fields.items() if field.examples]
    if not described:
        return "see docs/configuration.md"
    name = max(described, key=lambda name: SequenceMatcher(None, key, name).ratio())
    return f"{name}: {json.dumps(fields[name].examples[0])}"


# what pydantic calls the branches of a union, and validators, in the place of a mistake
_UNION_BRANCH = re.compile(r"^(float|str|int|dict\[.*|list\[.*|tuple\[.*|constrained-\w+|function-\w+.*)$")


def _models(annotation: Any) -> list[type[Section]]:
    """The sections inside a type such as ``dict[str, Numerics]``."""
    if isinstance(annotation, type) and issubclass(annotation, Section):
        return [annotation]
    return [m for a in getattr(annotation, "__args__", ()) for m in _models(a)]
