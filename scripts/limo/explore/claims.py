"""The paper's statements on AR and E_hat inside a larger space: in what share of its designs each one holds.

Of a design all inputs but one stay, and the surrogate of a quantity is looked at along that one. The surrogate knows itself how
far off it may be, so functions are drawn from it along the line instead of its mean. What is left of a share at 0 or 1 is doubt.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from limo.explore.learn import Learned

#: designs along whose lines is looked, and functions drawn along each
DESIGNS, DRAWN = 64, 32
#: share of the mean stroke that it may differ by over AR and still count as hardly changed
HARDLY = 0.05


@dataclass(frozen=True)
class Claim:
    """A statement of the paper on an input: at which of its values a quantity is looked at, and which drawn (m, k) hold it."""

    text: str
    input: str
    at: tuple[float, ...]
    quantity: str
    holds: Callable[[np.ndarray], np.ndarray]


_AR, _E = (1.0, 1.5, 2.0, 2.5, 3.0), (0.5, 0.75, 1.0, 1.25)
#: paper, sections on the valve support and on the endocardium's stiffness
CLAIMS = (
    Claim("efficiency is largest at AR = 2.5", "aspect_ratio", _AR, "efficiency_90ml", lambda y: y.argmax(axis=1) == 3),
    Claim(
        "AR hardly changes the stroke (5 %)",
        "aspect_ratio",
        _AR,
        "stroke_volume",
        lambda y: np.ptp(y, axis=1) <= HARDLY * y.mean(axis=1),
    ),
    Claim("less peak stress at AR = 1 than at AR = 3", "aspect_ratio", _AR, "von_mises_peak", lambda y: y[:, 0] < y[:, -1]),
    Claim("efficiency is largest at E_hat = 0.75", "stiffness_ratio", _E, "efficiency_90ml", lambda y: y.argmax(axis=1) == 1),
    Claim("efficiency rises as E_hat falls, 1 to 0.75", "stiffness_ratio", _E, "efficiency_90ml", lambda y: y[:, 1] > y[:, 2]),
    Claim("stroke is largest at E_hat = 0.75", "stiffness_ratio", _E, "stroke_volume", lambda y: y.argmax(axis=1) == 1),
    Claim("less peak stress at E_hat = 0.5 than at 1", "stiffness_ratio", _E, "von_mises_peak", lambda y: y[:, 0] < y[:, 2]),
    Claim("more peak stress at E_hat = 1.25 than at 1", "stiffness_ratio", _E, "von_mises_peak", lambda y: y[:, 3] > y[:, 2]),
)


def shares(learned: Learned) -> tuple[list[str], list[float], np.ndarray]:
    """Texts of the claims that the space can tell of, its numbers of pouches, and in what share (claims, numbers) each holds.

    A claim needs its input with all values inside of the range, and a surrogate of its quantity.
    """
    inputs = {each.name: each for each in learned.space.inputs}
    numbers = list(inputs["n_pouches"].values) if "n_pouches" in inputs else [float(learned.exploration.space.numbers[0])]
    known = [claim for claim in CLAIMS if _can_be_told(learned, claim)]
    found = np.full((len(known), len(numbers)), np.nan)
    for row, claim in enumerate(known):
        column = learned.space.names.index(claim.input)
        units = np.array([inputs[claim.input].to_unit(value) for value in claim.at])
        process = learned.process(claim.quantity)
        for k, number in enumerate(numbers):
            random = np.random.default_rng([learned.seed, k])
            held = []
            for place in random.random((DESIGNS, len(inputs))):
                line = np.repeat(place[None], len(units), axis=0)
                line[:, column] = units
                if "n_pouches" in inputs:
                    line[:, learned.space.names.index("n_pouches")] = inputs["n_pouches"].to_unit(number)
                held.append(claim.holds(process.drawn(learned.space.snapped(line), DRAWN, random)).mean())
            found[row, k] = np.mean(held)
    return [claim.text for claim in known], numbers, found


def _can_be_told(learned: Learned, claim: Claim) -> bool:
    each = next((i for i in learned.space.inputs if i.name == claim.input), None)
    inside = each is not None and each.low <= min(claim.at) and max(claim.at) <= each.high
    wanted = (*learned.exploration.goals, *learned.exploration.constraints)
    return bool(inside and claim.quantity in wanted and learned.process(claim.quantity) is not None)
