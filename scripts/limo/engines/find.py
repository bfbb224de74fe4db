"""Which engines a configuration uses, whether they are there, and which builds of them."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

from limo.config.project import Loaded
from limo.engines.calculix import build as ccx_build
from limo.engines.newton import pardiso


def find_engines(loaded: Loaded, config_file: str) -> Path | None:
    """Find the engines that the studies use and note their builds in ``loaded``; returns CalculiX's executable if it is used.

    Raises ``ConfigError`` or ``SolverNotFoundError``.
    """
    used = {engine for study in loaded.studies.values() for engine in loaded.engines_of(study)}
    used.update(loaded.config.stress_test.engines if loaded.config.stress_test else ())
    return find_builds(loaded, config_file, used)


def find_builds(loaded: Loaded, config_file: str, engines: Collection[str]) -> Path | None:
    """The same for ``engines``, whoever uses them."""
    if "newton" in engines:
        loaded.builds["newton"] = f"mkl-{pardiso.mkl_version()}"
    if "calculix" not in engines:
        return None
    command = ccx_build.find_ccx(loaded.config.solver, config_file)
    loaded.builds["calculix"] = ccx_build.build_id(command)
    return command
