"""Where a running solve of CalculiX is, by the files that it writes as it goes."""

from __future__ import annotations

import contextlib
import re
from pathlib import Path

from limo.engines.calculix.deck import actuation_pressure_at, stage_times
from limo.engines.calculix.run import JOB
from limo.engines.calculix.sta import read_sta
from limo.engines.engine import Place
from limo.errors import ResultError
from limo.schema.numerics import Numerics
from limo.schema.section import STAGES
from limo.store.files import read_json
from limo.store.results import NUMERICS

_ITERATION = re.compile(rb"^\s+\d+\s+\d+\s+\d+\s+\d+\s", re.MULTILINE)


def place(run: Path, numerics: Numerics, actuation_pressure_max: float) -> Place | None:
    """How far the run in a folder came; None while it has no file. P_a in kPa.

    Increments come from .sta and iterations from .cvg; before these there is the deck. ``numerics`` are those of the case,
    which a recovery ladder may have changed.
    """
    if not (written := [time for end in ("inp", "sta", "cvg") if (time := _written(run / f"{JOB}.{end}"))]):
        return None
    increments = read_sta(run / f"{JOB}.sta")
    accepted = [i for i in increments if i.accepted]
    iterations = 0
    with contextlib.suppress(FileNotFoundError):
        iterations = len(_ITERATION.findall((run / f"{JOB}.cvg").read_bytes()))
    times = stage_times(_of_attempt(run, numerics), actuation_pressure_max)
    clock = accepted[-1].total_time if accepted else 0.0
    shares = tuple(min(max((clock - t.start) / t.duration, 0.0), 1.0) for t in times)
    stage = next((t.name for t in times if clock < t.end * (1 - 1e-5)), STAGES[-1])  # .sta has six digits
    pressure = float(actuation_pressure_at(times, actuation_pressure_max, clock))
    return Place(stage, pressure, shares, len(accepted), len(increments) - len(accepted), iterations, max(written))


def _written(file: Path) -> float:
    """When a file was written last, s since 1970; 0 without it. CalculiX may remove it at any moment to write it anew."""
    with contextlib.suppress(FileNotFoundError):
        return file.stat().st_mtime
    return 0.0


def _of_attempt(run: Path, numerics: Numerics) -> Numerics:
    """The numerics of the attempt that is running."""
    try:
        return Numerics.model_validate(read_json(run / NUMERICS))
    except (ResultError, ValueError):
        return numerics
