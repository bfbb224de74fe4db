"""What a study file may say: axes, variants, pressures, outputs and figures."""

from __future__ import annotations

import re
from collections.abc import Callable
from itertools import pairwise
from typing import Annotated, Any, Literal, get_args

from pydantic import Field, field_validator, model_serializer, model_validator

from limo.schema.bench import MeasuredCurves
from limo.schema.figures import SHAPES
from limo.schema.numerics import Mesh
from limo.schema.pressures import DECIMALS
from limo.schema.section import NAME, Engine, Section

Pouches = Annotated[int, Field(ge=0, le=16, multiple_of=2)]


Pressure = Annotated[float, Field(ge=0, le=1000)]


FRAME = re.compile(r"^\s*(P_v|max)\s*(?:([+-])\s*(\d+(?:\.\d*)?))?\s*$")


class Axes(Section):
    """The grid of a study: every combination is a case."""

    n_pouches: list[Pouches] = Field(
        min_length=1, description="N_p, even, on both faces together; 0 alone", examples=[[4, 6, 8, 10]]
    )
    ventricular_pressure: list[Pressure] = Field(min_length=1, description="P_v in kPa", examples=[[3.8, 13.8, 23.8]])
    aspect_ratio: list[Annotated[float, Field(ge=1, le=10)]] = Field(
        default=[2.0], min_length=1, description="AR of the valve support", examples=[[1.0, 2.0]]
    )
    stiffness_ratio: list[Annotated[float, Field(gt=0, le=100)]] = Field(
        default=[1.0], min_length=1, description="E_hat, endocardial over fabric modulus", examples=[[0.5, 1.0]]
    )
    width_scale: list[Annotated[float, Field(ge=0.5, le=1.5)]] | None = Field(
        None, min_length=1, description="instead of the device's own width_scale (for its calibration)", examples=[[0.8, 1.0]]
    )
    fabric_angle: list[Annotated[float, Field(ge=-90, le=90)]] | None = Field(
        None,
        min_length=1,
        description="angle of the warp in degrees, of all sheets, instead of their own; "
        "but at 0 and +-90, half of the device stands for a quarter",
        examples=[[0, 45, 90]],
    )
    bending_factor: list[Annotated[float, Field(gt=0, le=4)]] | None = Field(
        None, min_length=1, description="of all sheets, instead of their own", examples=[[0.05, 1.0]]
    )

    @model_serializer(mode="wrap")
    def _without_what_is_not_varied(self, plain: Callable[[Any], dict[str, Any]]) -> dict[str, Any]:
        """Plain data are as they were before the axes of the fabric came."""
        return {k: v for k, v in plain(self).items() if v is not None or k not in ("fabric_angle", "bending_factor")}

    @field_validator("*")
    @classmethod
    def _no_value_twice(cls, values: list | None) -> list | None:
        if values is not None and len(set(values)) != len(values):
            raise ValueError("no value twice")
        return values


class _OfAPattern(Section):
    """What may change the pattern of a device. Where nothing does, plain data lack the key."""

    pattern: dict[str, Any] = Field(
        {},
        description="what differs in the pattern of the device, keys left out are the device's; "
        "of a variant, keys left out are the study's",
        examples=[{"length": 140.0, "seams": {"fractions": {6: [0.55]}}}],
    )

    @model_serializer(mode="wrap")
    def _without_what_is_usual(self, plain: Callable[[Any], dict[str, Any]]) -> dict[str, Any]:
        data = plain(self)
        for key in ("pattern", "actuation", "actuation_volume"):
            if not data.get(key, True):
                del data[key]
        return data


class Variant(_OfAPattern):
    """What one variant of a study has instead of the study's own."""

    description: str = Field("", description="a few words", examples=["half of the device"])
    device: str | None = Field(None, pattern=NAME, description="another file in config/devices", examples=["mini_limo"])
    material: dict[str, Any] = Field(
        {}, description="what differs in the fabric; keys left out are the study's", examples=[{"thickness": 0.3}]
    )
    mesh: Mesh | None = Field(
        None, description="what differs in the mesh; keys left out are the study's", examples=[{"symmetry": "front_back"}]
    )
    numerics: Annotated[str, Field(pattern=NAME)] | dict[str, Any] | None = Field(
        None,
        description="another entry of numerics_presets, or what differs from the study's; keys left out are the study's",
        examples=[{"ramp": {"damping": 1.0e5}}],
    )
    engine: Engine | None = Field(None, description="another engine", examples=["newton"])


Output = Literal["volumes", "contact", "stress", "strain", "fatigue", "fields"]


OUTPUTS = get_args(Output)


Role = Literal["accuracy", "reference", "referee", "scatter", "shells"]


#: what a study may be for when errors are measured (``accuracy.roles``)
ROLES = get_args(Role)


class LoadPoint(Section):
    """A point on the way of a load at which both pressures are given."""

    actuation_pressure: Pressure | Literal["max"] = Field(description="P_a in kPa, or max", examples=[0])
    ventricular_pressure: Pressure = Field(description="P_v in kPa", examples=[13.8])


Waypoint = Pressure | Literal["max"] | LoadPoint


class Study(_OfAPattern):
    """A grid of cases and what is wanted of them."""

    description: str = Field("", description="one sentence", examples=["pressure-volume curves"])
    device: str = Field("limo", pattern=NAME, description="name of a file in config/devices", examples=["limo"])
    preset: str | None = Field(
        None,
        pattern=NAME,
        description="name of an entry of presets, for mesh, numerics, engine and branches that the study does not state itself",
        examples=["standard"],
    )
    material: dict[str, Any] = Field(
        {}, description="what differs in the fabric of the device; keys left out are the device's", examples=[{"thickness": 0.3}]
    )
    engine: Engine | None = Field(
        None, description="what solves the cases, instead of the configuration's engine", examples=["newton"]
    )
    branches: int | None = Field(
        None,
        ge=1,
        le=100,
        description="solutions of each case: the flat state as it is, and others from it with tiny seeded perturbations",
        examples=[5],
    )
    cross_check: int = Field(
        0, ge=0, le=1000, description="how many of the cases are solved by the other engine too, for comparison", examples=[2]
    )
    axes: Axes
    variants: dict[Annotated[str, Field(pattern=NAME)], Variant] = Field(
        default={},
        description="an axis of named variants of everything else: each case is solved once for each, in this order",
        examples=[{"quarter": {}, "half": {"mesh": {"symmetry": "front_back"}}}],
    )
    actuation_pressure_max: Annotated[float, Field(ge=0, le=1000)] | dict[float, Annotated[float, Field(ge=0, le=1000)]] = Field(
        0.0,
        description="P_a,max in kPa, one number or one for each P_v; 0 without pouches and with actuation_volume",
        examples=[{3.8: 60, 13.8: 100, 23.8: 140}],
    )
    actuation: list[Waypoint] | None = Field(
        None,
        min_length=3,
        max_length=41,
        description="way of the load beyond the ramp, from 0 to max and on: P_a in kPa, max, or both pressures in kPa of a point",
        examples=[[0, "max", 0, "max", 0]],
    )
    actuation_volume: list[Literal["rest"] | Annotated[float, Field(ge=0, le=2000)]] | None = Field(
        None,
        min_length=2,
        max_length=41,
        description="way of V_a in ml instead of a ramp of P_a, as a syringe gives it, on from rest: what the pouches hold at "
        "rest; engine newton alone",
        examples=[["rest", 80, "rest"]],
    )
    mesh: Mesh | None = Field(None, description="instead of the configuration's mesh")
    numerics: Annotated[str, Field(pattern=NAME)] | dict[str, Any] | None = Field(
        None,
        description="another entry of numerics_presets, or what differs from the default; keys left out are the default's",
        examples=[{"newton": {"load_step": 0.25}}],
    )
    frames: list[float | str] = Field(
        default=[0.0, "P_v", "P_v + 10", "P_v + 20", "P_v + 40", "P_v + 60", "max"],
        description="actuation pressures in kPa whose displacements are kept: a number, P_v, P_v + number, or max",
        examples=[[0, "P_v + 10", "max"]],
    )
    outputs: list[Output] = Field(
        default=["volumes", "contact"],
        min_length=1,
        description="what is computed for the cases: contact, stress, strain and fatigue at the frames, fields for ParaView at "
        "fields_at; S8 and S8R have volumes alone",
        examples=[["volumes", "stress", "strain", "fatigue", "fields"]],
    )
    fields_at: list[float | str] = Field(
        default=["max"],
        description="actuation pressures in kPa whose maps are kept and drawn, written as frames are and kept as frames too",
        examples=[["P_v + 20", "max"]],
    )
    reuse: Literal["exact", "further", "better"] = Field(
        "further",
        description="which other case may stand for one of the study: none (exact), one that goes to a higher P_a,max and is "
        "otherwise the same (further), or also a solved one on a mesh level with more degrees of freedom (better)",
        examples=["further"],
    )
    pressure_step: float = Field(
        0.5, ge=0.01, le=50, description="kPa between the pressures of the study's dataset", examples=[0.5]
    )
    figures: list[Annotated[str, Field(pattern=NAME)]] = Field(
        default=[], description="figures to draw", examples=[["pressure_volume"]]
    )
    measured: str | MeasuredCurves | None = Field(
        None,
        description="file of measured curves to lay over figures and to compare with, a path from the project's root; or "
        "with keys of what it does not say itself (docs/bench.md)",
        examples=[
            "config/measured/curves_synthetic.csv",
            {"data": "config/measured/mine.csv", "units": {"actuation_pressure": "mmHg"}},
        ],
    )
    role: Role | None = Field(
        None,
        description="what the study is for when errors are measured: reference, an ensemble on the finest mesh; accuracy, one "
        "setting at a time; scatter, an ensemble on another mesh; referee, CalculiX on a fine mesh; shells, of volumes alone",
        examples=["reference"],
    )
    subject: str | None = Field(
        None, pattern=NAME, description="what its errors are of; studies of one subject belong together", examples=["np4"]
    )

    @field_validator("frames", "fields_at")
    @classmethod
    def _frames(cls, frames: list[float | str]) -> list[float | str]:
        for frame in frames:
            if isinstance(frame, str) and (not (match := FRAME.match(frame)) or match.group(1, 2) == ("max", "+")):
                raise ValueError(f"not {frame!r}")
            if not isinstance(frame, str) and frame < 0:
                raise ValueError(f"no negative pressure, not {frame}")
        return frames

    @model_validator(mode="after")
    def _role_of_a_subject(self) -> Study:
        if (self.role is None) != (self.subject is None):
            raise ValueError("role and subject together, or neither; such as role: reference and subject: np4")
        return self

    def maximum_for(self, ventricular_pressure: float) -> float:
        """P_a,max (kPa) of the cases at a P_v (kPa). Raises ``KeyError`` where none is given."""
        if isinstance(self.actuation_pressure_max, dict):
            return self.actuation_pressure_max[ventricular_pressure]
        return self.actuation_pressure_max

    @model_validator(mode="after")
    def _begins_with_the_ramp(self) -> Study:
        if self.actuation is not None and self.actuation[:2] != [0, "max"]:
            raise ValueError('actuation that begins with 0 and max, the ramp; such as actuation: [0, "max", 0]')
        return self

    @field_validator("actuation_volume")
    @classmethod
    def _from_rest(cls, points: list[str | float] | None) -> list[str | float] | None:
        if points is not None and (points[0] != "rest" or any(a == b for a, b in pairwise(points))):
            raise ValueError("volumes that begin with rest and move")
        return points

    @property
    def syringe(self) -> tuple[float | None, ...]:
        """V_a in ml of the points to which a syringe goes from rest on, in order; None for V_a at rest."""
        return tuple(None if point == "rest" else float(point) for point in (self.actuation_volume or [])[1:])

    @property
    def has_legs(self) -> bool:
        """Whether the load goes on after the ramp, or goes by volume."""
        return bool(self.actuation or self.actuation_volume)

    def cycle_for(self, ventricular_pressure: float) -> tuple[tuple[float, float], ...]:
        """P_v and P_a (kPa) of the points after the ramp of cases at a P_v (kPa), in order; none without a cycle."""
        points, before = [], ventricular_pressure
        for point in (self.actuation or [])[2:]:
            actuation = point.actuation_pressure if isinstance(point, LoadPoint) else point
            before = point.ventricular_pressure if isinstance(point, LoadPoint) else before
            points.append((before, self.maximum_for(ventricular_pressure) if actuation == "max" else float(actuation)))
        return tuple(points)

    def frames_for(self, ventricular_pressure: float) -> list[float]:
        """Pressures of the kept frames (kPa), in order, those beyond P_a,max left out for ``P_v`` expressions."""
        frames = [*self.frames, *(self.fields_at if self.uses_frames else [])]
        pressures = {self.pressure_of(frame, ventricular_pressure) for frame in frames}
        return sorted(p for p in pressures if p is not None)

    def needed_frames(self, ventricular_pressure: float) -> list[float]:
        """Pressures (kPa) that a case going further must have kept to stand for one of the study, in order.

        A study of volumes and contact needs no frame at its end: its ``max`` means the end of whatever case it is.
        """
        if self.uses_frames:
            return self.frames_for(ventricular_pressure)
        fixed = [f for f in self.frames if not (isinstance(f, str) and FRAME.match(f).group(1) == "max")]
        return sorted({p for p in (self.pressure_of(f, ventricular_pressure) for f in fixed) if p is not None})

    def pressure_of(self, frame: float | str, ventricular_pressure: float) -> float | None:
        """Actuation pressure (kPa) that an entry of ``frames`` or ``fields_at`` means; None beyond the range of the case."""
        maximum, value = self.maximum_for(ventricular_pressure), frame
        if isinstance(frame, str):
            base, sign, offset = FRAME.match(frame).groups()
            value = ventricular_pressure if base == "P_v" else maximum
            value += float(f"{sign or '+'}{offset or 0}")
        return round(value, DECIMALS) if 0 <= value <= maximum else None

    @property
    def measured_curves(self) -> MeasuredCurves | None:
        """Its measured curves, however they are given."""
        return MeasuredCurves(data=self.measured) if isinstance(self.measured, str) else self.measured

    @property
    def uses_frames(self) -> bool:
        """Whether something is computed at certain frames: an output beyond volumes and contact, or surfaces for a figure.

        Contact is sought in whatever frames there are.
        """
        return bool(set(self.measures) - {"contact"}) or any(figure in SHAPES for figure in self.figures)

    @property
    def measures(self) -> tuple[str, ...]:
        """The outputs beyond volumes, in one order."""
        return tuple(o for o in OUTPUTS[1:] if o in self.outputs)
