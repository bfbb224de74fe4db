"""Numbers as laboratories write them: decimal marks, marks between thousands, gaps, units behind the number."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np
import pandas as pd

from limo.bench import units
from limo.bench.text import Cells
from limo.errors import ConfigError
from limo.schema.bench import Layout

#: what stands where a value is missing
GAPS = {
    *("", "nan", "na", "n/a", "#n/a", "#na", "null", "none", "-", "--", "---", "?", "inf", "-inf", "+inf"),
    *("1.#qnan", "1.#inf", "#div/0!", "#num!", "#value!"),
}
#: blanks and quotation marks around a cell
_EDGES = ' \t\f\v"'
_BODY = re.compile(r"[+-]?([\d.,' ]*\d[\d.,' ]*)(?:[eE][+-]?\d+)?")
_BEGIN = re.compile(r"[+-]?[\d.,]")
_THREES = {mark: re.compile(rf"[1-9]\d{{0,2}}(?:{re.escape(mark)}\d{{3}})+") for mark in ",. '"}


@dataclass(frozen=True)
class Numbers:
    """The numbers of a table (lines, columns), NaN where there is none, and where there is text instead.

    ``suffixes``: units that stand behind all numbers of a column, by column from 0.
    """

    values: np.ndarray
    is_text: np.ndarray
    suffixes: dict[int, str]
    decimal: str
    thousands: str


def to_numbers(table: Cells, layout: Layout) -> Numbers:
    """The cells of a table as numbers. Raises ``ConfigError`` where their marks mean one thing or another."""
    columns = [_plain(table.cells[j].to_numpy(object)) for j in table.cells]
    suffixes: dict[int, str] = {}
    for j, cells in enumerate(columns):
        columns[j], suffix = _without_suffix(cells)
        if suffix:
            suffixes[j] = suffix
    decimal, thousands = _marks(table, columns, layout)
    said = f"decimal mark {decimal}" + (f", {thousands!r} between thousands" if thousands else "")
    table.understood[0] += f", {said}"
    values = np.column_stack([_converted(cells, decimal, thousands) for cells in columns])
    is_text = np.isnan(values)
    for j, cells in enumerate(columns):
        at = np.flatnonzero(is_text[:, j])
        is_text[at, j] = [c.casefold() not in GAPS for c in cells[at]]
    return Numbers(values, is_text, suffixes, decimal, thousands)


def _plain(cells: np.ndarray) -> np.ndarray:
    """Cells with the minus, the blanks and the apostrophes of a keyboard, without quotation marks around them."""
    joined = "\0".join(cells)
    for wrong, right in (("\u2212", "-"), ("\xa0", " "), ("\u202f", " "), ("\u2009", " "), ("\u2019", "'")):
        joined = joined.replace(wrong, right)
    framed = f"\0{joined}\0"
    if any(f"\0{edge}" in framed or f"{edge}\0" in framed for edge in _EDGES):  # looked for at once: cells are many
        return np.array([c.strip(_EDGES) for c in joined.split("\0")], object)
    return np.array(joined.split("\0"), object)


def _without_suffix(cells: np.ndarray) -> tuple[np.ndarray, str]:
    """Cells without the unit that stands behind every number, and that unit."""
    first = _first_number(cells[:-50:-1]) or _first_number(pd.unique(cells[::-1]))
    found = re.fullmatch(r"[+-]?[\d.,]+(?:[eE][+-]?\d+)? ?([^\d\s.,;:+-][^\d\s.,;:]{0,7}\d?)", first)
    if not found or not units.is_any_unit(found[1]):
        return cells, ""
    if any(_BODY.fullmatch(c) for c in cells if not c.endswith(found[1])):
        return cells, ""
    cut = [c.removesuffix(found[1]).rstrip() if c.endswith(found[1]) and _BEGIN.match(c) else c for c in cells]
    return np.array(cut, object), found[1]


def _first_number(cells: np.ndarray) -> str:
    return next((c for c in cells if c and _BEGIN.match(c)), "")


def _bodies(cells: np.ndarray, mark: str) -> list[str]:
    """The digits and marks of those number-like cells that hold a mark."""
    return [found[1].strip() for c in cells if mark in c and (found := _BODY.fullmatch(c))]


def _marks(table: Cells, columns: list[np.ndarray], layout: Layout) -> tuple[str, str]:
    """The decimal mark and the mark between thousands ("" for none)."""
    stated = "" if layout.thousands in (None, "none") else layout.thousands
    if layout.decimal and layout.thousands:
        if layout.decimal == stated:
            raise ConfigError(table.path, "thousands", stated, "another mark than decimal", "thousands: none")
        return layout.decimal, stated
    commas = [_bodies(cells, ",") for cells in columns]
    spaced = next((m for m in " '" if any(_THREES[m].match(b) for c in columns for b in _bodies(c, m))), "")
    if layout.decimal:
        other = "." if layout.decimal == "," else ","
        grouped = any(_THREES[other].match(body) for cells in columns for body in _bodies(cells, other))
        return layout.decimal, spaced or (other if grouped and layout.thousands is None else "")
    if not any(commas):
        return _without_commas(table, columns, stated, spaced)
    every = [body for bodies in commas for body in bodies]
    seen_comma = next((b for b in every if _is_decimal(b, ",")), None)
    seen_dot = _first_decimal(columns, ".")
    if stated in (",", "."):
        return ("." if stated == "," else ","), stated
    if seen_comma and seen_dot:
        expected = "one decimal mark in all columns; decimal and thousands say which mark is which"
        raise ConfigError(table.path, "(numbers)", f"{seen_comma} and {seen_dot}", expected, 'decimal: ","')
    if seen_comma:
        dots = any(_THREES["."].match(body) for cells in columns for body in _bodies(cells, "."))
        return ",", "." if dots else spaced
    if seen_dot:
        return ".", ","
    if any(b.count(",") > 1 for b in every):
        return ".", ","
    dotted = next((body for cells in columns for body in _bodies(cells, ".")), None)
    if table.separator != "," and dotted is None and not any(map(_has_small_whole, columns, commas)):
        return ",", spaced  # a column in whole thousands alone does not begin at zero
    value = f"{every[0]} and {dotted}" if dotted else every[0]
    first = every[0]
    either = f"{first.replace(',', '.')} or {first.replace(',', '')}"
    expected = f"numbers that are clear: decimal or thousands says whether {first} is {either}"
    raise ConfigError(table.path, "(numbers)", value, expected, 'decimal: ","')


def _without_commas(table: Cells, columns: list[np.ndarray], stated: str, spaced: str) -> tuple[str, str]:
    """The same where no number holds a comma."""
    if stated == ".":
        return ",", "."
    if any(body.count(".") > 1 and _THREES["."].fullmatch(body) for cells in columns for body in _bodies(cells[:2000], ".")):
        return ",", "."
    if table.separator != "," and not _first_decimal(columns, "."):
        for cells in columns:
            dotted = _bodies(cells, ".")
            if dotted and _has_small_whole(cells, dotted):
                value = dotted[0]
                expected = f"numbers that are clear: decimal says whether {value} is {value} or {value.replace('.', '')}"
                raise ConfigError(table.path, "(numbers)", value, expected, "decimal: .")
    return ".", spaced or (stated if stated in (" ", "'") else "")


def _is_decimal(body: str, mark: str) -> bool:
    """Whether a mark in a number can be nothing but a decimal one."""
    other = "." if mark == "," else ","
    last = body.rpartition(mark)
    if other in body:
        return body.rfind(mark) > body.rfind(other) and body.count(mark) == 1
    return body.count(mark) == 1 and not _THREES[mark].fullmatch(body) and last[2].strip().isdigit() | (last[2] == "")


def _first_decimal(columns: list[np.ndarray], mark: str) -> str | None:
    for cells in columns:
        for c in cells:
            if mark in c and (found := _BODY.fullmatch(c)) and _is_decimal(found[1].strip(), mark):
                return found[1].strip()
    return None


def _has_small_whole(cells: np.ndarray, marked: list[str]) -> bool:
    """Whether a column with marks holds whole numbers from 1 to 999, too, as one with marks between thousands does."""
    return bool(marked) and any(c.lstrip("+-").isdigit() and 0 < len(c.lstrip("+-0")) <= 3 for c in cells)


def _converted(cells: np.ndarray, decimal: str, thousands: str) -> np.ndarray:
    """Cells (n,) as numbers, NaN where one is none."""
    texts = cells
    if thousands and any(thousands in c for c in cells):
        threes = re.compile(rf"[+-]?\d{{1,3}}(?:{re.escape(thousands)}\d{{3}})+(?:{re.escape(decimal)}\d*)?(?:[eE][+-]?\d+)?")
        texts = np.array([c.replace(thousands, "") if thousands in c and threes.fullmatch(c) else c for c in texts], object)
    if decimal == ",":
        joined = "\0".join("text" if "." in c else c for c in texts)
        texts = np.array(joined.replace(",", ".").split("\0"), object)
    found = pd.to_numeric(pd.Series(texts), errors="coerce").to_numpy(float)
    return np.where(np.isfinite(found), found, np.nan)
