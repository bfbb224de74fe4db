"""What a mesh level and a numerics preset may say."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field, field_validator, model_validator

from limo.schema.element import element
from limo.schema.section import NAME, ElementName, Section, Symmetry

Precision = Literal["single", "double"]


GeometricStiffness = Literal["consistent", "mixed"]
Coupling = Literal["near", "all"]


#: largest multiple of P_v by which a device is fitted
MOST_VIA = 100.0


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
    element: ElementName = Field(
        "C3D20R",
        description="S8 and S8R (expanded by CalculiX, full device only), the same layer written out, or SHELL8R (newton only)",
        examples=["C3D20R"],
    )

    @model_validator(mode="after")
    def _shells_are_full(self) -> Mesh:
        if element(self.element).is_shell and self.symmetry != "full":
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
    fit_on: list[str] = Field(
        [],
        max_length=5,
        description="entries of mesh_levels on which a device is fitted first, from coarse to fine, all coarser than the study's",
        examples=[["preview", "coarse"]],
    )
    fit_via: list[float] = Field(
        [1.0],
        min_length=1,
        max_length=8,
        description="ways of the first fit: to these multiples of P_v and back by halves; the state of least energy is kept",
        examples=[[1, 3, 10]],
    )
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
    factor_precision: Precision = Field(
        "single",
        description="of the factors of the tangent; with single, solutions are refined on the tangent in double precision",
        examples=["double"],
    )
    geometric_stiffness: GeometricStiffness = Field(
        "consistent",
        description="stress in the tangent's geometric part: consistent, that of the state; mixed, as the last step predicted it",
        examples=["mixed"],
    )

    @field_validator("fit_via")
    @classmethod
    def _ways(cls, value: list[float]) -> list[float]:
        if min(value) < 1 or max(value) > MOST_VIA or len(set(value)) < len(value):
            raise ValueError(f"multiples from 1 to {MOST_VIA:g}, each once")
        return value

    @model_validator(mode="after")
    def _ordered(self) -> Newton:
        if self.rejected_step < self.largest_step:
            raise ValueError("rejected_step no smaller than largest_step")
        if self.first_shift < self.smallest_shift:
            raise ValueError("first_shift no smaller than smallest_shift")
        return self

    def content(self) -> dict[str, Any]:
        """Plain data by which results are named, without the keys of ``LATER`` that have their defaults.

        The meshes of ``fit_on`` are told by what they are, not by their names (``Case.content``).
        """
        plain = self.model_dump(mode="json", exclude={"fit_on"})
        return {key: value for key, value in plain.items() if key not in LATER or value != Newton.model_fields[key].default}


class Touch(Section):
    """Which layers may not pass each other; none as in the paper's model."""

    front_back: bool = Field(False, description="the inner layers of front and back", examples=[True])
    endo_epi: bool = Field(False, description="endocardium and epicardium of each pouch", examples=[True])
    penetration: float = Field(
        0.05,
        gt=0,
        le=0.5,
        description="from which gap on layers touch, and how far one bar presses them past each other, over the thickness",
        examples=[0.05],
    )
    coupling: Coupling = Field(
        "near",
        description="pairs of layers that a factor couples: near, those that touch or nearly do, anew as they part; all",
        examples=["all"],
    )

    def content(self) -> dict[str, Any]:
        """Plain data by which results are named; nothing where no layers touch, nor the default coupling."""
        if not (self.front_back or self.endo_epi):
            return {}
        return self.model_dump(
            mode="json", exclude={"coupling"} if self.coupling == Touch.model_fields["coupling"].default else set()
        )


#: keys of ``Newton`` that results are named by only where they are not the default
LATER = ("factor_precision", "geometric_stiffness", "fit_via")


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
    contact: Touch = Touch()
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
        still = Stage(damping=0, duration=1)
        neutral = Numerics(fit=still, hold=still, ramp=Stage(damping=0, rate=1))
        return neutral.model_copy(update={name: getattr(self, name) for name in READ_BY[engine]})

    def content(self, engine: str) -> dict[str, Any]:
        """Plain data by which a case of ``engine`` is named."""
        seen = self.for_engine(engine)
        plain = seen.model_dump(mode="json", exclude={"contact"}) | {"newton": seen.newton.content()}
        touching = seen.contact.content()
        return plain | ({"contact": touching} if touching else {})

    @property
    def solver_damping(self) -> float:
        """Damping (1/s) on the solver's clock, of which CalculiX knows one a run: the largest of the stages'."""
        return max(stage.damping for stage in (self.fit, self.hold, self.ramp))


#: keys of numerics that an engine reads: newton has no time
READ_BY = {
    "calculix": (
        *("hht_alpha", "fit", "hold", "ramp", "first_increment", "smallest_increment", "largest_increment", "controls"),
        "rest_tolerance",
    ),
    "newton": ("newton", "contact"),
}
