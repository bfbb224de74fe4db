"""The increments that CalculiX reports in its STA file."""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Increment:
    """A line of the .sta file: an accepted increment, or an attempt that was cut back."""

    step: int
    increment: int
    attempt: int
    accepted: bool
    iterations: int
    total_time: float
    step_time: float
    size: float


_STA = re.compile(r"^\s*(\d+)\s+(\d+)\s+(\d+)(U?)\s+(\d+)\s+(\S+)\s+(\S+)\s+(\S+)\s*$")


def read_sta(path: Path, last: int | None = None) -> tuple[Increment, ...]:
    """Increments from a .sta file, or some of its ``last`` bytes; lines that are not (yet) complete are left out.

    CalculiX writes the time before a rejected attempt, so ``total_time`` of such a line is where it started from.
    """
    if not path.exists():
        return ()
    increments = []
    with path.open("rb") as file:
        if last is not None and file.seek(0, os.SEEK_END) > last:
            file.seek(-last, os.SEEK_END)
            file.readline()  # a part of one
        else:
            file.seek(0)
        text = file.read().decode("ascii", errors="replace")
    for line in text[: text.rfind("\n") + 1].splitlines():
        if match := _STA.match(line):
            step, increment, attempt, rejected, iterations, *times = match.groups()
            try:
                numbers = [float(t) for t in times]
            except ValueError:
                continue
            increments.append(Increment(int(step), int(increment), int(attempt), not rejected, int(iterations), *numbers))
    return tuple(increments)
