"""Tables of measured rows: read from CSV, and written as markdown, where what is not known is a dash."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from limo.errors import ResultError


def read_rows(file: Path, what: str, needed: Sequence[str], **options: Any) -> pd.DataFrame:
    """A CSV file with at least the columns ``needed``; ``what`` it should be stands in the message. Raises ``ResultError``."""
    try:
        rows = pd.read_csv(file, **options)
    except (OSError, ValueError) as error:
        raise ResultError(f"{file}: not a table of {what} ({error})") from None
    if missing := [c for c in needed if c not in rows]:
        raise ResultError(f"{file}: no columns {', '.join(missing)}")
    return rows


def markdown_table(table: pd.DataFrame) -> str:
    """A table as markdown; an empty one says that nothing was measured."""
    if table.empty:
        return "Not measured."
    lines = [
        list(map(str, table.columns)),
        ["---"] * len(table.columns),
        *([str(v) for v in row] for row in table.itertuples(index=False)),
    ]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def number(value: float, digits: int = 1) -> str:
    """With so many digits behind the point."""
    return f"{value:.{digits}f}" if np.isfinite(value) else "-"


def signed_percent(value: float) -> str:
    """A share as a change in per cent."""
    return f"{value:+.1%}" if np.isfinite(value) else "-"
