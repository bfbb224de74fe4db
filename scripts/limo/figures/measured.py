"""Measured curves that a study lays over its figures."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from limo.errors import ConfigError

COLUMNS = ("label", "actuation_pressure", "actuation_volume_change", "stroke_volume")


def read_measured(path: Path) -> pd.DataFrame:
    """Measured curves: a CSV with the columns label, actuation_pressure (kPa), actuation_volume_change and stroke_volume (ml).

    Raises ``ConfigError`` for a file that cannot be read or lacks a column; volumes that were not measured stay empty.
    """
    try:
        table = pd.read_csv(path, comment="#")
    except (OSError, ValueError) as error:
        raise ConfigError(path, "(file)", str(error), "a CSV file", ",".join(COLUMNS)) from None
    if missing := [c for c in COLUMNS if c not in table.columns]:
        raise ConfigError(
            path, "(header)", ",".join(table.columns), f"the columns {', '.join(missing)} as well", ",".join(COLUMNS)
        )
    for column in COLUMNS[1:]:
        try:
            table[column] = pd.to_numeric(table[column])
        except ValueError:
            raise ConfigError(path, column, "text", "numbers", f"{column}\n12.5") from None
    return table
