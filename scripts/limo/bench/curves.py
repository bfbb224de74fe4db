"""Measured pressure-volume curves of a device: pressures in kPa, volumes in ml, loops told apart by direction and cycle."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pandas as pd

from limo.bench import units
from limo.bench.names import CURVES
from limo.bench.table import Column, Table, in_wanted_unit, is_assumed, read_table
from limo.errors import ConfigError
from limo.measure.efficiency import efficiency_at_stroke
from limo.schema.bench import MeasuredCurves

#: columns of the table of measured curves
COLUMNS = (
    *("label", "n_pouches", "ventricular_pressure", "cycle", "direction", "actuation_pressure", "actuation_volume_change"),
    *("stroke_volume", "io_ratio", "efficiency"),
)
LOADING, UNLOADING = "loading", "unloading"
#: P_v (kPa) that count as equal
SAME_PRESSURE = 0.25
#: Delta V_a in ml up to which a ratio of two small volumes says nothing
SMALLEST_CHANGE = 1.0
#: share of the range by which a pressure must go back for a loop to turn
_TURN = 0.1
#: pressures (kPa) and volumes (ml) that are believed of files that name no unit, where no study says more
_PRESSURES, _VOLUMES = (1.0, 150.0), (1.0, 2000.0)
#: pressures (kPa) of the air, from which absolute ones begin
_AIR = (90.0, 110.0)
#: units that are tried where a pressure or a volume is too large or too small
_LARGER = {"pressure": ("mmHg", "cmH2O", "mbar", "Pa"), "volume": ("ul", "ml")}
_SMALLER = {"pressure": ("psi", "bar", "MPa"), "volume": ("oz", "l")}


@dataclass(frozen=True)
class Expected:
    """What a study leads to expect: pressures (kPa) and volumes (ml) of its device, and the P_v and N_p that it simulates."""

    pressures: tuple[float, float] = _PRESSURES
    volumes: tuple[float, float] = _VOLUMES
    ventricular_pressures: tuple[float, ...] = ()
    n_pouches: tuple[int, ...] = ()


@dataclass(frozen=True)
class Curves:
    """Measured curves: a row a point, with the columns of ``COLUMNS``; what was not measured is NaN.

    ``cycle`` counts from 1, ``direction`` is loading or unloading. ``understood``: what was recognised, in words.
    """

    table: pd.DataFrame
    understood: list[str] = field(default_factory=list)

    @property
    def labels(self) -> list[str]:
        """The names of the curves in their order."""
        return self.table.label.unique().tolist()

    def measured(self, name: str) -> bool:
        """Whether a quantity was measured at all."""
        return bool(self.table[name].notna().any())


def read_curves(measured: MeasuredCurves, expected: Expected | None = None) -> Curves:
    """Read measured curves. Raises ``ConfigError`` for what cannot be read or could mean two things.

    Volumes that the file gives as such are turned into changes from where each curve begins; strokes and changes that are mostly
    negative are turned round.
    """
    expected = expected or Expected()
    table = read_table(Path(measured.data), measured, CURVES)
    parts = list(_curves_of(table))
    said = list(dict.fromkeys(note for _, _, notes in parts for note in notes))
    source = _Source(table, measured, expected, said)
    frames = []
    for label, values, _ in parts:
        for name, rows in _by_label(table, label, values):
            frames.append(_frame(source, name, {k: v[rows] for k, v in values.items()}, rows))
    frames = [frame for frame in frames if len(frame)]
    if not frames:
        raise ConfigError(table.path, "(rows)", len(table.lines), "rows with an actuation pressure", ",".join(COLUMNS[5:8]))
    found = pd.concat(frames, ignore_index=True)
    _check_numbers(table, found)
    said += _check_ranges(source, found)
    stated = {n: e for n, e in measured.efficiency.items() if not (found.n_pouches == n).any()}
    if stated:
        rows = [
            {"label": f"N_p = {n}", "n_pouches": n, "cycle": 1, "direction": LOADING, "efficiency": e} for n, e in stated.items()
        ]
        found = pd.concat([found, pd.DataFrame(rows)], ignore_index=True)
    return Curves(found.reindex(columns=COLUMNS), [*table.understood, *said, _summary(found)])


def _summary(found: pd.DataFrame) -> str:
    names = found.label.unique().tolist()
    listed = ", ".join(names[:6]) + (", ..." if len(names) > 6 else "")
    cycles = f", up to {int(found.cycle.max())} cycles" if found.cycle.max() > 1 else ""
    loops = ", loading and unloading" if (found.direction == UNLOADING).any() else ""
    return f"{len(names)} curve{'s' if len(names) > 1 else ''} ({listed}){cycles}{loops}"


# --------------------------------------------------------------------------------------------------------------------
# which columns and rows are a curve

_VALUES = (
    *("actuation_pressure", "ventricular_pressure", "actuation_volume_change", "stroke_volume"),
    *("actuation_volume", "ventricle_volume"),
)


@dataclass(frozen=True)
class _Source:
    """A file of curves, what the configuration says of it, what is expected, and what is said of it meanwhile."""

    table: Table
    measured: MeasuredCurves
    expected: Expected
    said: list[str]


def _curves_of(table: Table) -> Iterator[tuple[str, dict[str, np.ndarray], list[str]]]:
    """Name, values by quantity (each (n,) in kPa and ml) and notes of each set of columns."""
    columns = {name: table.of(name) for name in _VALUES if table.of(name)}
    for change, absolute in (("actuation_volume_change", "actuation_volume"), ("stroke_volume", "ventricle_volume")):
        if change in columns:
            columns.pop(absolute, None)
    there = ", ".join(f"{c.number} {c.name}" for c in table.columns)
    if "actuation_pressure" not in columns:
        expected = f"a column of actuation_pressure; columns says which it is; there are {there}"
        raise ConfigError(table.path, "columns", "no such name", expected, "columns: {actuation_pressure: 1}")
    volumes = [name for name in columns if name.endswith(("volume", "change"))]
    if not volumes and not table.of("efficiency"):
        expected = f"a column of stroke_volume or actuation_volume_change; columns says which it is; there are {there}"
        raise ConfigError(table.path, "columns", "no such name", expected, "columns: {stroke_volume: 2}")
    count = max(len(found) for found in columns.values())
    for name, found in columns.items():
        if len(found) not in (1, count) or (len(found) == 1 < count and name in volumes):
            value = f"{len(found)} of {name}, {count} of others"
            example = f"columns: {{{name}: {found[0].number}}}"
            raise ConfigError(
                table.path, "columns", value, "one of each for a curve; columns says which belong together", example
            )
    rests = [c.rest for c in columns[volumes[0]]] if volumes else [""]
    names = rests if len({r for r in rests if r}) == count else [str(k + 1) for k in range(count)]
    for k in range(count):
        values, notes = {}, []
        for name, found in columns.items():
            values[name], note = in_wanted_unit(table, found[k if len(found) == count else 0], CURVES)
            notes.append(note)
        for name in ("n_pouches", "cycle", "efficiency", "time"):
            if (column := next(iter(table.of(name)), None)) is not None and column.values.dtype.kind == "f":
                values[name] = column.values
        if (efficiency := next(iter(table.of("efficiency")), None)) is not None:
            values["efficiency"], note = _efficiency(table, efficiency)
            notes.append(note)
        yield (names[k] if count > 1 else ""), values, notes


def _efficiency(table: Table, column: Column) -> tuple[np.ndarray, str]:
    """Efficiencies as shares: above 1 they are in per cent where no unit is named. Raises ``ConfigError`` beyond 100 %."""
    if not is_assumed(column):
        shares, note = in_wanted_unit(table, column, CURVES)
    else:
        unit = "%" if np.nanmax(column.values, initial=0.0) > 1.0 else "1"
        shares, note = column.values * units.factor(unit, "strain"), f"in {unit} (by its values)"
        note = f"efficiency: column {column.number} {column.name}, {note}"
    if len(wrong := shares[(shares < 0) | (shares > 1)]):
        expected = "shares from 0 to 1, or per cent from 0 to 100; units says which"
        raise ConfigError(table.path, "efficiency", f"{wrong[0]:.4g}", expected, "units: {efficiency: '%'}")
    return shares, note


def _by_label(table: Table, label: str, values: Mapping[str, np.ndarray]) -> Iterator[tuple[str, np.ndarray]]:
    """Name and rows of each curve of a set of columns."""
    usable = np.isfinite(values["actuation_pressure"])
    named = table.of("label")
    if named:
        texts = named[0].values.astype(str)
        for text in dict.fromkeys(texts[usable].tolist()):
            yield " ".join(filter(None, (text, label))), np.flatnonzero(usable & (texts == text))
        return
    blocks = [table.blocks[k].label for k in range(len(table.blocks))]
    if len(blocks) > 1 and len(set(filter(None, blocks))) == len(blocks):
        for k, text in enumerate(blocks):
            yield " ".join((text, label)).strip(), np.flatnonzero(usable & (table.block == k))
        return
    if "n_pouches" in values and len(counts := dict.fromkeys(values["n_pouches"][usable & np.isfinite(values["n_pouches"])])) > 1:
        for count in counts:
            yield " ".join(filter(None, (f"N_p = {count:g}", label))), np.flatnonzero(usable & (values["n_pouches"] == count))
        return
    yield label or table.path.stem, np.flatnonzero(usable)


# --------------------------------------------------------------------------------------------------------------------
# one curve


def _frame(source: _Source, label: str, values: dict[str, np.ndarray], rows: np.ndarray) -> pd.DataFrame:
    """The points of one curve."""
    table, measured, expected, said = source.table, source.measured, source.expected, source.said
    pressure = values["actuation_pressure"]
    if len(pressure) and -pressure.min() > pressure.max():
        pressure = -pressure
        said.append(f"{label}: actuation_pressure was negative: turned")
    if _is_mixed(pressure) and "time" not in values:
        order = np.argsort(pressure, kind="stable")
        values, rows, pressure = {k: v[order] for k, v in values.items()}, rows[order], pressure[order]
        said.append(f"{label}: rows in no order: sorted by pressure")
    cycle, direction = _turns(pressure)
    if "cycle" in values and np.isfinite(values["cycle"]).all():
        _, cycle = np.unique(values["cycle"], return_inverse=True)
        cycle = cycle + 1
        direction = np.concatenate([_turns(pressure[cycle == k])[1] for k in np.unique(cycle)]) if _in_order(cycle) else direction
    if stated := _stated_direction(table, rows):
        direction = np.array(stated)
    elif len(pressure) > 1 and (direction == UNLOADING).all() and "time" not in values:
        direction = np.full(len(pressure), LOADING)
        said.append(f"{label}: rows from the highest to the lowest pressure, taken for loading")
    volumes = {}
    for change, absolute, sign in (("actuation_volume_change", "actuation_volume", 1), ("stroke_volume", "ventricle_volume", -1)):
        volume = values.get(change)
        if volume is None and absolute in values:
            volume = sign * (values[absolute] - _first(values[absolute], pressure))
            said.append(f"{label}: {change} from {absolute}, counted from where the curve begins")
        if volume is not None and np.isfinite(volume).any() and -np.nanmin(volume) > np.nanmax(volume):
            volume = -volume
            said.append(f"{label}: {change} was negative: turned")
        volumes[change] = np.full(len(pressure), np.nan) if volume is None else volume
    large = np.abs(volumes["actuation_volume_change"]) > SMALLEST_CHANGE
    ratio = np.where(large, volumes["stroke_volume"] / np.where(large, volumes["actuation_volume_change"], 1.0), np.nan)
    count = _number(measured.n_pouches, label, "n_pouches", values, r"\bn_?p?\s*[=_ ]?\s*(\d+)\b|\b(\d+)\s*pouch")
    if np.isnan(count) and len(expected.n_pouches) == 1:
        count = float(expected.n_pouches[0])
        said.append(f"{label}: N_p = {count:g} taken, as in the study; n_pouches says another")
    ventricular = _number(measured.ventricular_pressure, label, "ventricular_pressure", values, r"\bp_?v\s*=?\s*([\d.]+)")
    if np.isnan(ventricular) and len(expected.ventricular_pressures) == 1:
        ventricular = expected.ventricular_pressures[0]
        said.append(f"{label}: P_v = {ventricular:g} kPa taken, as in the study; ventricular_pressure says another")
    efficiency = values.get("efficiency", np.array([np.nan]))
    known = efficiency[np.isfinite(efficiency)]
    if count in measured.efficiency:
        known = [measured.efficiency[int(count)]]
    frame = pd.DataFrame(
        {"label": label, "n_pouches": count, "ventricular_pressure": ventricular, "cycle": cycle, "direction": direction}
        | {"actuation_pressure": pressure, **volumes, "io_ratio": ratio}
    )
    return frame.assign(efficiency=float(known[0]) if len(known) else _efficiency_of(frame, ventricular))


def _efficiency_of(frame: pd.DataFrame, ventricular_pressure: float) -> float:
    """eta at a stroke of 90 ml from the volumes of a curve, mean over its loadings; NaN where P_v or a volume is unknown."""
    names = ["actuation_pressure", "stroke_volume", "actuation_volume_change"]
    found = []
    for _, branch in frame[frame.direction == LOADING].dropna(subset=names).groupby("cycle"):
        if len(branch) > 2 and np.isfinite(ventricular_pressure):
            pressure, stroke, change = (branch[n].to_numpy(float) for n in names)
            found.append(efficiency_at_stroke(pressure, ventricular_pressure, stroke, change - change[0])[0])
    return float(np.nanmean(found)) if np.isfinite(found).any() else float("nan")


def _first(volume: np.ndarray, pressure: np.ndarray) -> float:
    """A volume where its curve begins: the first point that is as low in pressure as any but for a tenth of the range."""
    known = np.flatnonzero(np.isfinite(volume))
    if not len(known):
        return float("nan")
    low = pressure[known] <= pressure[known].min() + _TURN * np.ptp(pressure[known])
    return float(volume[known[int(np.argmax(low))]])


def _number(stated: object, label: str, name: str, values: Mapping[str, np.ndarray], pattern: str) -> float:
    """A number of a whole curve: by a key, from its column, or from its label; NaN where nobody says it."""
    if isinstance(stated, dict):
        stated = stated.get(label)
    if stated is not None:
        return float(stated)
    if name in values and np.isfinite(values[name]).any():
        return float(np.nanmedian(values[name]))
    found = re.search(pattern, label, re.IGNORECASE)
    return float(next(filter(None, found.groups()))) if found else np.nan


def _stated_direction(table: Table, rows: np.ndarray) -> list[str] | None:
    """Directions by a column of words such as up and down; None without one, or with other words."""
    columns = table.of("direction")
    if not columns:
        return None
    words, at = np.unique(columns[0].values[rows].astype(str), return_inverse=True)
    falls = [re.search(r"unload|down|deflat|decreas|fall|release|entlast|^-1?$|ab$", word.casefold()) for word in words]
    rises = [re.search(r"(?<!un)load|up|inflat|increas|rise|belast|^\+?1?$|auf$", word.casefold()) for word in words]
    if not all(f or r for f, r in zip(falls, rises, strict=True)):
        return None
    return np.array([UNLOADING if f else LOADING for f in falls])[at].tolist()


def _is_mixed(pressure: np.ndarray) -> bool:
    """Whether pressures stand in no order at all."""
    if len(pressure) < 8 or not np.ptp(pressure):
        return False
    steps = np.diff(pressure)
    return 0.25 < float(np.mean(steps < 0)) < 0.75 and float(np.median(np.abs(steps))) > 0.15 * np.ptp(pressure)


def _in_order(cycle: np.ndarray) -> bool:
    return bool((np.diff(cycle) >= 0).all())


def _turns(pressure: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Cycle (n,), from 1, and direction (n,) of each point of a series of pressures (n,).

    A series turns where it has gone back from its last extreme by a tenth of its range: noise does not turn it. The first point
    at a highest pressure is the last of its loading.
    """
    count, least = len(pressure), _TURN * float(np.ptp(pressure)) if len(pressure) else 0.0
    rising = np.ones(count, bool)
    if not least:
        return np.ones(count, int), np.full(count, LOADING)
    turns, extreme, up = [], 0, None
    for k in range(1, count):
        step = pressure[k] - pressure[extreme]
        if up is None:
            if abs(step) > least:
                up, extreme = step > 0, k
        elif step > 0 if up else step < 0:
            extreme = k
        elif abs(step) > least:
            turns.append(extreme + 1)
            up, extreme = not up, k
    up = (not up if len(turns) % 2 else up) if up is not None else True
    for begin, end in zip([0, *turns], [*turns, count], strict=True):
        rising[begin:end], up = up, not up
    cycle = np.ones(count, int)
    for begin in turns:
        if rising[begin] and begin:
            cycle[begin:] += 1
    return cycle, np.where(rising, LOADING, UNLOADING)


# --------------------------------------------------------------------------------------------------------------------
# whether units can be right


def _check_numbers(table: Table, found: pd.DataFrame) -> None:
    """Numbers of whole curves must be possible, whatever their unit: counts from 1, and pressures that are not negative."""
    limits = {"n_pouches": (1.0, 100.0, "n_pouches: 6"), "ventricular_pressure": (0.0, 1000.0, "ventricular_pressure: 3.8")}
    for name, (low, high, example) in limits.items():
        values = found[name].dropna().to_numpy(float)
        if len(wrong := values[(values < low) | (values > high)]):
            raise ConfigError(table.path, name, f"{wrong[0]:.4g}", f"{low:g} to {high:g}", example)


def _check_ranges(source: _Source, found: pd.DataFrame) -> list[str]:
    """Values in units that nobody said must be in the range of the study; the message names the unit that is likely.

    What the file says itself is believed and told where it is not in that range. It is refused only where it cannot be: volumes
    larger than the device, and pressures that begin at that of the air. A key ``units`` is always believed.
    """
    table, expected, told = source.table, source.expected, []
    kinds = {"actuation_pressure": ("pressure", expected.pressures)}
    kinds |= {name: ("volume", expected.volumes) for name in ("stroke_volume", "actuation_volume_change")}
    absolute = {"stroke_volume": "ventricle_volume", "actuation_volume_change": "actuation_volume"}
    for name, (kind, (low, high)) in kinds.items():
        columns = table.of(name) or table.of(absolute.get(name, name))
        if not columns or not found[name].notna().any() or columns[0].quantity in source.measured.units:
            continue
        quantity, values = columns[0].quantity, found[name].dropna().abs()
        if name == "actuation_pressure" and _AIR[0] < values.min() < _AIR[1]:
            expected_text = "pressures over that of the air, which begin near zero; subtract it in the file, or state units"
            raise ConfigError(table.path, quantity, f"from {values.min():.4g} kPa", expected_text, f"units: {{{quantity}: kPa}}")
        largest, wanted = float(values.max()), units.WANTED[kind]
        if low <= largest <= high:
            continue
        likely = _likely(columns[0], largest, kind, low, high)
        would = ", ".join(f"{value:.3g} {wanted} if in {unit}" for unit, value in likely.items())
        where = "where the file names no unit" if is_assumed(columns[0]) else "of such a device, whatever the file says"
        if is_assumed(columns[0]) or (kind == "volume" and largest > high):
            text = f"a largest value of {low:.4g} to {high:.4g} {wanted} {where}; units says which ({would})"
            example = f"units: {{{quantity}: {next(iter(likely))}}}"
            raise ConfigError(table.path, quantity, f"up to {largest:.4g}", text, example)
        told.append(f"{quantity}: up to {largest:.4g} {wanted} is taken as the file says, although {would} would fit better")
    return told


def _likely(column: Column, largest: float, kind: str, low: float, high: float) -> dict[str, float]:
    """Units that would bring a column's largest value, in the wanted unit now, into a range, and what it were then."""
    written = largest / (1.0 if is_assumed(column) else units.factor(column.unit, kind))
    others = (*_LARGER[kind], units.WANTED[kind], *_SMALLER[kind])
    if is_assumed(column):
        others = (_LARGER if largest > high else _SMALLER)[kind]
    converted = {unit: written * units.factor(unit, kind) for unit in others}
    return {unit: value for unit, value in converted.items() if low <= value <= high} or converted
