"""What a table of errors says: the Pareto front, orders, extrapolations, scatter and scaling."""

from __future__ import annotations

import numpy as np
import pandas as pd
import xarray as xr

from limo.accuracy.sizes import COLUMNS as SIZES
from limo.accuracy.sizes import MEASURED
from limo.store.statuses import CONVERGED

# --------------------------------------------------------------------------------------------------------------------
# what figures and the report make of it

#: what the paper says of its mesh: how far the surface (d_c / L) is from that of the finest one
PAPER_CHAMFER = 5e-3
#: the element that stands for the default one with the same limit
SHELLS = "SHELL8R"


def rows_of(dataset: xr.Dataset) -> pd.DataFrame:
    """The rows without curves and shapes; ``error_volumes`` is the larger error of both volumes."""
    table = dataset[[n for n in dataset if dataset[n].dims == ("run",)]].to_dataframe()
    table["error_volumes"] = np.maximum(table.error_ventricle_volume, table.error_actuation_volume)
    return table


def settings_of(rows: pd.DataFrame) -> pd.DataFrame:
    """The rows of one device that say what a setting costs and how wrong it is.

    Runs that converged from the flat state as it is and solve the same problem (another fabric is another problem).
    """
    same = ~rows.varied.str.contains("fabric")
    return rows[(rows.kind == "run") & (rows.status == CONVERGED) & (rows.branch == 0) & (rows.part != "scatter") & same]


def meshes_of(rows: pd.DataFrame) -> pd.DataFrame:
    """The rows that differ from the default in the mesh level and in shells for bricks alone: discrete models of one limit."""
    shells = rows.varied.isin(["element", "level, element"]) & (rows.element == SHELLS)
    return rows[rows.varied.isin(["", "level"]) | shells]


def pareto(cost: np.ndarray, error: np.ndarray) -> np.ndarray:
    """Indices of the points that no other beats in both cost and error, cheapest first; NaN are left out."""
    cost, error = np.asarray(cost, float), np.asarray(error, float)
    best, front = np.inf, []
    for k in np.lexsort((error, cost)):
        if np.isfinite(cost[k]) and error[k] < best:
            best = error[k]
            front.append(k)
    return np.array(front, int)


#: without which there is no exponent
LEAST_SIZES = 3


def exponent(size: np.ndarray, cost: np.ndarray) -> tuple[float, float]:
    """p and a of cost = a size^p by least squares in logarithms; NaN of fewer than three different sizes."""
    size, cost = np.asarray(size, float), np.asarray(cost, float)
    use = np.isfinite(size) & np.isfinite(cost) & (size > 0) & (cost > 0)
    if len(np.unique(size[use])) < LEAST_SIZES:
        return float("nan"), float("nan")
    power, offset = np.polyfit(np.log(size[use]), np.log(cost[use]), 1)
    return float(power), float(np.exp(offset))


def richardson(size: np.ndarray, value: np.ndarray, order: float) -> float:
    """a of value = a + c h^order through the two largest sizes, which come last; h = size^(-1/2) is the edge of an element."""
    (coarse, fine), (before, last) = np.asarray(size, float)[-2:], np.asarray(value, float)[-2:]
    return float(last + (last - before) / ((fine / coarse) ** (0.5 * order) - 1.0))


def scatter_row(rows: pd.DataFrame, part: str) -> pd.Series | None:
    """What paths alone make of one device's errors on the finest mesh (``reference``) or the default one (first ``scatter``)."""
    scattered = rows[(rows.kind == "scatter") & (rows.part == part)]
    return scattered.iloc[0] if len(scattered) else None


def sizes_of(dataset: xr.Dataset) -> pd.DataFrame:
    """The measured sizes, columns as in ``limo.accuracy.scaling``, but ``seconds_per_iteration`` for what all of them took."""
    table = pd.DataFrame({name: dataset[f"size_{name}"].values for name in SIZES})
    table = table[table.status == MEASURED]
    return table.assign(seconds_per_iteration=table.pop("cpu_seconds") / table.iterations)


def scaling_of(rows: pd.DataFrame) -> pd.DataFrame:
    """Converged runs by ``model``, an engine or a shell of it, that differ in mesh level and symmetry alone.

    With ``seconds_per_iteration``. Elements of which there are fewer than three sizes are left out.
    """
    plain = rows.varied.map(lambda varied: {*varied.split(", ")} <= {"", "level", "symmetry", "element"})
    timed = rows[(rows.kind == "run") & (rows.status == CONVERGED) & plain]
    other = ", " + timed.element
    timed = timed.assign(
        seconds_per_iteration=timed.cpu_seconds / timed.iterations,
        model=timed.engine + other.where(timed.varied.str.contains("element"), ""),
    )
    return timed[timed.groupby("model").solved_degrees_of_freedom.transform("nunique") >= LEAST_SIZES]


def models_of(runs: pd.DataFrame, sizes: pd.DataFrame) -> pd.DataFrame:
    """What the exponents of an iteration and of memory of one engine are fitted to, with ``displacements``.

    Models of the full device where such were measured (``sizes_of``), else its runs (of ``scaling_of``).
    """
    measured = sizes[sizes.engine.isin(runs.model)]
    return measured if len(measured) else runs.rename(columns={"solved_degrees_of_freedom": "displacements"})
