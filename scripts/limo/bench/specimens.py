"""The specimens of a tensile test: side by side, one below the other, by name, or one file each."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from limo.bench.names import TENSILE
from limo.bench.table import Column, Table, in_wanted_unit, is_assumed, read_table
from limo.errors import ConfigError
from limo.schema.bench import SIZES, Coupon, TensileTest

#: a specimen has as many points
_FEWEST = 3
#: two columns say the same where their ratio is so close to the coupon's: length, or width times thickness
_SAME = 0.02
_LIKE_A_SPECIMEN = re.compile(r"specimen|sample|coupon|prob|strip|test|run|prüf|éprouvette", re.IGNORECASE)


@dataclass(frozen=True)
class Specimen:
    """Nominal strain and stress (n,) in MPa of a specimen in the order of its test, with the lines they are from.

    ``sizes``: which of length, width and thickness were used. ``assumed``: quantities whose unit nobody said. ``notes``: what was
    turned, sorted or left out.
    """

    name: str
    file: str
    strain: np.ndarray
    stress: np.ndarray
    lines: np.ndarray
    sizes: tuple[str, ...]
    assumed: tuple[str, ...]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Reading:
    """All specimens of a tensile test, and what was understood of its files, in words."""

    specimens: list[Specimen]
    understood: list[str]
    synthetic: bool


@dataclass(frozen=True)
class _Pair:
    """A column of elongation or strain and one of force or stress, both (n,) in mm, 1, N or MPa, and a name."""

    name: str
    far: np.ndarray
    hard: np.ndarray
    is_strain: bool
    is_stress: bool
    assumed: tuple[str, ...] = field(default=())


def read_specimens(test: TensileTest) -> Reading:
    """Read the files of a tensile test. Raises ``ConfigError`` for what cannot be read or could mean two things."""
    found, understood, synthetic = [], [], False
    for name in test.files:
        path = Path(name)
        table = read_table(path, test, TENSILE)
        own, said = _of_table(table, test)
        prefix = f"{path.stem} " if len(test.files) > 1 else ""
        alone = len(own) == 1 and not own[0].name
        found += [replace(s, name=path.stem if alone else f"{prefix}{s.name}") for s in own]
        understood += [*table.understood, *said]
        synthetic |= any("SYNTHETIC" in line for line in table.comments[:1])
    names = [s.name for s in found]
    twice = {n for n in names if names.count(n) > 1}
    found = [replace(s, name=f"{s.name} {k + 1}") if s.name in twice else s for k, s in enumerate(found)]
    names = [s.name for s in found]
    for key, listed in (("leave_out", test.leave_out), ("coupons", test.coupons)):
        for name in listed:
            if name not in names:
                raise ConfigError(test.files[0], key, name, f"a specimen of the test: {', '.join(names)}", f"{key}: [{names[0]}]")
    kept = [s for s in found if s.name not in test.leave_out]
    if not kept:
        raise ConfigError(test.files[0], "leave_out", test.leave_out, "at least one specimen that stays", "leave_out: []")
    if test.leave_out:
        understood.append(f"left out: {', '.join(test.leave_out)}")
    return Reading(kept, understood, synthetic)


def _of_table(table: Table, test: TensileTest) -> tuple[list[Specimen], list[str]]:
    pairs, said = _pairs(table, test)
    found = []
    for pair in pairs:
        for label, rows, notes in _rows_of(table, pair, test):
            name = " ".join(filter(None, (pair.name, label)))
            one = _specimen(table, pair, rows, name, test)
            if one is not None:
                found.append(replace(one, notes=(*notes, *one.notes)))
    if not found:
        expected = f"{_FEWEST} or more rows with an elongation and a force"
        raise ConfigError(table.path, "(rows)", len(table.lines), expected, "elongation,force\n1.0,12.7\n2.0,25.4\n3.0,38.1")
    if len(found) > 1:
        found = [replace(s, name=s.name or str(k + 1)) for k, s in enumerate(found)]
        said.append(f"{len(found)} specimens: {', '.join(s.name for s in found)}")
    said += [f"{s.name or table.path.stem}: {note}" for s in found for note in s.notes]
    return found, said


# --------------------------------------------------------------------------------------------------------------------
# which columns belong together


def _pairs(table: Table, test: TensileTest) -> tuple[list[_Pair], list[str]]:
    """Every pair of columns that is a specimen's or several specimens' one below the other."""
    far, far_said = _one_of(table, test, "elongation", "strain")
    hard, hard_said = _one_of(table, test, "force", "stress")
    said = [*far_said, *hard_said]
    if len(far) == 1:
        far = far * len(hard)
    if len(far) != len(hard):
        value = f"{len(far)} of {far[0][0].quantity}, {len(hard)} of {hard[0][0].quantity}"
        example = f"columns: {{{far[0][0].quantity}: {far[0][0].number}, {hard[0][0].quantity}: {hard[0][0].number}}}"
        raise ConfigError(table.path, "columns", value, "a pair for each specimen; columns says which belong together", example)
    names = [h[0].rest for h in hard]
    if len(set(names)) == len(names) and {f[0].rest for f in far} == set(names):
        far = sorted(far, key=lambda f: names.index(f[0].rest))
    alone = len(hard) == 1
    unique = len({n for n in names if n}) == len(names)
    others = [f[0].rest for f in far]
    if not unique and len({n for n in others if n}) == len(others) > 1:
        names, unique = others, True
    found = []
    for k, ((a, x), (b, y)) in enumerate(zip(far, hard, strict=True)):
        name = "" if alone else names[k] if unique else str(k + 1)
        assumed = tuple(c.quantity for c in (a, b) if is_assumed(c))
        found.append(_Pair(name, x, y, a.quantity == "strain", b.quantity == "stress", assumed))
    return found, said


def _one_of(table: Table, test: TensileTest, absolute: str, relative: str) -> tuple[list[tuple[Column, np.ndarray]], list[str]]:
    """The columns of a quantity or of the same over the coupon's size, with values in wanted units.

    Where a file has both they must agree, or a key must say which one counts.
    """
    stated = [q for q in (absolute, relative) if q in test.columns]
    wanted = stated or [absolute, relative]
    columns = {q: table.of(q) for q in wanted if table.of(q)}
    if not columns:
        there = ", ".join(f"{c.number} {c.name}" for c in table.columns)
        expected = f"a column of {absolute} or {relative}; columns says which it is; there are {there}"
        free = [c.number for c in table.columns if not c.quantity and c.values.dtype.kind == "f"]
        pair = {"elongation": 1, "force": 2} if len(free) < 2 else {"elongation": free[0], "force": free[1]}
        example = ", ".join(f"{q}: {n}" for q, n in pair.items() if q == absolute or not table.of(q))
        raise ConfigError(table.path, "columns", "no such name", expected, f"columns: {{{example}}}")
    read = {q: [(c, *in_wanted_unit(table, c, TENSILE)) for c in found] for q, found in columns.items()}
    if len(read) == 2:
        _check_agreement(table, test, read[absolute], read[relative])
        del read[relative]
    (found,) = read.values()
    return [(c, values) for c, values, _ in found], [said for _, _, said in found]


def _check_agreement(table: Table, test: TensileTest, absolute: list, relative: list) -> None:
    if len(absolute) == len(relative):
        size, of = (test.length, "length") if absolute[0][0].quantity == "elongation" else (test.width * test.thickness, "area")
        if test.coupons:
            return
        for (a, x, _), (b, y, _) in zip(absolute, relative, strict=True):
            big = np.abs(x) > 0.2 * np.nanmax(np.abs(x), initial=0.0)
            ratio = float(np.nanmedian(y[big] * size / x[big])) if big.any() else np.nan
            if not abs(abs(ratio) - 1) < _SAME:
                value = f"{b.name} is {ratio:.3g} times {a.name} over the {of} of the coupon"
                expected = f"two columns that agree; columns says which counts, {a.name} or {b.name}"
                raise ConfigError(table.path, "columns", value, expected, f"columns: {{{a.quantity}: {a.number}}}")
        return
    a, b = absolute[0][0], relative[0][0]
    value = f"{len(absolute)} of {a.quantity}, {len(relative)} of {b.quantity}"
    example = f"columns: {{{a.quantity}: {a.number}}}"
    raise ConfigError(table.path, "columns", value, "one of them for each specimen; columns says which counts", example)


# --------------------------------------------------------------------------------------------------------------------
# which rows belong together


def _rows_of(table: Table, pair: _Pair, test: TensileTest) -> Iterator[tuple[str, np.ndarray, tuple[str, ...]]]:
    """Name, rows and notes of each specimen of a pair of columns."""
    usable = np.flatnonzero(np.isfinite(pair.far) & np.isfinite(pair.hard))
    lost = int((np.isfinite(pair.far) ^ np.isfinite(pair.hard)).sum())
    notes = (f"{lost} rows have only one of two values and are left out",) if lost else ()
    if test.specimens == "one":
        yield "", usable, notes
        return
    named = table.of("specimen")
    if len(named) > 1:
        there = ", ".join(f"{c.number} {c.name}" for c in named)
        example = f"columns: {{specimen: {named[0].number}}}"
        raise ConfigError(table.path, "columns.specimen", there, "one column with the names of the specimens", example)
    if named:
        labels = named[0].values
        for label in dict.fromkeys(labels[usable].tolist()):
            yield label, usable[labels[usable] == label], notes
        return
    if test.specimens == "auto":
        _check_text_columns(table, usable)
    parts = _pulls(pair, usable) if test.specimens == "stacked" else _parts(table, pair, usable)
    for k, (label, rows) in enumerate(parts):
        yield label or (str(k + 1) if len(parts) > 1 else ""), rows, notes if k == 0 else ()


def _check_text_columns(table: Table, usable: np.ndarray) -> None:
    """A column of texts that nobody named may be that of the specimens."""
    for column in table.columns:
        if column.quantity or column.values.dtype.kind == "f":
            continue
        texts, counts = np.unique(column.values[usable].astype(str), return_counts=True)
        if len(texts) > 1 and counts.min() >= _FEWEST:
            value = ", ".join(texts[:4])
            expected = f"to know what {column.name} tells apart: columns says whether it names specimens; else specimens: one"
            raise ConfigError(
                table.path, f"column {column.number} {column.name}", value, expected, f"columns: {{specimen: {column.number}}}"
            )


def _pulls(pair: _Pair, usable: np.ndarray) -> list[tuple[str, np.ndarray]]:
    """Rows one below the other, cut wherever elongation has gone back by half of its range and rises again."""
    far = pair.far[usable]
    if len(far) and far[int(np.argmax(np.abs(pair.hard[usable])))] < far[0]:
        far = -far  # counted downwards
    starts, high, low, whole = [0], 0, None, np.ptp(far) if len(far) else 0.0
    for k in range(1, len(far)):
        if low is None:
            high = k if far[k] > far[high] else high
            low = k if far[high] - far[k] > 0.5 * whole else None
        elif far[k] <= far[low]:
            low = k
        elif far[k] - far[low] > 0.1 * whole:
            starts.append(low)
            high, low = k, None
    return [("", usable[a:b]) for a, b in zip(starts, [*starts[1:], len(usable)], strict=True)]


def _parts(table: Table, pair: _Pair, usable: np.ndarray) -> list[tuple[str, np.ndarray]]:
    """Rows one below the other, cut where another specimen begins: by a line of words, or where elongation starts again."""
    if not len(usable):
        return []
    starts, labels = [0], [table.blocks[table.block[usable[0]]].label]
    far, block = pair.far[usable], table.block[usable]
    whole = np.ptp(far) or 1.0
    mixed = _is_mixed(far)
    may_begin = (block[1:] != block[:-1]) | (far[:-1] - far[1:] >= 0.1 * whole)
    for k in (np.flatnonzero(may_begin) + 1).tolist() if not mixed else ():
        before = far[starts[-1] : k]
        # counted from where it starts, whichever way it is counted
        back = abs(before[-1] - before[0]) - abs(far[k] - before[0])
        again = back > 0.5 * (np.ptp(before) or np.inf)
        new_block = block[k] != block[k - 1]
        label = table.blocks[block[k]].label if new_block else ""
        rest = far[k : k + np.argmax(np.append(block[k:], -1) != block[k])]
        goes_on = len(rest) >= _FEWEST and np.ptp(rest) > 0.2 * np.ptp(before)
        if (again and (new_block or goes_on)) or (label and _LIKE_A_SPECIMEN.search(label)):
            starts.append(k)
            labels.append(label)
    ends = [*starts[1:], len(usable)]
    found = [(label, usable[a:b]) for a, b, label in zip(starts, ends, labels, strict=True)]
    return found if len(found) > 1 else [("", usable)]


def _is_mixed(far: np.ndarray) -> bool:
    """Whether elongations stand in no order at all."""
    if len(far) < 8:
        return False
    steps = np.diff(far)
    falling = float(np.mean(steps < 0))
    return 0.25 < falling < 0.75 and float(np.median(np.abs(steps))) > 0.1 * np.ptp(far)


# --------------------------------------------------------------------------------------------------------------------
# one specimen


def _specimen(table: Table, pair: _Pair, rows: np.ndarray, name: str, test: TensileTest) -> Specimen | None:
    """Strain and stress of some rows, in the order of the test and with tension positive; None for too few rows."""
    if len(rows) < _FEWEST:
        return None
    far, hard, lines = pair.far[rows], pair.hard[rows], table.lines[rows]
    notes = []
    if _is_mixed(far):
        order = np.argsort(far, kind="stable")
        far, hard, lines = far[order], hard[order], lines[order]
        notes.append("rows in no order: sorted by elongation")
    if test.sign == "turn" or (test.sign == "auto" and -hard.min() > hard.max()):
        hard = -hard
        notes.append(
            "forces were negative: turned, so that tension counts positive" if test.sign == "auto" else "forces turned (key sign)"
        )
    peak = int(np.argmax(hard))
    if test.sign == "auto" and peak < len(hard) / 10 and far[-1] < far[peak] - 0.5 * np.ptp(far) and _falls(far):
        far, hard, lines = far[::-1], hard[::-1], lines[::-1]
        notes.append("rows from the last to the first: turned round")
        peak = len(hard) - 1 - peak
    if peak and far[peak] < far[0]:
        far = -far
        notes.append("elongation was counted downwards: turned")
    coupon = test.coupons.get(name, Coupon())
    length, width, thickness = (getattr(coupon, key) or getattr(test, key) for key in SIZES)
    if not pair.is_strain:
        far = far / length
    if abs(far[0]) > 0.5 and np.ptp(far) < abs(far[0]):
        notes.append(f"strain counted from its first value, {far[0]:.4g}: the column holds lengths or positions")
        far = far - far[0]
    sizes = () if pair.is_strain else ("length",)
    if not pair.is_stress:
        hard, sizes = hard / (width * thickness), (*sizes, "width", "thickness")
    _check_pulls(table, far, hard, lines, test.specimens)
    return Specimen(name, str(table.path), far, hard, lines, sizes, pair.assumed, tuple(notes))


def _falls(far: np.ndarray) -> bool:
    return bool(np.mean(np.diff(far) <= 0) > 0.9)


def _check_pulls(table: Table, far: np.ndarray, hard: np.ndarray, lines: np.ndarray, specimens: str) -> None:
    """Loading and unloading before the largest force is no single pull, and another pull behind it may be another specimen's."""
    if len(far) < 6:
        return
    peak, whole = int(np.argmax(hard)), np.ptp(far)
    back = np.maximum.accumulate(far[: peak + 1]) - far[: peak + 1]
    if back.max() > 0.2 * whole:
        turned = int(np.argmax(far[: int(np.argmax(back)) + 1]))
        expected = "one pull, in which elongation does not go back before the largest force; data_rows says which lines are it, "
        expected += "specimens: stacked that each pull is a specimen's"
        example = f"data_rows: [{lines[0]}, {lines[turned]}]"
        raise ConfigError(table.path, f"line {lines[turned]}", "elongation goes back", expected, example)
    after, strong = far[peak:], hard[peak:] > 0.3 * hard[peak]
    again = after - np.minimum.accumulate(after)
    least = int(np.argmin(after[: int(np.argmax(again)) + 1]))
    if specimens == "auto" and again.max() > 0.2 * whole and after[0] - after[least] > 0.2 * whole and strong[least:].any():
        expected = "one pull; specimens: stacked says that each pull is a specimen's, specimens: one that the first is meant"
        raise ConfigError(table.path, f"line {lines[peak + least]}", "elongation starts again", expected, "specimens: stacked")
