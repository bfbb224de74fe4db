"""An earlier build beside today's on the same devices: rows that ``scripts/peer/before.py`` measured, as tables."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from limo.reports.markdown import markdown_table, number, percent, rows_if_any

KEYS = ["n_pouches", "ventricular_pressure", "setting"]
COLUMNS = [
    *KEYS,
    "commit",
    "status",
    "iterations",
    "iterations_ramp",
    "factorisations",
    "cpu_seconds",
    "memory_mib",
    "iteration_ratio",
    "rest_volume",
    "stroke",
    "energy_mj",
    "apart",
    "scatter",
    "energy_scatter",
    "error",
    "machine",
]
#: settings of the earlier build: its preset `standard`, the mesh of the grids at the paper's density, and its preset `preview`
EARLIER, EARLIER_PAPER, EARLIER_PREVIEW = "earlier", "earlier_paper", "earlier_preview"
#: kPa above P_v from which curves are compared: below, snaps differ by single load steps
ABOVE = 10
#: share of an energy within which another one is the same
SAME = 1e-3
#: of V_v, relative L2 over the ramp: as near to the finest mesh as `standard` is meant to be
WITHIN = 0.02


@dataclass(frozen=True)
class Setting:
    """A setting in words, the keys of a study that name it, and the setting of the earlier build that it is beside."""

    words: str
    study: dict
    beside: str = EARLIER


def _mesh(level: str, element: str) -> dict:
    return {"engine": "newton", "mesh": {"level": level, "element": element}}


def _begun_on(*levels: str, **others: str) -> dict:
    return {"variants": {"nested": {"numerics": {"newton": {"fit_on": list(levels)} | others}}}}


_BRICKS = _mesh("medium", "C3D20R")
_PAPER = _mesh("paper", "C3D20R")
_NESTED_MIXED = _begun_on("preview", "coarse", geometric_stiffness="mixed")
#: what the earlier build solves
EARLIERS = {
    EARLIER: Setting("its preset `standard`, bricks on the mesh level `medium`", {"preset": "standard"}),
    EARLIER_PAPER: Setting("bricks at the paper's density", _PAPER),
    EARLIER_PREVIEW: Setting("its preset `preview`", {"preset": "preview"}),
}
#: what is solved beside the earlier build
SETTINGS = {
    "bricks_flat": Setting("bricks, fitted from the flat state", _BRICKS),
    "bricks_nested": Setting("bricks, begun at rest on coarser meshes", _BRICKS | _begun_on("preview", "coarse")),
    "bricks": Setting(
        "bricks, begun at rest on coarser meshes, geometric stiffness mixed",
        _BRICKS | _NESTED_MIXED,
    ),
    "shells": Setting(
        "shells on the same mesh, begun at rest on coarser meshes", _mesh("medium", "SHELL8R") | _begun_on("preview", "coarse")
    ),
    "shells_coarse": Setting(
        "shells on the mesh level coarse, begun at rest on preview", _mesh("coarse", "SHELL8R") | _begun_on("preview")
    ),
    "shells_paper": Setting(
        "shells at the paper's density, begun at rest on coarser meshes",
        _mesh("paper", "SHELL8R") | _begun_on("preview", "coarse"),
    ),
    "standard": Setting("preset `standard`: those shells, layers touch", {"preset": "standard"}),
    "bricks_paper": Setting(
        "bricks at the paper's density, begun at rest on coarser meshes, geometric stiffness mixed",
        _PAPER | _NESTED_MIXED,
        EARLIER_PAPER,
    ),
    "preview": Setting("preset `preview`", {"preset": "preview"}, EARLIER_PREVIEW),
}


def read_before(file: Path) -> pd.DataFrame:
    """The rows that were measured, none if there is no file. Raises ``ResultError``."""
    return rows_if_any(file, "measurements beside an earlier build", COLUMNS)


def times_less(rows: pd.DataFrame, setting: str, of: str = "cpu_seconds") -> pd.Series:
    """CPU time or another column of the earlier build over that of a setting, by number of pouches and P_v (kPa)."""
    both = _beside(rows, setting, of)
    return both.earlier / both.today


def share(rows: pd.DataFrame, setting: str) -> float:
    """CPU time of a setting over the earlier build's, of all devices that both solved together; NaN for none."""
    both = _beside(rows, setting, "cpu_seconds").sum()
    return both.today / both.earlier if both.earlier else float("nan")


def within_scatter(rows: pd.DataFrame, setting: str) -> pd.Series:
    """Whether V_v is as near to the earlier build's as two of its branches are to each other, of devices where both are known."""
    known = pd.DataFrame({"apart": _of(rows, setting).apart, "scatter": _of(rows, SETTINGS[setting].beside).scatter}).dropna()
    return known.apart <= known.scatter


def no_higher(rows: pd.DataFrame, setting: str) -> pd.Series:
    """Whether the potential energy at P_a,max is the same as the earlier build's or lower, of all devices.

    The same: within ``SAME``, or within what two branches of the earlier build differ by, where both were solved.
    """
    both = _beside(rows, setting, "energy_mj")
    scatter = _of(rows, SETTINGS[setting].beside).energy_scatter.astype(float).reindex(both.index).fillna(0.0)
    return both.today <= both.earlier + np.maximum(SAME * both.earlier.abs(), scatter)


def accurate(rows: pd.DataFrame) -> pd.Series:
    """CPU time of the earlier build's `standard` over that of the cheapest setting with V_v within ``WITHIN``, by device.

    Of devices of which the earlier build keeps runs on its finest mesh; NaN where no setting is within.
    """
    known = rows[rows.error.notna()]
    good = known[(known.error <= WITHIN) & ~known.setting.isin(EARLIERS)]
    cheapest = good.groupby(KEYS[:2]).cpu_seconds.min()
    return _of(known, EARLIER).cpu_seconds / cheapest


def _of(rows: pd.DataFrame, setting: str) -> pd.DataFrame:
    return rows[rows.setting == setting].set_index(KEYS[:2])


def _beside(rows: pd.DataFrame, setting: str, of: str) -> pd.DataFrame:
    """A column of the earlier build and of a setting beside it, of the devices that both have."""
    names = {"earlier": SETTINGS[setting].beside, "today": setting}
    return pd.DataFrame({name: _of(rows, one)[of] for name, one in names.items()}).dropna()


def before_section(rows: pd.DataFrame) -> list[str]:
    """The parts of the section; without rows it says how to measure them."""
    if rows.empty:
        return ["Not measured: `scripts/peer/before.py CHECKOUT` does."]
    is_earlier = rows.setting.isin(EARLIERS)
    today = rows[~is_earlier]
    intro = (
        f"Written by `scripts/peer/before.py`: `{', '.join(sorted(set(rows[is_earlier].commit)))}` and settings of "
        f"`{', '.join(sorted(set(today.commit)))}` solve the same devices `limo_2025`. "
        f"Two run at a time, one thread a case: {', '.join(sorted(set(rows.machine)))}. CPU time includes the states of coarser "
        "meshes that a case begins at. `times less`: CPU time of the earlier build over that of the setting. `apart`: relative "
        f"L2 distance of V_v from the earlier build's, from P_v + {ABOVE} kPa on; within the scatter: no further than the two "
        "branches of the device that the earlier build keeps. `V_v off`: the same distance over the whole ramp from the mean of "
        "the runs on the finest mesh that it keeps of two devices. Energy: potential energy at P_a,max, equal within "
        f"{percent(SAME)}, or within what two branches of the earlier build differ by where these were solved (`--branches 2`)."
    )
    summary = []
    for name, setting in SETTINGS.items():
        group = _of(today, name)
        if group.empty:
            continue
        before = _of(rows, setting.beside).reindex(group.index)
        less, near, low = times_less(rows, name), within_scatter(rows, name), no_higher(rows, name)
        summary.append(
            {
                "setting": setting.words,
                "devices": len(group),
                "times less, median": number(less.median(), 1),
                "least": number(less.min(), 1),
                "most": number(less.max(), 1),
                "apart, median": percent(group.apart.median()),
                "most apart": percent(group.apart.max()),
                "V_v off, most": percent(group.error.max()) if group.error.notna().any() else "-",
                "within the scatter": f"{near.sum()} of {len(near)}" if len(near) else "-",
                "energy lower or equal": f"{low.sum()} of {len(low)}",
                "iterations over the earlier's": number((group.iterations / before.iterations).median(), 2),
                "an iteration over its factorise and solve (the earlier's)": f"{number(group.iteration_ratio.median(), 2)} "
                f"({number(before.iteration_ratio.median(), 2)})",
                "memory [MiB], most": round(group.memory_mib.max()),
            }
        )
    parts = [intro, markdown_table(pd.DataFrame(summary))]
    for name, setting in EARLIERS.items():
        if (rows.setting == name).any():
            parts += [f"Beside {setting.words}:", markdown_table(_devices(rows, name))]
    return parts


def _devices(rows: pd.DataFrame, earlier: str) -> pd.DataFrame:
    """A row a device: CPU seconds and strokes, by the settings beside one of the earlier build."""
    table, measured = [], set(rows.setting)
    settings = [name for name, setting in SETTINGS.items() if setting.beside == earlier and name in measured]
    for _, before in rows[rows.setting == earlier].iterrows():
        same = (rows.n_pouches == before.n_pouches) & (rows.ventricular_pressure == before.ventricular_pressure)
        group = rows[same].set_index("setting")
        line = {"N_p": before.n_pouches, "P_v": before.ventricular_pressure, "CPU [s] earlier": round(before.cpu_seconds)}
        line |= {name: round(group.cpu_seconds[name]) if name in group.index else "-" for name in settings}
        line["stroke [ml] earlier"] = number(before.stroke, 1)
        line |= {f"{name} ": number(group.stroke[name], 1) if name in group.index else "-" for name in settings}
        table.append(line)
    return pd.DataFrame(table)
