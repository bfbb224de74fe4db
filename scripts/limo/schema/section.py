"""The base of all sections of a configuration, and the names and kinds that several of them share."""

from __future__ import annotations

from typing import Any, Literal, get_args

from pydantic import BaseModel, ConfigDict, field_validator

ElementName = Literal["S8", "S8R", "C3D20", "C3D20R", "SHELL8R"]


Engine = Literal["calculix", "newton"]


ENGINES = get_args(Engine)


#: the stages of a case in their order
STAGES = ("fit", "hold", "ramp")


Symmetry = Literal["full", "front_back", "quarter"]


NAME = r"^[A-Za-z][A-Za-z0-9_]*$"


FILE = r"^[\w-]+\.ya?ml$"


class Section(BaseModel):
    """A part of the configuration: unknown keys are refused, values are immutable."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    @field_validator("*", mode="before")
    @classmethod
    def _no_truth_values(cls, value: Any) -> Any:
        """No key of the configuration is yes or no, and ``True`` must not pass for 1."""
        for item in value if isinstance(value, list) else [value]:
            if isinstance(item, bool):
                raise ValueError("a number or text, not yes or no")
        return value
