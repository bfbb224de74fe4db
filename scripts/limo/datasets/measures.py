"""The measured quantities of many cases on the grid of a study."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import xarray as xr

from limo.cases.grid import study_grid
from limo.config.project import Project
from limo.datasets.gather import GridArrays, Member, frame_labels, members
from limo.measure.contact import CONTACTS
from limo.measure.quantities import FRAME, LABELS, Measure, chosen_measures
from limo.schema.pressures import is_beyond, reaches, same_pressure
from limo.schema.study import Study
from limo.store.files import UNREADABLE
from limo.store.statuses import MEASURED, MISSING


def gather_measures(project: Project, name: str, case_folder: Path, sources: Sequence[str] | None = None) -> xr.Dataset:
    """The measures of a study's cases below ``case_folder``, over all dimensions of a case.

    ``sources``: ids of the cases that serve the study, in the order of its grid (default: its own cases).
    ``frame`` counts the pressures of the study as it writes them (``P_v + 10``); ``frame_pressure`` is what they came to.
    """
    grid = study_grid(project, name)
    study, entries = grid.study, frame_labels([*grid.study.frames, *grid.study.fields_at])
    chosen = chosen_measures(study.measures, study.has_legs)
    arrays = GridArrays(grid.axes)
    sizes = {"frame": len(entries)} | {d: len(v) for d, (_, v, _) in LABELS.items()}
    for n, m in chosen.items():
        arrays.add(n, np.nan if m.units else "", m.long_name, m.units, {d: sizes[d] for d in m.per})
    arrays.add("measure_status", MISSING, "whether a case could be measured")
    arrays.add("measure_reason", "", "why a case could not be measured")
    for member in members(grid.cases, arrays.axes, case_folder, sources):
        _fill(arrays, member, study, list(entries.values()), chosen)
    used = {d: v for d, v in LABELS.items() if any(d in m.per for m in chosen.values())}
    dataset = arrays.dataset(used | {"frame": list(entries)})
    dataset.frame.attrs["long_name"] = FRAME
    if "fatigue" in study.measures:
        dataset.attrs["fatigue"] = project.config.fatigue.model_dump_json()
    return dataset


def _fill(arrays: GridArrays, member: Member, study: Study, entries: Sequence[float | str], chosen: dict[str, Measure]) -> None:
    """Put the measures of one case into their places, or why there are none."""
    index, case = member.index, member.case
    try:
        with xr.open_dataset(member.files.measures) as opened:
            measured = opened.load()
        status, reason = measured.attrs["status"], measured.attrs["reason"]
    except FileNotFoundError:  # no more of it: where it would lie is no part of a dataset
        arrays["measure_reason"][index] = "not measured"
        return
    except UNREADABLE as error:
        arrays["measure_reason"][index] = str(error)
        return
    arrays["measure_status"][index], arrays["measure_reason"][index] = status, reason
    if status != MEASURED:
        return
    if member.source != case.case_id:
        measured = _up_to(measured, case.actuation_pressure_max)
    _take(arrays, index, measured, chosen, [study.pressure_of(entry, case.ventricular_pressure) for entry in entries])


def _up_to(measured: xr.Dataset, maximum: float) -> xr.Dataset:
    """The measures of a case without what lies beyond ``maximum`` (kPa): events of buckling, and contact.

    Contact is as fine as the frames, so the last clear one is the last frame at all where contact comes later.
    """
    measured = measured.copy()
    beyond = is_beyond(measured.buckling_after, maximum)
    for name in ("buckling_before", "buckling_after", "buckling_jump", "buckling_displacement"):
        measured[name] = measured[name].where(~beyond)
    pressures = measured.frame_pressure.values
    last = max(pressures[reaches(maximum, pressures)], default=np.nan)
    for name in CONTACTS:
        if not reaches(maximum, measured[name]):
            measured[f"{name}_clear"] = np.fmin(measured[f"{name}_clear"], last).assign_attrs(measured[f"{name}_clear"].attrs)
            measured[name] = measured[name].where(False)
    return measured


def _take(
    arrays: GridArrays, index: tuple, measured: xr.Dataset, chosen: dict[str, Measure], pressures: list[float | None]
) -> None:
    """Put one case's measures in their places, frames by the pressure that was asked for."""
    stored = measured.requested_pressure.values
    rows = [next((j for j, s in enumerate(stored) if p is not None and same_pressure(s, p)), None) for p in pressures]
    for name, measure in chosen.items():
        if name not in measured:
            continue
        values = measured[name].values
        if "frame" not in measure.per:
            arrays[name][index] = values
            continue
        for k, row in enumerate(rows):
            if row is not None:
                arrays[name][(*index, k)] = values[row]
