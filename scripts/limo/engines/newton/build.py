"""Which build of the engine newton is used. It needs two packages that there are not for every machine."""

from __future__ import annotations

import platform
from importlib.metadata import PackageNotFoundError, version

from limo.engines.engine import Build
from limo.errors import ConfigError, SolverNotFoundError
from limo.schema.solver import Solver

#: distributions that ``iteration`` imports or loads, beside those of the project
PACKAGES = ("mkl", "pymetis")


def mkl_version() -> str:
    """Version of the installed package ``mkl``; raises ``SolverNotFoundError`` without one."""
    if (installed := _version("mkl")) is None:
        raise SolverNotFoundError(_says(["mkl"]))
    return installed


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def lacking() -> list[str]:
    """Those of ``PACKAGES`` that are not installed."""
    return [package for package in PACKAGES if _version(package) is None]


def require_packages() -> None:
    """Raises ``SolverNotFoundError`` where a package is lacking."""
    if absent := lacking():
        raise SolverNotFoundError(_says(absent))


def find_build(solver: Solver, config_file: str) -> Build:
    """The build, named by its MKL. Raises ``ConfigError`` where a package is lacking."""
    if absent := lacking():
        expected = f"calculix, for {_says(absent)}"
        raise ConfigError(config_file, "engine", "newton", expected, "engine: calculix")
    return Build(f"mkl-{mkl_version()}")


def _says(absent: list[str]) -> str:
    packages = f"the package{'s' * (len(absent) > 1)} {' and '.join(absent)}"
    machine = platform.machine()
    mend = "`make setup` installs them" if machine == "x86_64" else f"there are none for {machine}"
    return f"newton needs {packages}, not installed here ({mend})"
