"""The data that are kept in git, as the documents read them: studies of the gallery, costs, errors, curves."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import pandas as pd
import xarray as xr

from limo.accuracy.statistics import rows_of
from limo.accuracy.table import read_errors, under_presets
from limo.config.load import load_config
from limo.errors import ResultError
from limo.measure.states import lowest
from limo.reports.markdown import read_rows
from limo.reports.performance import CASE, read_measurements, with_iterations

#: the sets of the gallery: the first one, and those of two presets
FIRST, STANDARD, AS_IN_PAPER = "", "standard", "as_in_paper"
#: data of the gallery that are no study
NO_STUDY = ("accuracy", "material")


@dataclass(frozen=True)
class Kept:
    """The data that are kept below the project's folder, each read once. Members raise ``ResultError``."""

    root: Path
    _read: dict[Path, xr.Dataset] = field(default_factory=dict)

    def study(self, name: str, part: str = FIRST) -> xr.Dataset:
        """The dataset of a study in a set of the gallery."""
        file = self.root / "docs/gallery" / part / "data" / f"{name}.nc"
        try:
            if file not in self._read:
                self._read[file] = xr.load_dataset(file)
            return self._read[file]
        except (OSError, ValueError) as error:
            raise ResultError(f"{file}: not a study's dataset ({error})") from None

    def studies(self, part: str) -> list[xr.Dataset]:
        """The datasets of all studies in a set of the gallery."""
        files = sorted((self.root / "docs/gallery" / part / "data").glob("*.nc"))
        names = [f.stem for f in files if f.stem not in NO_STUDY and not f.stem.endswith(("_shapes", "_runs"))]
        return [self.study(name, part) for name in names]

    def loads(self, part: str) -> xr.Dataset:
        """The study over devices and ventricular pressures, solved from the exact flat states."""
        return lowest(self.study("afterload", part))

    def level(self, part: str) -> str:
        """Mesh level of a set of the gallery, as code."""
        return f"`{made_with(self.study('afterload', part))[0]}`"

    @cached_property
    def costs(self) -> pd.DataFrame:
        """The measured costs of runs, with ``iterations``."""
        return with_iterations(read_measurements(self.root / "docs/data/performance.csv"))

    @cached_property
    def errors(self) -> pd.DataFrame:
        """The measured errors of the settings of the device, one row a run, under the presets of today."""
        presets = load_config(str(self.root / "config/config.yaml")).config.presets
        return rows_of(under_presets(read_errors(self.root / "docs/gallery/data/accuracy.nc"), presets))

    @cached_property
    def paths(self) -> pd.DataFrame:
        """Curves of one case solved again, perturbed and on other meshes, by engine newton."""
        file = self.root / "docs/data/repeatability.csv"
        rows = read_rows(file, "curves", ("kind", "engine", "run", "pressure", "stroke_volume"), dtype={"run": str})
        return rows[rows.engine.isin(["newton"])]


def reference_of(rows: pd.DataFrame) -> pd.Series:
    """The mean of the runs on the finest mesh, of the rows of one device."""
    return rows[(rows.kind == "mean") & (rows.part == "reference")].iloc[0]


def grids(kept: Kept) -> dict[tuple[str, str], pd.DataFrame]:
    """The rows of whole grids by mesh level and engine, each case once."""
    rows = kept.costs[kept.costs.batch.str.startswith("grid")]
    rows = rows.drop_duplicates(["batch", *CASE])
    return dict(iter(rows.groupby(["level", "engine"], sort=False)))


def stock_factor(kept: Kept) -> float:
    """CPU time of CalculiX's stock build over that of the tuned one, for the same deck; NaN where it was not measured."""
    base = kept.costs[kept.costs.engine.isin(["calculix"]) & (kept.costs.variant == "base")].set_index("build").cpu_seconds
    return float(base["stock"] / base["tuned"]) if {"stock", "tuned"} <= set(base.index) else float("nan")


def made_with(dataset: xr.Dataset) -> tuple[str, str, str]:
    """Mesh level, engine and builds of a study's dataset."""
    setting = next(iter(json.loads(dataset.attrs["config"])["settings"].values()))
    builds = {re.sub(r" [0-9a-f]{16}\b", "", str(build)) for build in dataset.solver_build.values.ravel() if build}
    return setting["mesh"]["level"], setting["engine"], ", ".join(sorted(builds))
