"""The factors of a recovery ladder applied to numerics and a mesh level."""

from __future__ import annotations

from typing import Any

from pydantic import ValidationError

from limo.schema.numerics import MeshLevel, Numerics
from limo.schema.section import PLANNED
from limo.schema.solver import FAILED_STAGE, Rung

MESH = "mesh"  # what keys of a mesh level begin with; all others are of numerics


def multiplied(numerics: Numerics, level: MeshLevel, rung: Rung, failed_stage: str) -> tuple[Numerics, MeshLevel]:
    """Numerics and mesh level with the factors of a rung. Whole numbers are rounded.

    Raises ``ValueError`` for a key that they do not have and a value out of its range.
    """
    data = numerics.model_dump(mode="json") | {MESH: level.model_dump(mode="json")}
    for key, factor in rung.multiply.items():
        *sections, last = key.replace(FAILED_STAGE, failed_stage).split(".")
        section_data: Any = data
        for section in sections:
            section_data = section_data.get(section) if isinstance(section_data, dict) else None
        value = section_data.get(last) if isinstance(section_data, dict) else None
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise ValueError(f"{key} is no number of a numerics preset or a mesh level")
        section_data[last] = max(round(value * factor), 1) if isinstance(value, int) else value * factor
    try:
        level = MeshLevel.model_validate(data.pop(MESH))
        return Numerics.model_validate(data), level
    except ValidationError as error:
        first = error.errors()[0]
        raise ValueError(f"{'.'.join(map(str, first['loc']))}: {first['msg']}") from None


def check_ladder(rungs: list[Rung], numerics: Numerics, level: MeshLevel) -> None:
    """Climb all rungs from some settings, whichever stage fails. Raises ``ValueError`` for one that cannot be, naming it."""
    for stage in PLANNED:
        climbed = numerics, level
        for rung in rungs:
            try:
                climbed = multiplied(*climbed, rung, stage)
            except ValueError as error:
                raise ValueError(f"{rung.name}: {error}") from None
