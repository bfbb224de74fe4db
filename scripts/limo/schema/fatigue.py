"""What may be said of the strain-life curve, each number with its origin."""

from __future__ import annotations

from typing import Literal, get_args

from pydantic import Field, field_validator

from limo.schema.section import Section

#: how the mean of a cycle counts (``measure.fatigue.cycles_to_failure``)
MeanCorrection = Literal["none", "morrow", "smith_watson_topper"]
NONE, MORROW, SMITH_WATSON_TOPPER = get_args(MeanCorrection)


class Parameter(Section):
    """A number and where it comes from."""

    value: float = Field(description="the number", examples=[0.55])
    origin: str = Field(min_length=3, description="where it comes from", examples=["assumed"])


class Fatigue(Section):
    """Strain-life curve, eps_a = sigma_f'/E (2N)^b + eps_f' (2N)^c (paper, *Local stress concentration and fatigue risk*).

    Only eps_f' is the paper's own; the others are not public, so cycle counts are an index for comparing designs. The
    defaults keep the plastic branch below the elastic one over the whole range, as the paper asks for below 100 cycles.
    """

    youngs_modulus: Parameter = Field(
        Parameter(value=146.0, origin="bulk TPU, upper end of the reported 100 to 146 MPa"),
        description="E in MPa of bulk TPU",
        examples=[{"value": 146.0, "origin": "tensile test"}],
    )
    strength_coefficient: Parameter = Field(
        Parameter(value=85.0, origin="assumed: just enough that the plastic branch stays below the elastic one from 1 cycle on"),
        description="sigma_f' in MPa",
        examples=[{"value": 85.0, "origin": "assumed"}],
    )
    strength_exponent: Parameter = Field(
        Parameter(
            value=-0.18,
            origin="assumed: through the amplitude 4.6 MPa at 5e6 cycles of the fatigue limit 10.25 MPa at R = 0.1 that "
            "Wang et al., Polymers 15 (2023) 899, report for TPU",
        ),
        description="b",
        examples=[{"value": -0.18, "origin": "assumed"}],
    )
    ductility_coefficient: Parameter = Field(
        Parameter(value=0.55, origin="yield strain of TPU, the value of the paper"),
        description="eps_f'",
        examples=[{"value": 0.55, "origin": "paper"}],
    )
    ductility_exponent: Parameter = Field(
        Parameter(value=-0.6, origin="assumed: middle of the usual range -0.5 to -0.7"),
        description="c",
        examples=[{"value": -0.6, "origin": "assumed"}],
    )
    endurance_cycles: Parameter = Field(
        Parameter(value=1e7, origin="assumed: order of the longest fatigue tests on polymers; no number is given beyond"),
        description="N beyond which no number is given, at most 1e12",
        examples=[{"value": 1e7, "origin": "assumed"}],
    )
    seam_distance: Parameter = Field(
        Parameter(value=4.0, origin="assumed: about the width of a heat-sealed seam and one element beside it"),
        description="mm from the nearest seam or edge within which the estimate is valid",
        examples=[{"value": 4.0, "origin": "assumed"}],
    )

    mean_correction: MeanCorrection = Field(
        MORROW, description="how the mean of a load cycle counts; of no matter without one", examples=["smith_watson_topper"]
    )

    @field_validator("youngs_modulus", "strength_coefficient", "ductility_coefficient")
    @classmethod
    def _positive(cls, parameter: Parameter) -> Parameter:
        if not 0 < parameter.value <= 1e6:
            raise ValueError("a value above 0 and up to 1e6")
        return parameter

    @field_validator("strength_exponent", "ductility_exponent")
    @classmethod
    def _negative(cls, parameter: Parameter) -> Parameter:
        if not -2 <= parameter.value < 0:
            raise ValueError("a value from -2 to below 0")
        return parameter

    @field_validator("endurance_cycles")
    @classmethod
    def _cycles(cls, parameter: Parameter) -> Parameter:
        if not 10 <= parameter.value <= 1e12:
            raise ValueError("a value from 10 to 1e12")
        return parameter

    @field_validator("seam_distance")
    @classmethod
    def _distance(cls, parameter: Parameter) -> Parameter:
        if not 0 < parameter.value <= 100:
            raise ValueError("a value above 0 and up to 100")
        return parameter
