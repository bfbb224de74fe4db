"""Kratos beside engine newton on two cushions: rows that ``scripts/peer/kratos.py`` measured, as tables."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from limo.reports.markdown import markdown_table, number, rows_if_any, signed_percent

KEYS = ["case", "code", "model", "n"]
COLUMNS = [
    *KEYS,
    "version",
    "elements",
    "height_mm",
    "rim_mm",
    "volume_l",
    "draw_in_mm",
    "smooth_draw_in_mm",
    "iterations",
    "converged",
    "cpu_seconds",
    "memory_mib",
    "runs",
    "load",
    "machine",
]
#: a model in words, and what it leaves out
MODELS = {
    "relaxed_3n": (
        "membranes of 3 nodes with a wrinkling law, explicit relaxation",
        "bending, folds, contact; wrinkles are smeared",
    ),
    "c3d20r": ("bricks C3D20R, straight up", "nothing but self-contact; wrinkles no finer than elements"),
    "c3d20r_via": ("bricks C3D20R, via 100 and 10 p", "the same"),
    "shell8r": ("shells SHELL8R, straight up", "stress across the layer; wrinkles no finer than elements"),
    "shell8r_via": ("shells SHELL8R, via 100 and 10 p", "the same"),
}
#: height (mm) that was published of membranes, and the volume (l) of a quarter of the upper sheet that the relaxed ones tend to
AIRBAG = {"height": 216.7, "volume": 15.626}
#: of two inextensible discs of radius R = 200 mm: height R 0.9139 / 2, rim 0.7627 R in mm, volume 1.2185 R^3 / 8 in l
MYLAR = {"height": 91.39, "rim": 152.55, "volume": 1.21852}


def read_peer(file: Path) -> pd.DataFrame:
    """The rows that were measured, none if there is no file. Raises ``ResultError``."""
    return rows_if_any(file, "measurements beside a peer", COLUMNS)


def peer_section(rows: pd.DataFrame) -> list[str]:
    """The parts of the section; without rows it says how to measure them."""
    if rows.empty:
        return ["Not measured: `PYTHONPATH=scripts .venv/bin/python scripts/peer/kratos.py` does."]
    versions = ", ".join(f"{code} {', '.join(sorted(set(group.version)))}" for code, group in rows.groupby("code"))
    runs = f"{rows.runs.min()}" if rows.runs.nunique() == 1 else f"{rows.runs.min()} to {rows.runs.max()}"
    busy = "" if rows.load.max() < 1.5 else " **Other work shared the machine**, so ratios count here, seconds less."
    intro = (
        f"Written by `scripts/peer/kratos.py` ({versions}), which installs the peer by itself and is no part of the tests. Both "
        f"codes solve in turns, each in a process and on one thread: {', '.join(sorted(set(rows.machine)))}. CPU time is that of "
        f"the solve alone, without imports; solves of which the median is kept: {runs}. The machine's load was "
        f"{rows.load.min():g} to {rows.load.max():g}.{busy} Memory is that of the whole process, Python "
        "included. `n`: elements along half a side, or along half a radius; as membranes, four triangles each."
    )
    parts = [intro]
    words = {
        "airbag": (
            "The classical square airbag (`config/airbags/classical.yaml`): errors against the published height of "
            f"{AIRBAG['height']:g} mm and the volume of a quarter that the relaxed membranes tend to, {AIRBAG['volume']:g} l. "
            "The draw-in `u_B` of an edge's middle grows with the mesh without a limit, so the smooth one is compared."
        ),
        "mylar": (
            "The mylar balloon: two discs (R = 200 mm, 3 GPa, 0.05 mm, 1 kPa) that hardly stretch, against the closed form rim "
            "0.7627 R, thickness 0.9139 R, volume 1.2185 R^3. **Straight up, meshes that are not fine lock flat** in a true "
            "equilibrium; a way via more pressure leaves it."
        ),
    }
    for case, table in (("airbag", _airbag), ("mylar", _mylar)):
        group = rows[rows.case == case]
        if len(group):
            parts += [words[case], markdown_table(table(group.sort_values(["code", "model", "n"])))]
    return [*parts, markdown_table(_models(rows))]


def _airbag(rows: pd.DataFrame) -> pd.DataFrame:
    return _shared(
        rows,
        {
            "height off": (rows.height_mm / AIRBAG["height"] - 1).map(signed_percent),
            "volume off": (rows.volume_l / AIRBAG["volume"] - 1).map(signed_percent),
            "smooth u_B [mm]": rows.smooth_draw_in_mm.map(number),
            "u_B [mm]": rows.draw_in_mm.map(number),
        },
    )


def _mylar(rows: pd.DataFrame) -> pd.DataFrame:
    return _shared(
        rows,
        {
            "thickness off": (rows.height_mm / MYLAR["height"] - 1).map(signed_percent),
            "rim off": (rows.rim_mm / MYLAR["rim"] - 1).map(signed_percent),
            "volume off": (rows.volume_l / MYLAR["volume"] - 1).map(signed_percent),
        },
    )


def _shared(rows: pd.DataFrame, errors: dict[str, pd.Series]) -> pd.DataFrame:
    return pd.DataFrame(
        {
            "code": rows.code,
            "model": [MODELS[m][0] for m in rows.model],
            "n": rows.n,
            "elements": rows.elements,
            **errors,
            "iterations or steps": [f"{r.iterations}{'' if r.converged else ', **not at rest**'}" for r in rows.itertuples()],
            "CPU [s]": [number(value, 2) for value in rows.cpu_seconds],
            "memory [MiB]": rows.memory_mib.round().astype(int),
        }
    )


def _models(rows: pd.DataFrame) -> pd.DataFrame:
    used = rows.drop_duplicates(["code", "model"]).sort_values(["code", "model"])
    return pd.DataFrame(
        {"code": used.code, "model": [MODELS[m][0] for m in used.model], "leaves out": [MODELS[m][1] for m in used.model]}
    )
