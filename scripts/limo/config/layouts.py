"""Whether devices can be cut and sealed, tried once for each layout: it takes libraries that nothing else in planning needs."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable
from functools import cache
from pathlib import Path

from limo.schema.device import Pattern
from limo.store.code import SCRIPTS, code_digest
from limo.store.digest import digest

#: what decides whether a layout can be cut
CODE = "limo.geometry.pattern"
#: digests of the layouts that can, beside the package
FILE = SCRIPTS / "limo" / "__pycache__" / "layouts.json"
MOST = 5000  # digests that are kept


def check_layouts(pattern: Pattern, numbers: Iterable[int], file: Path) -> None:
    """Raise ``ConfigError``, which names the device's ``file``, for the first number of pouches whose layout cannot be cut."""
    content = pattern.model_dump(mode="json")
    keys = {n: digest([content, n, code_digest(CODE)]) for n in numbers}
    unknown = {n: key for n, key in keys.items() if key not in known_layouts()}
    if not unknown:
        return
    from limo.geometry.pattern import flat_pattern

    for n_pouches, key in unknown.items():
        flat_pattern(pattern, n_pouches, file)
        known_layouts().add(key)
    _keep()


@cache
def known_layouts() -> set[str]:
    """The layouts that have been tried, and could be cut."""
    try:
        return {key for key in json.loads(FILE.read_text()) if isinstance(key, str)}
    except (OSError, ValueError, TypeError):
        return set()


def _keep() -> None:
    """Keep what was tried; where nothing can be written, it is tried again next time."""
    aside = FILE.with_name(f"{FILE.name}.{os.getpid()}")
    try:
        aside.parent.mkdir(exist_ok=True)
        aside.write_text(json.dumps(sorted(known_layouts())[:MOST]))
        aside.replace(FILE)
    except OSError:
        aside.unlink(missing_ok=True)
