"""When two pressures are the same: they come from YAML, from sums of floats and from the clocks of solvers."""

from __future__ import annotations

from typing import TypeVar

Pressures = TypeVar("Pressures")

#: decimals of a pressure in kPa that count
DECIMALS = 6
#: kPa; pressures closer than this are the same
CLOSE = 1e-6


def same_pressure(first: Pressures, second: Pressures) -> bool | Pressures:
    """Whether pressures (kPa, numbers or arrays) are the same; a NaN is like nothing."""
    return abs(first - second) < CLOSE


def is_beyond(pressure: Pressures, limit: float) -> bool | Pressures:
    """Whether pressures (kPa, numbers or arrays) are higher than a limit (kPa) and not the same."""
    return pressure > limit + CLOSE


def reaches(pressure: Pressures, wanted: float) -> bool | Pressures:
    """Whether pressures (kPa, numbers or arrays) are as high as a wanted one (kPa); a NaN is not."""
    return pressure >= wanted - CLOSE
