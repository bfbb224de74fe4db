"""What may be said of a beating heart: circulation and pneumatic driver, every number with its unit."""

from __future__ import annotations

from functools import cache
from typing import Annotated, Any

from pydantic import BeforeValidator, Field, PlainSerializer, WithJsonSchema

from limo.schema.section import Section


@cache
def _pint():
    from pint import UnitRegistry  # loaded where a circulation is read

    return UnitRegistry()


def _within(unit: str, low: float, high: float, example: str) -> tuple[BeforeValidator, PlainSerializer, WithJsonSchema]:
    """A quantity written with its unit, turned into ``unit`` and written with it again.

    Raises ``ValueError`` for another one, for a number alone, and beyond its range.
    """

    def parsed(value: Any) -> float:
        if not isinstance(value, str):
            raise ValueError(f"a number with its unit, such as {example}")
        import pint

        try:
            number = float(_pint().Quantity(value).to(unit).magnitude)
        except (pint.PintError, AttributeError, TypeError, ValueError, AssertionError) as error:
            raise ValueError(f"a number with its unit, such as {example} ({error})") from None
        if not low <= number <= high:
            raise ValueError(f"{low:g} to {high:g} {unit}, and not {number:.6g}; for example {example}")
        return number

    written = PlainSerializer(lambda value: f"{value!r} {unit}", return_type=str)
    return BeforeValidator(parsed), written, WithJsonSchema({"type": "string", "examples": [example]})


_RESISTANCE = "kPa * s / ml"
_COMPLIANCE = "ml / kPa"


class Circuit(Section):
    """One circuit from a ventricle to the next one: valves, arteries, peripheral vessels, veins.

    Windkessel of three elements behind the outlet valve, a compliance before the inlet valve. Values are in kPa, ml and s once
    they are read.
    """

    outlet_resistance: Annotated[float, *_within(_RESISTANCE, 1e-5, 1, "0.03 mmHg s/ml")] = Field(
        description="of the outlet valve when it is open", examples=["0.03 mmHg s/ml"]
    )
    inlet_resistance: Annotated[float, *_within(_RESISTANCE, 1e-5, 1, "0.0075 mmHg s/ml")] = Field(
        description="of the inlet valve when it is open", examples=["0.0075 mmHg s/ml"]
    )
    peripheral_resistance: Annotated[float, *_within(_RESISTANCE, 1e-4, 10, "1.1 mmHg s/ml")] = Field(
        description="from arteries to veins", examples=["1.1 mmHg s/ml"]
    )
    arterial_compliance: Annotated[float, *_within(_COMPLIANCE, 0.01, 1e4, "1.6 ml/mmHg")] = Field(
        description="of the arteries", examples=["1.6 ml/mmHg"]
    )
    venous_compliance: Annotated[float, *_within(_COMPLIANCE, 0.1, 1e5, "60 ml/mmHg")] = Field(
        description="of the veins, or of the reservoir of a bench", examples=["60 ml/mmHg"]
    )
    arterial_pressure: Annotated[float, *_within("kPa", 0, 60, "90 mmHg")] = Field(
        description="of the arteries at the start; with that of the veins it sets how much blood there is", examples=["90 mmHg"]
    )
    venous_pressure: Annotated[float, *_within("kPa", 0, 30, "10 mmHg")] = Field(
        description="of the veins at the start", examples=["10 mmHg"]
    )


class Driver(Section):
    """A pneumatic driver: a source and a vent that a switch puts on the line to the pouches in turn."""

    source_pressure: Annotated[float, *_within("kPa", 0.1, 300, "100 kPa")] = Field(
        description="above the atmosphere, while the device is driven", examples=["100 kPa"]
    )
    vent_pressure: Annotated[float, *_within("kPa", -90, 100, "0 kPa")] = Field(
        description="above the atmosphere, while it is vented", examples=["0 kPa"]
    )
    line_resistance: Annotated[float, *_within(_RESISTANCE, 1e-5, 10, "0.05 kPa s/ml")] = Field(
        description="of line and switch, for air as it is at one atmosphere", examples=["0.05 kPa s/ml"]
    )
    dead_volume: Annotated[float, *_within("ml", 0.1, 1e4, "20 ml")] = Field(
        description="of the line between switch and pouches", examples=["20 ml"]
    )
    rate: Annotated[float, *_within("1/min", 5, 300, "60 1/min")] = Field(description="beats a minute", examples=["60 1/min"])
    duty: float = Field(gt=0, lt=1, description="share of the beat in which the source is on", examples=[0.35])


class Beat(Section):
    """A circulation with one device as left ventricle, or two with a second one as the right."""

    description: str = Field(min_length=3, description="what it stands for and where its numbers are from", examples=["healthy"])
    systemic: Circuit = Field(description="from the left ventricle to the right one, or back to the left one")
    pulmonary: Circuit | None = Field(None, description="from the right ventricle to the left one; with it there are two devices")
    driver: Driver = Field(description="of the left device")
    right_driver: Driver | None = Field(None, description="of the right device; the left one's without it")
