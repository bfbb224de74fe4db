"""An exploration goes in rounds: designs are proposed, solved as cases, and told; the next round learns from all before.

The first round samples the space, the next ones search it. Where nothing is worth a search any more, what is left of them has no
designs. Then the finer preset solves what is recommended, and after that what both presets together propose. A round is a file of
designs, and one of what came of them. Nothing else is known, so a sweep that ends is carried on where it was.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from limo.config.load import read_section
from limo.config.project import Project
from limo.errors import ConfigError, ResultError
from limo.explore.checks import check_designs
from limo.explore.designs import studies_of, with_studies
from limo.schema.exploration import Exploration
from limo.schema.study import Study
from limo.store.files import read_json, write_json
from limo.store.results import Results

#: below the folder of the configuration
FOLDER = "explorations"


def read_exploration(project: Project, config_file: Path, name: str) -> Exploration:
    """An exploration beside a configuration. Raises ``ConfigError`` for a mistake in it."""
    file = config_file.parent / FOLDER / f"{name}.yaml"
    if f"studies/{name}" in project.files:
        raise ConfigError(file, "(file name)", name, "a name that no study has", "best_heart.yaml")
    exploration = read_section(Exploration, file)
    check_designs(project, exploration, file)
    return exploration


def count_of(exploration: Exploration) -> int:
    """How many rounds there are."""
    return len(exploration.rounds) + len(exploration.fine_rounds)


def is_fine(exploration: Exploration, number: int) -> bool:
    """Whether a round is solved by the finer preset."""
    return number >= len(exploration.rounds)


def preset_of(exploration: Exploration, number: int) -> str:
    """The preset by which a round is solved."""
    return exploration.fine if is_fine(exploration, number) else exploration.cheap


def round_designs(results: Results, name: str, number: int) -> dict[str, dict[str, float]]:
    """The designs of a round by their names. Raises ``ResultError``."""
    return read_json(results.exploration(name).round(number))["designs"]


def rounds_on_disk(results: Results, name: str, exploration: Exploration) -> list[int]:
    """The rounds whose designs are there, of this exploration as it is written now."""
    found = []
    for number in range(count_of(exploration)):
        try:
            kept = read_json(results.exploration(name).round(number))
        except ResultError:
            break
        if kept.get("exploration") != exploration.model_dump(mode="json"):
            break
        found.append(number)
    return found


def explored(project: Project, explorations: Mapping[str, Exploration], results: Results) -> Project:
    """The project with all designs that are proposed so far as its studies."""
    studies: dict[str, Study] = {}
    for name, exploration in explorations.items():
        for number in rounds_on_disk(results, name, exploration):
            designs = round_designs(results, name, number)
            studies |= studies_of(project, exploration, designs, preset_of(exploration, number))
    return with_studies(project, studies)


def write_round(file: Path, content: dict[str, Any]) -> None:
    """Write a round, or what came of it."""
    file.parent.mkdir(parents=True, exist_ok=True)
    write_json(file, content)
