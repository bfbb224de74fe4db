"""The tables of docs/reliability.md from the files of docs/data, and the band of a case's paths as a figure."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from limo.errors import ResultError
from limo.reports import blocks
from limo.reports.markdown import markdown_table
from limo.solve.judge import THINNEST
from limo.store.statuses import CONVERGED, DEGRADED, DIVERGED, USABLE

RIGHT = USABLE
#: residual of forces (1) beyond which the check that is independent of the judge says no
RESIDUAL = 0.02
#: kPa below which no buckling event of the repeated case was found
BEFORE_EVENTS = 2.5
PRESSURES = (0.0, 5.0, 10.0, 20.0, 40.0, 60.0)
FAULT_COLUMNS = ("fault", "what happened", "started again", "seconds")


def _read(data: Path, name: str, **options) -> pd.DataFrame | None:
    try:
        return pd.read_csv(data / name, **options)
    except FileNotFoundError:
        return None
    except (OSError, ValueError) as error:
        raise ResultError(f"{data / name}: not a table ({error})") from None


def _table(header: tuple[str, ...], rows: list[tuple]) -> str:
    return markdown_table(pd.DataFrame(rows, columns=list(header), dtype=object))


def _share(part: int, whole: int) -> str:
    return f"{part} ({100 * part / whole:.0f} %)" if whole else "0"


def stress_summary(data: Path) -> str:
    """One row a box and engine: solved cases by how they ended, and those called right that the check of forces denies."""
    cases = _read(data, "stress_test.csv")
    if cases is None:
        return "Not measured yet."
    rows = []
    for (box, engine), group in cases.groupby(["box", "engine"], sort=True):
        n, first = len(group), group.first_status.isin(RIGHT)
        right = group.status.isin(RIGHT)
        ended = (group.status == DIVERGED) & (group.smallest_thickness < THINNEST)
        seen = group.residual - group.residual_floor > RESIDUAL  # by the judge, who called it degraded for that
        denied = right & ~seen & ~(group.forces_residual <= RESIDUAL)
        counts = (
            first & (group.status == CONVERGED),
            ~first & (group.status == CONVERGED),
            group.status == DEGRADED,
            ended,
            ~right & ~ended,
            right,
            right | ended,
        )
        worst = group.forces_residual[right].max()
        rows.append((box, engine, n, *(_share(int(c.sum()), n) for c in counts), int(denied.sum()), f"{worst:.2g}"))
    header = (
        "box",
        "engine",
        "cases",
        "converged at once",
        "after the ladder",
        "degraded",
        "fabric gave way",
        "failed",
        "right or degraded",
        "and fabric gave way",
        "denied",
        "largest residual",
    )
    return _table(header, rows)


_DESIGN = ["n_pouches", "ventricular_pressure", "aspect_ratio", "stiffness_ratio", "thickness", "youngs_modulus", "width_scale"]


def _shown(value: float, how: str = "g") -> str:
    """A number, "-" where a case whose files are damaged has none."""
    return "-" if pd.isna(value) else format(value, how)


def stress_failures(data: Path) -> str:
    """Every case that failed or is degraded: where it lies, how far it came, how thin it was, and why it ended."""
    cases = _read(data, "stress_test.csv")
    if cases is None:
        return "Not measured yet."
    rows = []
    for _, c in cases[cases.status != CONVERGED].sort_values(["engine", "box", "number"]).iterrows():
        rows.append(
            (
                f"{c.box} {c.number}, {c.engine}", *(_shown(c[name]) for name in _DESIGN), c.status,
                f"{_shown(c.actuation_pressure_reached, '.1f')} of {_shown(c.actuation_pressure_max)}",
                _shown(c.smallest_thickness, ".2f"), _shown(c.attempts), str(c.reason)[:110],
            )
        )  # fmt: skip
    header = ("case", "N_p", "P_v", "AR", "E_hat", "t", "E", "width", "status", "P_a [kPa]", "thinned to", "attempts", "reason")
    return _table(header, rows) if rows else "None."


def _curves(data: Path) -> pd.DataFrame | None:
    return _read(data, "repeatability.csv", dtype={"run": str})


def repeats(data: Path) -> str:
    """Equal runs, other builds: whether volumes are the same to the bit, and the largest relative differences."""
    curves = _curves(data)
    if curves is None:
        return "Not measured yet."
    rows = []
    for (engine, _), group in curves[curves.kind.isin(["same", "build"])].groupby(["engine", "kind"], sort=True):
        runs = list(dict.fromkeys(group.run))
        if len(runs) < 2:
            continue
        a, b = (group[group.run == r] for r in runs[:2])
        off = np.abs(b.ventricle_volume.to_numpy() / a.ventricle_volume.to_numpy() - 1)
        early = a.pressure.to_numpy() <= BEFORE_EVENTS
        same = "yes" if a.curve.iloc[0] == b.curve.iloc[0] else "no"
        rows.append((engine, f"{runs[0]} and {runs[1]}", same, f"{np.nanmax(off[early]):.1e}", f"{np.nanmax(off):.1e}"))
    return _table(("engine", "runs", "equal to the bit", f"V_v up to {BEFORE_EVENTS:g} kPa", "up to P_a,max"), rows)


def scatter(data: Path) -> str:
    """The band of a dozen perturbed paths of one case: stroke (ml), lowest to highest, by engine and P_a."""
    curves = _curves(data)
    if curves is None:
        return "Not measured yet."
    rows = []
    for engine, group in curves[curves.kind == "branch"].groupby("engine", sort=True):
        cells = []
        for p in PRESSURES[1:]:
            stroke = group[np.isclose(group.pressure, p)].stroke_volume
            cells.append(f"{stroke.min():.1f} to {stroke.max():.1f} ({100 * stroke.std() / stroke.mean():.1f} %)")
        rest = group[group.pressure == 0].ventricle_volume
        rows.append((engine, group.run.nunique(), f"{rest.min():.2f} to {rest.max():.2f}", *cells))
    return _table(("engine", "paths", "V_v at rest", *(f"{p:g} kPa" for p in PRESSURES[1:])), rows)


def meshes(data: Path) -> str:
    """Other meshes of one device: V_v at rest and stroke (ml) by what was done to the mesh."""
    curves = _curves(data)
    if curves is None:
        return "Not measured yet."
    rows = []
    first = curves[(curves.kind == "same") & (curves.run == "run 1")].assign(run="as it is")
    for (engine, run), group in pd.concat([first, curves[curves.kind == "mesh"]]).groupby(["engine", "run"], sort=False):
        position = [group[np.isclose(group.pressure, p)] for p in PRESSURES]
        cells = [
            f"{a.stroke_volume.iloc[0]:.2f}" if len(a) and np.isfinite(a.stroke_volume.iloc[0]) else "-" for a in position[1:]
        ]
        rows.append((engine, run, group.status.iloc[0], f"{position[0].ventricle_volume.iloc[0]:.3f}", *cells))
    return _table(("engine", "mesh", "status", "V_v at rest", *(f"{p:g} kPa" for p in PRESSURES[1:])), rows)


def faults(data: Path) -> str:
    """What real sweeps did when they were killed, starved and damaged."""
    collected = _read(data, "faults.csv", header=None, names=FAULT_COLUMNS)
    if collected is None:
        return "Not measured yet."
    return _table(FAULT_COLUMNS, list(collected.itertuples(index=False, name=None)))


TABLES: dict[str, Callable[[Path], str]] = {
    "stress_summary": stress_summary,
    "stress_failures": stress_failures,
    "repeats": repeats,
    "scatter": scatter,
    "meshes": meshes,
    "faults": faults,
}


def renewed(text: str, data: Path) -> str:
    """A document with its tables made anew from the files in ``data``. Raises ``ResultError``."""
    return blocks.renewed(text, {name: partial(make, data) for name, make in TABLES.items()})


def draw_band(data: Path, file: Path) -> None:
    """The strokes of all perturbed paths over P_a, a panel an engine, with the band from the lowest to the highest."""
    from limo.figures import style
    from limo.store.files import write_whole

    curves = _curves(data)
    if curves is None:
        raise ResultError(f"{data / 'repeatability.csv'}: not measured yet")
    branches = curves[curves.kind == "branch"]
    engines = sorted(branches.engine.unique())
    figure, axes = style.panels(max(len(engines), 1))
    for k, (axis, engine) in enumerate(zip(np.atleast_1d(axes), engines, strict=False)):
        table = branches[branches.engine == engine].pivot(index="pressure", columns="run", values="stroke_volume")
        axis.fill_between(table.index, table.min(axis=1), table.max(axis=1), color=style.COLORS[k], alpha=0.3, lw=0)
        axis.plot(table.index, table, color=style.COLORS[k], lw=0.5)
        axis.set(title=engine, xlabel="Actuation pressure $P_a$ [kPa]", ylabel="Stroke volume [ml]")
    write_whole(file, lambda path: style.save(figure, path))
    style.close(figure)
