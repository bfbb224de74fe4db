"""What ever larger models take: the table of measured sizes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from limo.store import statuses

#: columns of the table: units (none of a text), meaning
COLUMNS = {
    "engine": ("", "what iterated a model of this size: calculix or newton"),
    "build": ("", "build of the solver of a size"),
    "status": ("", "measured, or why a size was not"),
    "displacements": ("1", "displacements of a size's written-out bricks, full device"),
    "elements": ("1", "bricks of a size"),
    "iterations": ("1", "Newton iterations that a size was given"),
    "cpu_seconds": ("s", "CPU time of the solver for them, setting up left out where the engine tells it"),
    "memory_mib": ("MiB", "peak resident memory of the solver at a size"),
}


#: status of a size that was measured
MEASURED = statuses.MEASURED


def read_scaling(folder: Path) -> dict[str, tuple[str, np.ndarray]]:
    """What is in the tables of a folder, one an engine, as variables ``size_<column>`` along ``size``; none without tables."""
    tables = [pd.read_csv(file) for file in sorted(folder.glob("*.csv"))]
    rows = pd.concat([pd.DataFrame(columns=[*COLUMNS]), *tables]) if tables else pd.DataFrame(columns=[*COLUMNS])
    return {
        f"size_{name}": ("size", rows[name].to_numpy(float) if units else rows[name].fillna("").to_numpy(str))
        for name, (units, _) in COLUMNS.items()
    }
