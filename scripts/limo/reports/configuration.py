"""The reference of configuration keys, from the models: type and range, default, unit, meaning and example of each key."""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import partial
from typing import Any

import pandas as pd
import yaml

from limo.reports.markdown import markdown_table
from limo.schema.accuracy import Airbag
from limo.schema.beat import Beat
from limo.schema.config import Config
from limo.schema.device import Device
from limo.schema.exploration import Exploration
from limo.schema.inference import Inference
from limo.schema.section import FILE, NAME, Section
from limo.schema.study import Study

#: the models of the kinds of file, in the order of the reference; a section that several use stands with the first of them
KINDS: dict[str, type[Section]] = {
    "study": Study,
    "config": Config,
    "device": Device,
    "airbag": Airbag,
    "inference": Inference,
    "beat": Beat,
    "exploration": Exploration,
}
#: what texts of a pattern are called
PATTERNS = {NAME: "name", FILE: "name of a file"}
#: units that descriptions state, longest first
UNIT = re.compile(r"(?<![\w'/^-])(kPa/s|g/m\^2|1/s2|1/s|kPa|MPa|mm|minutes|s)(?![\w'/^-])")
TYPES = {"number": "number", "integer": "integer", "string": "text", "boolean": "true or false", "object": "mapping"}
Schema = dict[str, Any]


def parts() -> dict[str, Callable[[], str]]:
    """What makes the parts of the reference, by the kind of file."""
    return {kind: partial(part, kind) for kind in KINDS}


def part(kind: str) -> str:
    """The tables of one kind of file: its own keys, then those of sections that no kind before it uses."""
    before: set[str] = set()
    for name, model in KINDS.items():
        schema = model.model_json_schema()
        if name == kind:
            return "\n\n".join(_tables(schema, before))
        before |= set(_sections(schema))
    raise KeyError(kind)


def _tables(schema: Schema, before: set[str]) -> list[str]:
    sections = schema.get("$defs", {})
    texts = [_words(schema), table(schema, sections)]
    for name in _sections(schema):
        if name not in before:
            texts += [f"### {name}", _words(sections[name]), table(sections[name], sections)]
    return texts


def _sections(schema: Schema) -> list[str]:
    """The sections that a schema uses, each behind the first that uses it."""
    sections, collected = schema.get("$defs", {}), []
    left = [schema]
    while left:
        for name in _references({key: value for key, value in left.pop(0).items() if key != "$defs"}):
            if name not in collected:
                collected.append(name)
                left.append(sections[name])
    return collected


def _references(data: Any) -> list[str]:
    if isinstance(data, dict):
        selected = [data["$ref"].rpartition("/")[2]] if "$ref" in data else []
        return selected + [name for value in data.values() for name in _references(value)]
    return [name for value in data for name in _references(value)] if isinstance(data, list) else []


def table(schema: Schema, sections: Schema) -> str:
    """One row a key of a section."""
    rows = []
    for key, value in schema["properties"].items():
        rows.append(
            {
                "key": f"`{key}`",
                "value": kind_of(value),
                "default": _required(schema, key) or _default(value, sections),
                "unit": unit_of(value, sections),
                "meaning": value.get("description") or _sentence(sections[_references(value)[0]]),
                "example": f"`{_flow(value['examples'][0])}`" if value.get("examples") else "",
            }
        )
    return markdown_table(pd.DataFrame(rows))


def kind_of(schema: Schema) -> str:
    """Type and range of a value in words: ``number, 0 < x <= 5``, ``list of integer``, ``[Mesh](#mesh)``."""
    if "$ref" in schema:
        name = schema["$ref"].rpartition("/")[2]
        return f"[{name}](#{name.lower()})"
    if "anyOf" in schema:
        return " or ".join(dict.fromkeys(kind_of(each) for each in schema["anyOf"] if each.get("type") != "null"))
    if "const" in schema or "enum" in schema:
        return ", ".join(f"`{value}`" for value in schema.get("enum", [schema.get("const")]))
    if schema.get("type") == "array":
        return _list(schema)
    if schema.get("type") == "object":
        inner = next(iter(schema.get("patternProperties", {}).values()), schema.get("additionalProperties"))
        return f"mapping to {kind_of(inner)}" if isinstance(inner, dict) else "mapping"
    if schema.get("pattern"):
        return PATTERNS.get(schema["pattern"], f"text like `{schema['pattern']}`")
    return TYPES[schema["type"]] + _range(schema)


def _list(schema: Schema) -> str:
    if "prefixItems" in schema:
        each = [kind_of(item) for item in schema["prefixItems"]]
        return f"[low, high], each {each[0]}" if len(set(each)) == 1 else f"[x, y]: {'; '.join(each)}"
    least, most = schema.get("minItems", 0), schema.get("maxItems")
    count = (f", at least {least}" if least > 1 else "") + (f", at most {most}" if most else "")
    return f"list of {kind_of(schema['items'])}{count}"


def _range(schema: Schema) -> str:
    low = f"{_bound(schema['minimum'])} <= " if "minimum" in schema else ""
    low = f"{_bound(schema['exclusiveMinimum'])} < " if "exclusiveMinimum" in schema else low
    high = f" <= {_bound(schema['maximum'])}" if "maximum" in schema else ""
    high = f" < {_bound(schema['exclusiveMaximum'])}" if "exclusiveMaximum" in schema else high
    return (f", {low}x{high}" if low or high else "") + (", even" if schema.get("multipleOf") == 2 else "")


def _bound(value: float) -> str:
    return str(value) if isinstance(value, int) else f"{value:g}"


def unit_of(schema: Schema, sections: Schema) -> str:
    """The units that the description of a number states, of one with its origin, too; nothing for what is no number."""
    selected = [sections[name]["properties"].get("value") for name in _references(schema)]
    if not _has_numbers(schema) and not any(selected):
        return ""
    return ", ".join(dict.fromkeys(UNIT.findall(schema.get("description", "")))).replace("minutes", "min")


def _has_numbers(data: Any) -> bool:
    if isinstance(data, dict):
        return data.get("type") in ("number", "integer") or any(_has_numbers(value) for value in data.values())
    return any(_has_numbers(value) for value in data) if isinstance(data, list) else False


def _default(schema: Schema, sections: Schema) -> str:
    value = schema.get("default")
    if value is None:
        return "-"
    if "$ref" in schema and value == _defaults(sections[schema["$ref"].rpartition("/")[2]], sections):
        return "its own"
    return f"`{_flow(value)}`"


def _defaults(section: Schema, sections: Schema) -> Schema:
    """What a section is if nothing is said; incomplete for one with required keys."""
    collected = {}
    for key, value in section["properties"].items():
        if "default" in value:
            collected[key] = value["default"]
        elif "$ref" in value:
            collected[key] = _defaults(sections[value["$ref"].rpartition("/")[2]], sections)
    return collected


def _words(schema: Schema) -> str:
    """The docstring of a section as markdown."""
    return " ".join(schema.get("description", "").replace("``", "`").split())


def _sentence(section: Schema) -> str:
    """The first sentence of a section's docstring."""
    return re.split(r"(?<!\bSt)\. ", _words(section))[0].rstrip(".")


def _required(schema: Schema, key: str) -> str:
    """Whether a key must be given, always or unless the file extends another one."""
    if key in schema.get("required", ()):
        return "**required**"
    otherwise = schema["anyOf"][0]["required"] if "anyOf" in schema else ()
    return "**required** unless the file `extends` another" if key in otherwise else ""


def _flow(value: Any) -> str:
    """A value as it stands in a YAML file, on one line."""
    text = yaml.safe_dump(_plain(value), default_flow_style=True, sort_keys=False, width=10_000, allow_unicode=True)
    return text.removesuffix("\n").removesuffix("...").strip()


def _plain(value: Any) -> Any:
    """Numbers with as many digits as a person would type; keys that JSON made texts are numbers again."""
    if isinstance(value, dict):
        return {yaml.safe_load(key) if re.fullmatch(r"[\d.]+", key) else key: _plain(v) for key, v in value.items()}
    if isinstance(value, list):
        return [_plain(v) for v in value]
    return float(f"{value:.7g}") if isinstance(value, float) else value
