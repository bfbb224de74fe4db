"""Which lines of a file are numbers, which name their columns and units, and which are neither."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from limo.bench import units
from limo.bench.numbers import Numbers
from limo.bench.text import Cells, fields_of, is_number
from limo.errors import ConfigError
from limo.schema.bench import Layout

#: lines of words above the numbers that are looked at
_HEAD = 8
#: rows of another table in the file, over those of the table that is read, up to which it is left out
_SMALL_SHARE = 0.2
_SUMMARY = re.compile(
    r"\W*(mean|average|avg|max\w*|min\w*|std\w*|s\.?d\.?|standard dev\w*|median|cov|mittelwert|moyenne|end\b.*|eof|sum|total|"
    r"count|n)\W*",
    re.IGNORECASE,
)
_SPECIMEN = re.compile(r"specimen|sample|coupon|prob|strip|test|run|prüf", re.IGNORECASE)


@dataclass(frozen=True)
class Body:
    """Which lines (n,) hold data, and which columns (from 0) numbers and which texts. Runs of such lines are blocks."""

    is_data: np.ndarray
    numeric: list[int]
    texts: list[int]

    @property
    def blocks(self) -> list[tuple[int, int]]:
        """First line of each block and the one behind its last, from 0."""
        edges = np.flatnonzero(np.diff(self.is_data.astype(np.int8), prepend=0, append=0))
        return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def find_body(cells: Cells, numbers: Numbers, layout: Layout, words: frozenset[int] = frozenset()) -> Body:
    """The lines of data. ``words``: columns that hold texts even where these look like numbers.

    Raises ``ConfigError`` for a file without any.
    """
    is_number, is_text = ~np.isnan(numbers.values), numbers.is_text.copy()
    for j in words:
        is_text[:, j] = (cells.cells[j] != "").to_numpy()
        is_number[:, j] = False
    allowed = np.ones(len(is_number), bool)
    if layout.data_rows:
        allowed[: max(layout.data_rows[0] - 1, 0)] = allowed[layout.data_rows[1] :] = False
    for key in ("header_row", "unit_row"):
        line = getattr(layout, key)
        if line and line > len(is_number):
            raise ConfigError(cells.path, key, line, f"a line of the file, which has {len(is_number)}", f"{key}: 1")
        if line:
            allowed[0 if key == "header_row" else line - 1 : line] = False
    counts = is_number[allowed].sum(0), is_text[allowed].sum(0)
    usual = _usual_kinds(is_number[allowed], is_text[allowed])
    numeric = [j for j in range(is_number.shape[1]) if counts[0][j] and (usual[j] == "N" or counts[0][j] > 2 * counts[1][j])]
    if not numeric:
        expected = "rows with two or more numbers; data_rows says which lines they are"
        raise ConfigError(cells.path, "(rows)", "no numbers", expected, "data_rows: [2, 100]")
    fits = allowed & is_number[:, numeric].any(1) & ~is_text[:, numeric].any(1)
    full = is_number[:, numeric].sum(1) >= min(2, len(numeric))
    run = np.cumsum(np.diff(fits, prepend=False) & fits)
    good = np.bincount(run[fits & full], minlength=run.max(initial=0) + 1) > 0
    is_data = fits & good[run]
    texts = [j for j in range(is_number.shape[1]) if j not in numeric and is_text[is_data, j].any()]
    return Body(is_data, numeric, texts)


def _usual_kinds(is_number: np.ndarray, is_text: np.ndarray) -> str:
    """The kinds of the cells of most lines that hold numbers: N a number, T a text, E nothing."""
    kinds = np.where(is_number, "N", np.where(is_text, "T", "E"))
    counts = is_number.sum(1)
    some = counts >= min(2, counts.max(initial=0))
    if not some.any() or not counts.max(initial=0):
        return "E" * kinds.shape[1]
    joined = np.ascontiguousarray(kinds[some]).view(f"U{kinds.shape[1]}").ravel()
    found, times = np.unique(joined, return_counts=True)
    return str(found[times.argmax()]).ljust(kinds.shape[1], "E")


@dataclass(frozen=True)
class Block:
    """A run of data lines from ``start`` to before ``stop`` (from 0): what stands above it, and whether names of its own do."""

    start: int
    stop: int
    label: str
    repeats: bool


@dataclass(frozen=True)
class Head:
    """The names of the columns, what stands above these, and their units, by column ("" where there is nothing).

    ``line``, ``unit_line``: where they were found (from 0). ``named``: how many cells the line of names has. ``blocks``: those
    that are read. ``notes``: what is said of lines that are not.
    """

    names: list[str]
    groups: list[str]
    units: list[str]
    line: int | None
    unit_line: int | None
    named: int
    blocks: list[Block]
    notes: list[str] = field(default_factory=list)


def find_head(cells: Cells, body: Body, layout: Layout, meaning: Callable[[str], object]) -> Head:
    """The lines above the data. ``meaning``: what a name means, None where it means nothing that is known.

    Raises ``ConfigError`` for a line that is not there, and for a second table.
    """
    return _Reader(cells, body, layout, meaning).head()


class _Reader:
    """Looks at the lines above each block."""

    def __init__(self, cells: Cells, body: Body, layout: Layout, meaning: Callable[[str], object]):
        self.cells, self.body, self.layout, self.meaning = cells, body, layout, meaning
        self.width = cells.cells.shape[1]
        self.stated = {str(n).casefold() for v in layout.columns.values() for n in (v if isinstance(v, list) else [v])}

    def row(self, line: int) -> list[str]:
        return [str(v).strip().strip('"').strip() for v in self.cells.cells.iloc[line]]

    def known(self, texts: list[str]) -> int:
        """How many of some texts are names of quantities."""
        return sum(t.casefold() in self.stated or self.meaning(t) is not None for t in texts if t)

    def above(self, start: int) -> list[int]:
        """Lines of words above a line, the nearest first, as far as the data before."""
        if start and not self.cells.fields[max(0, start - _HEAD) : start].any():
            return []
        found, k = [], start - 1
        while k >= 0 and len(found) < _HEAD and not self.body.is_data[k]:
            if any(self.row(k)):
                found.append(k)
            k -= 1
        return found

    def of_block(self, start: int) -> tuple[int | None, int | None, list[int]]:
        """The line of names, that of units, and the other lines above a block, each None where there is none."""
        sought = self.above(start)
        unit_line = next((k for k in sought if _holds_units(self.row(k))), None)
        rest = [k for k in sought if k != unit_line]
        scores = {k: self.known(self.row(k)) for k in rest}
        best = max(scores.values(), default=0)
        line = next((k for k in rest if scores[k] == best and best >= min(2, len(self.body.numeric))), None)
        if line is None:  # names that nobody knows: the nearest line with words in most columns
            enough = (len(self.body.numeric) + 1) // 2
            line = next((k for k in rest if sum(map(bool, self.row(k))) > enough), None)
        return line, unit_line, [k for k in rest if k != line]

    def head(self) -> Head:
        blocks = self.body.blocks
        found = [self.of_block(start) for start, _ in blocks]
        keys = [self.key(line) for line, _, _ in found]
        sizes: dict[tuple[str, ...] | None, int] = {}
        owners, owner = [], None
        for (start, stop), key in zip(blocks, keys, strict=True):
            owner = key or owner  # a block without names belongs to those above it
            owners.append(owner)
            sizes[owner] = sizes.get(owner, 0) + stop - start
        main = max(sizes, key=lambda key: sizes[key])
        first = owners.index(main)
        line, unit_line, others = found[first]
        line, unit_line = (self.stated_line(key, at) for key, at in (("header_row", line), ("unit_row", unit_line)))
        names, named = [""] * self.width, 0
        if line is not None:
            names, named = self.row(line), int(self.cells.fields[line])
        elif self.layout.header_row is None and (said := self.commented(blocks[first][0])):
            names, named = said + [""] * (self.width - len(said)), len(said)
        groups = _filled(self.row(line - 1)) if line is not None and line - 1 in others else [""] * self.width
        read, notes = [], []
        for k, ((start, stop), owner) in enumerate(zip(blocks, owners, strict=True)):
            if owner == main:
                label = " ".join(filter(None, self.row(found[k][2][0]))) if found[k][2] else ""
                read.append(Block(start, stop, label, keys[k] is not None))
            elif sizes[owner] > _SMALL_SHARE * sizes[main]:
                value = ", ".join(filter(None, owner or self.row(start)))[:80]
                expected = "one table in the file; data_rows says which lines are read"
                own = [block for block, other in zip(blocks, owners, strict=True) if other == main]
                example = f"data_rows: [{own[0][0] + 1}, {own[-1][1]}]"
                raise ConfigError(self.cells.path, f"line {start + 1}", value, expected, example)
            else:
                notes.append(f"lines {start + 1} to {stop} are another table and left out")
        found_units = [""] * self.width if unit_line is None else self.row(unit_line)
        return Head(names, groups, found_units, line, unit_line, named, read, notes)

    def key(self, line: int | None) -> tuple[str, ...] | None:
        """What tells the names of one table from those of another; None where a line is rather what a specimen is called."""
        if line is None:
            return None
        names, needed = self.row(line), min(2, len(self.body.numeric))
        words = [name for name in names if name and not is_number(name)]
        if self.known(names) < needed and (len(words) < len(self.body.numeric) or _SPECIMEN.search(words[0])):
            return None
        return tuple(name.casefold() for name in names)

    def stated_line(self, key: str, found: int | None) -> int | None:
        stated = getattr(self.layout, key)
        if stated is None:
            return found
        return stated - 1 if stated else None

    def commented(self, start: int) -> list[str] | None:
        """The cells of the last comment above a line where it has as many as the data."""
        before = [k for k in self.cells.comments if k < start]
        if not before:
            return None
        text = self.cells.comments[max(before)]
        for line in (text, re.sub(r"^[^\w\"]*", "", text)):  # the mark may be a name of its own, as of row numbers
            found = [c.strip() for c in fields_of(line, self.cells.separator)]
            if len(found) == len(self.body.numeric) + len(self.body.texts):
                return [re.sub(r"^[^\w\"]+(?=\w)", "", found[0]), *found[1:]]
        return None


def _holds_units(texts: list[str]) -> bool:
    filled = [t for t in texts if t]
    known = sum(units.is_any_unit(t) for t in filled)
    return known > 0 and 2 * known >= len(filled)


def _filled(texts: list[str]) -> list[str]:
    """Texts of merged cells: each holds to the right until the next."""
    found: list[str] = []
    for text in texts:
        found.append(text or (found[-1] if found else ""))
    return found


# --------------------------------------------------------------------------------------------------------------------
# what must fit


def check_comments(cells: Cells, body: Body, layout: Layout) -> list[str]:
    """What is said of comments among the data. Raises ``ConfigError`` for one that looks like a row with a name in front."""
    at = np.flatnonzero(body.is_data)
    inside = [k for k in cells.comments if k > at[0]]
    if layout.comment is None and body.texts and body.texts[0] == 0:
        for k in (k for k in cells.comments if k > at[0] - 2):
            parts = fields_of(cells.comments[k], cells.separator)
            if len(parts) == np.median(cells.fields[at]) and all(re.match(r"\s*[+-]?[\d.,]", parts[j]) for j in body.numeric):
                expected = 'comment: "" where it is data, comment: "#" where it is none'
                raise ConfigError(cells.path, f"line {k + 1}", cells.comments[k][:60], expected, 'comment: ""')
    return [f"{len(inside)} lines among the numbers are comments and left out"] if inside else []


def check_widths(cells: Cells, body: Body, head: Head, example: str) -> None:
    """Raises ``ConfigError`` where rows have more values than there are names, or fewer: it is unknown which is which then."""
    at = np.flatnonzero(body.is_data)
    names = max((j + 1 for j, name in enumerate(head.names) if name), default=0)
    if not names:
        return
    filled = (cells.cells.iloc[at] != "").to_numpy()
    values = np.where(filled.any(1), filled.shape[1] - np.argmax(filled[:, ::-1], axis=1), 0)
    usual = Counter(values.tolist()).most_common(1)[0][0]
    named = max(names, head.named)

    def refuse(row: int, expected: str, example: str) -> ConfigError:
        shown = " | ".join(map(str, cells.cells.iloc[at[row]])).rstrip(" |")[:60]
        return ConfigError(cells.path, f"line {at[row] + 1}", f"{values[row]} values: {shown}", expected, example)

    expected = f"as many values in a row as names above it, {names}"
    if usual > named:
        row = int(np.argmax(values == usual))
        if cells.separator == "," and usual == 2 * names:
            raise refuse(row, f"{expected}; where commas are decimal marks, something else between the columns", "1,25;12,7")
        raise refuse(row, f"{expected}; or columns with the numbers of those that hold something", example)
    if (values > named).any():
        row = int(np.argmax(values > named))
        raise refuse(row, f"at most {named} values in a row, as there are names", f"data_rows: [{at[0] + 1}, {at[row]}]")
    if np.median(cells.fields[at]) < names and not filled[:, names - 1].any():
        raise refuse(0, f"{expected}; or columns with the numbers of those that hold something", example)


def check_texts(cells: Cells, numbers: Numbers, body: Body, head: Head, layout: Layout, used: list[int]) -> list[str]:
    """What is said of lines below the data. Raises ``ConfigError`` for a text among the numbers of ``used`` columns."""
    if layout.data_rows:
        return []
    first, last = np.flatnonzero(body.is_data)[[0, -1]]
    before_names = {m for b in head.blocks if b.repeats for m in range(_end_before(body, b.start), b.start)}
    skipped = []
    for k in np.flatnonzero(~body.is_data[first:]) + first:
        has_number = not np.isnan(numbers.values[k, used]).all()
        bad = next((j for j in used if numbers.is_text[k, j]), None)
        if bad is not None and has_number and k not in before_names:
            texts = [str(v).strip() for v in cells.cells.iloc[k] if str(v).strip()]
            sums_up = k > last and any(_SUMMARY.fullmatch(t) for t in texts)
            if not sums_up and not _SPECIMEN.search(" ".join(texts)):
                name = head.names[bad] or f"column {bad + 1}"
                expected = f"a number in the column {name}, or nothing; data_rows says which lines are read"
                example = f"data_rows: [{first + 1}, {k}]"
                raise ConfigError(cells.path, f"line {k + 1}", cells.cells.iat[k, bad], expected, example)
        if k > last and (bad is not None or has_number or numbers.is_text[k].any()):
            skipped.append(k)
    return [f"lines {skipped[0] + 1} to {skipped[-1] + 1} below the numbers are left out"] if skipped else []


def _end_before(body: Body, line: int) -> int:
    """The line behind the last data before a line."""
    before = np.flatnonzero(body.is_data[:line])
    return int(before[-1]) + 1 if len(before) else 0
