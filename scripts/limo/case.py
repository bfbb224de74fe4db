"""One physical case: what determines its result, its name, and what it shares with other cases."""

from __future__ import annotations

import ast
import hashlib
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any

from limo.config import ENGINES, OUTPUTS, Device, Loaded, Mesh, MeshLevel, Numerics
from limo.errors import ResultError
from limo.files import read_json

PACKAGE = Path(__file__).parent
#: modules whose code decides what a mesh looks like
MESH_CODE = ("geometry", "mesh", "elements")
_JUDGE_CODE = ("judge", "recovery", "equilibrium", "layer", "constitutive")
_SOLUTION_CODE = (
    *(*MESH_CODE, "model", "volumes", "energy", "kinematics", "buckling", "engines.__init__", "solution"),
    *_JUDGE_CODE,
)
#: the same for a solution, by engine
SOLVE_CODE = {
    "calculix": (*_SOLUTION_CODE, "deck", "frd", "engines.calculix"),
    "newton": (*_SOLUTION_CODE, "assembly", "kernels", "engines.newton", "engines.pardiso"),
}
#: modules whose code decides what is measured of a solved case, and what is drawn of it for ParaView
FIELD_CODE = ("elements", "kinematics", "mesh", "model", "constitutive", "layer", "zones", "strain", "fatigue")
MEASURE_CODE = (*FIELD_CODE, "stress", "equilibrium", "buckling", "contact", "measures")
#: modules whose code decides what shapes of a study are kept for its figures
SHAPE_CODE = (*MEASURE_CODE, "solution", "dataset", "shapes")
#: modules whose code decides what is gathered of a stress test
STRESS_TEST_CODE = ("reliability", "assembly", "kernels", "equilibrium", "model")
#: modules whose code decides what a study's dataset holds
GATHER_CODE = ("dataset", "efficiency", "solution", "measures")
#: modules whose code decides what is in the table of a study
EXPORT_CODE = ("export",)


def number_label(value: float) -> str:
    """A float as part of a name: ``3.8`` -> ``3.8``, ``2.0`` -> ``2``; never an exponent."""
    text = f"{float(value):.6f}".rstrip("0").rstrip(".")
    return text or "0"


def digest(data: Any, length: int = 10) -> str:
    """Hash of plain data, the same for equal content whatever its order of keys."""
    text = json.dumps(data, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()[:length]


@cache
def code_digest(modules: tuple[str, ...]) -> str:
    """Hash of what modules of this package do: comments, docstrings and layout do not count."""
    files = (PACKAGE / f"{name.replace('.', '/')}.py" for name in modules)
    return digest([_meaning(file.read_text(encoding="utf-8")) for file in files])


@cache
def _meaning(source: str) -> str:
    """Hash of what a module does."""
    tree = ast.parse(source)
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        if isinstance(body, list) and body and isinstance(body[0], ast.Expr) and isinstance(body[0].value, ast.Constant):
            del body[0]
    return hashlib.sha256(ast.dump(tree).encode()).hexdigest()


@dataclass(frozen=True)
class Case:
    """Everything that determines the solution of one device under one pair of pressures.

    Pressures in kPa. ``frames`` are the pressures (kPa) whose displacements are kept; they do not belong to the identity.
    ``build`` names the build of the engine, so that results of two builds lie side by side. ``branch`` is 0 for the flat state
    as it is, and otherwise the seed of a perturbation of it that is far below what could be made.
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
        return {
            "mesh": self.mesh_content(),
            "element": self.mesh.element,
            "material": self.device.material.model_dump(mode="json"),
            "ventricular_pressure": self.ventricular_pressure,
            "actuation_pressure_max": self.actuation_pressure_max,
            "aspect_ratio": self.aspect_ratio,
            "stiffness_ratio": self.stiffness_ratio,
            "engine": self.engine,
            "numerics": self.numerics.for_engine(self.engine).model_dump(mode="json"),
            "build": self.build,
            "branch": self.branch,
        }

    def path(self, *, any_level: bool = False) -> str:
        """Hash of all that decides how the solution evolves with P_a: everything but where it stops.

        Cases with equal paths differ in P_a,max alone; with ``any_level`` they may differ in the mesh level too.
        """
        content = self.content()
        del content["actuation_pressure_max"]
        if any_level:
            del content["mesh"]["level"]
        return digest(content)

    def to_dict(self) -> dict[str, Any]:
        """Plain data from which ``from_dict`` makes the same case again (for passing it between processes)."""
        values = {f.name: getattr(self, f.name) for f in fields(self)}
        return {k: v.model_dump(mode="json") if hasattr(v, "model_dump") else v for k, v in values.items()}

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> Case:
        """The case that ``to_dict`` described."""
        models = {"device": Device, "mesh": Mesh, "mesh_level": MeshLevel, "numerics": Numerics}
        values = {k: models[k].model_validate(v) if k in models else v for k, v in data.items()}
        return cls(**{**values, "frames": tuple(values["frames"])})

    @property
    def mesh_id(self) -> str:
        """Name of the mesh, shared by all cases with the same outline, N_p, level and symmetry."""
        return f"{self.device_name}_np{self.n_pouches}_{self.mesh.level}_{self.mesh.symmetry}_{digest(self.mesh_content())}"

    @property
    def label(self) -> str:
        """Device and the four physical numbers, with which the name of the case begins."""
        return (
            f"{self.device_name}_np{self.n_pouches}_pv{number_label(self.ventricular_pressure)}"
            f"_ar{number_label(self.aspect_ratio)}_eh{number_label(self.stiffness_ratio)}"
        )

    @property
    def case_id(self) -> str:
        """Name of the case: the four physical numbers for people, a hash of all the rest."""
        return f"{self.label}_{self.mesh.level}_{self.numerics_name}_{digest(self.content())}"


def solve_code(engine: str) -> str:
    """Hash of the code that a solution comes from."""
    return code_digest(SOLVE_CODE[engine])


def describe(case: Case) -> dict[str, Any]:
    """What ``case.json`` holds, from which a solved case is found again: the case, and the code that solved it."""
    return {"case": case.to_dict(), "code": solve_code(case.engine)}


OWN_MESH = "mesh.vtu"  # in the folder of a case that its ladder put on another mesh


def solved_on(case: Case, mesh_file: Path, folder: Path) -> tuple[Case, Path]:
    """A case as it was solved, and the file of its mesh: other ones where the recovery ladder put it on another mesh.

    ``folder`` is that of the case. Raises ``ResultError`` where its ``case.json`` says something else than it should.
    """
    file = folder / "case.json"
    other = read_json(file).get("solved_on") if file.exists() else None
    if other is None:
        return case, mesh_file
    try:
        mesh, level = Mesh.model_validate(other["mesh"]), MeshLevel.model_validate(other["mesh_level"])
    except (KeyError, TypeError, ValueError) as error:
        raise ResultError(f"{file}: solved_on is no mesh ({error})") from None
    return replace(case, mesh=mesh, mesh_level=level), folder / OWN_MESH


def study_cases(loaded: Loaded, name: str) -> dict[tuple, Case]:
    """The cases of a study by their places along ``study_axes``."""
    study, config = loaded.studies[name], loaded.config
    settings = loaded.settings(study)
    devices = {
        (variant, scale): _scaled(setting.device, scale)
        for variant, setting in settings.items()
        for scale in study.axes.width_scale or [None]
    }
    # what the engine does not look at is no part of a case: changing it must change nothing that a case is compared by
    numerics = {name: s.numerics.for_engine(s.engine) for name, s in settings.items()}
    cases = {}
    for key in product(*study_axes(loaded, name).values()):
        n_pouches, pressure, aspect, stiffness, scale, variant, branch = key
        setting = settings[variant]
        cases[key] = Case(
            device=devices[variant, scale if study.axes.width_scale else None],
            device_name=setting.device_name,
            n_pouches=n_pouches,
            ventricular_pressure=pressure,
            actuation_pressure_max=study.maximum_for(pressure),
            aspect_ratio=aspect,
            stiffness_ratio=stiffness,
            mesh=setting.mesh,
            mesh_level=config.mesh_levels[setting.mesh.level],
            numerics=numerics[variant],
            numerics_name=setting.preset,
            frames=tuple(study.frames_for(pressure)),
            engine=setting.engine,
            build=loaded.builds.get(setting.engine, ""),
            branch=branch,
        )
    return cases


def study_axes(loaded: Loaded, name: str) -> dict[str, list]:
    """The dimensions of a study's grid and their values; those that it does not vary have one.

    Without ``width_scale`` devices have their own; the one of the study's device stands for it.
    """
    study = loaded.studies[name]
    axes = study.axes
    return {
        "n_pouches": axes.n_pouches,
        "ventricular_pressure": axes.ventricular_pressure,
        "aspect_ratio": axes.aspect_ratio,
        "stiffness_ratio": axes.stiffness_ratio,
        "width_scale": axes.width_scale or [loaded.devices[study.device].pattern.width_scale],
        "variant": list(study.variants) or [""],
        "branch": list(range(loaded.branches_of(study))),
    }


def _scaled(device: Device, scale: float | None) -> Device:
    """The device with other widths; with None the device."""
    if scale is None:
        return device
    return device.model_copy(update={"pattern": device.pattern.model_copy(update={"width_scale": scale})})


def cross_checks(loaded: Loaded, name: str) -> dict[tuple, Case]:
    """The cases of a study that another engine solves too, by their place in the study's grid: ``cross_check`` of them.

    They are spread evenly over the grid, the first and the last among them, and none is perturbed.
    """
    study = loaded.studies[name]
    cases = {key: case for key, case in study_cases(loaded, name).items() if not case.branch}
    settings = loaded.settings(study)
    count, keys = min(study.cross_check, len(cases)), list(cases)
    places = [round(k * (len(keys) - 1) / max(count - 1, 1)) for k in range(count)]
    return {keys[k]: _by_other_engine(loaded, cases[keys[k]], settings[keys[k][-2]].numerics) for k in places}


def _by_other_engine(loaded: Loaded, case: Case, numerics: Numerics) -> Case:
    other = next(e for e in ENGINES if e != case.engine)
    return replace(case, engine=other, build=loaded.builds.get(other, ""), numerics=numerics.for_engine(other))


@dataclass(frozen=True)
class Wanted:
    """What all studies together want of a case: pressures (kPa) of its frames by output.

    ``fields`` are drawn at their pressures with the outputs in ``drawn``.
    """

    pressures: dict[str, tuple[float, ...]]
    drawn: tuple[str, ...] = ()

    @property
    def outputs(self) -> tuple[str, ...]:
        return tuple(o for o in OUTPUTS if o in self.pressures)

    def to_dict(self) -> dict[str, Any]:
        """Plain data from which ``from_dict`` makes the same again."""
        return {"pressures": {k: list(v) for k, v in self.pressures.items()}, "drawn": list(self.drawn)}

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> Wanted:
        return cls({k: tuple(v) for k, v in data["pressures"].items()}, tuple(data["drawn"]))


def wanted_cases(
    loaded: Loaded, studies: Iterable[str] | None = None, served: Mapping[str, Mapping[tuple, str]] | None = None
) -> dict[str, Wanted]:
    """What the studies (default: all) want of each case, by its id; cases of which only volumes are wanted are left out.

    ``served``: by study, the id of the case that stands for each of its grid (default: the study's own cases).
    """
    pressures: dict[str, dict[str, set[float]]] = {}
    drawn: dict[str, set[str]] = {}
    for name in loaded.studies if studies is None else studies:
        study = loaded.studies[name]
        if not study.measures:
            continue
        for key, case in study_cases(loaded, name).items():
            case_id = served[name][key] if served else case.case_id
            of_case = pressures.setdefault(case_id, {})
            p_v = case.ventricular_pressure
            for output in study.measures:
                chosen = study.fields_at if output == "fields" else [*study.frames, *study.fields_at]
                of_case.setdefault(output, set()).update(p for p in (study.pressure_of(f, p_v) for f in chosen) if p is not None)
            if "fields" in study.measures:
                drawn.setdefault(case_id, set()).update(o for o in study.measures if o != "fields")
    return {
        case_id: Wanted(
            {o: tuple(sorted(of_case[o])) for o in OUTPUTS if o in of_case},
            tuple(o for o in OUTPUTS if o in drawn.get(case_id, ())),
        )
        for case_id, of_case in pressures.items()
    }
