"""A file from a laboratory as a table of quantities with units.

What a file says itself is recognised, a key of the configuration overrules it, and everything that was understood is kept in
words. What could mean two things is refused with the key that settles it.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from limo.bench import units
from limo.bench.lines import Block, Body, Head, check_comments, check_texts, check_widths, find_body, find_head
from limo.bench.names import Meaning, Vocabulary, understand
from limo.bench.numbers import Numbers, to_numbers
from limo.bench.text import Cells, read_cells
from limo.errors import ConfigError
from limo.schema.bench import Layout


@dataclass(frozen=True)
class Column:
    """A column: its number from 1, what the file calls it, and its values (n,), numbers or texts.

    ``quantity`` is what it holds ("" where nobody said), ``unit`` its unit as written, found in ``unit_from``; ``rest`` is what
    else stands in or above its name, such as a specimen.
    """

    number: int
    name: str
    values: np.ndarray
    quantity: str = ""
    unit: str = ""
    unit_from: str = ""
    rest: str = ""


@dataclass(frozen=True)
class Table:
    """What was read of a file: its columns, and the line (n,), from 1, and the block (n,) of each row.

    ``comments``: lines that were left out as such. ``understood``: what was recognised, in words.
    """

    path: Path
    columns: list[Column]
    lines: np.ndarray
    block: np.ndarray
    blocks: list[Block]
    comments: list[str]
    understood: list[str] = field(default_factory=list)

    def of(self, quantity: str) -> list[Column]:
        """The columns that hold a quantity, from left to right."""
        return [c for c in self.columns if c.quantity == quantity]


def read_table(path: Path, layout: Layout, vocabulary: Vocabulary) -> Table:
    """Read a file. Raises ``ConfigError`` for what is no table, and for what is ambiguous with the key that settles it."""

    def meaning(text: str) -> Meaning | None:
        return understand(text, vocabulary)

    cells = read_cells(path, layout)
    numbers = to_numbers(cells, layout)
    body = find_body(cells, numbers, layout)
    head = find_head(cells, body, layout, meaning)
    words = _word_columns(head, layout, vocabulary)
    if words & set(body.numeric) or (words and any(_has_words(cells, j) for j in words)):
        body = find_body(cells, numbers, layout, words)
        head = find_head(cells, body, layout, meaning)
    notes = [*check_comments(cells, body, layout), *head.notes]
    try:
        check_widths(cells, body, head, vocabulary.example)
    except ConfigError:
        stated = [n for names in layout.columns.values() for n in (names if isinstance(names, list) else [names])]
        if not stated or not all(isinstance(n, int) for n in stated):
            raise
        nothing = [""] * len(head.names)  # names that do not fit name nothing
        head = replace(head, names=nothing, groups=nothing, units=nothing)
    table = _with_quantities(_assembled(cells, numbers, body, head), layout, vocabulary, numbers, head)
    used = [c.number - 1 for c in table.columns if c.quantity and c.number - 1 in body.numeric]
    notes += check_texts(cells, numbers, body, head, layout, used or body.numeric)
    return replace(table, understood=[*table.understood, *notes])


def _word_columns(head: Head, layout: Layout, vocabulary: Vocabulary) -> frozenset[int]:
    """The columns (from 0) that hold texts by what they are called, even where all of them look like numbers."""
    found = set()
    for j, name in enumerate(head.names):
        meant = understand(name, vocabulary) if name else None
        if meant and vocabulary.kinds.get(meant.default) == "text":
            found.add(j)
    for quantity, stated in layout.columns.items():
        for name in stated if isinstance(stated, list) else [stated]:
            at = name - 1 if isinstance(name, int) else next((j for j, n in enumerate(head.names) if _same(n, name)), -1)
            if 0 <= at < len(head.names):
                (found.add if vocabulary.kinds[quantity] == "text" else found.discard)(at)
    return frozenset(found)


def _has_words(cells: Cells, column: int) -> bool:
    return bool((cells.cells[column] != "").any())


def _same(one: str, other: str) -> bool:
    """Whether two names are the same but for their case and what stands in brackets behind one."""
    one, other = one.strip().casefold(), other.strip().casefold()
    return one == other or re.split(r"\s*[(\[]", one)[0] == other


def _assembled(cells: Cells, numbers: Numbers, body: Body, head: Head) -> Table:
    """The rows and columns of the blocks that are read."""
    at = np.concatenate([np.arange(b.start, b.stop) for b in head.blocks])
    block = np.repeat(np.arange(len(head.blocks)), [b.stop - b.start for b in head.blocks])
    columns = []
    for j in sorted([*body.numeric, *body.texts]):
        values = numbers.values[at, j] if j in body.numeric else cells.cells[j].to_numpy(object)[at].astype(str)
        columns.append(Column(j + 1, head.names[j] or f"column {j + 1}", values))
    where = f"names in line {head.line + 1}" if head.line is not None else "names in a comment" if head.named else "no names"
    where += "" if head.unit_line is None else f", units in line {head.unit_line + 1}"
    said = [f"{where}, {len(at)} rows in lines {at[0] + 1} to {at[-1] + 1}"]
    comments = list(cells.comments.values())
    return Table(cells.path, columns, at + 1, block, head.blocks, comments, [*cells.understood, *said])


def _with_quantities(table: Table, layout: Layout, vocabulary: Vocabulary, numbers: Numbers, head: Head) -> Table:
    """The same with the quantity and the unit of each column; those that keys state come first."""
    stated: dict[int, str] = {}
    for quantity, names in layout.columns.items():
        for name in names if isinstance(names, list) else [names]:
            stated[_number_of(table, quantity, name)] = quantity
    columns = []
    for column in table.columns:
        j = column.number - 1
        meant = understand(head.names[j], vocabulary) if head.names[j] else None
        unit, source = (head.units[j], "unit row") if head.units[j] else (meant.unit if meant else "", "in its name")
        if not unit and j in numbers.suffixes:
            unit, source = numbers.suffixes[j], "behind its values"
        quantity = stated.get(column.number) or _quantity(table, column, meant, unit, set(stated.values()), layout)
        if not unit and quantity and (bracket := re.findall(r"[(\[]([^()\[\]]+)[)\]]", head.names[j])):
            unit = next((b for b in bracket if units.is_unit(b, vocabulary.kinds[quantity])), "")
        if quantity in layout.units:
            own, unit = units.tidy(unit), str(layout.units[quantity])
            source = "key units" + (f" instead of {own}" if own and own != units.tidy(unit) else "")
        rest = " ".join(filter(None, (head.groups[j], meant.rest if meant else "")))
        columns.append(replace(column, quantity=quantity, unit=units.tidy(unit) if unit else "", unit_from=source, rest=rest))
    return replace(table, columns=columns)


def _quantity(table: Table, column: Column, meant: Meaning | None, unit: str, stated: set[str], layout: Layout) -> str:
    """What a column's name means, "" where nothing or something that a key states another column for."""
    if meant is None:
        return ""
    kinds = list(meant.by_kind)
    if not kinds:
        return "" if meant.default in stated else meant.default
    overruled = [q for q in meant.by_kind.values() if q in layout.units]
    if len(overruled) == 1 and not (unit and meant.quantity(unit) not in ("", overruled[0])):
        return "" if overruled[0] in stated else overruled[0]
    quantity = meant.quantity(unit)
    if not quantity and not stated & set(meant.by_kind.values()):
        expected = f"a unit of {' or of '.join(kinds)}; units says which it is"
        example = f"units: {{{meant.default}: {units.WANTED[kinds[0]]}}}"
        raise ConfigError(table.path, f"column {column.number} {column.name}", unit, expected, example)
    return "" if quantity in stated else quantity


def _number_of(table: Table, quantity: str, name: str | int) -> int:
    """The number of the column that a key names. Raises ``ConfigError`` where there is none, or more than one."""
    if isinstance(name, int):
        found = [c.number for c in table.columns if c.number == name]
    else:
        found = [c.number for c in table.columns if c.name == name] or [c.number for c in table.columns if _same(c.name, name)]
    if len(found) != 1:
        there = ", ".join(f"{c.number} {c.name}" for c in table.columns)
        what = "one column, by its number" if found else "a column of the file"
        example = f"columns: {{{quantity}: {(found or [table.columns[0].number])[0]}}}"
        raise ConfigError(table.path, f"columns.{quantity}", name, f"{what}; there are {there}", example)
    return found[0]


def is_assumed(column: Column) -> bool:
    """Whether the unit of a column is assumed because nobody said it."""
    return not column.unit


def in_wanted_unit(table: Table, column: Column, vocabulary: Vocabulary) -> tuple[np.ndarray, str]:
    """A column's values (n,) in the wanted unit of its quantity (``units.WANTED``), and in words what was taken for what.

    Raises ``ConfigError`` for a unit that is none, and for none at all where the name is not the quantity's own.
    """
    quantity, kind = column.quantity, vocabulary.kinds[column.quantity]
    wanted, where = units.WANTED[kind], f"column {column.number} {column.name}"
    if column.values.dtype.kind != "f":
        expected = f"numbers of {quantity}; columns says where they are"
        raise ConfigError(table.path, where, str(column.values[0]), expected, vocabulary.example)
    if is_assumed(column):
        own = re.sub(r"[\s._-]+", "_", column.name.strip().casefold())
        if quantity not in vocabulary.assumed or not re.fullmatch(rf"(\w+_)?{quantity}(_?\w+)?|column_\d+", own):
            expected = (
                f"a unit in its name, in a row below it or as a key: units says which; only {_assumed(vocabulary)} need none"
            )
            said = re.findall(r"[(\[][^()\[\]]+[)\]]", column.name)
            raise ConfigError(table.path, where, said[-1] if said else "no unit", expected, f"units: {{{quantity}: {wanted}}}")
        return column.values, f"{quantity}: {where}, in {wanted} (assumed, the file names no unit)"
    try:
        scale = units.factor(column.unit, kind)
    except ValueError:
        example = f"units: {{{quantity}: {wanted}}}"
        raise ConfigError(table.path, where, column.unit, f"a unit of {kind}; units says which it is", example) from None
    return column.values * scale, f"{quantity}: {where}, in {column.unit} ({column.unit_from})"


def _assumed(vocabulary: Vocabulary) -> str:
    return ", ".join(f"{q} ({units.WANTED[vocabulary.kinds[q]]})" for q in vocabulary.assumed if q != "time")
