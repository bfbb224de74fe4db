"""Which engines are there, and which builds of them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from limo.engines.calculix import build as ccx_build
from limo.engines.newton.build import mkl_version
from limo.schema.solver import Solver


@dataclass(frozen=True)
class Build:
    """A build of an engine: ``id`` is a part of what determines a result, ``command`` the executable of one that has its own."""

    id: str
    command: Path | None = None


def find_builds(solver: Solver, config_file: str, engines: Iterable[str]) -> dict[str, Build]:
    """The builds of engines by their names. Raises ``ConfigError`` or ``SolverNotFoundError`` for one that is not there."""
    return {name: _build(name, solver, config_file) for name in engines}


def _build(engine: str, solver: Solver, config_file: str) -> Build:
    if engine == "newton":
        return Build(f"mkl-{mkl_version()}")
    command = ccx_build.find_ccx(solver, config_file)
    return Build(ccx_build.build_id(command), command)
