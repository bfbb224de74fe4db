"""Many parameter sets of a beating heart, and what a controller would have to do."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product
from pathlib import Path

import numpy as np
import xarray as xr
from scipy.optimize import brentq

from limo.beat.periodic import NUMBERS, PERIODIC_STATE, SIDES, beating
from limo.beat.surface import Surface
from limo.config.yaml_file import parse
from limo.errors import LimoError
from limo.schema.beat import Beat


def with_keys(beat: Beat, keys: Mapping[str, float]) -> Beat:
    """A circulation with other numbers, by keys such as ``driver.rate``, in the units that these have once they are read.

    Raises ``LimoError`` for a key that is none, and for a number out of its range.
    """
    data = beat.model_dump()
    for key, value in keys.items():
        section, _, name = key.partition(".")
        if not isinstance(data.get(section), dict) or name not in data[section]:
            known = ", ".join(f"{s}.{n}" for s, each in data.items() if isinstance(each, dict) for n in each)
            raise LimoError(f"{key}: no number of this circulation; one of {known}")
        unit = data[section][name].partition(" ")[2] if isinstance(data[section][name], str) else ""
        data[section][name] = f"{float(value)!r} {unit}" if unit else float(value)
    return parse(Beat, data, Path("limo beat"))


def swept(surface: Surface, beat: Beat, keys: Mapping[str, Sequence[float]]) -> xr.Dataset:
    """``NUMBERS`` of every combination of values of some keys, NaN without a periodic state; status and reason of each."""
    shape, sides = tuple(len(values) for values in keys.values()), SIDES[: 2 if beat.pulmonary else 1]
    numbers = {name: np.full((*shape, len(sides)), np.nan) for name in NUMBERS}
    statuses, reasons = np.full(shape, "", object), np.full(shape, "", object)
    sets = [with_keys(beat, dict(zip(keys, values, strict=True))) for values in product(*keys.values())]
    for index, one in zip(np.ndindex(shape), sets, strict=True):
        found = beating(surface, one)
        statuses[index], reasons[index] = found.status, found.reason
        if found.status == PERIODIC_STATE:
            for name, value in found.numbers.items():
                numbers[name][index] = value
    dims = tuple(keys)
    dataset = {n: ((*dims, "side"), v, {"units": NUMBERS[n][0], "long_name": NUMBERS[n][1]}) for n, v in numbers.items()}
    dataset |= {"status": (dims, statuses.astype(str)), "reason": (dims, reasons.astype(str))}
    return xr.Dataset(dataset, {**{key: list(values) for key, values in keys.items()}, "side": list(sides)})


def held(surface: Surface, beat: Beat, output: str, target: float, key: str, low: float, high: float) -> float:
    """The value of ``key`` between ``low`` and ``high`` with which the left device has ``target`` of an output; NaN without one.

    Found by Brent's method to a thousandth of the range; where a heart beats at neither end it is NaN, too.
    """

    def miss(value: float) -> float:
        found = beating(surface, with_keys(beat, {key: value}))
        if found.status != PERIODIC_STATE:
            raise LimoError(found.reason)
        return float(found.numbers[output][0]) - target

    try:
        if miss(low) * miss(high) > 0:
            return float("nan")
        return float(brentq(miss, low, high, xtol=1e-3 * (high - low)))
    except LimoError:
        return float("nan")
