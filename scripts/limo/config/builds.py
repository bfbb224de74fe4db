"""A project that is ready to be solved: with the builds of the engines that it uses, which names of cases contain."""

from __future__ import annotations

import logging
from collections.abc import Collection, Iterable
from pathlib import Path

from limo.config.load import ALL, load_config
from limo.config.project import Project
from limo.engines.find import find_builds

log = logging.getLogger(__name__)


def with_found_builds(
    project: Project, config_file: str, engines: Collection[str] | None = None, needed: Collection[str] | None = None
) -> tuple[Project, Path | None]:
    """A project with the builds of engines (default: those it uses) that are found, and the executable of one that has its own.

    One that is not ``needed`` (default: all are) may be lacking and has no build then. Raises ``ConfigError`` or
    ``SolverNotFoundError`` for one that is needed.
    """
    builds = find_builds(project.config.solver, config_file, project.engines if engines is None else engines, needed)
    command = next((build.command for build in builds.values() if build.command), None)
    return project.with_builds({**project.builds, **{name: build.id for name, build in builds.items()}}), command


def open_project(
    config_file: str,
    studies: Iterable[str] = (),
    example: str = "limo check",
    *,
    strict: bool = False,
    all_engines: bool | None = None,
) -> Project:
    """The project of a configuration with the builds of its engines; warns of files that are left out.

    ``studies`` are asked for (none: those that the configuration runs); ``example`` is a command that works. ``strict``: no file
    may have a mistake. ``all_engines`` (default: if strict): no engine may be lacking, also of other studies. Raises what
    ``load_config``, ``Project.require`` and ``with_found_builds`` raise.
    """
    names = list(studies)
    project = load_config(config_file, names or [ALL], strict=strict)
    project.require(names, config_file, example)
    warn_of_broken(project)
    needed = project.engines if (strict if all_engines is None else all_engines) else engines_of(project, names or [ALL])
    return with_found_builds(project, config_file, needed=needed)[0]


def engines_of(project: Project, studies: Iterable[str]) -> set[str]:
    """The engines that solve some studies; ``all`` are those that the configuration runs, names of none are passed over."""
    names = [name for asked in studies for name in (project.config.studies if asked == ALL else [asked])]
    return {engine for name in names if name in project.studies for engine in project.engines_of(name)}


def warn_of_broken(project: Project) -> None:
    """Log a warning for each mistake in a file that was left out."""
    for warning in project.warnings:
        log.warning("%s", warning)
