"""What a stress test may say."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from limo.schema.numerics import Mesh
from limo.schema.section import NAME, Engine, Section
from limo.schema.study import Pressure

Even = Annotated[int, Field(ge=2, le=16, multiple_of=2)]


class Box(Section):
    """Ranges of the parameters that a stress test draws from: lowest and highest, the same for one that stays."""

    samples: int = Field(ge=1, le=10000, description="cases of the Latin hypercube", examples=[60])
    corners: Literal[0, 16] = Field(
        0, description="16: these corners too, a fractional factorial design of resolution IV", examples=[16]
    )
    n_pouches: tuple[Even, Even] = Field(description="N_p, even, uniform", examples=[[2, 12]])
    ventricular_pressure: tuple[Pressure, Pressure] = Field(description="P_v in kPa, uniform", examples=[[0, 30]])
    aspect_ratio: tuple[Annotated[float, Field(ge=1, le=10)], Annotated[float, Field(ge=1, le=10)]] = Field(
        description="AR of the valve support, uniform", examples=[[1, 4]]
    )
    stiffness_ratio: tuple[Annotated[float, Field(gt=0, le=100)], Annotated[float, Field(gt=0, le=100)]] = Field(
        description="E_hat, uniform in its logarithm", examples=[[0.1, 4]]
    )
    thickness: tuple[Annotated[float, Field(gt=0, le=5)], Annotated[float, Field(gt=0, le=5)]] = Field(
        description="of the fabric in mm, uniform in its logarithm; its density stays", examples=[[0.05, 0.5]]
    )
    modulus_factor: tuple[Annotated[float, Field(gt=0, le=100)], Annotated[float, Field(gt=0, le=100)]] = Field(
        description="factor of the fabric's modulus, uniform in its logarithm", examples=[[0.1, 10]]
    )
    width_scale: tuple[Annotated[float, Field(ge=0.5, le=1.5)], Annotated[float, Field(ge=0.5, le=1.5)]] = Field(
        description="of the device, uniform", examples=[[0.8, 1.2]]
    )

    @model_validator(mode="after")
    def _ordered(self) -> Box:
        for name in BOX_AXES:
            if getattr(self, name)[0] > getattr(self, name)[1]:
                raise ValueError(f"{name}: the lower end first")
        return self


#: parameters of a stress test in the order of its hypercube
BOX_AXES = (
    *("n_pouches", "ventricular_pressure", "aspect_ratio", "stiffness_ratio"),
    *("thickness", "modulus_factor", "width_scale"),
)


class StressTest(Section):
    """Cases over boxes of parameters, solved to see what fails (``snakemake stress_test``)."""

    device: str = Field("limo", pattern=NAME, description="name of a file in config/devices", examples=["limo"])
    engines: list[Engine] = Field(min_length=1, description="each solves every case", examples=[["newton"]])
    mesh: Mesh = Field(Mesh(), description="mesh of its cases")
    numerics: str | None = Field(None, pattern=NAME, description="name of a preset, instead of the default", examples=["fast"])
    seed: int = Field(1, ge=0, le=2**32 - 1, description="of the hypercube", examples=[1])
    actuation_above: float = Field(40.0, gt=0, le=500, description="P_a,max - P_v in kPa", examples=[40.0])
    time_limit: float | None = Field(
        None, gt=0, description="minutes of wall time an attempt may take, instead of the solver's time_limit", examples=[2.0]
    )
    boxes: dict[Annotated[str, Field(pattern=NAME)], Box] = Field(min_length=1, description="boxes by name")
