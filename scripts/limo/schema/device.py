"""What a device file may say: outline, pouch layout, valve and fabric."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Annotated, Any

from pydantic import Field, ValidationInfo, field_validator, model_serializer, model_validator

from limo.schema.section import Section

Point = tuple[Annotated[float, Field(ge=0, le=2)], Annotated[float, Field(ge=0, le=1.2)]]


SplinePoints = Annotated[list[Point], Field(min_length=2)]


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


class Weave(Section):
    """Yarns of a woven fabric: orthotropic St. Venant-Kirchhoff material along warp and weft, instead of E and nu."""

    warp_modulus: float = Field(gt=0, le=1e5, description="E_1 in MPa along the warp", examples=[400.0])
    weft_modulus: float = Field(gt=0, le=1e5, description="E_2 in MPa along the weft", examples=[200.0])
    poisson_ratio: float = Field(
        gt=-1, lt=10, description="nu_12, contraction along the weft over extension along the warp, of a strip along the warp",
        examples=[0.33],
    )  # fmt: skip
    shear_modulus: float = Field(gt=0, le=1e5, description="G_12 in MPa", examples=[60.0])
    angle: float = Field(
        0.0, ge=-90, le=90, description="of the warp to the axis of the flat device, in degrees, positive towards x",
        examples=[45.0],
    )  # fmt: skip

    @model_validator(mode="after")
    def _definite(self) -> Weave:
        mean = self.poisson_ratio * (self.weft_modulus / self.warp_modulus) ** 0.5
        if abs(mean) >= 0.5:
            largest = 0.5 * (self.warp_modulus / self.weft_modulus) ** 0.5
            raise ValueError(
                "poisson_ratio x sqrt(weft_modulus / warp_modulus) within +-0.5, beyond which the stiffness is indefinite: it is "
                f"{mean:.3g}, and poisson_ratio may be up to {largest:.3g}; for example poisson_ratio: {0.6 * largest:.2g}"
            )
        return self

    @property
    def is_mirrored(self) -> bool:
        """Whether the right half of a sheet is the mirror image of the left one."""
        return self.angle in (-90, 0, 90)


class Sheet(Elastic):
    """A sheet of fabric: elasticity, mass, weave and bending."""

    areal_density: float = Field(gt=0, le=1e4, description="mass per area in g/m^2", examples=[170.0])
    weave: Weave | None = Field(
        None, description="yarns of an orthotropic fabric, which replace youngs_modulus and poisson_ratio"
    )
    bending_factor: float = Field(
        1.0, gt=0, le=4, description="bending stiffness over that of a plate of this thickness and these moduli", examples=[0.1]
    )

    @model_serializer(mode="wrap")
    def _without_what_is_usual(self, plain: Callable[[Any], dict[str, Any]]) -> dict[str, Any]:
        """Plain data are as they were before the keys came that are left at what they stand for."""
        usual = {key: field.default for key, field in type(self).model_fields.items() if not field.is_required()}
        return {key: value for key, value in plain(self).items() if key not in usual or value != usual[key]}


class Material(Sheet):
    """St. Venant-Kirchhoff fabric (paper, *Constitutive modeling*)."""

    pouch_sheet: Sheet | None = Field(
        None, description="the fabric of the epicardium of the pouches, where it is another one than that of wall and endocardium"
    )
    # says nothing that a result depends on: no name of a case is made of it
    modulus_origin: str | None = Field(
        None,
        exclude=True,
        min_length=3,
        description="where youngs_modulus comes from; limo tensile --into writes both",
        examples=["tensile test mine.csv, method found, +- 0.6 MPa"],
    )

    @property
    def weaves(self) -> list[Weave]:
        """Those of its sheets that have yarns."""
        return [sheet.weave for sheet in (self, self.pouch_sheet) if sheet is not None and sheet.weave is not None]


class Pattern(Section):
    """Outline and pouch layout of a face, right half. Coordinates are fractions of the length.

    Without ``pouch_array`` and ``seams`` it is of a device without pouches. Without ``valve``, too, it is sealed all round.
    """

    length: float = Field(ge=1, le=1000, description="L in mm, from the valve edge to the apex", examples=[140.0])
    width_scale: float = Field(1.0, ge=0.5, le=1.5, description="scale of all widths away from the valve edge", examples=[0.9])
    width_blend: float = Field(
        0.25, gt=0, le=1, description="y/L over which width_scale is blended to 1 at the valve edge", examples=[0.25]
    )
    valve: Valve | None = Field(None, description="the valve support; without it a device without pouches is closed")
    outline: list[SplinePoints] = Field(
        min_length=1,
        description="smooth curves, end to start, from the valve edge (x/L, 0), or without a valve from the axis (0, 0), to the "
        "apex (0, 1)",
        examples=[[[[0.4, 0.0], [0.44, 0.5], [0.0, 1.0]]]],
    )
    pouch_array: list[SplinePoints] | None = Field(
        None,
        min_length=1,
        description="smooth curves, end to start, from (0, y_bottom) round the array to (0, y_top)",
        examples=[[[[0.0, 0.2], [0.4, 0.2]], [[0.4, 0.2], [0.4, 0.9]], [[0.4, 0.9], [0.0, 0.9]]]],
    )
    seams: Seams | None = Field(None, description="seams between pouches; none without pouch_array")

    @field_validator("outline", "pouch_array")
    @classmethod
    def _chained(cls, curves: list[list[Point]] | None) -> list[list[Point]] | None:
        if curves is None:
            return None
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
    def _from_valve_to_apex(cls, curves: list[list[Point]], info: ValidationInfo) -> list[list[Point]]:
        if info.data.get("valve", True) is None:
            if curves[0][0] != (0, 0):
                raise ValueError("a first point on the axis (0, 0), for there is no valve; or a valve")
        elif curves[0][0][1] != 0 or curves[0][0][0] == 0:
            raise ValueError("a first point on the valve edge (x > 0, y = 0)")
        if curves[-1][-1][1] <= 0:
            raise ValueError("a last point at the apex (0, y) with y > 0")
        return curves

    @field_validator("pouch_array")
    @classmethod
    def _from_below_to_above(cls, curves: list[list[Point]] | None) -> list[list[Point]] | None:
        if curves is None:
            return None
        low, high = curves[0][0], curves[-1][-1]
        if low[0] != 0 or not 0 < low[1] < high[1]:
            raise ValueError("a first point (0, y_bottom) off the valve edge and a last point (0, y_top) above it")
        return curves

    @model_validator(mode="after")
    def _whole(self) -> Pattern:
        if (self.pouch_array is None) != (self.seams is None):
            raise ValueError("pouch_array and seams together, or neither of a device without pouches")
        if self.pouch_array and self.valve is None:
            raise ValueError("valve, for there are pouches; only a device without pouches may be closed")
        return self


class Device(Section):
    """A flat fabric device: two faces, each a wall with pouches on it, of one fabric."""

    pattern: Pattern
    material: Material
