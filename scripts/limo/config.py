"""The configuration: what a device, a study, an airbag and a numerics preset may say, in which units and ranges.

``load_config`` reads ``config/config.yaml`` with the devices, studies and airbags beside it and refuses every mistake in one
message that names file, key, value, range and an example. The JSON schema in ``workflow/schemas`` is generated from
these models (``python -m limo.config``), never written by hand.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise, product
from pathlib import Path
from typing import Annotated, Any, Literal, get_args

import yaml
from pydantic import ConfigDict, Field, ValidationError, field_validator, model_validator

from limo.bench.schema import MeasuredCurves, TensileTest
from limo.errors import ConfigError
from limo.figures import FIGURES, MEASURED, NEEDS, SHAPES
from limo.section import Section

Element = Literal["S8", "S8R", "C3D20", "C3D20R"]
Engine = Literal["calculix", "newton"]
ENGINES = get_args(Engine)
#: the stages of a case in their order
STAGES = ("fit", "hold", "ramp")
Symmetry = Literal["full", "front_back", "quarter"]
Point = tuple[Annotated[float, Field(ge=0, le=2)], Annotated[float, Field(ge=0, le=1.2)]]
SplinePoints = Annotated[list[Point], Field(min_length=2)]
#: rules of the workflow, whose names a study cannot have because it becomes a rule itself
RULES = (
    *("all", "mesh_device", "solve_case", "measure_case", "write_fields", "gather_study", "gather_shapes", "draw_figure"),
    *("fit_material", "material", "check_paper", "paper", "stress_test", "export_study", "page"),
    *("accuracy", "solve_airbag", "gather_airbag", "draw_airbag", "keep_airbags", "gather_accuracy", "draw_accuracy"),
)
NAME = r"^[A-Za-z][A-Za-z0-9_]*$"
FILE = r"^[\w-]+\.ya?ml$"
#: keys of a configuration that a preset stands for
PRESET_KEYS = ("engine", "mesh", "numerics", "branches")


# --------------------------------------------------------------------------------------------------------------------
# the device


class Valve(Section):
    """Rigid elliptic valve support. Its perimeter is that of the flat edge, kept for every aspect ratio."""

    semi_major_over_length: float | None = Field(
        None, gt=0, lt=1, description="a/L, the semi-axis in x over the device length, at at_aspect_ratio", examples=[0.3275]
    )
    at_aspect_ratio: float = Field(
        2.0, ge=1, le=10, description="aspect ratio that semi_major_over_length is given for", examples=[2.0]
    )
    flat_half_width_over_length: float | None = Field(
        None,
        gt=0,
        lt=1,
        description="half width of the flat valve edge over L, instead of semi_major_over_length",
        examples=[0.3966],
    )

    @model_validator(mode="after")
    def _one_of_two(self) -> Valve:
        if (self.semi_major_over_length is None) == (self.flat_half_width_over_length is None):
            raise ValueError("exactly one of semi_major_over_length and flat_half_width_over_length")
        return self


class Seams(Section):
    """Seams between pouches with x >= 0, as multiples in x of one reference seam."""

    reference: SplinePoints = Field(
        description="points (x/L, y/L) of the reference seam, from the lower border of the pouch array to the upper",
        examples=[[[0.13, 0.22], [0.13, 0.94]]],
    )
    reference_position: float = Field(
        gt=0,
        lt=1,
        description="where the reference seam lies at mid-height, as a fraction of the array's half width",
        examples=[0.61],
    )
    spacing_exponent: float = Field(
        1.0,
        ge=1,
        le=3,
        description="p in 1 - (1 - u)^p, the placement of seams for numbers of pouches not in fractions",
        examples=[1.36],
    )
    fractions: dict[int, list[Annotated[float, Field(ge=0, le=10)]]] = Field(
        default_factory=dict,
        description="multiples of the reference seam for a number of pouches; 0 is a seam on the axis",
        examples=[{8: [0.0, 1.0]}],
    )

    @field_validator("reference")
    @classmethod
    def _upwards(cls, points: list[Point]) -> list[Point]:
        if any(p == q for p, q in pairwise(points)):
            raise ValueError("no point twice in a row")
        if points[0][1] >= points[-1][1]:
            raise ValueError("points from the lower border of the array to the upper")
        return points

    @field_validator("fractions")
    @classmethod
    def _count_and_order(cls, fractions: dict[int, list[float]]) -> dict[int, list[float]]:
        for n_pouches, positions in fractions.items():
            if n_pouches < 2 or n_pouches % 2:
                raise ValueError("even numbers of pouches as keys")
            per_face = n_pouches // 2
            if len(positions) != per_face // 2 or (per_face % 2 == 0) != (bool(positions) and positions[0] == 0):
                raise ValueError(
                    f"for {n_pouches} pouches {per_face // 2} seam(s) with x >= 0, the first "
                    + ("0 (on the axis)" if per_face % 2 == 0 else "off the axis")
                )
            if list(positions) != sorted(set(positions)):
                raise ValueError("increasing positions")
        return fractions


class Elastic(Section):
    """A sheet of St. Venant-Kirchhoff material."""

    youngs_modulus: float = Field(gt=0, le=1e5, description="E in MPa", examples=[267.0])
    poisson_ratio: float = Field(gt=-1, lt=0.5, description="nu", examples=[0.33])
    thickness: float = Field(gt=0, le=5, description="t in mm", examples=[0.19])


class Material(Elastic):
    """St. Venant-Kirchhoff fabric (paper, *Constitutive modeling*)."""

    areal_density: float = Field(gt=0, le=1e4, description="mass per area in g/m^2", examples=[170.0])
    # says nothing that a result depends on: no name of a case is made of it
    modulus_origin: str | None = Field(
        None,
        exclude=True,
        min_length=3,
        description="where youngs_modulus comes from; limo tensile --into writes both",
        examples=["tensile test mine.csv, method found, +- 0.6 MPa"],
    )


class Pattern(Section):
    """Outline and pouch layout of a face, right half. Coordinates are fractions of the length."""

    length: float = Field(ge=1, le=1000, description="L in mm, from the valve edge to the apex", examples=[140.0])
    width_scale: float = Field(1.0, ge=0.5, le=1.5, description="scale of all widths away from the valve edge", examples=[0.9])
    width_blend: float = Field(
        0.25, gt=0, le=1, description="y/L over which width_scale is blended to 1 at the valve edge", examples=[0.25]
    )
    valve: Valve
    outline: list[SplinePoints] = Field(
        min_length=1,
        description="smooth curves, end to start, from the valve edge (x/L, 0) to the apex (0, 1)",
        examples=[[[[0.4, 0.0], [0.44, 0.5], [0.0, 1.0]]]],
    )
    pouch_array: list[SplinePoints] = Field(
        min_length=1,
        description="smooth curves, end to start, from (0, y_bottom) round the array to (0, y_top)",
        examples=[[[[0.0, 0.2], [0.4, 0.2]], [[0.4, 0.2], [0.4, 0.9]], [[0.4, 0.9], [0.0, 0.9]]]],
    )
    seams: Seams

    @field_validator("outline", "pouch_array")
    @classmethod
    def _chained(cls, curves: list[list[Point]]) -> list[list[Point]]:
        for before, after in pairwise(curves):
            if before[-1] != after[0]:
                raise ValueError(f"curves that meet end to start: {before[-1]} and {after[0]} differ")
        for curve in curves:
            if any(p == q for p, q in pairwise(curve)):
                raise ValueError("no point twice in a row")
        if curves[-1][-1][0] != 0:
            raise ValueError("a last point on the axis x = 0")
        return curves

    @field_validator("outline")
    @classmethod
    def _from_valve_to_apex(cls, curves: list[list[Point]]) -> list[list[Point]]:
        if curves[0][0][1] != 0 or curves[0][0][0] == 0:
            raise ValueError("a first point on the valve edge (x > 0, y = 0)")
        if curves[-1][-1][1] <= 0:
            raise ValueError("a last point at the apex (0, y) with y > 0")
        return curves

    @field_validator("pouch_array")
    @classmethod
    def _from_below_to_above(cls, curves: list[list[Point]]) -> list[list[Point]]:
        low, high = curves[0][0], curves[-1][-1]
        if low[0] != 0 or not 0 < low[1] < high[1]:
            raise ValueError("a first point (0, y_bottom) off the valve edge and a last point (0, y_top) above it")
        return curves


class Device(Section):
    """A flat fabric device: two faces, each a wall with pouches on it, of one fabric."""

    pattern: Pattern
    material: Material


# --------------------------------------------------------------------------------------------------------------------
# numerics


#: displacements of the largest mesh
LARGEST_MESH = 5_000_000


class MeshLevel(Section):
    """How fine a mesh is."""

    degrees_of_freedom: int = Field(
        ge=1000,
        le=LARGEST_MESH,
        description="three displacements a node of the written-out bricks, for four quarters",
        examples=[70000],
    )
    grading: float = Field(
        1.0, ge=0.2, le=1, description="element size on seams and edges over the size away from them", examples=[0.7]
    )


class Mesh(Section):
    """The mesh a study asks for."""

    level: str = Field("preview", pattern=NAME, description="name of an entry of mesh_levels", examples=["preview"])
    symmetry: Symmetry = Field("quarter", description="planes used: none, z = 0, or z = 0 and x = 0", examples=["quarter"])
    element: Element = Field(
        "C3D20R",
        description="S8 and S8R (expanded by CalculiX, full device only) or the same layer written out",
        examples=["C3D20R"],
    )

    @model_validator(mode="after")
    def _shells_are_full(self) -> Mesh:
        if self.element.startswith("S8") and self.symmetry != "full":
            raise ValueError(f"symmetry: full for element {self.element} (or element C3D20R for a symmetric model)")
        return self


class Stage(Section):
    """One stage of the loading: how long it takes and how strongly it is damped."""

    damping: float = Field(ge=0, le=1e12, description="mass-proportional damping in 1/s", examples=[1.0e6])
    duration: float | None = Field(
        None, gt=0, description="s; not for the ramp, whose length follows from its rate", examples=[20.0]
    )
    rate: float | None = Field(None, gt=0, le=1000, description="kPa/s of the actuation pressure, ramp only", examples=[0.25])


class Controls(Section):
    """Newton limits; CalculiX's own default wherever a key is left out (*CONTROLS)."""

    residual: float = Field(5e-3, gt=0, le=1, description="largest residual over mean force", examples=[5e-3])
    correction: float = Field(
        1e-2, gt=0, le=100, description="largest correction over largest increment of displacement", examples=[1e-2]
    )
    growth: float = Field(1.5, gt=1, le=10, description="factor of a growing increment", examples=[1.5])
    cutback: float = Field(0.25, gt=0, lt=1, description="factor of an increment that is tried again", examples=[0.25])
    iterations_for_growth: int = Field(
        4, ge=2, le=50, description="an increment grows after at most this many iterations", examples=[4]
    )
    iterations_for_decrease: int = Field(
        10, ge=3, le=100, description="an increment shrinks after more iterations than this", examples=[10]
    )
    cutbacks: int = Field(5, ge=1, le=100, description="most attempts at one increment", examples=[5])


class Newton(Section):
    """Limits of the engine newton, which goes from equilibrium to equilibrium without time."""

    fit_steps: int = Field(10, ge=1, le=1000, description="equilibria from the flat state to the fitted one", examples=[10])
    load_step: float = Field(1.0, gt=0, le=100, description="kPa between the equilibria of the ramp", examples=[1.0])
    easy_steps: int = Field(
        4,
        ge=1,
        le=20,
        description="how many of these steps are taken at once after one that came easily, as far as P_a is high enough",
        examples=[4],
    )
    residual: float = Field(1e-3, gt=0, le=0.1, description="largest residual over the load, both as 2-norms", examples=[1e-3])
    correction: float = Field(
        1e-2, gt=0, le=1, description="largest correction over the largest displacement of a load step", examples=[1e-2]
    )
    largest_step: float = Field(
        0.07, gt=0, le=1, description="largest displacement of one iteration over the length of the device", examples=[0.07]
    )
    rejected_step: float = Field(
        0.2, gt=0, le=10, description="the same, beyond which a step is tried again with a larger shift", examples=[0.2]
    )
    first_shift: float = Field(1e6, gt=0, le=1e12, description="shift that the fit starts with, 1/s2 times mass", examples=[1e6])
    smallest_shift: float = Field(1e4, gt=0, le=1e12, description="shift that the iteration falls to, 1/s2", examples=[1e4])
    shift_growth: float = Field(5.0, gt=1, le=100, description="factor of the shift after a rejected step", examples=[5.0])
    shift_decay: float = Field(0.5, gt=0, lt=1, description="factor of the shift after an accepted step", examples=[0.5])
    iterations: int = Field(400, ge=5, le=100000, description="most iterations at one load", examples=[400])

    @model_validator(mode="after")
    def _ordered(self) -> Newton:
        if self.rejected_step < self.largest_step:
            raise ValueError("rejected_step no smaller than largest_step")
        if self.first_shift < self.smallest_shift:
            raise ValueError("first_shift no smaller than smallest_shift")
        return self


class Numerics(Section):
    """How the equations are integrated in time (paper, *Numerical solver*)."""

    description: str = Field("", description="one sentence", examples=["quasi-static"])
    hht_alpha: float = Field(-1 / 3, ge=-1 / 3, le=0, description="HHT parameter", examples=[-0.3333333])
    fit: Stage = Field(description="valve edge onto the ellipse and ventricular pressure, ramped linearly")
    hold: Stage = Field(description="constant loads, until the device rests")
    ramp: Stage = Field(description="actuation pressure from zero to its maximum")
    first_increment: float = Field(1e-3, gt=0, le=1, description="first increment over the duration of the fit", examples=[1e-3])
    smallest_increment: float = Field(
        1e-7, gt=0, le=1e-2, description="smallest increment over the duration of the fit", examples=[1e-7]
    )
    largest_increment: float = Field(2.0, gt=0, le=100, description="largest increment, in kPa of the ramp", examples=[2.0])
    controls: Controls = Controls()
    newton: Newton = Newton()
    rest_tolerance: float = Field(
        5e-3,
        gt=0,
        lt=1,
        description="at rest: relative change of the ventricle volume over the second half of the hold",
        examples=[5e-3],
    )

    @model_validator(mode="after")
    def _stages(self) -> Numerics:
        for name in ("fit", "hold"):
            stage = getattr(self, name)
            if stage.duration is None or stage.rate is not None:
                raise ValueError(f"{name} takes duration and no rate")
        if self.ramp.rate is None or self.ramp.duration is not None:
            raise ValueError("ramp takes rate and no duration")
        dampings = [s.damping for s in (self.fit, self.hold, self.ramp)]
        if min(dampings) == 0 and max(dampings) > 0:
            raise ValueError("damping zero in all stages or in none")
        if self.first_increment < self.smallest_increment:
            raise ValueError("first_increment no smaller than smallest_increment")
        return self

    def for_engine(self, engine: str) -> Numerics:
        """The same without words, and with neutral values wherever ``engine`` does not look."""
        if engine != "newton":
            return self.model_copy(update={"description": "", "newton": Newton()})
        still = Stage(damping=0, duration=1)
        return Numerics(fit=still, hold=still, ramp=Stage(damping=0, rate=1), newton=self.newton)

    @property
    def solver_damping(self) -> float:
        """Damping (1/s) on the solver's clock, of which CalculiX knows one a run: the largest of the stages'."""
        return max(stage.damping for stage in (self.fit, self.hold, self.ramp))


class Preset(Section):
    """A mesh, numerics and an engine together, whose error is measured (``docs/accuracy.md``)."""

    description: str = Field("", description="a few words", examples=["to find one's way"])
    mesh: Mesh = Field(Mesh(), description="mesh of studies that name the preset")
    numerics: str = Field("fast", pattern=NAME, description="name of an entry of numerics_presets", examples=["fast"])
    engine: Engine = Field("newton", description="what solves the cases", examples=["newton"])
    branches: int = Field(1, ge=1, le=100, description="solutions of each case, for a band", examples=[3])

    @model_validator(mode="after")
    def _newton_knows_no_shells(self) -> Preset:
        if self.engine == "newton" and self.mesh.element.startswith("S8"):
            raise ValueError(f"engine: calculix for element {self.mesh.element}")
        return self


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


# --------------------------------------------------------------------------------------------------------------------
# what is right, and what is tried when it is not


class Limits(Section):
    """What a solved case must keep to count as converged; beyond it is degraded, far beyond it has failed (``limo.judge``)."""

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


# --------------------------------------------------------------------------------------------------------------------
# fatigue


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


# --------------------------------------------------------------------------------------------------------------------
# studies

Pouches = Annotated[int, Field(ge=2, le=16, multiple_of=2)]
Pressure = Annotated[float, Field(ge=0, le=1000)]
FRAME = re.compile(r"^\s*(P_v|max)\s*(?:([+-])\s*(\d+(?:\.\d*)?))?\s*$")


class Axes(Section):
    """The grid of a study: every combination is a case."""

    n_pouches: list[Pouches] = Field(min_length=1, description="N_p, even, on both faces together", examples=[[4, 6, 8, 10]])
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

    @field_validator("*")
    @classmethod
    def _no_value_twice(cls, values: list | None) -> list | None:
        if values is not None and len(set(values)) != len(values):
            raise ValueError("no value twice")
        return values


class Variant(Section):
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


class Study(Section):
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
    actuation_pressure_max: Annotated[float, Field(gt=0, le=1000)] | dict[float, Annotated[float, Field(gt=0, le=1000)]] = Field(
        description="P_a,max in kPa, one number or one for each P_v", examples=[{3.8: 60, 13.8: 100, 23.8: 140}]
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
        default=["volumes"],
        min_length=1,
        description="what is computed for the cases: contact, stress, strain and fatigue at the frames, fields for ParaView at "
        "fields_at",
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
            "config/measured/arfaee2025.csv",
            {"data": "config/measured/mine.csv", "units": {"actuation_pressure": "mmHg"}},
        ],
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

    def maximum_for(self, ventricular_pressure: float) -> float:
        """P_a,max (kPa) of the cases at a P_v (kPa). Raises ``KeyError`` where none is given."""
        if isinstance(self.actuation_pressure_max, dict):
            return self.actuation_pressure_max[ventricular_pressure]
        return self.actuation_pressure_max

    def frames_for(self, ventricular_pressure: float) -> list[float]:
        """Pressures of the kept frames (kPa), in order, those beyond P_a,max left out for ``P_v`` expressions."""
        frames = [*self.frames, *(self.fields_at if self.uses_frames else [])]
        pressures = {self.pressure_of(frame, ventricular_pressure) for frame in frames}
        return sorted(p for p in pressures if p is not None)

    def needed_frames(self, ventricular_pressure: float) -> list[float]:
        """Pressures (kPa) that a case going further must have kept to stand for one of the study, in order.

        Nothing is computed from the frames of a study of volumes alone: its ``max`` means the end of whatever case it is.
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
        return round(value, 6) if 0 <= value <= maximum else None

    @property
    def measured_curves(self) -> MeasuredCurves | None:
        """Its measured curves, however they are given."""
        return MeasuredCurves(data=self.measured) if isinstance(self.measured, str) else self.measured

    @property
    def uses_frames(self) -> bool:
        """Whether something is computed from displacements: an output beyond volumes, or surfaces for a figure."""
        return bool(self.measures) or any(figure in SHAPES for figure in self.figures)

    @property
    def measures(self) -> tuple[str, ...]:
        """The outputs beyond volumes, in one order."""
        return tuple(o for o in OUTPUTS[1:] if o in self.outputs)


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


# --------------------------------------------------------------------------------------------------------------------
# the square airbag

AirbagElement = Literal["S3", "S4", "S4R", "S6", "S8", "S8R", "C3D20R", "C3D20"]
Planes = Literal["symmetric", "hinged"]


class AirbagSeries(Section):
    """One element type, solved on several meshes."""

    element: AirbagElement = Field(description="shells that CalculiX expands, or written-out C3D20R or C3D20", examples=["S8R"])
    engine: Engine = Field("calculix", description="newton for C3D20R and C3D20 alone", examples=["newton"])
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
    def _shells_are_calculix_and_hinged(self) -> AirbagSeries:
        if self.engine == "newton" and not self.is_brick:
            raise ValueError(f"engine: calculix for element {self.element}")
        if self.planes == "symmetric" and not self.is_brick:
            raise ValueError(f"planes: hinged for element {self.element}")
        return self

    @property
    def chosen_planes(self) -> Planes:
        """``planes``, or their default."""
        return self.planes or ("symmetric" if self.is_brick else "hinged")

    @property
    def is_brick(self) -> bool:
        """Whether the layer is written out as bricks; CalculiX expands shells itself."""
        return self.element.startswith("C3D")


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
        return self.newton.model_dump(mode="json") if engine == "newton" else self.model_dump(mode="json", exclude={"newton"})


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


def _required_unless_extended(schema: dict[str, Any]) -> None:
    """A configuration that extends another one may leave out what that says."""
    schema["anyOf"] = [{"required": schema.pop("required")}, {"required": ["extends"]}]


class Config(Section):
    """``config/config.yaml``: what runs by default and the presets that studies name."""

    model_config = ConfigDict(json_schema_extra=_required_unless_extended)

    extends: str | None = Field(
        None,
        pattern=FILE,
        description="configuration in the same folder whose keys hold where this one says nothing",
        examples=["config.yaml"],
    )
    studies: list[Annotated[str, Field(pattern=NAME)]] = Field(
        min_length=1, description="studies that `snakemake` runs when none is named", examples=[["pressure_volume"]]
    )
    engine: Engine = Field(
        "calculix", description="what solves the cases of studies that say nothing else", examples=["calculix"]
    )
    mesh: Mesh = Field(Mesh(), description="mesh of studies that say nothing else")
    numerics: str = Field("fast", pattern=NAME, description="preset of studies that say nothing else", examples=["fast"])
    branches: int = Field(1, ge=1, le=100, description="solutions of each case of studies that say nothing else", examples=[1])
    preset: str | None = Field(
        None,
        pattern=NAME,
        description="name of an entry of presets; instead of engine, mesh, numerics, branches of studies that say nothing else",
        examples=["standard"],
    )
    presets: dict[Annotated[str, Field(pattern=NAME)], Preset] = Field(
        {}, description="a mesh, numerics and an engine by the name of the accuracy they are for"
    )
    mesh_levels: dict[Annotated[str, Field(pattern=NAME)], MeshLevel] = Field(min_length=1, description="mesh levels by name")
    numerics_presets: dict[Annotated[str, Field(pattern=NAME)], Numerics] = Field(min_length=1, description="numerics by name")
    solver: Solver = Solver()
    limits: Limits = Field(Limits(), description="what a case must keep to count as converged")
    recovery: Recovery = Field(Recovery(), description="what is tried in turn when a case fails")
    stress_test: StressTest | None = Field(None, description="cases that look for what fails")
    scaling: Scaling | None = Field(None, description="ever larger models, to see what they take")
    fatigue: Fatigue = Field(Fatigue(), description="strain-life curve of the fatigue output, each number with its origin")
    tensile_test: TensileTest = Field(TensileTest(), description="what `snakemake material` fits the modulus of the fabric to")


# --------------------------------------------------------------------------------------------------------------------
# reading


@dataclass(frozen=True)
class Setting:
    """What the cases of a study, or of one of its variants, are solved with; ``device_name`` and ``preset`` are names."""

    device_name: str
    device: Device
    mesh: Mesh
    preset: str
    numerics: Numerics
    engine: str


def _merged(data: dict[str, Any], change: dict[str, Any]) -> dict[str, Any]:
    """Nested ``data`` with the values of ``change`` in their places."""
    both = {k: _merged(data[k], v) for k, v in change.items() if isinstance(v, dict) and isinstance(data.get(k), dict)}
    return data | change | both


class Loaded:
    """A configuration with its devices and studies resolved and checked against each other.

    ``config`` (``Config``), ``devices``, ``studies`` and ``airbags`` (by name), ``files`` (path of each of them), ``builds``
    (which build of each engine would solve; empty until someone looks).
    """

    def __init__(
        self,
        config: Config,
        devices: dict[str, Device],
        studies: dict[str, Study],
        files: dict[str, Path],
        airbags: dict[str, Airbag] | None = None,
    ):
        self.config, self.devices, self.studies, self.files, self.airbags = config, devices, studies, files, airbags or {}
        self.builds: dict[str, str] = {}

    def require(self, names: Iterable[str], file: object, example: str) -> None:
        """Raise ``ConfigError`` for the first of ``names`` that is no study of ``file``; ``example`` is a command that works."""
        for name in names:
            if name not in self.studies:
                raise ConfigError(file, "STUDY", name, f"one of: {', '.join(self.studies)}", example)

    def settings(self, study: Study) -> dict[str, Setting]:
        """What a study uses, by the names of its variants; without variants by an empty name.

        Raises pydantic's ``ValidationError`` for changed numerics or material that are none, ``KeyError`` for a name that is not
        there.
        """
        return {name: self._setting(study, variant) for name, variant in (study.variants or {"": Variant()}).items()}

    def default(self, preset: str | None = None) -> Config | Preset:
        """What has mesh, numerics, engine, branches where nothing else is said: a preset, else the configuration's, or itself.

        Raises ``KeyError`` for a name that is not there.
        """
        name = preset or self.config.preset
        return self.config.presets[name] if name else self.config

    def branches_of(self, study: Study) -> int:
        """How many solutions each case of a study has."""
        return study.branches or self.default(study.preset).branches

    def _setting(self, study: Study, variant: Variant) -> Setting:
        default = self.default(study.preset)
        mesh = study.mesh or default.mesh
        if variant.mesh:
            mesh = mesh.model_copy(update={k: getattr(variant.mesh, k) for k in variant.mesh.model_fields_set})
        preset, change = default.numerics, {}
        for own in (study.numerics, variant.numerics):
            preset, change = (own, {}) if isinstance(own, str) else (preset, _merged(change, own or {}))
        numerics = self.config.numerics_presets[preset]
        if change:
            numerics = Numerics.model_validate(_merged(numerics.model_dump(exclude_unset=True), change))
        device_name = variant.device or study.device
        device = self.devices[device_name]
        if change := study.material | variant.material:
            device = device.model_copy(update={"material": Material.model_validate(device.material.model_dump() | change)})
        return Setting(device_name, device, mesh, preset, numerics, variant.engine or study.engine or default.engine)

    def engines_of(self, study: Study) -> list[str]:
        """The engines that a study uses, of ``ENGINES``."""
        used = {setting.engine for setting in self.settings(study).values()}
        return [engine for engine in ENGINES if engine in used or study.cross_check]

    def content(self, name: str) -> dict[str, Any]:
        """The resolved configuration of a study: what its dataset depends on besides the results of its cases."""
        study = self.studies[name]
        # what is drawn of a dataset is no part of it
        sections = {"study": study.model_dump(mode="json", exclude={"figures", "measured"})}
        sections["study"]["branches"] = self.branches_of(study)
        sections["settings"] = {
            name: {
                "device": setting.device.model_dump(mode="json"),
                **({"modulus_origin": origin} if (origin := setting.device.material.modulus_origin) else {}),
                "mesh": setting.mesh.model_dump(mode="json"),
                "mesh_level": self.config.mesh_levels[setting.mesh.level].model_dump(mode="json"),
                "numerics": setting.numerics.model_dump(mode="json"),
                "engine": setting.engine,
            }
            for name, setting in self.settings(study).items()
        }
        if "fatigue" in study.measures:
            sections["fatigue"] = self.config.fatigue.model_dump(mode="json")
        return sections


class _UniqueKeyLoader(yaml.SafeLoader):
    """Refuses a key that stands twice in a mapping (plain YAML lets the last one win without a word)."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict:
        keys = [self.construct_object(k, deep=True) for k, _ in node.value if k.tag != "tag:yaml.org,2002:merge"]
        for k in keys:
            if keys.count(k) > 1:
                raise yaml.constructor.ConstructorError(None, None, f"key {k!r} stands twice", node.start_mark)
        return super().construct_mapping(node, deep)


# YAML 1.1 reads 1e6 as text: take it as the number it is
_UniqueKeyLoader.add_implicit_resolver(
    "tag:yaml.org,2002:float",
    re.compile(r"^[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)$"),
    list("-+0123456789."),
)


def read_yaml(path: Path) -> dict[str, Any]:
    """A YAML mapping. Raises ``ConfigError`` when it cannot be read or is not a mapping."""
    try:
        data = yaml.load(path.read_text(encoding="utf-8"), Loader=_UniqueKeyLoader)
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(path, "(file)", str(error), "a readable text file", "config/devices/limo.yaml") from None
    except (yaml.YAMLError, ValueError, RecursionError, TypeError) as error:
        where = getattr(error, "problem_mark", None)
        at = f"line {where.line + 1}" if where else "(file)"
        raise ConfigError(path, at, getattr(error, "problem", None) or str(error), "YAML", "key: value") from None
    if not isinstance(data, dict):
        raise ConfigError(path, "(file)", data, "a mapping of keys to values", "device: limo")
    return data


def parse(model: type[Section], data: dict[str, Any], path: Path) -> Any:
    """``model`` made from ``data``, or the first mistake as a ``ConfigError``."""
    try:
        return model.model_validate(data)
    except ValidationError as error:
        raise _explain(model, error, path) from None


def _explain(model: type[Section], error: ValidationError, path: Path) -> ConfigError:
    """One message for the first mistake pydantic found."""
    errors = error.errors()
    # of the branches of a union, the one that got furthest into the value says most
    first = max((e for e in errors if e["loc"][:1] == errors[0]["loc"][:1]), key=lambda e: len(e["loc"]))
    owner, field, name, keys = model, None, "", []
    for part in map(str, first["loc"]):
        fields = getattr(owner, "model_fields", {})
        if part in fields:
            field, name = fields[part], part
            owner = next(iter(_models(field.annotation)), None)
        elif first["type"] != "extra_forbidden" and _UNION_BRANCH.match(part):
            continue
        keys.append(part)
    key, value = ".".join(keys) or "(file)", first["input"]
    if isinstance(value, dict) and len(value) > 4:
        value = "{" + ", ".join(map(str, value))[:500] + "}"
    if first["type"] == "extra_forbidden":
        known = ", ".join(sorted(getattr(owner or model, "model_fields", {})))
        return ConfigError(path, key, value, f"no such key; known here: {known}", "see config/README.md")
    message = first["msg"].removeprefix("Value error, ").removeprefix("Input should be ")
    if first["type"] == "missing":
        message, value = "a value (the key is missing)", None
    if field is None or not field.examples:
        return ConfigError(path, key, value, message, "see config/README.md")
    expected = f"{message} ({field.description})" if field.description else message
    return ConfigError(path, key, value, expected, f"{name}: {json.dumps(field.examples[0])}")


# what pydantic calls the branches of a union, and validators, in the place of a mistake
_UNION_BRANCH = re.compile(r"^(float|str|int|dict\[.*|list\[.*|tuple\[.*|constrained-\w+|function-\w+.*)$")


def _models(annotation: Any) -> list[type[Section]]:
    """The sections inside a type such as ``dict[str, Numerics]``."""
    if isinstance(annotation, type) and issubclass(annotation, Section):
        return [annotation]
    return [m for a in getattr(annotation, "__args__", ()) for m in _models(a)]


def _read_config(path: Path) -> Config:
    """A configuration, and where it extends another one the keys of that; ``preset`` here takes the place of what it stands for.

    Raises ``ConfigError`` for a mistake in either, and for one that extends one that extends another.
    """
    data = read_yaml(path)
    if isinstance(name := data.get("extends"), str) and re.search(FILE, name):
        base = read_yaml(path.with_name(name))
        if "extends" in base or path.with_name(name) == path:
            expected = "a configuration that extends none itself"
            raise ConfigError(path, "extends", name, expected, "extends: config.yaml")
        parse(Config, base, path.with_name(name))
        taken = PRESET_KEYS if data.get("preset") else ()
        data = {key: value for key, value in base.items() if key not in taken} | data
    return parse(Config, data, path)


def load_config(path: str | Path = "config/config.yaml") -> Loaded:
    """Read ``path``, and ``devices/*.yaml``, ``studies/*.yaml`` and ``airbags/*.yaml`` beside it.

    Raises ``ConfigError`` for the first mistake found in any of them.
    """
    path = Path(path)
    config = _read_config(path)
    files: dict[str, Path] = {}

    def read_all(folder: str, model: type[Section]) -> dict[str, Any]:
        found = {}
        for file in sorted((path.parent / folder).glob("*.y*ml")):
            if not re.fullmatch(NAME.strip("^$"), file.stem):
                raise ConfigError(file, "(file name)", file.stem, "letters, digits and _, a letter first", "my_study.yaml")
            if model is Study and file.stem in RULES:
                raise ConfigError(file, "(file name)", file.stem, "a name that no rule of the workflow has", "my_study.yaml")
            if file.stem in found:
                raise ConfigError(file, "(file name)", file.stem, "one file for a name", "remove one of .yml and .yaml")
            found[file.stem] = parse(model, read_yaml(file), file)
            files[f"{folder}/{file.stem}"] = file
        return found

    devices, studies, airbags = (read_all(*kind) for kind in (("devices", Device), ("studies", Study), ("airbags", Airbag)))
    loaded = Loaded(config, devices, studies, files, airbags)
    for name in config.studies:
        if name not in studies:
            names = ", ".join(studies)
            raise ConfigError(path, "studies", name, f"a study in {path.parent}/studies: {names}", "studies: [pressure_volume]")
    _check_names(path, "mesh.level", config.mesh.level, config.mesh_levels)
    _check_names(path, "numerics", config.numerics, config.numerics_presets)
    for name, preset in config.presets.items():
        _check_names(path, f"presets.{name}.mesh.level", preset.mesh.level, config.mesh_levels)
        _check_names(path, f"presets.{name}.numerics", preset.numerics, config.numerics_presets)
    if config.preset:
        _check_preset(path, config.preset, config)
        if stated := [n for n in PRESET_KEYS if n in config.model_fields_set]:
            expected = f"no {', '.join(stated)} beside it, for which it stands"
            raise ConfigError(path, "preset", config.preset, expected, f"preset: {config.preset}")
    _check_recovery(path, config)
    if config.stress_test:
        _check_stress_test(path, loaded, config.stress_test)
    if config.scaling:
        _check_names(path, "scaling.device", config.scaling.device, devices)
    cut: set[tuple[str, float, int]] = set()
    for name, study in studies.items():
        _check_study(loaded, files[f"studies/{name}"], study, cut)
    return loaded


def _check_recovery(path: Path, config: Config) -> None:
    """Every rung must be possible with every preset and mesh level."""
    from limo.recovery import check_ladder

    for engine in ENGINES:
        rungs: list[Rung] = getattr(config.recovery, engine)
        names = [rung.name for rung in rungs]
        example = "recovery: {newton: [{name: smaller_load_steps, multiply: {newton.load_step: 0.25}}]}"
        if len(set(names)) < len(names):
            raise ConfigError(path, f"recovery.{engine}", names, "no name twice", example)
        for (preset, numerics), (level, size) in product(config.numerics_presets.items(), config.mesh_levels.items()):
            try:
                check_ladder(rungs, numerics, size)
            except ValueError as error:
                expected = f"factors that leave the preset {preset} and the mesh level {level} in their ranges ({error})"
                raise ConfigError(path, f"recovery.{engine}", names, expected, example) from None


def _check_stress_test(path: Path, loaded: Loaded, test: StressTest) -> None:
    """What a stress test names must exist; layouts that cannot be cut are found when it is run."""
    _check_names(path, "stress_test.device", test.device, loaded.devices)
    _check_names(path, "stress_test.mesh.level", test.mesh.level, loaded.config.mesh_levels)
    if test.numerics:
        _check_names(path, "stress_test.numerics", test.numerics, loaded.config.numerics_presets)
    if "newton" in test.engines and test.mesh.element.startswith("S8"):
        raise ConfigError(path, "stress_test.mesh.element", test.mesh.element, "C3D20R or C3D20", "element: C3D20R")


def _check_names(path: Path, key: str, value: str, known: dict[str, Any], *, listed: bool = False) -> None:
    """``value`` of a key (``listed``: one of several) must be a name in ``known``."""
    if value not in known:
        names = ", ".join(known)
        section, _, last = key.rpartition(".")
        example = f"{last}: {[next(iter(known))] if listed else next(iter(known))}".replace("'", "")
        raise ConfigError(path, key, value, f"one of: {names}", f"{section}: {{{example}}}" if section else example)


def _check_preset(path: Path, name: str, config: Config) -> None:
    if not config.presets:
        expected = "no preset, for the configuration has no presets"
        raise ConfigError(path, "preset", name, expected, "presets: {preview: {mesh: {level: preview}}}")
    _check_names(path, "preset", name, config.presets)


def _check_study(loaded: Loaded, path: Path, study: Study, cut: set[tuple[str, float, int]]) -> None:
    """What a study names must exist, and its pressures must fit together.

    ``cut``: the (device, width_scale, N_p) whose layout other studies have tried; those of this study are added.
    """
    from limo.geometry import flat_pattern

    if study.preset:
        _check_preset(path, study.preset, loaded.config)
    for name, variant in (study.variants or {"": Variant()}).items():
        prefix = f"variants.{name}." if name else ""
        for where, numerics in (("", study.numerics), (prefix, variant.numerics)):
            if isinstance(numerics, str):
                _check_names(path, f"{where}numerics", numerics, loaded.config.numerics_presets)
        _check_names(path, f"{prefix}device", variant.device or study.device, loaded.devices)
        try:
            setting = loaded._setting(study, variant)
        except ValidationError as error:
            model, key = (Material, "material") if error.title == "Material" else (Numerics, "numerics")
            prefix = prefix if getattr(variant, key) else ""
            found = _explain(model, error, path)
            raise ConfigError(path, f"{prefix}{key}.{found.key}", found.value, found.expected, found.example) from None
        _check_setting(loaded, path, study, prefix, setting)
    for figure in study.figures:
        _check_names(path, "figures", figure, dict.fromkeys(FIGURES), listed=True)
        if (needed := NEEDS.get(figure, "volumes")) not in ("volumes", *study.outputs):
            expected = f"{needed} among them, which the figure {figure} shows"
            raise ConfigError(path, "outputs", study.outputs, expected, f"outputs: [volumes, {needed}]")
    _check_measured(path, study)
    for pressure in study.axes.ventricular_pressure:
        try:
            maximum = study.maximum_for(pressure)
        except KeyError:
            raise ConfigError(
                path,
                "actuation_pressure_max",
                study.actuation_pressure_max,
                f"a maximum for P_v = {pressure} kPa",
                f"actuation_pressure_max: {{{pressure}: {pressure + 60:g}}}",
            ) from None
        if maximum <= pressure:
            raise ConfigError(
                path,
                "actuation_pressure_max",
                maximum,
                f"more than P_v = {pressure} kPa, or nothing inflates",
                f"actuation_pressure_max: {pressure + 60:g}",
            )
        for key in ("frames", "fields_at"):
            if beyond := [f for f in getattr(study, key) if not isinstance(f, str) and f > maximum]:
                raise ConfigError(
                    path, key, beyond[0], f"pressures up to actuation_pressure_max = {maximum:g} kPa", f"{key}: [0, max]"
                )
    for name in {setting.device_name for setting in loaded.settings(study).values()}:
        device = loaded.devices[name]
        for scale in study.axes.width_scale or [device.pattern.width_scale]:
            for n_pouches in study.axes.n_pouches:
                if (name, scale, n_pouches) not in cut:
                    pattern = device.pattern.model_copy(update={"width_scale": scale})
                    flat_pattern(pattern, n_pouches, loaded.files[f"devices/{name}"])
                    cut.add((name, scale, n_pouches))


def _check_measured(path: Path, study: Study) -> None:
    """Measured curves of a study must be there, and one of its figures at least must show them."""
    if study.measured is None:
        return
    file = study.measured_curves.data
    if not Path(file).is_file():
        raise ConfigError(path, "measured", file, "a readable CSV file", "measured: config/measured/arfaee2025.csv")
    if study.figures and not set(study.figures) & set(MEASURED):
        expected = f"one of {', '.join(MEASURED)} among them: the others have no axes for the measured curves of the study"
        raise ConfigError(path, "figures", study.figures, expected, f"figures: [{MEASURED[0]}]")


def _check_setting(loaded: Loaded, path: Path, study: Study, prefix: str, setting: Setting) -> None:
    """What a study or a variant (its keys after ``prefix``) names must exist, and element and engine must fit together."""
    _check_names(path, f"{prefix}mesh.level", setting.mesh.level, loaded.config.mesh_levels)
    element = setting.mesh.element
    if not element.startswith("S8"):
        return
    if setting.mesh.symmetry != "full":
        raise ConfigError(
            path, f"{prefix}mesh.symmetry", setting.mesh.symmetry, f"full with element {element}", "mesh: {symmetry: full}"
        )
    if study.measures:
        raise ConfigError(
            path,
            "outputs",
            study.outputs,
            f"volumes only with element {element}, which keeps no displacements through the thickness",
            "mesh: {level: preview, symmetry: quarter, element: C3D20R}",
        )
    if setting.engine == "newton" or study.cross_check:
        key, value = ("cross_check", study.cross_check) if study.cross_check else (f"{prefix}engine", setting.engine)
        raise ConfigError(path, key, value, "element C3D20R or C3D20 where the engine newton is used", "mesh: {element: C3D20R}")


def json_schemas() -> dict[str, dict[str, Any]]:
    """The JSON schemas of the four kinds of configuration file, by file name."""
    models = {"config": Config, "study": Study, "device": Device, "airbag": Airbag}
    return {f"{name}.schema.json": model.model_json_schema() for name, model in models.items()}


if __name__ == "__main__":
    target = Path(sys.argv[1] if len(sys.argv) > 1 else "workflow/schemas")
    for file_name, schema in json_schemas().items():
        (target / file_name).write_text(json.dumps(schema, indent=2) + "\n", encoding="utf-8")
