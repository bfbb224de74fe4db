"""The engines that a project uses, and which builds of them solve here."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

from limo.config.project import Loaded
from limo.engines import find


def find_engines(loaded: Loaded, config_file: str, studies: Collection[str] = (), *, strict: bool = False) -> Path | None:
    """Note the builds of the engines that are used in ``loaded``; returns the executable of one that has its own.

    Those of ``studies`` (none: those that the configuration runs) must be there; an engine that others use may be lacking, and
    has no build then. ``strict``: all must be there. Raises ``ConfigError`` or ``SolverNotFoundError``.
    """
    test = loaded.config.stress_test
    used = _engines_of(loaded, loaded.studies) | {*(test.engines if test else ())}
    return _find(loaded, config_file, used, used if strict else _engines_of(loaded, studies or loaded.config.studies))


def find_builds(loaded: Loaded, config_file: str, engines: Collection[str]) -> Path | None:
    """The same for ``engines``, whoever uses them: all must be there."""
    return _find(loaded, config_file, engines, engines)


def _find(loaded: Loaded, config_file: str, engines: Collection[str], needed: Collection[str]) -> Path | None:
    builds = find.find_builds(loaded.config.solver, config_file, engines, needed)
    loaded.builds.update({name: build.id for name, build in builds.items()})
    return next((build.command for build in builds.values() if build.command), None)


def _engines_of(loaded: Loaded, studies: Collection[str]) -> set[str]:
    return {engine for name in studies for engine in loaded.engines_of(loaded.studies[name])}
