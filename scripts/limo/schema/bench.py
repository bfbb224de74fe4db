"""What the configuration may say of a file from a laboratory: how it is laid out, and what is made of it.

Every key of a layout is optional: what a file says itself is recognised, and a key overrules it (``docs/bench.md``).
"""

from __future__ import annotations

import codecs
from typing import Annotated, Literal

from pydantic import Field, field_validator, model_validator

from limo.schema.section import Section

#: quantities that a tensile test and measured curves may have columns of
TENSILE_QUANTITIES = ("elongation", "force", "strain", "stress", "time", "specimen")
CURVE_QUANTITIES = (
    *("label", "n_pouches", "ventricular_pressure", "actuation_pressure", "actuation_volume_change", "stroke_volume"),
    *("actuation_volume", "ventricle_volume", "efficiency", "time", "cycle", "direction"),
)
#: keys of the coupon's size
SIZES = ("length", "width", "thickness")
SEPARATORS = {"tab": "\t", "space": " ", "comma": ",", "semicolon": ";", "bar": "|"}
#: Young's moduli (MPa) between those of a soft rubber and of steel
PLAUSIBLE_MODULUS = (0.5, 220_000.0)

ColumnName = str | Annotated[int, Field(ge=1, le=10000)]
Line = Annotated[int, Field(ge=0, le=10_000_000)]
Length = Annotated[float, Field(gt=0, le=10_000)]


class Layout(Section):
    """How a file is laid out, where that is not to be recognised."""

    separator: str | None = Field(
        None, description="between columns: one character, or tab, space, comma, semicolon, bar", examples=[";"]
    )
    decimal: Literal[".", ","] | None = Field(None, description="decimal mark", examples=[","])
    thousands: Literal[",", ".", " ", "'", "none"] | None = Field(None, description="mark between thousands", examples=["."])
    encoding: str | None = Field(None, description="of the text, as Python calls it", examples=["cp1252"])
    header_row: Line | None = Field(None, description="line of the columns' names, from 1; 0: there is none", examples=[3])
    unit_row: Line | None = Field(None, description="line of the units, from 1; 0: there is none", examples=[4])
    data_rows: tuple[Line, Line] | None = Field(
        None, description="first and last line of the numbers, from 1", examples=[[5, 200]]
    )
    comment: str | None = Field(
        None, max_length=3, description='what a line that is no data begins with; "": every line is data', examples=["#"]
    )
    columns: dict[str, ColumnName | list[ColumnName]] = Field(
        {},
        description="name or number (from 1) of the column of a quantity; a list for specimens side by side",
        examples=[{"force": "Channel 2"}],
    )
    units: dict[str, str | Literal[1]] = Field(
        {}, description="unit of a quantity, whatever the file says", examples=[{"force": "kN", "strain": 1}]
    )

    @field_validator("separator")
    @classmethod
    def _one_character(cls, value: str | None) -> str | None:
        if value is not None and len(SEPARATORS.get(value, value)) != 1:
            raise ValueError(f"one character or {', '.join(SEPARATORS)}")
        return value

    @field_validator("encoding")
    @classmethod
    def _known_encoding(cls, value: str | None) -> str | None:
        try:
            codecs.lookup(value or "ascii")
        except (LookupError, ValueError):
            raise ValueError("an encoding that Python knows") from None
        return value

    @model_validator(mode="after")
    def _known_quantities(self) -> Layout:
        for key in ("columns", "units"):
            for name in getattr(self, key):
                if name not in self.quantities():
                    raise ValueError(f"{key} of {', '.join(self.quantities())}, not of {name}")
        if self.data_rows and self.data_rows[0] > self.data_rows[1]:
            raise ValueError("data_rows with the first line first")
        return self

    @classmethod
    def quantities(cls) -> tuple[str, ...]:
        """What its columns may hold."""
        return ()


class Coupon(Section):
    """What one specimen has instead of the coupon of all."""

    length: Length | None = Field(None, description="in mm, l_0", examples=[200.0])
    width: Length | None = Field(None, description="in mm, w_0", examples=[50.0])
    thickness: Length | None = Field(None, description="in mm, t_0", examples=[0.19])


class TensileTest(Layout):
    """A tensile test of the fabric (paper, *Material model calibration*); devices state their moduli themselves."""

    data: str | list[str] = Field(
        "config/measured/uniaxial_synthetic.csv",
        description="file of elongations and forces, or of strains and stresses, a path from the project's root; or several",
        examples=["config/measured/uniaxial_synthetic.csv"],
    )
    length: Length = Field(200.0, description="of the coupon in mm, l_0", examples=[200.0])
    width: Length = Field(50.0, description="of the coupon in mm, w_0", examples=[50.0])
    thickness: Length = Field(0.19, description="of the coupon in mm, t_0", examples=[0.19])
    largest_strain: float = Field(
        0.1, gt=0, le=10, description="nominal strain, from the begin of loading, below which points are fitted", examples=[0.1]
    )
    method: Literal["found", "window", "paper"] = Field(
        "found",
        description="of the fit: a straight part is found; the strains of window; or the paper's own, a line through the origin "
        "over all strains below largest_strain",
        examples=["paper"],
    )
    window: tuple[float, float] | None = Field(
        None, description="lowest and highest strain of the fit, for the method window", examples=[[0.01, 0.05]]
    )
    sign: Literal["auto", "keep", "turn"] = Field(
        "auto", description="of the forces: auto counts tension positive", examples=["turn"]
    )
    specimens: Literal["auto", "one", "stacked"] = Field(
        "auto",
        description="one: all rows belong to one; stacked: another one begins where elongation starts again",
        examples=["stacked"],
    )
    leave_out: list[str] = Field([], description="specimens that are not fitted", examples=[["strip 3"]])
    coupons: dict[str, Coupon] = Field(
        {}, description="sizes of single specimens by name, instead of those of all", examples=[{"strip 2": {"thickness": 0.2}}]
    )
    modulus_range: tuple[Annotated[float, Field(ge=0)], Annotated[float, Field(gt=0)]] = Field(
        PLAUSIBLE_MODULUS, description="E in MPa that is believed: between a rubber's and a metal's", examples=[[0.05, 5000]]
    )
    smallest_r_squared: float = Field(
        0.9, ge=0, lt=1, description="share of the variance that the line must explain", examples=[0.8]
    )

    @field_validator("data")
    @classmethod
    def _some_data(cls, value: str | list[str]) -> str | list[str]:
        if not value or not all(value):
            raise ValueError("a path, or several")
        return value

    @model_validator(mode="after")
    def _window_of_its_method(self) -> TensileTest:
        if (self.window is not None) != (self.method == "window"):
            raise ValueError("window and method: window together")
        if self.window and self.window[0] >= self.window[1]:
            raise ValueError("window with its lower end first")
        if self.modulus_range[0] >= self.modulus_range[1]:
            raise ValueError("modulus_range with its lower end first")
        return self

    @classmethod
    def quantities(cls) -> tuple[str, ...]:
        """What its columns may hold."""
        return TENSILE_QUANTITIES

    @property
    def files(self) -> list[str]:
        """The paths of its files."""
        return [self.data] if isinstance(self.data, str) else self.data


class MeasuredCurves(Layout):
    """Measured pressure-volume curves that are laid over a study's figures and compared with it."""

    data: str = Field(
        description="file of the curves, a path from the project's root", examples=["config/measured/curves_synthetic.csv"]
    )
    n_pouches: Annotated[int, Field(ge=1, le=100)] | dict[str, Annotated[int, Field(ge=1, le=100)]] | None = Field(
        None, description="N_p of the measured device, or of each by its label; odd ones are allowed", examples=[{"bag A": 5}]
    )
    ventricular_pressure: Annotated[float, Field(ge=0, le=1000)] | dict[str, Annotated[float, Field(ge=0, le=1000)]] | None = (
        Field(None, description="P_v in kPa of the measurement, or of each curve by its label", examples=[3.8])
    )
    efficiency: dict[Annotated[int, Field(ge=1, le=100)], Annotated[float, Field(gt=0, le=1)]] = Field(
        {}, description="measured efficiency at a stroke of 90 ml by N_p, where it is known", examples=[{5: 0.8}]
    )

    @classmethod
    def quantities(cls) -> tuple[str, ...]:
        """What its columns may hold."""
        return CURVE_QUANTITIES
