"""Look at single cases: find one by a few words, show what it is and what came out, compare two."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from limo.cases.case import Case
from limo.cases.cost import duration
from limo.errors import LimoError, ResultError
from limo.measure.buckling import events, largest_events
from limo.measure.ramp import read_ramp
from limo.reports.markdown import shown, text_table
from limo.store.files import finite_number, read_json
from limo.store.progress import solving_since
from limo.store.results import CaseFiles, Results
from limo.store.statuses import RUNNING, STALE
from limo.terminal.status import DEVICE, CaseStatus, case_status, ended_status, read_ended, short_names

_LISTED = 12  # cases that an error names
_CURVES = {
    "ventricle_volume": "ventricle volume V_v",
    "actuation_volume": "pouch volume V_a",
    "stroke_volume": "stroke volume",
    "actuation_volume_change": "actuation volume",
}
_COSTS = {
    "solver_cpu_seconds": ("solver CPU", "s"),
    "python_cpu_seconds": ("python CPU", "s"),
    "iterations": ("iterations", ""),
    "increments": ("increments", ""),
    "rejected_attempts": ("cut-backs", ""),
    "solver_memory_mib": ("memory", "MiB"),
}


def find_case(results: Path, words: str | Sequence[str]) -> str:
    """The one case whose name has all the words: beginnings of the name, of its hash, or whole parts such as ``np6``.

    Words may be given in one text, divided by spaces or commas. Raises ``LimoError`` where none or several match.
    """
    wanted = " ".join([words] if isinstance(words, str) else words).replace(",", " ").split()
    names = Results(results).case_ids()
    if not names:
        raise LimoError(
            f"{Results(results).cases}: no case was begun yet; run a study first, for example: limo sweep pressure_volume"
        )
    matches = [name for name in names if all(_matches(name, word) for word in wanted)]
    if len(wanted) == 1 and wanted[0] in names:
        matches = wanted
    if len(matches) == 1:
        return matches[0]
    text = " ".join(wanted)
    listed = matches or names
    short = short_names(names)
    rest = [f"  and {len(listed) - _LISTED} more"] if len(listed) > _LISTED else []
    message = f"{len(matches)} cases are meant by" if matches else "no case is meant by"
    raise LimoError("\n".join([f"{message} {text!r}; there are:", *(f"  {short[name]}" for name in listed[:_LISTED]), *rest]))


def _matches(name: str, word: str) -> bool:
    hashed = name.rsplit("_", 1)[-1]
    return (
        name.startswith(word)
        or DEVICE.sub("", name).startswith(word)
        or f"_{word}_" in f"_{name}_"
        or (len(word) > 3 and hashed.startswith(word))
    )


@dataclass(frozen=True)
class CaseFolder:
    """A case on disk, as far as its files can be read."""

    folder: Path

    @property
    def files(self) -> CaseFiles:
        """The files of the case."""
        return CaseFiles(self.folder)

    @cached_property
    def described(self) -> dict[str, Any]:
        """The case as ``case.json`` describes it, empty while there is none."""
        try:
            described = read_json(self.files.described).get("case")
        except ResultError:
            return {}
        return described if isinstance(described, dict) else {}

    @cached_property
    def case(self) -> Case | None:
        """The case, None while there is no description that this version understands."""
        try:
            return Case.from_dict(self.described)
        except (KeyError, TypeError, ValueError, AttributeError):
            return None

    @cached_property
    def status(self) -> CaseStatus:
        """Where the case is."""
        ended = read_ended(self.folder)
        if ended is not None and solving_since(self.folder) is None:
            return ended_status(self.folder.name, ended.status, finite_number(self.described, "actuation_pressure_max"))
        if self.case is not None:
            return case_status(self.case, self.folder)
        return CaseStatus(self.folder.name, RUNNING if solving_since(self.folder) is not None else STALE)

    @cached_property
    def ended(self) -> dict[str, Any]:
        """What ``status.json`` says, empty while there is none."""
        ended = read_ended(self.folder)
        return ended.status.to_json() if ended is not None else {}

    @cached_property
    def ramp(self) -> xr.Dataset | None:
        """The ramp from the state at rest, with stroke and actuation volume (ml) beside the volumes; None without one."""
        try:
            ramp = read_ramp(self.folder)
            if not ramp.sizes["increment"]:
                return None
            ventricle, actuation = ramp.ventricle_volume, ramp.actuation_volume
            return ramp.assign(stroke_volume=ventricle[0] - ventricle, actuation_volume_change=actuation - actuation[0])
        except ResultError:
            return None

    def at(self, name: str, pressures: np.ndarray) -> np.ndarray:
        """A curve (ml) at pressures (kPa), NaN beyond what the case reached."""
        return np.interp(pressures, self.ramp.actuation_pressure.values, self.ramp[name].values, right=np.nan)


def show_case(results: Path, words: Sequence[str], pressures: Sequence[float] = ()) -> str:
    """What a case is, where its files are, its volumes at some P_a (kPa; none: those of its frames), events and costs."""
    name = find_case(results, words)
    one = CaseFolder(Results(results).case(name).folder)
    lines = [name, f"  {_how_it_is(one.status)}", *(f"  {remark}" for remark in one.ended.get("remarks", ())), *_what_it_is(one)]
    if one.ramp is not None:
        lines += ["", *_volumes(one, pressures), "", *_events(one)]
    if one.ended:
        lines += ["", "costs: " + ", ".join(_cost(one.ended, key) for key in _COSTS if finite_number(one.ended, key) is not None)]
    return "\n".join([*lines, "", "files:", *_files(results, one)])


def _what_it_is(one: CaseFolder) -> list[str]:
    case = one.case
    if case is None:
        return [f"  {one.files.described}: not there yet, or written by another version"]
    material, mesh = case.device.material, case.mesh
    return [
        f"  device {case.device_name}, N_p = {case.n_pouches}, P_v = {case.ventricular_pressure:g} kPa, "
        f"P_a up to {case.actuation_pressure_max:g} kPa, AR = {case.aspect_ratio:g}, E_hat = {case.stiffness_ratio:g}",
        f"  L = {case.device.pattern.length:g} mm; fabric E = {material.youngs_modulus:g} MPa, nu = {material.poisson_ratio:g}, "
        f"t = {material.thickness:g} mm, {material.areal_density:g} g/m2",
        f"  mesh {mesh.level} {mesh.symmetry} {mesh.element}, numerics {case.numerics_name}, engine {case.engine} {case.build}",
    ]


def _how_it_is(status: CaseStatus) -> str:
    parts = [status.status]
    if status.actuation_pressure is not None and status.actuation_pressure_max is not None:
        parts.append(f"reached P_a = {status.actuation_pressure:g} of {status.actuation_pressure_max:g} kPa")
    if status.seconds is not None:
        parts.append(f"in {duration(status.seconds)}")
    return " ".join(parts) + (f": {status.reason}" if status.reason else "")


def _volumes(one: CaseFolder, pressures: Sequence[float]) -> list[str]:
    reached = float(one.ramp.actuation_pressure[-1])
    wanted = list(pressures) or [p for p in one.described.get("frames", ()) if isinstance(p, int | float)] or [0.0, reached]
    curves = [one.at(name, np.array(wanted, float)) for name in _CURVES]
    header, rows = ("P_a [kPa]", "V_v [ml]", "V_a [ml]", "stroke [ml]", "actuation [ml]", "ratio"), []
    for pressure, *values in zip(wanted, *curves, strict=True):
        ratio = values[2] / values[3] if values[3] > 1.0 else np.nan  # next to nothing says nothing
        rows.append((f"{pressure:g}", *(shown(v, ".1f") for v in values), shown(ratio, ".2f")))
    return _indented(text_table(header, rows))


def _events(one: CaseFolder) -> list[str]:
    jumps = largest_events(events(one.ramp.actuation_pressure.values, one.ramp.stroke_volume.values))
    lines = [f"  {e.before:.2f} to {e.after:.2f} kPa: {e.jump:+.1f} ml" for e in jumps]
    return ["buckling events (jumps of the stroke volume):", *lines] if lines else ["no buckling events"]


def _cost(ended: Mapping[str, Any], key: str) -> str:
    title, unit = _COSTS[key]
    return f"{title} {finite_number(ended, key):.6g} {unit}".rstrip()


def _files(results: Path, one: CaseFolder) -> list[str]:
    case, folder = one.files, Results(results)
    files = [*case.solved, case.measures, case.picture]
    files += [*sorted(case.fields.glob("*.pvd")), *sorted(case.run.glob("*"))]
    files.append(folder.log("solve_case", one.folder.name))
    if one.case is not None:
        files.insert(0, folder.mesh(one.case.mesh_id))
    return [f"  {file}" for file in files if file.exists()]


def draw_case(results: Path, words: Sequence[str], file: Path | None = None) -> Path:
    """Draw the pressure-volume curves of a case (default: ``case.png`` in its folder); returns the file.

    Raises ``ResultError`` for a case without a ramp.
    """
    from limo.figures import style
    from limo.store.files import write_whole

    name = find_case(results, words)
    one = CaseFolder(Results(results).case(name).folder)
    if one.ramp is None:
        raise ResultError(f"{one.files.volumes}: no ramp to draw")
    figure, axes = style.panels(3)
    pressure = one.ramp.actuation_pressure
    axes[0].plot(pressure, one.ramp.ventricle_volume, color=style.COLORS[1], label="ventricle $V_v$")
    axes[0].plot(pressure, one.ramp.actuation_volume, color=style.COLORS[0], label="pouches $V_a$")
    axes[1].plot(pressure, one.ramp.stroke_volume, color=style.COLORS[1], label="stroke $\\Delta V_v$")
    axes[1].plot(pressure, one.ramp.actuation_volume_change, color=style.COLORS[0], label="actuation $\\Delta V_a$")
    axes[2].plot(one.ramp.actuation_volume_change, one.ramp.stroke_volume, color=style.COLORS[2])
    for axis in axes[:2]:
        axis.set(xlabel="Actuation pressure $P_a$ [kPa]", ylabel="Volume [ml]")
        axis.legend()
    axes[2].set(xlabel="Actuation volume $\\Delta V_a$ [ml]", ylabel="Stroke volume $\\Delta V_v$ [ml]")
    figure.suptitle(f"{name} ({one.status.status})", fontsize=8)
    file = file or one.files.picture
    if file.suffix not in (".png", ".pdf", ".svg"):
        raise LimoError(f"{file}: expected a name that ends in .png, .pdf or .svg")
    write_whole(file, lambda path: style.save(figure, path))
    style.close(figure)
    return file


def compare_cases(results: Path, first: str, second: str, step: float = 0.5) -> str:
    """Parameters in which two cases differ, differences of their curves every ``step`` kPa, and their costs."""
    names = find_case(results, first), find_case(results, second)
    a, b = (CaseFolder(Results(results).case(name).folder) for name in names)
    lines = [f"a  {names[0]} ({a.status.status})", f"b  {names[1]} ({b.status.status})", ""]
    flat = [flatten(one.described) for one in (a, b)]
    rows = [(key, *(str(f.get(key, "-")) for f in flat)) for key in dict.fromkeys([*flat[0], *flat[1]])]
    rows = [row for row in rows if row[1] != row[2]]
    lines += ["parameters that differ", *_columns(("", "a", "b"), rows)] if rows else ["the same parameters"]
    if a.ramp is not None and b.ramp is not None:
        end = min(float(one.ramp.actuation_pressure[-1]) for one in (a, b))
        pressures = np.append(np.arange(0.0, end, step), end)
        rows = [(text, *_difference(pressures, a.at(name, pressures), b.at(name, pressures))) for name, text in _CURVES.items()]
        lines += ["", f"curves up to {end:g} kPa, b - a in ml", *_columns(("", "at the end", "largest", "at kPa", "rms"), rows)]
    else:
        lines += ["", "no curves to compare: " + ", ".join(str(one.folder) for one in (a, b) if one.ramp is None)]
    rows = []
    for key, (title, unit) in _COSTS.items():
        left, right = finite_number(a.ended, key), finite_number(b.ended, key)
        if left is not None and right is not None:
            ratio = f"{right / left:.2f}" if left else "-"
            rows.append((f"{title} [{unit}]" if unit else title, f"{left:.6g}", f"{right:.6g}", ratio))
    return "\n".join([*lines, *(["", "costs", *_columns(("", "a", "b", "b / a"), rows)] if rows else [])])


def _difference(pressures: np.ndarray, a: np.ndarray, b: np.ndarray) -> tuple[str, ...]:
    difference = b - a
    worst = int(np.nanargmax(np.abs(difference)))
    return (
        f"{difference[-1]:+.2f}",
        f"{difference[worst]:+.2f}",
        f"{pressures[worst]:g}",
        f"{np.sqrt(np.nanmean(difference**2)):.2f}",
    )


def flatten(data: Mapping[str, Any], before: str = "") -> dict[str, Any]:
    """Nested plain data as one mapping with dotted keys; lists stay whole."""
    flat: dict[str, Any] = {}
    for key, value in data.items():
        name = f"{before}{key}"
        flat |= flatten(value, f"{name}.") if isinstance(value, Mapping) else {name: value}
    return flat


def _columns(header: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Rows of text with the first column to the left and the others to the right, long cells cut."""
    rows = [[cell if len(cell) <= 40 else f"{cell[:37]}..." for cell in row] for row in rows]
    return _indented(text_table(header, rows, left=1))


def _indented(text: str) -> list[str]:
    return [f"  {line}" for line in text.splitlines()]
