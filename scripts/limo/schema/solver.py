"""What may be said of the solver, of the limits that a result must keep, and of the recovery ladder."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from limo.schema.section import NAME, Section, Symmetry


class Solver(Section):
    """Where CalculiX is and how long it may take."""

    command: str | None = Field(
        None, description="path of ccx; found in .local/ or on PATH when empty", examples=["/usr/bin/ccx"]
    )
    build: Literal["any", "tuned", "stock"] = Field(
        "any",
        description="tuned build of this machine, the distribution's ccx, or the first of these there is",
        examples=["stock"],
    )
    threads: int = Field(1, ge=1, le=64, description="threads a case; one is bit-reproducible", examples=[1])
    time_limit: float = Field(120.0, gt=0, description="minutes of wall time an attempt at a case may take", examples=[120.0])
    stall_limit: float = Field(
        10.0, gt=0, description="minutes without a new Newton iteration before a case is stopped", examples=[10.0]
    )


class Limits(Section):
    """What a solved case must keep to count as converged; beyond it is degraded, far beyond it has failed."""

    residual: float = Field(
        0.02, gt=0, le=1, description="force resultants out of equilibrium over the applied load", examples=[0.02]
    )
    viscous_share: float = Field(0.05, gt=0, le=1, description="damping and inertia over the applied load", examples=[0.05])
    dissipated_fraction: float = Field(
        0.5, gt=0, le=1, description="dissipated share of the actuation work, snaps included", examples=[0.5]
    )
    energy_created: float = Field(
        0.05, gt=0, le=1, description="largest fall of the dissipated energy over the actuation work", examples=[0.05]
    )
    jump: float = Field(
        0.25,
        gt=0,
        le=1,
        description="change of a volume between increments that is no buckling event, over the ventricle at rest",
        examples=[0.25],
    )
    smallest_volume_ratio: float = Field(
        0.5,
        ge=0,
        lt=1,
        description="share of its volume that fabric keeps at every integration point, of all increments",
        examples=[0.5],
    )
    compression_share: float = Field(
        0.37,
        gt=0,
        le=1,
        description="share of the fabric's energy at rest that is compression which no wrinkle carries",
        examples=[0.37],
    )
    actuation_volume: float = Field(
        0.05,
        gt=0,
        le=1,
        description="V_a at rest below zero, beyond the thickness of the pouches' fabric, over the ventricle at rest",
        examples=[0.05],
    )


#: stands in the keys of a rung for the stage in which the attempt before failed
FAILED_STAGE = "failed"


class Rung(Section):
    """What changes, on top of the rungs before, for another attempt at a case that failed."""

    name: str = Field(pattern=NAME, max_length=40, description="what the attempt is called", examples=["smaller_start"])
    multiply: dict[str, Annotated[float, Field(gt=0, le=1e6)]] = Field(
        {},
        description="keys of a numerics preset, or of a mesh level behind mesh., and factors of their values; failed stands for "
        "the stage that failed",
        examples=[{"first_increment": 0.1, "failed.damping": 10}, {"mesh.degrees_of_freedom": 2}],
    )
    symmetry: Symmetry | None = Field(None, description="another part of the device", examples=["front_back"])

    @model_validator(mode="after")
    def _changes_something(self) -> Rung:
        if not self.multiply and self.symmetry is None:
            raise ValueError("multiply or symmetry")
        return self


Ladder = Annotated[list[Rung], Field(max_length=10)]


class Recovery(Section):
    """What is tried in turn, by engine, when a case diverges, stalls or times out."""

    calculix: Ladder = Field(
        [], description="rungs of CalculiX", examples=[[{"name": "smaller_start", "multiply": {"first_increment": 0.1}}]]
    )
    newton: Ladder = Field(
        [], description="rungs of newton", examples=[[{"name": "smaller_load_steps", "multiply": {"newton.load_step": 0.25}}]]
    )
