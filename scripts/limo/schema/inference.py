"""What an inference of unknown geometry may say."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from limo.schema.section import NAME, Section

Text = Annotated[str, Field(min_length=3)]


class Inference(Section):
    """Which statements of the paper the unknown seams are inferred from, and which are held out (``limo infer``)."""

    description: str = Field("", description="one sentence", examples=["seams of N_p = 6 and 10 from half of the statements"])
    devices: str = Field(
        "afterload",
        pattern=NAME,
        description="study of all numbers of pouches, judged with the seams put in",
        examples=["afterload"],
    )
    seams: str = Field(
        "seam_positions",
        pattern=NAME,
        description="study whose variants have different seams.fractions, which is interpolated between; the first is the prior",
        examples=["seam_positions"],
    )
    prior_spread: float = Field(
        0.1, gt=0, le=10, description="standard deviation of the prior, in multiples of the reference seam", examples=[0.1]
    )
    designs: list[Annotated[str, Field(pattern=NAME)]] = Field(
        default=[],
        description="studies of which the paper does not say the number of pouches, judged with each that they have",
        examples=[["valve_support", "compliance"]],
    )
    used: list[Text] = Field(
        min_length=1,
        description="statements of docs/paper_check.md that are inferred from",
        examples=[["fewer pouches, more stroke"]],
    )
    held_out: list[Text] = Field(
        min_length=1, description="statements that are not, to test what was inferred", examples=[["efficiencies at 90 ml"]]
    )

    @model_validator(mode="after")
    def _apart(self) -> Inference:
        if both := set(self.used) & set(self.held_out):
            raise ValueError(f"no statement both used and held out: {', '.join(sorted(both))}")
        if max(map(len, (self.used, self.held_out))) > len({*self.used, *self.held_out}) or len({*self.used}) < len(self.used):
            raise ValueError("no statement twice")
        return self
