"""Writing results so that no half-written file is ever taken for one: write aside, flush to disk, rename.

This is written here because no dependency does it, and the package atomicwrites is not maintained any more.
"""

from __future__ import annotations

import hashlib
import json
import os
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from limo.errors import ResultError

if TYPE_CHECKING:
    import xarray as xr


#: conventions that names, units and attributes of datasets keep
CONVENTIONS = "CF-1.11"
#: what opening a damaged netCDF file and taking what should be in it may raise
UNREADABLE = (OSError, ValueError, KeyError, AttributeError, RuntimeError)


def write_whole(path: Path, write: Callable[[Path], None], *, durable: bool = True) -> None:
    """Let ``write`` fill a temporary file beside ``path``, then put it in place in one step.

    The temporary name keeps the ending, by which some libraries choose their format. ``durable``: not before it is on the disk.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    aside = path.with_name(f".{os.getpid()}.{path.name}")
    try:
        write(aside)
        if durable:
            with aside.open("rb") as handle:
                os.fsync(handle.fileno())
        aside.replace(path)
    finally:
        aside.unlink(missing_ok=True)


def write_json(path: Path, data: dict[str, Any], *, durable: bool = True) -> None:
    """Write a JSON object as a whole."""
    write_whole(path, lambda p: p.write_text(json.dumps(data, indent=2) + "\n", encoding="utf-8"), durable=durable)


def stamp_of(path: Path) -> dict[str, Any]:
    """Size and hash of a file, by which ``is_whole`` knows it again."""
    with path.open("rb") as handle:
        return {"bytes": os.fstat(handle.fileno()).st_size, "sha256": hashlib.file_digest(handle, "sha256").hexdigest()}


def is_whole(path: Path, stamp: dict[str, Any], written: float) -> bool:
    """Whether a file is still the one of which a stamp was taken at a time ``written`` (s since 1970).

    It is read only if its size is right and it was touched since.
    """
    try:
        collected = path.stat()
        if collected.st_size != stamp["bytes"]:
            return False
        return collected.st_mtime <= written or stamp_of(path) == stamp
    except (OSError, KeyError, TypeError):
        return False


def read_netcdf(path: Path, what: str) -> xr.Dataset:
    """A dataset, which ``what`` names in the error. Raises ``ResultError`` for a file that holds none."""
    import xarray as xr  # planning needs no datasets

    try:
        with xr.open_dataset(path) as opened:
            return opened.load()
    except UNREADABLE as error:
        raise ResultError(f"{path}: no {what} ({error})") from None


def write_netcdf(
    dataset: xr.Dataset, path: Path, packed: Mapping[str, Mapping[str, Any]] | None = None, *, checked: bool = True
) -> None:
    """Write a dataset as a whole, as netCDF-4 of the simplest kind and by the CF conventions.

    Texts are arrays of UTF-8 characters, which every reader of netCDF knows; strings of any length are newer than some. Whole
    numbers have at most 32 bits: so a file can be turned into netCDF's classic formats, which know no longer ones.
    ``packed``: how variables are stored, by their names. ``checked``: every array of numbers is under a checksum that readers
    verify, some kB each.
    """
    encoding: dict[str, dict[str, Any]] = {}
    for name, variable in dataset.variables.items():
        stored = dict((packed or {}).get(name, {}))
        if variable.dtype.kind in "UO":
            stored["dtype"] = "S1"
        elif checked and variable.dtype.kind in "fi" and variable.ndim and variable.size:
            stored["fletcher32"] = True
        if variable.dtype.kind in "iu" and "dtype" not in stored and _fits_classic(variable):
            stored["dtype"] = "int32"
        if name in dataset.dims:  # an axis has no gaps
            stored["_FillValue"] = None
        if stored:
            encoding[name] = stored
    dataset = dataset.assign_attrs({"Conventions": CONVENTIONS} | dataset.attrs)
    write_whole(path, lambda aside: dataset.to_netcdf(aside, encoding=encoding))


def _fits_classic(variable: xr.Variable) -> bool:
    """Whether whole numbers are of a type that netCDF's classic formats do not have, and fit into 32 bits, which these have."""
    if variable.dtype.name in ("int8", "int16", "int32"):
        return False
    return not variable.size or (variable.values.min() >= -(2**31) and variable.values.max() < 2**31)


def read_json(path: Path) -> dict[str, Any]:
    """Read a JSON object. Raises ``ResultError`` when it is missing or damaged."""
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise ResultError(f"{path}: cannot be read ({error})") from None
    if not isinstance(data, dict):
        raise ResultError(f"{path}: not a JSON object")
    return data


def finite_number(data: Mapping[str, Any], key: str) -> float | None:
    """A finite number from plain data, None for anything else."""
    value = data.get(key)
    # whole numbers of JSON may be larger than any float
    usable = isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= sys.float_info.max
    return value if usable else None
