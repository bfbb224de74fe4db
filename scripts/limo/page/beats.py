"""What the page shows of hearts that beat: the last beat of every device of a study in every circulation.

Of a beat it has pressures and volumes at a few moments. The shape of the device at a moment is made in the browser, between the
stored states of the study's cases whose P_v and P_a are nearest.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from limo.beat.loop import TRACE
from limo.beat.periodic import PERIODIC_STATE, beating
from limo.beat.surface import surfaces_beside
from limo.errors import ResultError
from limo.page.curves import rounded
from limo.schema.beat import Beat

#: moments of a beat
MOMENTS = 80
#: what is shown of them; arteries come from the vessels
SHOWN = ("ventricular_pressure", "actuation_pressure", "ventricle_volume", "actuation_volume")


def beats_of(dataset: Path, circulations: Mapping[str, Beat]) -> dict[str, dict[str, Any]]:
    """By N_p and circulation of the left device: a note, and the beat where it is periodic; empty where a study has no surfaces.

    Pressures in kPa, volumes in ml, times in s.
    """
    try:
        surfaces = surfaces_beside(dataset)
    except ResultError:
        return {}
    return {str(n): {name: _beat(surface, beat) for name, beat in circulations.items()} for n, surface in surfaces.items()}


def _beat(surface, beat: Beat) -> dict[str, Any]:
    found = beating(surface, beat)
    if found.status != PERIODIC_STATE:
        return {"note": f"{found.status.replace('_', ' ')}: {found.reason}"}
    places = np.linspace(0, len(found.time) - 1, MOMENTS).round().astype(int)
    traces = {name: found.traces[0, TRACE.index(name)] for name in SHOWN} | {"arterial_pressure": found.vessels[0]}
    plain = {name: [rounded(float(value)) for value in trace[places]] for name, trace in traces.items()}
    numbers = {name: float(value[0]) for name, value in found.numbers.items()}
    note = f"{numbers['stroke_volume']:.0f} ml a beat, {numbers['cardiac_output']:.1f} l/min, {numbers['power']:.1f} W"
    return {"note": note, "time": [rounded(float(t)) for t in found.time[places]]} | plain
