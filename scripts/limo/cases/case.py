"""One physical case: what determines its result, its name, and what it shares with other cases."""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from limo.errors import ResultError
from limo.schema.device import Device
from limo.schema.numerics import Mesh, MeshLevel, Numerics
from limo.store.code import code_digest
from limo.store.digest import digest, number_label
from limo.store.files import read_json
from limo.store.results import CaseFiles


@dataclass(frozen=True)
class Case:
    """Everything that determines the solution of one device under one pair of pressures.

    Pressures in kPa. ``frames`` are the pressures (kPa) whose displacements are kept; they do not belong to the identity.
    ``build`` names the build of the engine, so that results of two builds lie side by side. ``branch`` is 0 for the flat state
    as it is. Otherwise it is the seed of a perturbation far below what could be made. ``fit_levels`` are the coarser meshes that
    ``numerics.newton.fit_on`` names. ``cycle``: P_v and P_a (kPa) of the points to which the load goes after its ramp, in order.
    ``syringe``: V_a (ml) of the points to which a syringe goes instead of a ramp, None for V_a at rest.
    """

    device: Device
    device_name: str
    n_pouches: int
    ventricular_pressure: float
    actuation_pressure_max: float
    aspect_ratio: float
    stiffness_ratio: float
    mesh: Mesh
    mesh_level: MeshLevel
    numerics: Numerics
    numerics_name: str
    frames: tuple[float, ...] = field(compare=False, default=())
    engine: str = "calculix"
    build: str = ""
    branch: int = 0
    fit_levels: tuple[MeshLevel, ...] = ()
    cycle: tuple[tuple[float, float], ...] = ()
    syringe: tuple[float | None, ...] = ()

    @cached_property
    def fit(self) -> Case | None:
        """The case at whose state at rest this one begins: the same on the last of ``fit_levels``, without a ramp; else None."""
        if not self.fit_levels:
            return None
        *before, level = self.fit_levels
        newton = self.numerics.newton
        return replace(
            self,
            mesh=self.mesh.model_copy(update={"level": newton.fit_on[-1]}),
            mesh_level=level,
            numerics=self.numerics.model_copy(update={"newton": newton.model_copy(update={"fit_on": newton.fit_on[:-1]})}),
            fit_levels=tuple(before),
            actuation_pressure_max=0.0,
            frames=(0.0,),
            cycle=(),
            syringe=(),
        )

    @property
    def fits(self) -> tuple[Case, ...]:
        """That case, and those before it."""
        return (self.fit, *self.fit.fits) if self.fit else ()

    def mesh_content(self) -> dict[str, Any]:
        """What the mesh depends on: not the pressures, the aspect ratio or any stiffness."""
        return {
            "pattern": self.device.pattern.model_dump(mode="json"),
            "n_pouches": self.n_pouches,
            "level": self.mesh_level.model_dump(mode="json"),
            "symmetry": self.mesh.symmetry,
        }

    def content(self) -> dict[str, Any]:
        """What the solution depends on."""
        fitted = {"fit_levels": [level.model_dump(mode="json") for level in self.fit_levels]} if self.fit_levels else {}
        cycled = {"cycle": [list(point) for point in self.cycle]} if self.cycle else {}
        cycled |= {"syringe": list(self.syringe)} if self.syringe else {}
        return (
            fitted
            | cycled
            | {
                "mesh": self.mesh_content(),
                "element": self.mesh.element,
                "material": self.device.material.model_dump(mode="json"),
                "ventricular_pressure": self.ventricular_pressure,
                "actuation_pressure_max": self.actuation_pressure_max,
                "aspect_ratio": self.aspect_ratio,
                "stiffness_ratio": self.stiffness_ratio,
                "engine": self.engine,
                "numerics": self.numerics.content(self.engine),
                "build": self.build,
                "branch": self.branch,
            }
        )

    @cached_property
    def path(self) -> str:
        """Hash of all that decides how the solution evolves with P_a: cases with equal paths differ in P_a,max alone."""
        content = self.content()
        del content["actuation_pressure_max"]
        return digest(content)

    @cached_property
    def path_on_any_level(self) -> str:
        """The same without the mesh level."""
        content = self.content()
        del content["actuation_pressure_max"], content["mesh"]["level"]
        return digest(content)

    def to_dict(self) -> dict[str, Any]:
        """Plain data from which ``from_dict`` makes the same case again (for passing it between processes)."""
        values = {f.name: getattr(self, f.name) for f in fields(self)}
        plain = {k: v.model_dump(mode="json") if hasattr(v, "model_dump") else v for k, v in values.items()}
        plain["fit_levels"] = [level.model_dump(mode="json") for level in self.fit_levels]
        cycle, syringe = [list(point) for point in plain.pop("cycle")], list(plain.pop("syringe"))
        return plain | ({"cycle": cycle} if cycle else {}) | ({"syringe": syringe} if syringe else {})

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> Case:
        """The case that ``to_dict`` described."""
        models = {"device": Device, "mesh": Mesh, "mesh_level": MeshLevel, "numerics": Numerics}
        values = {k: models[k].model_validate(v) if k in models else v for k, v in data.items()}
        levels = tuple(map(MeshLevel.model_validate, values.get("fit_levels", ())))
        cycle = tuple((float(p_v), float(p_a)) for p_v, p_a in values.get("cycle", ()))
        load = {"frames": tuple(values["frames"]), "cycle": cycle, "syringe": tuple(values.get("syringe", ()))}
        return cls(**{**values, **load, "fit_levels": levels})

    @cached_property
    def mesh_id(self) -> str:
        """Name of the mesh, shared by all cases with the same outline, N_p, level and symmetry."""
        return f"{self.device_name}_np{self.n_pouches}_{self.mesh.level}_{self.mesh.symmetry}_{digest(self.mesh_content())}"

    @cached_property
    def label(self) -> str:
        """Device and the four physical numbers, with which the name of the case begins."""
        return (
            f"{self.device_name}_np{self.n_pouches}_pv{number_label(self.ventricular_pressure)}"
            f"_ar{number_label(self.aspect_ratio)}_eh{number_label(self.stiffness_ratio)}"
        )

    @cached_property
    def case_id(self) -> str:
        """Name of the case: the four physical numbers for people, a hash of all the rest."""
        return f"{self.label}_{self.mesh.level}_{self.numerics_name}_{digest(self.content())}"


def engine_code(engine: str, task: str = "solve") -> str:
    """Entry point of an engine for a task: with the script that gives it the task, the code that decides the result."""
    return f"limo.engines.{engine}.engine:{task}"


def solve_code(engine: str) -> str:
    """Hash of the code that a solution comes from."""
    return code_digest("solve_case", engine_code(engine))


def describe(case: Case) -> dict[str, Any]:
    """What ``case.json`` holds, from which a solved case is found again: the case, and the code that solved it."""
    return {"case": case.to_dict(), "code": solve_code(case.engine)}


def solved_on(case: Case, mesh_file: Path, folder: Path) -> tuple[Case, Path]:
    """A case as it was solved, and the file of its mesh: other ones where the recovery ladder put it on another mesh.

    ``folder`` is that of the case. Raises ``ResultError`` where its ``case.json`` says something else than it should.
    """
    files = CaseFiles(folder)
    other = read_json(files.described).get("solved_on") if files.described.exists() else None
    if other is None:
        return case, mesh_file
    try:
        mesh, level = Mesh.model_validate(other["mesh"]), MeshLevel.model_validate(other["mesh_level"])
    except (KeyError, TypeError, ValueError) as error:
        raise ResultError(f"{files.described}: solved_on is no mesh ({error})") from None
    return replace(case, mesh=mesh, mesh_level=level), files.own_mesh
