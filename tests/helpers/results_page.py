"""The tables of docs/results.md and the variables of real files."""

from __future__ import annotations

import re
from pathlib import Path

import netCDF4
import numpy as np

from limo.datasets.variables import CASE_DIMS

DOCUMENT = Path(__file__).parents[2] / "docs" / "results.md"


def section(name: str) -> str:
    """The part of the document about one file."""
    parts = re.split(r"^## ", DOCUMENT.read_text(encoding="utf-8"), flags=re.MULTILINE)
    found = [part for part in parts if part.startswith(f"`{name}`")]
    assert found, f"{DOCUMENT.name} has no section `{name}`"
    return found[0]


def table(name: str) -> dict[str, tuple[str, ...]]:
    """The rows of a section's table by their first cell, without the backticks."""
    lines = re.findall(r"^\| `([^`]+)` \|(.*)\|$", section(name), flags=re.MULTILINE)
    return {key: tuple(cell.strip() for cell in rest.split("|")) for key, rest in lines}


def rows(file: Path) -> dict[str, tuple[str, ...]]:
    """Dimensions, unit and meaning of every variable of a dataset, as netCDF itself has them.

    The dimensions of a case are called ``case`` together, whether or not there are branches; the length of a text is none.
    """
    found = {}
    with netCDF4.Dataset(file) as data:
        for name, variable in data.variables.items():
            is_text = variable.dtype == "S1"
            dims = list(variable.dimensions[: -1 if is_text else None])
            if set(CASE_DIMS) - {"branch"} <= set(dims):
                dims = ["case", *(d for d in dims if d not in CASE_DIMS)]
            given = {a: variable.getncattr(a) for a in variable.ncattrs()}
            meaning = given.get("long_name", "")
            if "flag_meanings" in given:
                values = np.atleast_1d(given["flag_values"])
                pairs = zip(values, given["flag_meanings"].split(), strict=True)
                meaning += f" ({', '.join(f'{value} {word}' for value, word in pairs)})"
            found[name] = (", ".join(dims), "text" if is_text else given.get("units", ""), meaning)
    return found
