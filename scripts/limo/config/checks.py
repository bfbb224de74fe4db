"""What the files of a configuration say about each other must fit together."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from itertools import pairwise, product
from pathlib import Path
from typing import get_args

from pydantic import ValidationError

from limo.config.layouts import check_layouts
from limo.config.rungs import check_ladder
from limo.config.settings import Setting, setting_of, variants_of
from limo.config.yaml_file import explain
from limo.engines.find import find_engine
from limo.errors import ConfigError
from limo.schema.accuracy import Airbag
from limo.schema.config import PRESET_KEYS, Config
from limo.schema.device import Device, Material, Pattern
from limo.schema.element import element as find_element
from limo.schema.figures import FIGURES, MEASURED, NEEDS, OF_CYCLES
from limo.schema.numerics import Mesh, MeshLevel, Numerics
from limo.schema.section import ENGINES, ElementName
from limo.schema.solver import Rung
from limo.schema.study import ROLES, Study, Variant

#: densities (g/cm^3) of what a sheet may be made of, from open knitwear to heavy metal
_DENSITIES = (0.01, 25.0)
_OLD_ROLE = re.compile(rf"^({'|'.join(ROLES)})_(.+)$")


def check_name(path: Path, key: str, value: str, known: Iterable[str], *, listed: bool = False) -> None:
    """``value`` of a key (``listed``: one of several) must be among ``known`` names."""
    if value not in known:
        names = list(known)
        section, _, last = key.rpartition(".")
        example = f"{last}: {[names[0]] if listed else names[0]}".replace("'", "") if names else f"no {last}"
        example = f"{section}: {{{example}}}" if section else example
        raise ConfigError(path, key, value, f"one of: {', '.join(names)}", example)


# --------------------------------------------------------------------------------------------------------------------
# the configuration itself


def check_config(path: Path, config: Config) -> None:
    """Names in a configuration must exist in it, and its recovery ladders must be possible."""
    check_name(path, "mesh.level", config.mesh.level, config.mesh_levels)
    check_name(path, "numerics", config.numerics, config.numerics_presets)
    for name, preset in config.presets.items():
        check_name(path, f"presets.{name}.mesh.level", preset.mesh.level, config.mesh_levels)
        check_name(path, f"presets.{name}.numerics", preset.numerics, config.numerics_presets)
        check_engine(path, f"presets.{name}.engine", preset.engine, preset.mesh.element)
        key, numerics = f"presets.{name}.numerics", config.numerics_presets[preset.numerics]
        check_contact(path, key, numerics, [preset.engine])
        check_fit(path, config.mesh_levels, key, numerics, preset.mesh.level, [preset.engine])
    if config.preset:
        check_preset(path, config.preset, config)
        if stated := [n for n in PRESET_KEYS if n in config.model_fields_set]:
            expected = f"no {', '.join(stated)} beside it, for which it stands"
            raise ConfigError(path, "preset", config.preset, expected, f"preset: {config.preset}")
    for engine in ENGINES:
        check_recovery(path, config, engine)
    check_stress_test(path, config)


def check_preset(path: Path, name: str, config: Config) -> None:
    """A preset must be one of the configuration."""
    if not config.presets:
        expected = "no preset, for the configuration has no presets"
        raise ConfigError(path, "preset", name, expected, "presets: {preview: {mesh: {level: preview}}}")
    check_name(path, "preset", name, config.presets)


def check_recovery(path: Path, config: Config, engine: str) -> None:
    """Every rung of an engine's ladder must be possible with every preset and mesh level."""
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


def check_stress_test(path: Path, config: Config) -> None:
    """What a stress test names in the configuration must exist; layouts that cannot be cut are found when it is run."""
    test = config.stress_test
    if test is None:
        return
    check_name(path, "stress_test.mesh.level", test.mesh.level, config.mesh_levels)
    if test.numerics:
        check_name(path, "stress_test.numerics", test.numerics, config.numerics_presets)
        numerics = config.numerics_presets[test.numerics]
        check_contact(path, "stress_test.numerics", numerics, test.engines)
        if numerics.newton.fit_on:
            expected = "a preset without fit_on, for each of its designs is solved on one mesh"
            raise ConfigError(path, "stress_test.numerics", test.numerics, expected, f"numerics: {config.numerics}")
    element = find_element(test.mesh.element)
    if element.is_shell or element.plane_stress:
        expected = "bricks, C3D20R or C3D20: their forces check each result"
        raise ConfigError(path, "stress_test.mesh.element", element.name, expected, "element: C3D20R")


# --------------------------------------------------------------------------------------------------------------------
# one study


@dataclass(frozen=True)
class Known:
    """What a study may refer to: the configuration, sound devices, paths of files, and mistakes of broken devices by name."""

    config: Config
    devices: Mapping[str, Device]
    files: Mapping[str, Path]
    broken: Mapping[str, ConfigError]

    def check_device(self, path: Path, key: str, name: str) -> None:
        """A device must be there and sound. Raises the mistake in its own file."""
        if name in self.broken:
            raise self.broken[name]
        check_name(path, key, name, self.devices)


def check_study(known: Known, path: Path, study: Study) -> dict[str, Setting]:
    """What a study names must exist, and its pressures must fit together; returns its settings by variant."""
    if study.preset:
        check_preset(path, study.preset, known.config)
    settings = {name: checked_setting(known, path, study, name, variant) for name, variant in variants_of(study).items()}
    if 0 in study.axes.n_pouches:
        check_without_pouches(path, study, settings)
    check_figures(path, study)
    for pressure in study.axes.ventricular_pressure:
        check_pressures(path, study, pressure)
    for file, pattern in _patterns(known, path, settings):
        for scale in study.axes.width_scale or [pattern.width_scale]:
            scaled = pattern.model_copy(update={"width_scale": scale})
            check_layouts(scaled, study.axes.n_pouches, file)
    return settings


def _patterns(known: Known, path: Path, settings: Mapping[str, Setting]) -> list[tuple[Path, Pattern]]:
    """The patterns of a study, each once, with the file that a mistake in it is in: the study's where it changes the device's."""
    found: list[tuple[Path, Pattern]] = []
    for setting in settings.values():
        pattern, own = setting.device.pattern, known.devices[setting.device_name].pattern
        file = known.files[f"devices/{setting.device_name}"] if pattern == own else path
        if (file, pattern) not in found:
            found.append((file, pattern))
    return found


def checked_setting(known: Known, path: Path, study: Study, name: str, variant: Variant) -> Setting:
    """The setting of a variant, whose names must exist, and whose numerics, pattern and material must be valid."""
    prefix = f"variants.{name}." if name else ""
    for where, numerics in (("", study.numerics), (prefix, variant.numerics)):
        if isinstance(numerics, str):
            check_name(path, f"{where}numerics", numerics, known.config.numerics_presets)
    known.check_device(path, f"{prefix}device", variant.device or study.device)
    try:
        setting = setting_of(known.config, known.devices, study, variant)
    except ValidationError as error:
        models = {"Material": (Material, "material"), "Pattern": (Pattern, "pattern")}
        model, key = models.get(error.title, (Numerics, "numerics"))
        section = f"{prefix if getattr(variant, key) else ''}{key}"
        mistake = explain(model, error, path)
        raise ConfigError(path, f"{section}.{mistake.key}", mistake.value, mistake.expected, mistake.example) from None
    stated = {**(study.material or {}), **(variant.material or {})}
    check_density(path if stated else known.files[f"devices/{setting.device_name}"], setting.device.material, stated)
    check_name(path, f"{prefix}mesh.level", setting.mesh.level, known.config.mesh_levels)
    if find_element(setting.mesh.element).is_shell:
        check_shells(path, study, prefix, setting)
    check_fabric(path, study, prefix, setting)
    check_engines(path, study, prefix, setting)
    engines = ENGINES if study.cross_check else [setting.engine]
    check_fit(path, known.config.mesh_levels, f"{prefix}numerics", setting.numerics, setting.mesh.level, engines)
    return setting


def check_fabric(path: Path, study: Study, prefix: str, setting: Setting) -> None:
    """Yarns at an angle are not their own mirror image, and CalculiX's own shells have none."""
    woven, axes, mesh = setting.device.material.weaves, study.axes, setting.mesh
    if axes.fabric_angle is not None and not woven:
        expected = f"no fabric_angle, or a device with yarns: the fabric of {setting.device_name} is isotropic"
        example = "material: {weave: {warp_modulus: 400, weft_modulus: 180, poisson_ratio: 0.3, shear_modulus: 60}}"
        raise ConfigError(path, f"{prefix}axes.fabric_angle", axes.fabric_angle, expected, example)
    if woven and find_element(mesh.element).is_shell:
        raise ConfigError(
            path, f"{prefix}mesh.element", mesh.element, "C3D20R, C3D20 or SHELL8R for a woven fabric", "element: SHELL8R"
        )
    slanted = [] if axes.fabric_angle is not None else [weave.angle for weave in woven if not weave.is_mirrored]
    if slanted and mesh.symmetry == "quarter":
        expected = (
            f"front_back or full: with its warp at {slanted[0]:g} degrees the right half is no mirror image of the left one"
        )
        raise ConfigError(path, f"{prefix}mesh.symmetry", mesh.symmetry, expected, "mesh: {symmetry: front_back}")


def check_density(path: Path, material: Material, stated: Collection[str]) -> None:
    """Mass per area over thickness must be the density of a solid (g/cm^3), or one of both has another unit.

    ``stated``: the keys that ``path`` states, where it is a study's.
    """
    (low, high), density = _DENSITIES, material.areal_density / material.thickness / 1000  # 1 g/m^2 over 1 mm: 0.001 g/cm^3
    if low <= density <= high:
        return
    units = {"thickness": ("m", 1000 * material.thickness), "areal_density": ("kg/m^2", 1000 * material.areal_density)}
    if density > high and "areal_density" not in stated:
        key, usual = "thickness", 0.19
    elif density < low and "thickness" not in stated:
        key, usual = "areal_density", 170.0
    else:
        key, usual = ("areal_density", 170.0) if "areal_density" in stated else ("thickness", 0.19)
    unit, value = units[key]
    other = {"thickness": (material.areal_density, value), "areal_density": (value, material.thickness)}[key]
    fits = low <= other[0] / other[1] / 1000 <= high
    expected = f"a density of {low:g} to {high:g} g/cm^3, with areal_density in g/m^2 and thickness in mm, and not {density:.3g}"
    expected += f"; a {key} in {unit} would be {value:.4g}" if fits else ""
    raise ConfigError(path, f"material.{key}", getattr(material, key), expected, f"{key}: {value if fits else usual:.4g}")


def check_shells(path: Path, study: Study, prefix: str, setting: Setting) -> None:
    """Shells are solved as full devices by engines that take them, and keep no displacements through the thickness."""
    element = setting.mesh.element
    if setting.mesh.symmetry != "full":
        expected = f"full with element {element}"
        raise ConfigError(path, f"{prefix}mesh.symmetry", setting.mesh.symmetry, expected, "mesh: {symmetry: full}")
    if study.measures:
        expected = f"volumes only with element {element}, which keeps no displacements through the thickness"
        example = "outputs: [volumes]"
        raise ConfigError(path, "outputs", study.outputs, expected, example)


def check_engines(path: Path, study: Study, prefix: str, setting: Setting) -> None:
    """The engines that solve a setting take its element, and its element the levers of its numerics."""
    element = setting.mesh.element
    engines = ENGINES if study.cross_check else [setting.engine]
    if usable := _other_elements(engines, element, setting.mesh.symmetry):
        key, value = ("cross_check", study.cross_check) if study.cross_check else (f"{prefix}engine", setting.engine)
        expected = f"element {' or '.join(usable)}, which the engines that are used take, and not {element}"
        raise ConfigError(path, key, value, expected, f"mesh: {{element: {usable[0]}}}")
    check_contact(path, f"{prefix}numerics", setting.numerics, engines)
    if study.actuation_volume and (unable := [e for e in engines if not find_engine(e).SYRINGE]):
        able = next(e for e in ENGINES if find_engine(e).SYRINGE)
        key, value = ("cross_check", study.cross_check) if study.cross_check else (f"{prefix}engine", setting.engine)
        expected = f"engine {able} alone with actuation_volume: {unable[0]} drives a device by P_a"
        raise ConfigError(path, key, value, expected, f"engine: {able}")


def check_contact(path: Path, key: str, numerics: Numerics, engines: Iterable[str]) -> None:
    """Engines must have a contact where numerics ask for one."""
    contact = numerics.contact
    if (contact.front_back or contact.endo_epi) and (unable := [e for e in engines if not find_engine(e).CONTACT]):
        expected = f"no contact with engine {unable[0]}, or engine newton alone"
        value = contact.model_dump(exclude={"penetration"})
        raise ConfigError(path, f"{key}.contact", value, expected, "contact: {front_back: false, endo_epi: false}")


def check_fit(
    path: Path, levels: Mapping[str, MeshLevel], key: str, numerics: Numerics, level: str, engines: Iterable[str]
) -> None:
    """The meshes on which a device is fitted first are there, each finer than the one before, and coarser than its own level."""
    key = f"{key}.newton.fit_on"
    names = next((fit_on for engine in engines if (fit_on := numerics.for_engine(engine).newton.fit_on)), ())
    for name in names:
        check_name(path, key, name, levels, listed=True)
    sizes = [levels[name].degrees_of_freedom for name in (*names, level)]
    if any(second <= first for first, second in pairwise(sizes)):
        expected = f"mesh levels from coarse to fine, all coarser than {level}, on which devices are solved"
        coarser = [name for name, level in levels.items() if level.degrees_of_freedom < sizes[-1]]
        example = min(coarser, key=lambda name: levels[name].degrees_of_freedom, default="")
        raise ConfigError(path, key, names, expected, f"fit_on: [{example}]")


def _other_elements(engines: Collection[str], element: str, symmetry: str) -> list[str]:
    """The elements that all engines take, the default first, where one does not take ``element``; none where all do."""
    if all(find_engine(engine).takes(find_element(element)) for engine in engines):
        return []
    known = [find_element(name) for name in get_args(ElementName)]
    fit = [e for e in known if symmetry == "full" or not e.is_shell]
    usable = [e.name for e in fit if all(find_engine(engine).takes(e) for engine in engines)]
    return sorted(usable, key=lambda name: name != Mesh.model_fields["element"].default)


def check_engine(path: Path, key: str, engine: str, element: str) -> None:
    """The engine of a key must take an element."""
    if not find_engine(engine).takes(find_element(element)):
        other = next(name for name in ENGINES if find_engine(name).takes(find_element(element)))
        raise ConfigError(path, key, engine, f"engine: {other} for element {element}", f"engine: {other}")


def check_airbag(path: Path, airbag: Airbag) -> None:
    """The engine of every series must take its element."""
    for k, series in enumerate(airbag.series):
        check_engine(path, f"series.{k}.engine", series.engine, series.element)


def check_figures(path: Path, study: Study) -> None:
    """Figures must exist, with the outputs that they show; so must the measured curves."""
    for figure in study.figures:
        check_name(path, "figures", figure, FIGURES, listed=True)
        if (needed := NEEDS.get(figure, "volumes")) not in ("volumes", *study.outputs):
            expected = f"{needed} among them, which the figure {figure} shows"
            raise ConfigError(path, "outputs", study.outputs, expected, f"outputs: [volumes, {needed}]")
        if figure in OF_CYCLES and not study.has_legs:
            expected = f"the way of the load beyond the ramp, which the figure {figure} shows"
            raise ConfigError(path, "actuation", study.actuation, expected, 'actuation: [0, "max", 0]')
    check_measured(path, study)


def check_without_pouches(path: Path, study: Study, settings: Mapping[str, Setting]) -> None:
    """Without pouches nothing is actuated: engine newton inflates the device to P_v, and there are volumes alone."""
    numbers, maximum = study.axes.n_pouches, study.actuation_pressure_max
    if numbers != [0]:
        raise ConfigError(path, "axes.n_pouches", numbers, "0 alone, for devices with pouches have a ramp", "n_pouches: [8]")
    if maximum != 0:
        expected = f"an even number from 2 to 16; or 0 beside actuation_pressure_max: 0, and not {maximum}: nothing is actuated"
        raise ConfigError(path, "axes.n_pouches", numbers, expected, "n_pouches: [8]")
    if min(study.axes.ventricular_pressure) == 0:
        expected = "more than 0 kPa with n_pouches: [0], or there is no load"
        raise ConfigError(path, "axes.ventricular_pressure", 0, expected, "ventricular_pressure: [1]")
    for key in ("figures", "measured", "cross_check"):
        if value := getattr(study, key):
            expected = "none with n_pouches: [0], whose P_a stays zero"
            raise ConfigError(path, key, value, expected, f"no {key}")
    if study.measures:
        expected = "volumes alone with n_pouches: [0]"
        raise ConfigError(path, "outputs", study.outputs, expected, "outputs: [volumes]")
    for name, setting in settings.items():
        if not find_engine(setting.engine).WITHOUT_RAMP:
            key, able = f"variants.{name}.engine" if name else "engine", [e for e in ENGINES if find_engine(e).WITHOUT_RAMP]
            raise ConfigError(path, key, setting.engine, f"{able[0]} with n_pouches: [0]", f"engine: {able[0]}")


def check_measured(path: Path, study: Study) -> None:
    """Measured curves of a study must be there, and one of its figures at least must show them."""
    if study.measured is None:
        return
    file = study.measured_curves.data
    if not Path(file).is_file():
        raise ConfigError(path, "measured", file, "a readable CSV file", "measured: config/measured/curves_synthetic.csv")
    if study.figures and not set(study.figures) & set(MEASURED):
        expected = f"one of {', '.join(MEASURED)} among them: the others have no axes for the measured curves of the study"
        raise ConfigError(path, "figures", study.figures, expected, f"figures: [{MEASURED[0]}]")


def check_pressures(path: Path, study: Study, pressure: float) -> None:
    """At a P_v (kPa) there must be a P_a,max above it, and no frame beyond that."""
    key, example = "actuation_pressure_max", f"actuation_pressure_max: {pressure + 60:g}"
    try:
        maximum = study.maximum_for(pressure)
    except KeyError:
        expected, example = f"a maximum for P_v = {pressure} kPa", f"{key}: {{{pressure}: {pressure + 60:g}}}"
        raise ConfigError(path, key, study.actuation_pressure_max, expected, example) from None
    if study.actuation_volume and (study.actuation or maximum):
        expected = "none beside actuation_pressure_max or actuation: a device is driven by V_a or by P_a"
        raise ConfigError(path, "actuation_volume", study.actuation_volume, expected, "no actuation_volume")
    if maximum <= pressure and study.axes.n_pouches != [0] and not study.actuation_volume:
        raise ConfigError(path, key, maximum, f"more than P_v = {pressure} kPa, or nothing inflates", example)
    for name in ("frames", "fields_at"):
        if beyond := [frame for frame in getattr(study, name) if not isinstance(frame, str) and frame > maximum]:
            expected = f"pressures up to actuation_pressure_max = {maximum:g} kPa"
            raise ConfigError(path, name, beyond[0], expected, f"{name}: [0, max]")


# --------------------------------------------------------------------------------------------------------------------
# studies beside each other


def check_roles(studies: Mapping[str, Study], files: Mapping[str, Path]) -> dict[str, ConfigError]:
    """Mistakes of studies in what they are for, by their names: a role of a subject that is taken, or spelt in the name alone."""
    mistakes: dict[str, ConfigError] = {}
    taken: dict[tuple[str, str], str] = {}
    for name, study in studies.items():
        path = files[f"studies/{name}"]
        if study.role:
            first = taken.setdefault((study.role, study.subject), name)
            if first != name:
                expected = f"another role or subject than {files[f'studies/{first}']} has"
                mistakes[name] = ConfigError(path, "role", study.role, expected, f"subject: {study.subject}_again")
        elif (spelt := _OLD_ROLE.match(name)) and _had_role(studies, *spelt.groups()):
            role, subject = spelt.groups()
            expected = f"role: {role} and subject: {subject} as keys, which the name does not say any more, or another name"
            mistakes[name] = ConfigError(path, "role", None, expected, f"role: {role} and subject: {subject}")
    return mistakes


def _had_role(studies: Mapping[str, Study], role: str, subject: str) -> bool:
    """Whether a study of such a name had this role when names said it: with a reference of the same subject."""
    reference = f"reference_{subject}" in studies
    return role == "reference" or reference or any((s.role, s.subject) == ("reference", subject) for s in studies.values())


def check_device_of(known: Known, path: Path, section: str, device: str) -> ConfigError | None:
    """The mistake in the device's file that a section of the configuration names, if any. Raises for one that is not there."""
    if device in known.broken:
        return known.broken[device]
    check_name(path, f"{section}.device", device, known.devices)
    return None
