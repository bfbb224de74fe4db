"""The recovery ladder: with which numerics a case that failed is tried again, in which order.

Rungs change how a path is followed, never the model: mesh, symmetry, loads and material belong to what a case is, and a
result on another mesh under its name would be another case in disguise.
"""

from __future__ import annotations

from typing import Any

from pydantic import ValidationError

from limo.config import FAILED_STAGE, STAGES, Numerics, Rung

CONFIGURED = "as configured"  # the name of the first attempt


def climb(numerics: Numerics, rung: Rung, failed_stage: str) -> Numerics:
    """Numerics with the factors of a rung; ``failed`` in its keys stands for ``failed_stage``.

    Whole numbers are rounded. Raises ``ValueError`` for a key that no numerics have and a value out of its range.
    """
    data = numerics.model_dump(mode="json")
    for key, factor in rung.multiply.items():
        *sections, last = key.replace(FAILED_STAGE, failed_stage).split(".")
        at: Any = data
        for section in sections:
            at = at.get(section) if isinstance(at, dict) else None
        value = at.get(last) if isinstance(at, dict) else None
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise ValueError(f"{key} is no number of a numerics preset")
        at[last] = max(round(value * factor), 1) if isinstance(value, int) else value * factor
    try:
        return Numerics.model_validate(data)
    except ValidationError as error:
        first = error.errors()[0]
        raise ValueError(f"{'.'.join(map(str, first['loc']))}: {first['msg']}") from None


def check_ladder(rungs: list[Rung], numerics: Numerics) -> None:
    """Climb all rungs from ``numerics``, whichever stage fails. Raises ``ValueError`` for one that cannot be, naming it."""
    for stage in STAGES:
        climbed = numerics
        for rung in rungs:
            try:
                climbed = climb(climbed, rung, stage)
            except ValueError as error:
                raise ValueError(f"{rung.name}: {error}") from None
