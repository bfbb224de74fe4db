"""Arrays of different lengths packed into one."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr

from limo.accuracy.surfaces import STEP


def packed(dataset: xr.Dataset) -> dict[str, dict]:
    """How variables are stored: compressed, in single precision, coordinates of shapes in steps of ``STEP``."""
    stored = {}
    for name, variable in dataset.variables.items():
        if name in ("points", "sections"):
            stored[name] = {"dtype": "int16", "scale_factor": STEP, "_FillValue": -32768, "zlib": True, "complevel": 9}
        elif name == "quads":
            stored[name] = {"dtype": "int32", "zlib": True, "complevel": 9}
        elif variable.dtype.kind == "f":
            squeezed = {"zlib": True, "complevel": 9} if variable.size > 1000 else {}
            stored[name] = {"dtype": "float32", "_FillValue": np.float32(np.nan)} | squeezed
    return stored


def padded(arrays: Sequence[np.ndarray]) -> np.ndarray:
    """Arrays (n,) of different lengths as rows, NaN behind their ends."""
    table = np.full((len(arrays), max([len(a) for a in arrays], default=0)), np.nan)
    for row, array in zip(table, arrays, strict=True):
        row[: len(array)] = array
    return table


def filled(arrays: Sequence[np.ndarray], fill: float) -> np.ndarray:
    """Arrays (n, k) of different lengths as one (a, n, k), ``fill`` behind their ends."""
    longest = max(map(len, arrays))
    return np.array([np.pad(a, ((0, longest - len(a)), (0, 0)), constant_values=fill) for a in arrays])


def stacked(sections: Sequence[tuple[np.ndarray, ...]], frames: int) -> np.ndarray:
    """Segments (s, frames, k, 2, 2) of runs, NaN behind the last of each frame."""
    longest = max([len(part) for parts in sections for part in parts], default=0)
    table = np.full((len(sections), frames, longest, 2, 2), np.nan)
    for row, parts in zip(table, sections, strict=True):
        for place, part in zip(row, parts, strict=False):
            place[: len(part)] = part
    return table
