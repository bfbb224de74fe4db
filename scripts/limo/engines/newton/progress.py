"""Where a running solve of the engine newton is, by what it reports of itself (``limo.store.progress``)."""

from __future__ import annotations

from pathlib import Path

from limo.engines.engine import Place
from limo.errors import ResultError
from limo.schema.section import STAGES
from limo.store.files import finite_number, read_json
from limo.store.results import CaseFiles


def place(folder: Path, actuation_pressure_max: float) -> Place | None:
    """How far the last run in the folder of a case came; None while it has reported nothing. P_a in kPa."""
    file = CaseFiles(folder).progress
    try:
        reported = read_json(file)
    except ResultError:
        return None
    stage = reported.get("stage") if reported.get("stage") in STAGES else STAGES[0]
    pressure = min(max(finite_number(reported, "actuation_pressure") or 0.0, 0.0), actuation_pressure_max)
    fitted = min(max(finite_number(reported, "fitted") or 0.0, 0.0), 1.0) if stage == "fit" else 1.0
    counts = (int(finite_number(reported, key) or 0) for key in ("increments", "rejected", "iterations"))
    rested = stage not in ("fit", "hold")
    ramped = pressure / actuation_pressure_max if actuation_pressure_max else float(rested)
    shares = (fitted, float(rested), ramped)
    return Place(stage, pressure, shares, *counts, file.stat().st_mtime)
