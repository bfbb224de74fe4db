"""The measured quantities of many cases on the grid of a study."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import xarray as xr

from limo.cases.case import Case
from limo.config.project import Loaded
from limo.measure.quantities import FRAME, LABELS, MEASURES, Measure
from limo.store.files import UNREADABLE

# --------------------------------------------------------------------------------------------------------------------
# a study


def gather_measures(
    loaded: Loaded,
    name: str,
    cases: dict[tuple, Case],
    coords: dict[str, list],
    case_folder: Path,
    sources: Mapping[tuple, str] | None = None,
) -> xr.Dataset:
    """The measures of a study's cases: ``coords`` are the dimensions of a case and their values.

    ``sources``: by grid point the id of the case that serves it (default: the study's own).
    ``frame`` counts the pressures of the study as it writes them (``P_v + 10``); ``frame_pressure`` is what they came to.
    """
    study = loaded.studies[name]
    labels = [f if isinstance(f, str) else f"{f:g}" for f in (*study.frames, *study.fields_at)]
    entries = dict(zip(labels, (*study.frames, *study.fields_at), strict=True))
    shape, dims = tuple(len(v) for v in coords.values()), tuple(coords)
    sizes = {"frame": len(entries)} | {d: len(v) for d, (_, v, _) in LABELS.items()}
    chosen = {n: m for n, m in MEASURES.items() if not m.output or m.output in study.measures}
    data = {
        n: np.full(shape + tuple(sizes[d] for d in m.per), np.nan if m.units else "", float if m.units else object)
        for n, m in chosen.items()
    }
    status, reason = np.full(shape, "missing", object), np.full(shape, "", object)
    for key, case in cases.items():
        index = tuple(coords[d].index(k) for d, k in zip(dims, key, strict=True))
        source = sources[key] if sources else case.case_id
        try:
            with xr.open_dataset(case_folder / source / "measures.nc") as measured:
                measured = measured.load()
            status[index], reason[index] = measured.attrs["status"], measured.attrs["reason"]
        except UNREADABLE as error:
            reason[index] = str(error)
            continue
        if status[index] == "measured":
            if source != case.case_id:
                measured = _up_to(measured, case.actuation_pressure_max)
            pressures = [study.pressure_of(entry, case.ventricular_pressure) for entry in entries.values()]
            _take(data, index, measured, chosen, pressures)
    described = {}
    for n, m in chosen.items():
        attributes = {"long_name": m.long_name} | ({"units": m.units} if m.units else {})
        described[n] = ((*dims, *m.per), data[n] if m.units else data[n].astype(str), attributes)
    described["measure_status"] = (dims, status.astype(str), {"long_name": "whether a case could be measured"})
    described["measure_reason"] = (dims, reason.astype(str), {"long_name": "why a case could not be measured"})
    labels_used = {d: v for d, v in LABELS.items() if any(d in m.per for m in chosen.values())}
    dataset = xr.Dataset(described, coords=coords | labels_used | {"frame": list(entries)})
    dataset.frame.attrs["long_name"] = FRAME
    if "fatigue" in study.measures:
        dataset.attrs["fatigue"] = loaded.config.fatigue.model_dump_json()
    return dataset


def _up_to(measured: xr.Dataset, maximum: float) -> xr.Dataset:
    """The measures of a case without what lies beyond ``maximum`` (kPa): events of buckling, and contact.

    Contact is as fine as the frames, so the last clear one is the last frame at all where contact comes later.
    """
    measured = measured.copy()
    beyond = measured.buckling_after > maximum + 1e-6
    for name in ("buckling_before", "buckling_after", "buckling_jump", "buckling_displacement"):
        measured[name] = measured[name].where(~beyond)
    pressures = measured.frame_pressure.values
    last = max(pressures[pressures <= maximum + 1e-6], default=np.nan)
    for name in ("contact_front_back", "contact_endo_epi"):
        if not measured[name] <= maximum + 1e-6:
            measured[f"{name}_clear"] = np.fmin(measured[f"{name}_clear"], last).assign_attrs(measured[f"{name}_clear"].attrs)
            measured[name] = measured[name].where(False)
    return measured


def _take(data: dict, index: tuple, measured: xr.Dataset, chosen: dict[str, Measure], pressures: list[float | None]) -> None:
    """Put one case's measures in their places, frames by the pressure that was asked for."""
    stored = measured.requested_pressure.values
    rows = [next((j for j, s in enumerate(stored) if p is not None and abs(s - p) < 1e-6), None) for p in pressures]
    for name, measure in chosen.items():
        if name not in measured:
            continue
        values = measured[name].values
        if "frame" not in measure.per:
            data[name][index] = values
            continue
        for k, row in enumerate(rows):
            if row is not None:
                data[name][(*index, k)] = values[row]
