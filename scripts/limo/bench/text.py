"""A file as lines of text and these as cells: encoding, comments, what stands between columns."""

from __future__ import annotations

import csv
import re
import statistics
from dataclasses import dataclass, field
from io import StringIO
from pathlib import Path

import numpy as np
import pandas as pd

from limo.errors import ConfigError
from limo.schema.bench import SEPARATORS, Layout

#: lines of a file that its separator is recognised by, and columns that no file has more of
_SAMPLE, _WIDEST = 120, 2000
#: how well an earlier separator must do, over the one that does best, to be taken
_CLEARLY = 0.85
#: letters beyond ASCII that names of columns and units have in western Europe, as code page 1252 has them
_USUAL = set("µ°²³±·×–—‘’“”…€éèêëàâäáåãçñöóòôõøüúùûíìîïßæœÄÖÜÉÈÀÅÇÑØÆ´`«»\xa0")
#: what a text may begin with to say how it is encoded
_MARKS = {
    b"\xef\xbb\xbf": "utf-8-sig", b"\xff\xfe\0\0": "utf-32", b"\0\0\xfe\xff": "utf-32", b"\xff\xfe": "utf-16",
    b"\xfe\xff": "utf-16",
}  # fmt: skip
_NUMBER = re.compile(r"[+\-\u2212]?(?:\d+(?:[.,']\d+)*[.,]?|[.,]\d+)(?:[eE][+-]?\d+)?")
_WITH_UNIT = re.compile(_NUMBER.pattern + r" ?[A-Za-z%µ]{1,4}")
_GROUPED = re.compile(r"[+\-\u2212]?\d{1,3}(?:[ \xa0\u202f]\d{3})+(?:[.,]\d+)?")


@dataclass(frozen=True)
class Cells:
    """A file's cells as texts (lines, columns), line 0 the first of the file; lines that were not read are empty.

    ``fields``: how many cells each line has, trailing empty ones included. ``comments``: the lines that were left out as such,
    by their number. ``understood``: what was recognised, in words.
    """

    path: Path
    cells: pd.DataFrame
    fields: np.ndarray
    separator: str
    comments: dict[int, str]
    understood: list[str] = field(default_factory=list)


def read_cells(path: Path, layout: Layout) -> Cells:
    """The cells of a text file. Raises ``ConfigError`` for one that is no text or has no columns."""
    text, encoding = _decoded(path, layout.encoding)
    lines = re.split(r"\r\n|\n|\r", text)
    stated = layout.separator and SEPARATORS.get(layout.separator, layout.separator)
    if lines and (directive := re.fullmatch(r'"?sep=(.)"?', lines[0].strip())):
        stated, lines[0] = stated or directive[1], ""
    mark = "#" if layout.comment is None else layout.comment
    comments = {k: line for k, line in enumerate(lines) if mark and line.lstrip().startswith(mark)}
    for k in comments:
        lines[k] = ""
    if not any(re.search(r"\d", line) for line in lines):
        if rows := [k for k, line in comments.items() if len(re.findall(r"\d+", line)) > 1]:
            expected = f"numbers in lines that do not begin with {mark}; comment says what a line that is no data begins with"
            raise ConfigError(path, f"line {rows[0] + 1}", comments[rows[0]][:60], expected, 'comment: ""')
        raise ConfigError(path, "(file)", "no numbers", "a CSV file with columns of numbers", "elongation,force\n1.0,12.7")
    _join_quoted(lines)
    separator = stated or _separator(path, lines)
    cells, fields = _split(path, lines, separator)
    name = {v: k for k, v in SEPARATORS.items()}.get(separator, repr(separator))
    found = "stated" if layout.separator else "recognised"
    return Cells(path, cells, fields, separator, comments, [f"{path.name}: {encoding}, {name} between columns ({found})"])


def _join_quoted(lines: list[str]) -> None:
    """Put lines together that are one between quotation marks, such as a name with its unit below it; empty ones stay."""
    for k, line in enumerate(lines[:-1]):
        if line.count('"') % 2 and any(other.count('"') % 2 for other in lines[k + 1 : k + 4]):
            lines[k], lines[k + 1] = "", f"{line} {lines[k + 1]}"


def _decoded(path: Path, encoding: str | None) -> tuple[str, str]:
    """The text of a file and how it is encoded."""
    try:
        raw = path.read_bytes()
    except OSError as error:
        raise ConfigError(path, "(file)", error.strerror or str(error), "a CSV file that can be read", "data: mine.csv") from None
    if encoding:
        try:
            return raw.decode(encoding).removeprefix("\ufeff"), encoding
        except UnicodeError as error:
            raise ConfigError(path, "encoding", encoding, f"the encoding of the file ({error})", "encoding: utf-8") from None
    if raw[:4] in (b"PK\x03\x04", b"\xd0\xcf\x11\xe0"):
        raise ConfigError(path, "(file)", "a workbook", "text: save its sheet as CSV", "data: mine.csv")
    for mark, name in _MARKS.items():
        if raw.startswith(mark):
            return _checked(path, raw, name)
    if b"\0" in raw[:4000]:
        sample = raw[:4000]
        zeros = sample[0::2].count(0), sample[1::2].count(0)
        if max(zeros) > 0.3 * len(sample) / 2 and min(zeros) == 0:
            return _checked(path, raw, "utf-16-be" if zeros[0] else "utf-16-le")
        raise ConfigError(path, "(file)", "no text", "a CSV file; encoding says how it is written", "encoding: utf-16-le")
    for name in ("ascii", "utf-8"):
        try:
            return raw.decode(name), name
        except UnicodeError:
            continue
    if set(text := raw.decode("cp1252", "replace")) - set(map(chr, range(128))) <= _USUAL:
        return text, "cp1252"
    from charset_normalizer import from_bytes

    best = from_bytes(raw[:100_000]).best()
    if best is None:
        raise ConfigError(path, "(file)", "no text", "a CSV file; encoding says how it is written", "encoding: cp1252")
    return _checked(path, raw, best.encoding)


def _checked(path: Path, raw: bytes, name: str) -> tuple[str, str]:
    try:
        return raw.decode(name).removeprefix("\ufeff"), name
    except UnicodeError as error:
        raise ConfigError(path, "encoding", name, f"the encoding of the file ({error})", "encoding: cp1252") from None


def is_number(text: str) -> bool:
    """Whether a text looks like a number, whatever its marks."""
    text = text.strip()
    return bool(_NUMBER.fullmatch(text) or _GROUPED.fullmatch(text))


def fields_of(line: str, separator: str) -> list[str]:
    """The cells of a line."""
    if separator == " ":
        return [part.strip('"') for part in re.findall(r'"[^"]*"|\S+', line)]
    try:
        return next(csv.reader([line], delimiter=separator, skipinitialspace=True), [])
    except csv.Error:
        return line.split(separator)


def _separator(path: Path, lines: list[str]) -> str:
    """What cuts most lines into the same number of cells, most of them numbers."""
    full = [line for line in lines[:: max(1, len(lines) // (4 * _SAMPLE))] if re.search(r"\d", line)]
    full = full or [line for line in lines if re.search(r"\d", line)]
    sample = [line[:20_000] for line in full[:: max(1, len(full) // _SAMPLE)]]
    scores: dict[str, float] = {}
    for separator in ("\t", ";", "|", ",", " "):
        rows = [[cell.strip() for cell in fields_of(line, separator)] for line in sample]
        rows = [_trimmed(row) for row in rows]
        count = statistics.mode(len(row) for row in rows)
        if count < 2:
            continue
        alike = [row for row in rows if len(row) == count]
        filled = [cell for row in alike for cell in row if cell]
        grouped = separator not in (",", " ")
        numbers = sum(bool(_NUMBER.fullmatch(c) or (grouped and _GROUPED.fullmatch(c))) for c in filled)
        if separator != " ":
            numbers += sum(bool(_WITH_UNIT.fullmatch(c)) for c in filled)
        scores[separator] = len(alike) / len(rows) * numbers / max(len(filled), 1)
    highest = max(scores.values(), default=0.0)
    if not highest:
        value = next((line for line in lines if line.strip()), "")[:60]
        expected = "two or more columns of numbers with the same mark between them in every line; separator says which"
        raise ConfigError(path, "(lines)", value, expected, 'separator: ";"')
    # blanks divide words as well, and commas decimals: they must be clearly better
    return next(separator for separator, score in scores.items() if score >= _CLEARLY * highest)


def _trimmed(row: list[str]) -> list[str]:
    """A row without its trailing empty cells."""
    while row and not row[-1]:
        row = row[:-1]
    return row


def _split(path: Path, lines: list[str], separator: str) -> tuple[pd.DataFrame, np.ndarray]:
    """All cells as texts, and how many each line has; long lines of words above a table are left out."""
    if separator == " ":
        lines = ["\t".join(fields_of(line, " ")) if line else "" for line in lines]
        separator = "\t"
    counts = np.array([line.count(separator) + 1 if line else 0 for line in lines])
    usual = statistics.mode(counts[counts > 1].tolist() or [1])
    if usual > _WIDEST:
        expected = f"at most {_WIDEST} columns; separator says what is between them"
        raise ConfigError(path, "(lines)", f"{usual} columns", expected, 'separator: ";"')
    for k in np.flatnonzero(counts > 2 * usual + 8):
        cells = fields_of(lines[k], separator)
        if sum(map(is_number, cells)) > len(cells) / 2:
            raise ConfigError(
                path, f"line {k + 1}", lines[k][:60], f"{usual} values, as in the other lines", "data_rows: [2, 100]"
            )
        lines[k], counts[k] = "", 0
    if any('"' in line for line in lines):
        counts = np.array([len(fields_of(line, separator)) if line else 0 for line in lines])
    width = int(max(counts.max(initial=1), 1))
    if width < 2:
        value = next((line for line in lines if line.strip()), "")[:60]
        raise ConfigError(path, "separator", value, "what is between the columns", 'separator: ";"')
    empty = separator * (width - 1)
    try:
        cells = pd.read_csv(
            StringIO("\n".join([line or empty for line in lines])), sep=separator, header=None, names=range(width),
            index_col=False, dtype=object, keep_default_na=False, na_filter=False, skip_blank_lines=False, skipinitialspace=True,
            engine="c",
        ).fillna("")  # fmt: skip
    except (ValueError, pd.errors.ParserError) as error:
        expected = "a table; separator says what is between its columns"
        raise ConfigError(path, "(lines)", str(error), expected, 'separator: ";"') from None
    if len(cells) != len(lines):
        if len(cells) > len(lines) or any(line for line in lines[len(cells) :]):
            expected = "every quotation mark closed in its own line"
            raise ConfigError(path, "(lines)", f"{len(cells)} rows in {len(lines)} lines", expected, '"strip 1",1.0,12.7')
        counts = counts[: len(cells)]
    return cells, counts
