"""A study's dataset as one table for spreadsheets: a row for each case and P_a, units in the header."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import xarray as xr

from limo.schema.pressures import DECIMALS

PRESSURE = "actuation_pressure"
_SPREAD = ("zone", "side", "event", "leg")  # dimensions that become columns


def tidy(dataset: xr.Dataset) -> pd.DataFrame:
    """All variables of a study in one table, by case and P_a; names of columns have their units behind them.

    Values at frames stand at the P_a of the frame, in rows of their own where the curves have no such P_a. What belongs to a
    whole case is repeated in each of its rows. Rows without any curve are left out, but every case has at least one.
    """
    dims = list(dataset.case_status.dims)
    dataset = dataset.reset_coords(drop=True)
    columns: dict[str, xr.DataArray] = {}
    units = {name: dataset[name].attrs.get("units", "") for name in (*dims, PRESSURE)}
    for name, variable in dataset.data_vars.items():
        for column, part in _spread(str(name), variable).items():
            columns[column] = part
            units[column] = variable.attrs.get("units", "")
    by_case = [n for n, v in columns.items() if set(v.dims) == set(dims)]
    curves = [n for n, v in columns.items() if PRESSURE in v.dims]
    framed = [n for n, v in columns.items() if "frame" in v.dims]
    rows = _table(columns, curves, [*dims, PRESSURE]).dropna(subset=curves, how="all")
    rows[PRESSURE] = rows[PRESSURE].round(DECIMALS)
    if "frame_pressure" in framed:
        frames = _table(columns, framed, [*dims, "frame"]).dropna(subset="frame_pressure")
        frames[PRESSURE] = frames.pop("frame_pressure").round(DECIMALS)
        rows = rows.merge(frames.drop_duplicates([*dims, PRESSURE]), on=[*dims, PRESSURE], how="outer")
    table = _table(columns, by_case, dims).merge(rows, on=dims, how="left").sort_values([*dims, PRESSURE], ignore_index=True)
    texts = [n for n in ("case_id", "case_status", "case_reason") if n in by_case]
    order = list(dict.fromkeys([*dims, *texts, PRESSURE, *curves, *(c for c in rows if c not in dims), *by_case]))
    return table[order].rename(columns=lambda name: f"{name} [{units[name]}]" if units.get(name) else name)


def _spread(name: str, variable: xr.DataArray) -> dict[str, xr.DataArray]:
    """A variable, or its parts where it has a dimension besides those of a row; events that no case has are left out."""
    parts = {name: variable}
    for dim in (d for d in _SPREAD if d in variable.dims):
        parts = {f"{n} {value}": part.sel({dim: value}, drop=True) for n, part in parts.items() for value in part[dim].values}
    return {n: part for n, part in parts.items() if "event" not in variable.dims or part.notnull().any()}


def _table(columns: dict[str, xr.DataArray], names: list[str], index: list[str]) -> pd.DataFrame:
    if not names:
        return pd.DataFrame(columns=index)
    return xr.Dataset({n: columns[n] for n in names}).to_dataframe(dim_order=index).reset_index()


def write_csv(dataset: xr.Dataset, path: Path) -> None:
    """Write the table with six significant digits; what is not known stays empty."""
    tidy(dataset).to_csv(path, index=False, float_format="%.6g", na_rep="")
