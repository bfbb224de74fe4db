"""Tables of measured rows: read from CSV, written as markdown or text by tabulate; what is not known is a dash."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from tabulate import DataRow, TableFormat, tabulate

from limo.errors import ResultError

#: tables of GitHub without padding, so that a cell that changes is one line that changes
_MARKDOWN = TableFormat(
    lineabove=None,
    linebelowheader=lambda widths, _: "|" + " --- |" * len(widths),
    linebetweenrows=None,
    linebelow=None,
    headerrow=DataRow("|", "|", "|"),
    datarow=DataRow("|", "|", "|"),
    padding=1,
    with_header_hide=None,
)


def read_rows(file: Path, what: str, needed: Sequence[str], **options: Any) -> pd.DataFrame:
    """A CSV file with at least the columns ``needed``; ``what`` it should be stands in the message. Raises ``ResultError``."""
    try:
        rows = pd.read_csv(file, **options)
    except (OSError, ValueError) as error:
        raise ResultError(f"{file}: not a table of {what} ({error})") from None
    if missing := [c for c in needed if c not in rows]:
        raise ResultError(f"{file}: no columns {', '.join(missing)}")
    return rows


def rows_if_any(file: Path, what: str, columns: Sequence[str]) -> pd.DataFrame:
    """As ``read_rows``; no rows, with ``columns``, where there is no file."""
    return read_rows(file, what, columns) if file.exists() else pd.DataFrame(columns=list(columns))


def markdown_table(table: pd.DataFrame) -> str:
    """A table as markdown, with ``/`` for what would divide a cell; an empty one says that nothing was measured."""
    if table.empty:
        return "Not measured."
    header, *rows = [[str(v).replace("|", "/") for v in row] for row in (table.columns, *table.itertuples(index=False))]
    return tabulate(rows, header, tablefmt=_MARKDOWN, stralign=None, disable_numparse=True)


def text_table(header: Sequence[str], rows: Sequence[Sequence[str]], left: int = 0) -> str:
    """A table for the terminal, the first ``left`` columns to the left and the others to the right."""
    sides = [*["left"] * left, *["right"] * (len(header) - left)]
    return tabulate(rows, header, tablefmt="plain", colalign=sides, disable_numparse=True)


def shown(value: float, form: str) -> str:
    """A number in a format such as ``.1f`` or ``.0%``; a dash for one that is not known."""
    return format(value, form) if np.isfinite(value) else "-"


def number(value: float, digits: int = 1) -> str:
    """With so many digits behind the point."""
    return shown(value, f".{digits}f")


def signed_percent(value: float) -> str:
    """A share as a change in per cent."""
    return shown(value, "+.1%")


def percent(value: float) -> str:
    """A share in per cent, with two digits below one per cent."""
    return shown(value, ".2%" if abs(value) < 0.01 else ".1%")
