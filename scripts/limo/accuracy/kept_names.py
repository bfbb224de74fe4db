"""Which runs of a study are kept in the repository, and which are lacking: names alone, without their values."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

from limo.cases.case import Case
from limo.cases.grid import study_cases
from limo.config.project import Project
from limo.errors import ResultError
from limo.store.files import UNREADABLE


def kept_file(folder: Path, study: str) -> Path:
    """Where the runs of a study are kept."""
    return folder / f"{study}_runs.nc"


def kept_name(case: Case) -> str:
    """The name under which a run is kept: that of its case, whichever build of the engine solved it, without its device's.

    What decides a result is in the digest at its end, where the name of a device is not: a file may be renamed.
    """
    return without_device(replace(case, build="").case_id)


def without_device(name: str) -> str:
    """The name of a case without that of its device."""
    return re.sub(r"^\w+?_(?=np\d+_pv)", "", name)


def lacking(project: Project, name: str, folder: Path) -> list[bool]:
    """Of each case of a study, in the order of its grid, whether its run is not kept in ``folder``.

    Another mesh or other numerics are another case; another build of the engine is not.
    """
    there = set(names_in(kept_file(folder, name)))
    return [kept_name(case) not in there for case in study_cases(project, name).values()]


def names_in(file: Path) -> list[str]:
    """Names of the runs in a file; none without it. Raises ``ResultError``."""
    if not file.exists():
        return []
    import xarray as xr  # the rules ask for names, and mostly of no file

    try:
        with xr.open_dataset(file) as dataset:
            return [without_device(str(name)) for name in dataset.kept_name.values]
    except UNREADABLE as error:
        raise unusable(file, error) from None


def unusable(file: Path, error: Exception) -> ResultError:
    """What is said of a file that holds no runs."""
    return ResultError(f"{file}: not the runs of a study ({error}); without the file they are solved anew")
