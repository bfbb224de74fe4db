"""The files from a laboratory that a configuration names, tried before anything is solved."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from limo.bench.compare import study_curves
from limo.bench.tensile import fit_tensile, with_error
from limo.config.project import Project
from limo.schema.bench import TensileTest

#: Young's modulus in MPa below which a sheet is softer than most rubbers
_SOFT = 1.0


def check_files(project: Project, names: Iterable[str]) -> list[str]:
    """A line each about the tensile test and the measured curves of studies. Raises ``ConfigError`` for the first mistake.

    The tensile test that ships with the project is looked at where it is there; one that the configuration states must be.
    """
    test, lines = project.config.tensile_test, []
    if test != TensileTest() or all(Path(file).exists() for file in test.files):
        fit = fit_tensile(test)
        count = f"{len(fit.lines)} specimens" if len(fit.lines) > 1 else "one specimen"
        files, synthetic = ", ".join(test.files), "synthetic, " if fit.reading.synthetic else ""
        lines.append(f"  tensile test {files}: {synthetic}{count}, E = {with_error(fit.modulus, fit.error)} MPa")
    return lines + soft_devices(project, names) + check_curves(project, names)


def soft_devices(project: Project, names: Iterable[str]) -> list[str]:
    """A line about each device of studies whose modulus is below that of most rubbers: it may be in GPa."""
    settings = [setting for name in names for setting in project.settings(name).values()]
    moduli = dict.fromkeys(setting.device.material.youngs_modulus for setting in settings)
    return [
        f"  youngs_modulus: {modulus:g} MPa is that of a soft rubber; in GPa it would be {1000 * modulus:g} MPa"
        for modulus in moduli
        if modulus < _SOFT
    ]


def check_curves(project: Project, names: Iterable[str]) -> list[str]:
    """The same about the measured curves alone."""
    lines = []
    for name in names:
        if (curves := study_curves(project, name)) is not None:
            lines.append(f"  measured curves of {name}: {curves.understood[-1]}")
            lines += [f"    {said}" for said in curves.understood if any(word in said for word in ("assumed", "taken", "beyond"))]
    return lines
