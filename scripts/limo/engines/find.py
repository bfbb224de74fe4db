"""Engines by their names. An engine is imported when it is asked for, and its libraries when it solves."""

from __future__ import annotations

import importlib
from collections.abc import Collection

from limo.engines.engine import Build, Engine
from limo.errors import LimoError
from limo.schema.solver import Solver


def find_engine(name: str) -> Engine:
    """The engine of a name."""
    return importlib.import_module(f"limo.engines.{name}.engine")


def find_builds(
    solver: Solver, config_file: str, engines: Collection[str], needed: Collection[str] | None = None
) -> dict[str, Build]:
    """The builds of engines by their names; one that is not ``needed`` (default: all are) may be lacking and is left out.

    Raises ``ConfigError`` or ``SolverNotFoundError`` for one that is needed and is not there.
    """
    builds = {}
    for name in sorted(engines):
        try:
            builds[name] = find_engine(name).build(solver, config_file)
        except LimoError:
            if needed is None or name in needed:
                raise
    return builds
