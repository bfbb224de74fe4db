"""What gathering has in common: the cases of a study with the files that serve them, and arrays over the study's grid."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from limo.cases.case import Case
from limo.cases.grid import GridPoint
from limo.datasets.variables import CASE_DIMS
from limo.store.results import CaseFiles


@dataclass(frozen=True)
class Member:
    """One case of a study: its point, its place in arrays over the grid, and the files of the case that serves it."""

    point: GridPoint
    index: tuple[int, ...]
    case: Case
    files: CaseFiles

    @property
    def source(self) -> str:
        """Id of the case that serves it."""
        return self.files.folder.name


def members(
    cases: Mapping[GridPoint, Case], axes: Mapping[str, Sequence], case_folder: Path, sources: Sequence[str] | None = None
) -> Iterator[Member]:
    """The cases of a study in the order of its grid; ``sources``: ids of those that serve them (default: they themselves).

    ``axes``: values along each dimension of the arrays.
    """
    chosen = sources or [case.case_id for case in cases.values()]
    for (point, case), source in zip(cases.items(), chosen, strict=True):
        yield Member(point, point.index(axes), case, CaseFiles(case_folder / source))


def attributes(long_name: str, units: str = "") -> dict[str, str]:
    """The attributes of a stored variable; without units for a text or a flag."""
    return {"long_name": long_name} | ({"units": units} if units else {})


def frame_labels(frames: Sequence[float | str]) -> dict[str, float | str]:
    """Pressures as a study writes them, each once, by their labels."""
    return {f if isinstance(f, str) else f"{f:g}": f for f in frames}


class GridArrays:
    """Arrays over the grid of a study, filled case by case: ``arrays[name][member.index] = value``."""

    def __init__(self, axes: Mapping[str, Sequence]):
        self.axes = {name: list(values) for name, values in axes.items()}
        self.shape = tuple(map(len, self.axes.values()))
        self._arrays: dict[str, tuple[tuple[str, ...], np.ndarray, dict[str, str]]] = {}

    def __getitem__(self, name: str) -> np.ndarray:
        return self._arrays[name][1]

    def add(self, name: str, fill: Any, long_name: str, units: str = "", further: Mapping[str, int] | None = None) -> np.ndarray:
        """A new array of ``fill``, a number or a text; ``further`` are dimensions behind those of a case, and their lengths."""
        further = further or {}
        kind = object if isinstance(fill, str) else type(fill)
        array = np.full(self.shape + tuple(further.values()), fill, kind)
        self._arrays[name] = ((*CASE_DIMS, *further), array, attributes(long_name, units))
        return array

    def dataset(self, coords: Mapping[str, Any] | None = None) -> xr.Dataset:
        """All arrays as variables over the axes and ``coords`` of further dimensions."""
        variables = {n: (d, a.astype(str) if a.dtype == object else a, attrs) for n, (d, a, attrs) in self._arrays.items()}
        return xr.Dataset(variables, coords=self.axes | dict(coords or {}))
