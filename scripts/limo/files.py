"""Writing results so that no half-written file is ever taken for one: write aside, flush to disk, rename."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

from limo.errors import ResultError


def write_whole(path: Path, write: Callable[[Path], None], *, durable: bool = True) -> None:
    """Let ``write`` fill a temporary file beside ``path``, then put it in place in one step.

    The temporary name keeps the ending, by which some libraries choose their format. ``durable``: not before it is on the disk.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    aside = path.with_name(f".{os.getpid()}.{path.name}")
    try:
        write(aside)
        if durable:
            with aside.open("rb") as handle:
                os.fsync(handle.fileno())
        aside.replace(path)
    finally:
        aside.unlink(missing_ok=True)


def write_json(path: Path, data: dict[str, Any], *, durable: bool = True) -> None:
    """Write a JSON object as a whole."""
    write_whole(path, lambda p: p.write_text(json.dumps(data, indent=2) + "\n", encoding="utf-8"), durable=durable)


def read_json(path: Path) -> dict[str, Any]:
    """Read a JSON object. Raises ``ResultError`` when it is missing or damaged."""
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise ResultError(f"{path}: cannot be read ({error})") from None
    if not isinstance(data, dict):
        raise ResultError(f"{path}: not a JSON object")
    return data
