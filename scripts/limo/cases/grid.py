"""The grid of a study: its axes, its cases, and those that another engine solves too."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from types import MappingProxyType
from typing import Any, NamedTuple

from limo.cases.case import Case
from limo.config.project import Project
from limo.schema.device import Device, Material, Sheet
from limo.schema.numerics import Mesh, MeshLevel, Numerics
from limo.schema.section import ENGINES
from limo.schema.study import Study

#: axes that replace what a device has of its own, and that
OWN: dict[str, Callable[[Device], float]] = {
    "width_scale": lambda device: device.pattern.width_scale,
    "fabric_angle": lambda device: device.material.weave.angle if device.material.weave else 0.0,
    "bending_factor": lambda device: device.material.bending_factor,
}


class GridPoint(NamedTuple):
    """Where a case lies in the grid of a study: a value of each axis, P_v in kPa.

    ``width_scale``, ``fabric_angle`` and ``bending_factor`` are the device's own where a study does not vary them (an isotropic
    fabric has the angle 0); ``variant`` is empty where it has none.
    """

    n_pouches: int
    ventricular_pressure: float
    aspect_ratio: float
    stiffness_ratio: float
    width_scale: float
    fabric_angle: float
    bending_factor: float
    variant: str
    branch: int

    def index(self, axes: Mapping[str, Sequence[Any]]) -> tuple[int, ...]:
        """Its place along each of the axes of a study (``StudyGrid.axes``). Raises ``ValueError`` for a point beside them."""
        return tuple(axes[name].index(value) for name, value in zip(self._fields, self, strict=True))


@dataclass(frozen=True, eq=False)
class StudyGrid:
    """A study of a project, resolved once: axes, cases by point, and the points that another engine solves too."""

    project: Project
    name: str

    @property
    def study(self) -> Study:
        """What its file says."""
        return self.project.studies[self.name]

    @cached_property
    def axes(self) -> Mapping[str, tuple]:
        """The dimensions of the grid (the fields of ``GridPoint``) and their values; those that are not varied have one.

        What the axes of ``OWN`` leave out devices have of their own; that of the study's device stands for it.
        """
        axes, project = self.study.axes, self.project
        device = project.devices[self.study.device]
        own = {name: getattr(axes, name) or [value(device)] for name, value in OWN.items()}
        values = GridPoint(
            n_pouches=axes.n_pouches,
            ventricular_pressure=axes.ventricular_pressure,
            aspect_ratio=axes.aspect_ratio,
            stiffness_ratio=axes.stiffness_ratio,
            **own,
            variant=list(self.study.variants) or [""],
            branch=range(project.branches_of(self.study)),
        )
        return MappingProxyType({name: tuple(each) for name, each in values._asdict().items()})

    @cached_property
    def cases(self) -> Mapping[GridPoint, Case]:
        """The cases by their points, the last axis varying fastest."""
        study, config, settings = self.study, self.project.config, self.project.settings(self.name)
        varied = [name for name in OWN if getattr(study.axes, name)]
        devices = {}
        # what the engine does not look at is no part of a case: changing it must change nothing that a case is compared by
        numerics = {name: s.numerics.for_engine(s.engine) for name, s in settings.items()}
        fit_levels = {name: self._fit_levels(each) for name, each in numerics.items()}
        frames = {pressure: tuple(study.frames_for(pressure)) for pressure in study.axes.ventricular_pressure}
        cases = {}
        for point in map(GridPoint._make, product(*self.axes.values())):
            setting = settings[point.variant]
            changes = {name: getattr(point, name) for name in varied}
            device = (point.variant, *changes.values())
            if device not in devices:
                devices[device] = changed(setting.device, **changes)
            cases[point] = Case(
                device=devices[device],
                device_name=setting.device_name,
                n_pouches=point.n_pouches,
                ventricular_pressure=point.ventricular_pressure,
                actuation_pressure_max=study.maximum_for(point.ventricular_pressure),
                aspect_ratio=point.aspect_ratio,
                stiffness_ratio=point.stiffness_ratio,
                mesh=_mirrored(setting.mesh, devices[device].material),
                mesh_level=config.mesh_levels[setting.mesh.level],
                numerics=numerics[point.variant],
                numerics_name=setting.preset,
                frames=frames[point.ventricular_pressure],
                engine=setting.engine,
                build=self.project.builds.get(setting.engine, ""),
                branch=point.branch,
                fit_levels=fit_levels[point.variant],
                cycle=study.cycle_for(point.ventricular_pressure),
                syringe=study.syringe,
            )
        return MappingProxyType(cases)

    @cached_property
    def cross_checks(self) -> Mapping[GridPoint, Case]:
        """The cases that another engine solves too, ``cross_check`` of them, by their points, as that engine solves them.

        They are spread evenly over the grid, the first and the last among them, and none is perturbed.
        """
        points = [point for point in self.cases if not point.branch]
        count = min(self.study.cross_check, len(points))
        chosen = [points[round(k * (len(points) - 1) / max(count - 1, 1))] for k in range(count)]
        return MappingProxyType({point: self._by_other_engine(point) for point in chosen})

    def _by_other_engine(self, point: GridPoint) -> Case:
        case, numerics = self.cases[point], self.project.settings(self.name)[point.variant].numerics
        other = next(engine for engine in ENGINES if engine != case.engine)
        seen = numerics.for_engine(other)
        build, levels = self.project.builds.get(other, ""), self._fit_levels(seen)
        return replace(case, engine=other, build=build, numerics=seen, fit_levels=levels)

    def _fit_levels(self, numerics: Numerics) -> tuple[MeshLevel, ...]:
        """The meshes on which a device is fitted before its own."""
        return tuple(self.project.config.mesh_levels[name] for name in numerics.newton.fit_on)


def study_grid(project: Project, name: str) -> StudyGrid:
    """The grid of a study, the same one whenever the same project is asked."""
    if name not in project.resolved:
        project.resolved[name] = StudyGrid(project, name)
    return project.resolved[name]


def study_cases(project: Project, name: str) -> Mapping[GridPoint, Case]:
    """The cases of a study by their points (``StudyGrid.cases``)."""
    return study_grid(project, name).cases


def cross_checks(project: Project, name: str) -> Mapping[GridPoint, Case]:
    """The cases of a study that another engine solves too (``StudyGrid.cross_checks``)."""
    return study_grid(project, name).cross_checks


def changed(device: Device, **changes: float) -> Device:
    """The device with other values of ``OWN``; the fabric's are those of all its sheets."""
    pattern, material = device.pattern, _changed_sheet(device.material, changes)
    if "width_scale" in changes:
        pattern = pattern.model_copy(update={"width_scale": changes["width_scale"]})
    if material.pouch_sheet is not None:
        material = material.model_copy(update={"pouch_sheet": _changed_sheet(material.pouch_sheet, changes)})
    return device.model_copy(update={"pattern": pattern, "material": material})


def _mirrored(mesh: Mesh, material: Material) -> Mesh:
    """The mesh, or half of the device instead of a quarter where yarns are not their own mirror image."""
    if mesh.symmetry != "quarter" or all(weave.is_mirrored for weave in material.weaves):
        return mesh
    return mesh.model_copy(update={"symmetry": "front_back"})


def _changed_sheet(sheet: Sheet, changes: Mapping[str, float]) -> Sheet:
    update: dict[str, Any] = {}
    if "fabric_angle" in changes and sheet.weave is not None:
        update["weave"] = sheet.weave.model_copy(update={"angle": changes["fabric_angle"]})
    if "bending_factor" in changes:
        update["bending_factor"] = changes["bending_factor"]
    return sheet.model_copy(update=update)
