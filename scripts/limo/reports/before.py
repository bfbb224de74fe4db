"""An earlier build beside today's on the same devices: rows that ``scripts/peer/before.py`` measured, as tables."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

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
    "rest_volume",
    "stroke",
    "energy_mj",
    "apart",
    "machine",
]
#: the setting of the earlier build: its preset `standard`
EARLIER = "earlier"
#: kPa above P_v from which curves are compared: below, snaps differ by single load steps
ABOVE = 10


@dataclass(frozen=True)
class Setting:
    """A setting of today's build in words, and the keys of a study that name it."""

    words: str
    study: dict


def _mesh(level: str, element: str) -> dict:
    return {"engine": "newton", "mesh": {"level": level, "element": element}}


def _begun_on(*levels: str, **others: str) -> dict:
    return {"variants": {"nested": {"numerics": {"newton": {"fit_on": list(levels)} | others}}}}


_BRICKS = _mesh("medium", "C3D20R")
#: what is solved beside the earlier build
SETTINGS = {
    "bricks_flat": Setting("bricks, fitted from the flat state", _BRICKS),
    "bricks_nested": Setting("bricks, begun at rest on coarser meshes", _BRICKS | _begun_on("preview", "coarse")),
    "bricks": Setting(
        "bricks, begun at rest on coarser meshes, geometric stiffness mixed",
        _BRICKS | _begun_on("preview", "coarse", geometric_stiffness="mixed"),
    ),
    "shells": Setting(
        "shells on the same mesh, begun at rest on coarser meshes", _mesh("medium", "SHELL8R") | _begun_on("preview", "coarse")
    ),
    "shells_coarse": Setting(
        "shells on the mesh level coarse, begun at rest on preview", _mesh("coarse", "SHELL8R") | _begun_on("preview")
    ),
    "standard": Setting("preset `standard`: those shells, layers touch", {"preset": "standard"}),
}


def read_before(file: Path) -> pd.DataFrame:
    """The rows that were measured, none if there is no file. Raises ``ResultError``."""
    return rows_if_any(file, "measurements beside an earlier build", COLUMNS)


def times_less(rows: pd.DataFrame, setting: str, of: str = "cpu_seconds") -> pd.Series:
    """CPU time or another column of the earlier build over that of a setting, by number of pouches and P_v (kPa)."""
    earlier, today = (rows[rows.setting == name].set_index(KEYS[:2])[of] for name in (EARLIER, setting))
    return (earlier / today).dropna()


def before_section(rows: pd.DataFrame) -> list[str]:
    """The parts of the section; without rows it says how to measure them."""
    if rows.empty:
        return ["Not measured: `scripts/peer/before.py CHECKOUT` does."]
    earlier = rows[rows.setting == EARLIER].set_index(KEYS[:2])
    today = rows[rows.setting != EARLIER]
    intro = (
        f"Written by `scripts/peer/before.py`: the preset `standard` of `{', '.join(sorted(set(earlier.commit)))}` (bricks on "
        f"the mesh level `medium`) and settings of `{', '.join(sorted(set(today.commit)))}` solve the same devices `limo_2025`. "
        f"Two run at a time, one thread a case: {', '.join(sorted(set(rows.machine)))}. CPU time includes the states of coarser "
        "meshes that a case begins at. `times less`: CPU time of the earlier build over that of the setting. `apart`: relative "
        f"L2 distance of V_v from the earlier build's, from P_v + {ABOVE} kPa on. Energy: potential energy at P_a,max."
    )
    summary = []
    for name, setting in SETTINGS.items():
        group = today[today.setting == name].set_index(KEYS[:2])
        if group.empty:
            continue
        before = earlier.reindex(group.index)
        less, same = times_less(rows, name), 1e-3 * before.energy_mj.abs()
        summary.append(
            {
                "setting": setting.words,
                "devices": len(group),
                "times less, median": number(less.median(), 1),
                "least": number(less.min(), 1),
                "most": number(less.max(), 1),
                "apart, median": percent(group.apart.median()),
                "most apart": percent(group.apart.max()),
                "energy lower or equal": f"{(group.energy_mj <= before.energy_mj + same).sum()} of {len(group)}",
                "iterations over the earlier's": number((group.iterations / before.iterations).median(), 2),
                "memory [MiB], most": round(group.memory_mib.max()),
            }
        )
    return [intro, markdown_table(pd.DataFrame(summary)), markdown_table(_devices(earlier, today))]


def _devices(earlier: pd.DataFrame, today: pd.DataFrame) -> pd.DataFrame:
    """A row a device: CPU seconds, strokes and how far apart the curves are, by setting."""
    table = []
    for device, before in earlier.iterrows():
        group = today[(today.n_pouches == device[0]) & (today.ventricular_pressure == device[1])].set_index("setting")
        line = {"N_p": device[0], "P_v": device[1], "CPU [s] earlier": round(before.cpu_seconds)}
        line |= {f"{name}": round(group.cpu_seconds[name]) if name in group.index else "-" for name in SETTINGS}
        line["stroke [ml] earlier"] = number(before.stroke, 1)
        line |= {f"{name} ": number(group.stroke[name], 1) if name in group.index else "-" for name in SETTINGS}
        table.append(line)
    return pd.DataFrame(table)
