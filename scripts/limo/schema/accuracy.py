"""What an airbag file and the scaling of sizes may say."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, field_validator, model_validator

from limo.schema.device import Elastic
from limo.schema.element import element
from limo.schema.numerics import LARGEST_MESH, Controls, Newton
from limo.schema.section import NAME, Engine, Section
from limo.schema.study import Pouches


class Scaling(Section):
    """Ever finer meshes of one full device, each iterated a few times (``snakemake accuracy``)."""

    device: str = Field("limo", pattern=NAME, description="name of a file in config/devices", examples=["limo"])
    n_pouches: Pouches = Field(8, description="N_p, even", examples=[8])
    ventricular_pressure: float = Field(3.8, ge=0, le=100, description="P_v in kPa", examples=[3.8])
    start: int = Field(20000, ge=1000, le=LARGEST_MESH, description="displacements of the first mesh", examples=[20000])
    factor: float = Field(2.0, ge=1.2, le=10, description="displacements of a mesh over those of the one before", examples=[2])
    memory: float = Field(
        0.85, gt=0, le=1, description="share of the machine's memory beyond which no size is tried", examples=[0.85]
    )
    minutes: float = Field(15.0, gt=0, description="CPU time of a size beyond which it is not tried", examples=[15])


AirbagElement = Literal["S3", "S4", "S4R", "S6", "S8", "S8R", "C3D20R", "C3D20", "SHELL8R"]


Planes = Literal["symmetric", "hinged"]


class AirbagSeries(Section):
    """One element type, solved on several meshes."""

    element: AirbagElement = Field(
        description="shells that CalculiX expands, written-out C3D20R or C3D20, or SHELL8R", examples=["S8R"]
    )
    engine: Engine = Field("calculix", description="newton for C3D20R, C3D20 and SHELL8R alone", examples=["newton"])
    divisions: list[Annotated[int, Field(ge=2, le=200)]] = Field(
        min_length=1, description="numbers of elements along half a side", examples=[[4, 8, 16]]
    )
    planes: Planes | None = Field(
        None,
        description="whether the sheet keeps its slope on the planes of symmetry or may turn there: symmetric by default for "
        "bricks, always hinged for shells",
        examples=["hinged"],
    )
    path: list[Annotated[float, Field(gt=0, le=1000)]] = Field(
        default=[],
        max_length=20,
        description="pressures to pass through on the way to p, as multiples of p: higher ones iron wrinkles out",
        examples=[[100, 10]],
    )

    @field_validator("divisions")
    @classmethod
    def _rising(cls, divisions: list[int]) -> list[int]:
        if divisions != sorted(set(divisions)):
            raise ValueError("rising numbers, none twice")
        return divisions

    @model_validator(mode="after")
    def _shells_are_hinged(self) -> AirbagSeries:
        if self.planes == "symmetric" and element(self.element).is_shell:
            raise ValueError(f"planes: hinged for element {self.element}")
        return self

    @property
    def chosen_planes(self) -> Planes:
        """``planes``, or their default."""
        return self.planes or ("hinged" if element(self.element).is_shell else "symmetric")


class AirbagReference(Section):
    """A published value of the same airbag."""

    quantity: Literal["height", "edge_draw_in", "corner_draw_in", "stress"] = Field(
        description="height of the centre, or how far the middle of an edge or a corner moves in, or the largest principal "
        "stress at the centre",
        examples=["height"],
    )
    value: float = Field(gt=0, description="mm, or MPa of a stress", examples=[216.7])
    divisions: int | None = Field(
        None, ge=1, le=1000, description="elements along half a side of the published mesh", examples=[10]
    )
    source: str = Field(min_length=3, description="who published it", examples=["Contri and Schrefler 1988"])


class AirbagNumerics(Section):
    """How an airbag is inflated.

    CalculiX integrates overdamped dynamics: the pressure goes along its path in ``rise``, then rests for ``hold``. The engine
    newton has no time.
    """

    rise: float = Field(1.0, gt=0, le=1000, description="s of the path to p, each part of it equally long", examples=[1.0])
    hold: float = Field(0.5, gt=0, le=1000, description="s at the full pressure", examples=[0.5])
    damping_share: float = Field(
        0.01, gt=0, le=1, description="viscous pressure at a velocity of half a side a rise, over the pressure", examples=[0.01]
    )
    first_increment: float = Field(1e-4, gt=0, le=0.1, description="over the rise", examples=[1e-4])
    smallest_increment: float = Field(1e-8, gt=0, le=1e-2, description="over the rise", examples=[1e-8])
    largest_increment: float = Field(0.05, gt=0, le=1, description="over the rise", examples=[0.05])
    controls: Controls = Controls()
    newton: Newton = Newton()

    @model_validator(mode="after")
    def _ordered(self) -> AirbagNumerics:
        if not self.smallest_increment <= self.first_increment <= self.largest_increment:
            raise ValueError("smallest_increment, first_increment and largest_increment in rising order")
        return self

    def for_engine(self, engine: str) -> dict[str, Any]:
        """Plain data of the part that ``engine`` looks at."""
        by_engine = {"newton": self.newton.content(), "calculix": self.model_dump(mode="json", exclude={"newton"})}
        return by_engine[engine]


class Airbag(Elastic):
    """A square airbag, the runs that inflate it, and what others found."""

    description: str = Field("", description="one sentence", examples=["the classical case"])
    side: float = Field(gt=0, le=10000, description="mm, of the flat sheet", examples=[848.528])
    pressure: float = Field(gt=0, le=1000, description="p in kPa", examples=[5.0])
    series: list[AirbagSeries] = Field(
        min_length=1, description="what is solved", examples=[[{"element": "S8R", "divisions": [4, 8, 16]}]]
    )
    references: list[AirbagReference] = Field(
        default=[],
        description="published values",
        examples=[[{"quantity": "height", "value": 216.7, "divisions": 10, "source": "Jarasjarungkiat et al. 2009"}]],
    )
    numerics: AirbagNumerics = Field(
        AirbagNumerics(), description="how it is inflated", examples=[{"first_increment": 1e-4, "largest_increment": 0.05}]
    )
    time_limit: float = Field(3.0, gt=0, le=1000, description="minutes of wall time a run may take", examples=[3.0])

    @field_validator("series")
    @classmethod
    def _no_series_twice(cls, series: list[AirbagSeries]) -> list[AirbagSeries]:
        kinds = [(s.element, s.engine, s.chosen_planes, *s.path) for s in series]
        if len(set(kinds)) != len(kinds):
            raise ValueError("one entry for an element, engine, planes and path")
        return series
