"""The accepted increments of the ramp of a solved case."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import xarray as xr

from limo.errors import ResultError
from limo.schema.section import STAGES
from limo.store.files import UNREADABLE
from limo.store.results import CaseFiles


def ramp_of(history: xr.Dataset) -> xr.Dataset:
    """The ramp of a case from its state at rest: the last increment of the hold, and all of the ramp after it."""
    at_rest = np.flatnonzero(history.stage.values == STAGES.index("hold"))
    ramp = np.flatnonzero(history.stage.values == STAGES.index("ramp"))
    if not len(at_rest):
        return history.isel(increment=slice(0, 0))
    return history.isel(increment=np.concatenate([at_rest[-1:], ramp]))


def read_ramp(folder: Path) -> xr.Dataset:
    """The ramp in a case's ``volumes.nc``. Raises ``ResultError`` for a file that is missing, damaged or of something else."""
    file = CaseFiles(folder).volumes
    try:
        with xr.open_dataset(file) as history:
            return ramp_of(history.load())
    except UNREADABLE as error:
        raise ResultError(f"{file}: not the volumes of a case ({error})") from None
