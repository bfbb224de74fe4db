"""What an exploration may say: a space of designs, where they work, what is wanted of them, and what it may cost."""

from __future__ import annotations

import re
from typing import Annotated, Literal

from pydantic import Field, field_validator, model_validator

from limo.schema.section import NAME, Section
from limo.schema.study import Pouches, Pressure

#: a constraint: a bound, or that something never happens
BOUND = re.compile(r"^\s*(>=|<=)\s*(-?\d+(?:\.\d*)?)\s*$")
NEVER = "none"
#: up to so many pouches a device has no seam off the axis
ON_AXIS = 4
#: designs by the finer preset from which on it is learned from
LEARNED_FROM = 4
#: why the device of ``baseline`` is among the recommended ones
AS_IT_IS = "the device as it is"
#: how the reason begins why designs are there that test the surrogates, and those that both presets together propose
HELD_OUT = "held out"
SEARCHED_FINELY = "proposed by both presets"


def _interval(low: float, high: float):
    """Two numbers in rising order within a range."""
    number = Annotated[float, Field(ge=low, le=high)]
    return Annotated[list[number], Field(min_length=2, max_length=2)]


class Ranges(Section):
    """The inputs: numbers of pouches, and a range of each other one; an input that is left out is the device's own."""

    n_pouches: Annotated[list[Pouches], Field(min_length=2)] | Pouches = Field(
        description="N_p, even, on both faces together: several numbers, or one that all designs have", examples=[[4, 6, 8, 10]]
    )
    aspect_ratio: _interval(1, 10) | None = Field(None, description="AR of the valve support", examples=[[1.0, 3.0]])
    stiffness_ratio: _interval(0.01, 100) | None = Field(
        None, description="E_hat, endocardial over fabric modulus", examples=[[0.5, 1.5]]
    )
    thickness: _interval(0.01, 5) | None = Field(None, description="thickness of the fabric in mm", examples=[[0.12, 0.3]])
    seam_shift: _interval(-1, 1) | None = Field(
        None,
        description="by what share all seams off the axis are moved outwards, or inwards where it is negative",
        examples=[[-0.15, 0.15]],
    )
    width_scale: _interval(0.5, 1.5) | None = Field(
        None, description="instead of the device's own width_scale", examples=[[0.9, 1.1]]
    )

    @field_validator("n_pouches")
    @classmethod
    def _rising(cls, values: list[int] | int) -> list[int] | int:
        numbers = values if isinstance(values, list) else [values]
        if 0 in numbers or len(set(numbers)) != len(numbers):
            raise ValueError("numbers of pouches from 2 on, none twice")
        return sorted(values) if isinstance(values, list) else values

    @field_validator("aspect_ratio", "stiffness_ratio", "thickness", "seam_shift", "width_scale")
    @classmethod
    def _not_inverted(cls, ends: list[float] | None) -> list[float] | None:
        if ends is not None and ends[0] >= ends[1]:
            raise ValueError("a lower and a higher end of a range")
        return ends

    @model_validator(mode="after")
    def _not_empty(self) -> Ranges:
        if len(self.numbers) == 1 and not self.continuous:
            raise ValueError("one range at least, or several numbers of pouches; such as aspect_ratio: [1, 3]")
        if self.seam_shift and max(self.numbers) <= ON_AXIS:
            raise ValueError(f"seam_shift with more than {ON_AXIS} pouches, for others have no seam off the axis")
        return self

    @property
    def numbers(self) -> list[int]:
        """The numbers of pouches."""
        return self.n_pouches if isinstance(self.n_pouches, list) else [self.n_pouches]

    @property
    def continuous(self) -> dict[str, list[float]]:
        """The ranges by their names."""
        return {k: v for k in type(self).model_fields if k != "n_pouches" and (v := getattr(self, k)) is not None}


class Place(Section):
    """The pressures at which designs are compared; of several P_v the worst one counts."""

    ventricular_pressure: list[Pressure] = Field(min_length=1, max_length=8, description="P_v in kPa", examples=[[13.8]])
    actuation_pressure_max: float = Field(gt=0, le=1000, description="P_a,max in kPa", examples=[100])


class Exploration(Section):
    """Which device should be built: a search of a space of designs by surrogates on two fidelities."""

    description: str = Field("", description="one sentence", examples=["efficiency beside stress, at a stroke of 90 ml or more"])
    device: str = Field("limo", pattern=NAME, description="name of a file in config/devices", examples=["limo"])
    space: Ranges = Field(description="inputs and their ranges")
    at: Place = Field(description="where designs are compared")
    goals: dict[Annotated[str, Field(pattern=NAME)], Literal["maximise", "minimise"]] = Field(
        min_length=1,
        max_length=2,
        description="one or two quantities of a study's dataset; of curves and frames the value at P_a,max",
        examples=[{"efficiency_90ml": "maximise", "von_mises_peak": "minimise"}],
    )
    constraints: dict[Annotated[str, Field(pattern=NAME)], str] = Field(
        {},
        description="bounds of other quantities, >= or <= a number; or none, for what must not happen up to P_a,max",
        examples=[{"stroke_volume": ">= 90", "contact_front_back": "none"}],
    )
    budget: dict[Annotated[str, Field(pattern=NAME)], Annotated[int, Field(ge=1, le=10_000)]] = Field(
        min_length=2,
        max_length=2,
        description="how many designs are solved by each of two presets: many by the cheap one that is searched on, few by the "
        "one that recommended designs are solved by",
        examples=[{"preview": 120, "standard": 6}],
    )
    baseline: int | None = Field(
        None, description="N_p of the device as it is, which is solved beside the designs by both presets", examples=[8]
    )
    first: int | None = Field(
        None,
        ge=2,
        description="designs before the search begins (default: a third of the budget); the whole budget searches nothing",
        examples=[40],
    )
    batch: int = Field(8, ge=1, le=64, description="designs proposed at once", examples=[8])
    held_out: int | None = Field(
        None,
        ge=0,
        description="samples of the budget that are solved and never learned from, which test the surrogates (default: a tenth)",
        examples=[12],
    )
    worth: float = Field(
        0.002,
        ge=0,
        lt=1,
        description="the search ends after two batches of which no design is expected to add this share of the hypervolume; 0 "
        "spends the whole budget",
        examples=[0.002],
    )
    seed: int = Field(1, ge=0, le=2**31, description="of samples and of the search", examples=[1])
    tolerance: dict[Literal["aspect_ratio", "stiffness_ratio", "thickness", "seam_shift", "width_scale"], float] = Field(
        {},
        description="standard deviation of an input as it is made, in its own unit; a robust design is good within it",
        examples=[{"thickness": 0.01, "seam_shift": 0.02}],
    )
    trusted_below: float = Field(
        0.15,
        gt=0,
        le=1,
        description="error of a surrogate over the range of its values, above which it is not used",
        examples=[0.15],
    )

    @field_validator("constraints")
    @classmethod
    def _bounds(cls, constraints: dict[str, str]) -> dict[str, str]:
        for text in constraints.values():
            if text != NEVER and not BOUND.match(text):
                raise ValueError(f"a bound such as '>= 90', or {NEVER}, and not {text!r}")
        return constraints

    @model_validator(mode="after")
    def _enough(self) -> Exploration:
        if self.baseline is not None and self.baseline not in self.space.numbers:
            raise ValueError(f"baseline as one of n_pouches, {self.space.numbers}; such as baseline: {self.space.numbers[0]}")
        if len(set(self.budget.values())) == 1:
            raise ValueError(
                "a budget of many designs by one preset and few by another; such as budget: {shells: 120, standard: 6}"
            )
        inputs = (len(self.space.numbers) > 1) + len(self.space.continuous)
        if self.searched <= 2 * inputs:
            raise ValueError(
                f"a budget of more than {2 * inputs} designs for {inputs} inputs; such as budget: {{shells: 120, ...}}"
            )
        if self.tested > self.searched // 2:
            raise ValueError(
                f"held_out of at most half of the budget of {self.searched} designs; such as held_out: {self.searched // 10}"
            )
        if self.beginning + self.tested > self.searched:
            raise ValueError(
                f"first and held_out within the budget of {self.searched} designs; such as first: {self.searched // 3}"
            )
        return self

    @property
    def cheap(self) -> str:
        """The preset that is searched on: that of more designs."""
        return max(self.budget, key=self.budget.__getitem__)

    @property
    def fine(self) -> str:
        """The preset that recommended designs are solved by: that of fewer designs."""
        return min(self.budget, key=self.budget.__getitem__)

    @property
    def searched(self) -> int:
        """How many designs the search may solve."""
        return self.budget[self.cheap]

    @property
    def beginning(self) -> int:
        """How many of them before it begins."""
        return self.first or max(2 * (1 + len(self.space.continuous)), self.searched // 3)

    @property
    def tested(self) -> int:
        """How many of them test the surrogates."""
        return self.searched // 10 if self.held_out is None else self.held_out

    @property
    def rounds(self) -> list[int]:
        """How many designs each round by the cheap preset has: the first, with those held out, and batches as budget is left."""
        counts = [self.beginning + self.tested]
        while (left := self.searched - sum(counts)) > 0:
            counts.append(min(self.batch, left))
        return counts

    @property
    def fine_rounds(self) -> list[int]:
        """How many designs each round by the finer preset has: of many, half are chosen with what the others taught."""
        count = self.budget[self.fine]
        return [count] if count < 2 * LEARNED_FROM else [count - count // 2, count // 2]
