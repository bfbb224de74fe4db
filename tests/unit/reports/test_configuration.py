"""The reference of configuration keys: type, range, default, unit and example of a key as its model has them."""

from __future__ import annotations

from typing import Annotated, Literal

import pytest
from pydantic import Field

from limo.reports.configuration import KINDS, part, table
from limo.schema.section import NAME, Section


class Inner(Section):
    """A part of St. Example (paper). More."""

    size: float = Field(2.5, gt=0, description="mm of the device's edge", examples=[2.5])


class Outer(Section):
    """All kinds of keys."""

    name: str = Field(pattern=NAME, description="a name", examples=["limo"])
    count: int = Field(4, ge=2, le=16, multiple_of=2, description="N, even", examples=[4])
    share: float | None = Field(None, gt=-1, lt=0.5, description="share in 1/s", examples=[0.1])
    kind: Literal["a", "b"] = Field("a", description="which kind in mm", examples=["b"])
    values: list[Annotated[float, Field(ge=0)]] = Field([0.0], max_length=3, description="kPa/s, rising", examples=[[1, 2]])
    pair: tuple[float, float] = Field(description="low and high in MPa", examples=[[1, 2]])
    limits: dict[float, Annotated[float, Field(le=1000)]] = Field({}, description="by P_v", examples=[{3.8: 60}])
    inner: Inner = Inner()
    other: Inner = Field(Inner(size=3), description="another one")
    inners: dict[Annotated[str, Field(pattern=NAME)], Inner] = Field({}, description="by name")


ROWS = {
    "name": "name | **required** |  | a name | `limo`",
    "count": "integer, 2 <= x <= 16, even | `4` |  | N, even | `4`",
    "share": "number, -1 < x < 0.5 | - | 1/s | share in 1/s | `0.1`",
    "kind": "`a`, `b` | `a` |  | which kind in mm | `b`",
    "values": "list of number, 0 <= x, at most 3 | `[0.0]` | kPa/s | kPa/s, rising | `[1, 2]`",
    "pair": "[low, high], each number | **required** | MPa | low and high in MPa | `[1, 2]`",
    "limits": "mapping to number, x <= 1000 | `{}` |  | by P_v | `{3.8: 60}`",
    "inner": "[Inner](#inner) | its own |  | A part of St. Example (paper) | ",
    "other": "[Inner](#inner) | `{size: 3.0}` |  | another one | ",
    "inners": "mapping to [Inner](#inner) | `{}` |  | by name | ",
}


def test_a_row_says_what_the_model_does():
    schema = Outer.model_json_schema()
    made = table(schema, schema["$defs"]).splitlines()[2:]
    assert made == [f"| `{key}` | {text} |" for key, text in ROWS.items()]
    assert "| `size` | number, 0 < x | `2.5` | mm | mm of the device's edge | `2.5` |" in table(schema["$defs"]["Inner"], {})


def sections(schema: dict) -> list[dict]:
    return [schema, *schema.get("$defs", {}).values()]


@pytest.mark.parametrize("kind", KINDS)
def test_every_key_of_every_section_is_described_once(root, kind):
    text = (root / "docs/configuration.md").read_text(encoding="utf-8")
    made = part(kind)
    for section in sections(KINDS[kind].model_json_schema()):
        rows = [f"| `{key}` | " for key in section["properties"]]
        assert all(row in text for row in rows)
        if section["title"] != KINDS[kind].__name__:
            assert text.count(f"### {section['title']}\n") == 1
    assert "| - |  |  |  |" not in made, "a key without a meaning"
