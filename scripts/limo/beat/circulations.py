"""The circulations of a project: a file each, below ``config/beats``."""

from __future__ import annotations

from pathlib import Path

from limo.config.yaml_file import parse, read_yaml
from limo.schema.beat import Beat

#: below the project's root
FOLDER = Path("config/beats")


def read_circulations(folder: Path = FOLDER) -> dict[str, Beat]:
    """All circulations of a folder by their names. Raises ``ConfigError`` for a mistake in one."""
    return {file.stem: parse(Beat, read_yaml(file), file) for file in sorted(folder.glob("*.yaml"))}
