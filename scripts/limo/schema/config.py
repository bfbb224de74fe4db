"""What a configuration file may say: what runs by default, presets, limits."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import ConfigDict, Field

from limo.schema.accuracy import Scaling
from limo.schema.bench import TensileTest
from limo.schema.fatigue import Fatigue
from limo.schema.numerics import Mesh, MeshLevel, Numerics
from limo.schema.reliability import StressTest
from limo.schema.section import FILE, NAME, Engine, Section
from limo.schema.solver import Limits, Recovery, Solver

#: keys of a configuration that a preset stands for
PRESET_KEYS = ("engine", "mesh", "numerics", "branches")


class Preset(Section):
    """A mesh, numerics and an engine together, whose error is measured (``docs/accuracy.md``)."""

    description: str = Field("", description="a few words", examples=["to find one's way"])
    mesh: Mesh = Field(Mesh(), description="mesh of studies that name the preset")
    numerics: str = Field("fast", pattern=NAME, description="name of an entry of numerics_presets", examples=["fast"])
    engine: Engine = Field("newton", description="what solves the cases", examples=["newton"])
    branches: int = Field(1, ge=1, le=100, description="solutions of each case, for a band", examples=[3])


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
