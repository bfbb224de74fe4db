"""The base of all sections of a configuration, and the names and kinds that several of them share."""

from __future__ import annotations

from typing import Any, Literal, get_args

from pydantic import BaseModel, ConfigDict, ValidationInfo, field_validator

ElementName = Literal["S8", "S8R", "C3D20", "C3D20R", "SHELL8R"]


Engine = Literal["calculix", "newton"]


ENGINES = get_args(Engine)


#: the stages of a case in their order; a cycle is what follows the first ramp, where a study asks for it
STAGES = ("fit", "hold", "ramp", "cycle")
#: those that have numerics of their own; a cycle has those of the ramp
PLANNED = STAGES[:3]


Symmetry = Literal["full", "front_back", "quarter"]


NAME = r"^[A-Za-z][A-Za-z0-9_]*$"


FILE = r"^[\w-]+\.ya?ml$"


class Section(BaseModel):
    """A part of the configuration: unknown keys are refused, values are immutable."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    @field_validator("*", mode="before")
    @classmethod
    def _no_truth_values(cls, value: Any, info: ValidationInfo) -> Any:
        """``True`` must not pass for 1, nor 1 for it."""
        if cls.model_fields[info.field_name].annotation is bool:
            if not isinstance(value, bool):
                raise ValueError("true or false")
            return value
        for item in value if isinstance(value, list) else [value]:
            if isinstance(item, bool):
                raise ValueError("a number or text, not yes or no")
        return value
