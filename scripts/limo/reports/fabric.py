"""The generated parts of ``docs/fabric.md``: what bending and yarns do to devices, from the kept studies."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

from limo.datasets.curves import at_end
from limo.figures.trends import known, numbers_of
from limo.measure.states import lowest
from limo.reports.kept import STANDARD, Kept
from limo.reports.markdown import markdown_table

#: relative L2 errors in % of Delta V_v / V_a against experiments, by N_p (paper, Pressure-volume relationship)
PAPER_ERRORS = {4: 7.9, 6: 16.8, 8: 48.3, 10: 80.3}
#: digits of the numbers of a case after the point, those of other names have none
_DIGITS = {"Ratio": 2, "Cycles": 1}
NONE = "-"
_HEADS = {"n_pouches": "N_p", "variant": "fabric"}
_KEPT = ("n_pouches", "bending_factor", "branch", "actuation_pressure")


def parts(root: Path) -> dict[str, Callable[[], str]]:
    """What makes the text of each part. Raises ``ResultError`` for a dataset that cannot be read."""
    kept = Kept(root)
    return {
        "bending": lambda: markdown_table(numbers(kept.study("bending", STANDARD), "bending_factor", "f")),
        "growth": lambda: growth(kept.study("bending", STANDARD)),
        "angles": lambda: markdown_table(angles(kept.study("fabric_angle", STANDARD), kept.study("afterload", STANDARD))),
    }


def numbers(dataset: xr.Dataset, along: str, name: str) -> pd.DataFrame:
    """A row for every case of a study over ``along``: what the figure of trends has, least to largest of its solutions."""
    others = [d for d in dataset.case_status.dims if d not in ("branch", along) and dataset.sizes[d] > 1]
    dataset = dataset.isel({d: 0 for d in dataset.case_status.dims if d not in ("branch", along, *others)})
    found = known(numbers_of(dataset))
    rows = []
    for place in product(*(dataset[d].values for d in (*others, along))):
        here = dict(zip((*others, along), place, strict=True))
        row = {_HEADS.get(d, d): str(v) for d, v in here.items() if d != along} | {name: f"{here[along]:g}"}
        for text, values in found.items():
            head = text
            for written, plain in (("$", ""), ("\\Delta ", "Delta "), ("_{a,max}", "_a,max"), ("\\log_{10}", "log10")):
                head = head.replace(written, plain)
            row[head] = _span(values.sel(here).values, next((n for start, n in _DIGITS.items() if text.startswith(start)), 0))
        rows.append(row)
    return pd.DataFrame(rows)


def angles(woven: xr.Dataset, isotropic: xr.Dataset) -> pd.DataFrame:
    """A row for every case of a study over angles, after what is known of the isotropic fabric at the same load."""
    highest = float(woven.actuation_pressure.max())
    same = {d: woven[d].values for d in ("n_pouches", "ventricular_pressure")}
    plain = isotropic.sel(same).sel(actuation_pressure=slice(None, highest))
    plain = plain.drop_dims([d for d in ("frame", "event") if d in plain.dims])
    rows = [numbers(each, "fabric_angle", "angle") for each in (plain.expand_dims(fabric_angle=[np.nan]), woven)]
    rows[0] = rows[0].assign(fabric="isotropic", angle=NONE)
    table = pd.concat(rows, ignore_index=True).fillna(NONE)
    return table[["N_p", "fabric", "angle", *(c for c in rows[1].columns if c not in ("N_p", "fabric", "angle"))]]


def _span(values: np.ndarray, digits: int) -> str:
    known = np.atleast_1d(values)[np.isfinite(np.atleast_1d(values))]
    if not len(known):
        return NONE
    low, high = (f"{x:.{digits}f}" for x in (known.min(), known.max()))
    return low if low == high else f"{low} to {high}"


def distance(first: xr.DataArray, second: xr.DataArray) -> float:
    """Relative L2 distance of two curves over P_a, where both are known, to the second one."""
    both = np.isfinite(first.values) & np.isfinite(second.values)
    if not both.any():
        return np.nan
    return float(np.linalg.norm((first - second).values[both]) / np.linalg.norm(second.values[both]))


def growth(dataset: xr.Dataset) -> str:
    """How far bending moves Delta V_v / V_a of each N_p, beside the paper's error against experiments and the band."""
    ventricular = float(dataset.ventricular_pressure.max())
    dataset = dataset.squeeze([d for d in dataset.dims if d not in _KEPT and dataset.sizes[d] == 1], drop=True)
    ratio = dataset.io_ratio.where(dataset.actuation_pressure > ventricular)
    shown = lowest(dataset.assign(io_ratio=ratio)).io_ratio
    reference = shown.sel(bending_factor=1.0)
    rows, moved = [], {}
    for n in dataset.n_pouches.values:
        mine = {"n_pouches": n}
        each = {
            f: distance(shown.sel(mine | {"bending_factor": f}), reference.sel(mine)) for f in shown.bending_factor.values[:-1]
        }
        moved[int(n)] = each
        band = np.nan
        if dataset.sizes.get("branch", 1) > 1:
            solutions = ratio.sel(mine | {"bending_factor": 1.0})
            band = distance(solutions.isel(branch=0), solutions.isel(branch=1))
        plain = at_end(shown.sel(mine)).values
        rows.append(
            {"N_p": str(n), "paper against experiments [%]": f"{PAPER_ERRORS[int(n)]:g}" if int(n) in PAPER_ERRORS else NONE}
            | {f"f = {f:g} against 1 [%]": _percent(value) for f, value in each.items()}
            | {"between solutions at f = 1 [%]": _percent(band), "ratio at P_a,max falls or rises with f": _way(plain)}
        )
    return "\n\n".join([markdown_table(pd.DataFrame(rows)), *_verdict(moved)])


def _percent(value: float) -> str:
    return f"{100 * value:.1f}" if np.isfinite(value) else NONE


def _way(values: np.ndarray) -> str:
    known = values[np.isfinite(values)]
    if len(known) < 2:
        return NONE
    steps = np.diff(known)
    return "falls" if (steps < 0).all() else "rises" if (steps > 0).all() else "neither"


def _verdict(moved: dict[int, dict[float, float]]) -> list[str]:
    """How much more the smallest factor moves the most pouches than the fewest, beside the growth of the paper's error."""
    few, many = min(moved), max(moved)
    known = [f for f in moved[few] if all(np.isfinite(each[f]) for each in moved.values())]
    if not known or few not in PAPER_ERRORS or many not in PAPER_ERRORS:
        return []
    f = known[0]
    grown, paper = moved[many][f] / moved[few][f], PAPER_ERRORS[many] / PAPER_ERRORS[few]
    return [
        f"From N_p = {few} to {many} the paper's error grows {paper:.1f} times, and what f = {f:g} moves {grown:.1f} times. At "
        f"N_p = {many} it moves the ratio by {100 * moved[many][f]:.0f} %; the error is {PAPER_ERRORS[many]:g} %."
    ]
