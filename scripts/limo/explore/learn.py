"""What the results of an exploration teach: surrogates of its quantities, where designs are feasible, and the next ones."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.stats import norm
from sklearn.exceptions import ConvergenceWarning
from sklearn.gaussian_process import GaussianProcessClassifier
from sklearn.gaussian_process.kernels import ConstantKernel, Matern

from limo.explore.front import on_front
from limo.explore.search import Knowledge, Surrogate
from limo.explore.space import Space
from limo.explore.surrogate import FEWEST, Process, Quality, TwoFidelities, errors_of
from limo.explore.telling import Told, violation
from limo.schema.exploration import LEARNED_FROM, NEVER, Exploration

#: share of the range of a goal that the reference lies beyond the worst design that is feasible
BEYOND = 0.05


@dataclass(frozen=True)
class Learned:
    """Surrogates of what was told of designs at places (n, d) of a space.

    ``told`` and ``designs`` in the order of ``places``. Goals are turned so that less is better.
    """

    exploration: Exploration
    space: Space
    places: np.ndarray
    told: Sequence[Told]
    designs: Sequence[Mapping[str, float]]
    _cache: dict = field(default_factory=dict, repr=False)

    @property
    def seed(self) -> int:
        """That of the exploration."""
        return self.exploration.seed

    @property
    def signed(self) -> list[tuple[str, float]]:
        """The goals, and what they are multiplied with so that less is better."""
        return [(name, -1.0 if way == "maximise" else 1.0) for name, way in self.exploration.goals.items()]

    @cached_property
    def solved(self) -> np.ndarray:
        """Which designs (n,) were solved."""
        return np.array([each.is_solved for each in self.told], bool)

    def design(self, number: int) -> dict[str, float]:
        """A design as it was written."""
        return dict(self.designs[number])

    def values(self, quantity: str) -> np.ndarray:
        """A quantity (n,) of all designs, NaN where it is not known."""
        return np.array([each.values[quantity] for each in self.told], float)

    @cached_property
    def goals(self) -> np.ndarray:
        """Goals (n, g) of which less is better."""
        return np.stack([sign * self.values(name) for name, sign in self.signed], axis=1)

    @cached_property
    def feasible(self) -> np.ndarray:
        """Which designs (n,) were solved, have their goals and meet all constraints."""
        met = self.solved & np.isfinite(self.goals).all(axis=1)
        for name in self.exploration.constraints:
            beyond = np.array([violation(self.exploration, name, value) for value in self.values(name)])
            met &= np.where(np.isfinite(beyond), beyond, np.inf) <= 0
        return met

    def process(self, quantity: str, sign: float = 1.0) -> Process | None:
        """The surrogate of a quantity times a sign; None of too few values."""
        if (quantity, sign) not in self._cache:
            values = sign * self.values(quantity)
            known = self.solved & np.isfinite(values)
            scatter = np.array([each.scatter[quantity] for each in self.told], float)
            enough = known.sum() >= max(FEWEST, len(self.space.inputs) + 1)
            made = Process(self.places[known], values[known], scatter[known], self.seed) if enough else None
            self._cache[quantity, sign] = made
        return self._cache[quantity, sign]

    def chance(self, process_of: Callable[[str], Surrogate | None] | None = None) -> Callable[[np.ndarray], np.ndarray]:
        """The probability (m,) that a design at places (m, d) can be solved, has its goals and meets its constraints.

        Bounds by surrogates of their quantities, here those of ``process_of``; all else, which has no number, by a Gaussian
        process of classes.
        """
        process_of = process_of or self.process
        bounds = {name: text for name, text in self.exploration.constraints.items() if text != NEVER}
        lacking = ~(self.solved & np.isfinite(self.goals).all(axis=1))
        for name in self.exploration.constraints.keys() - bounds.keys():
            lacking |= np.isfinite(self.values(name))
        classes = None
        if lacking.any() and not lacking.all():
            kernel = ConstantKernel(1.0) * Matern(np.full(len(self.space.inputs), 0.5), nu=2.5)
            with warnings.catch_warnings():  # an input without an effect has the longest length there is
                warnings.simplefilter("ignore", ConvergenceWarning)
                classes = GaussianProcessClassifier(kernel, random_state=self.seed).fit(self.places, ~lacking)

        def chance(places: np.ndarray) -> np.ndarray:
            result = np.ones(len(places))
            if classes is not None:
                result = classes.predict_proba(places)[:, list(classes.classes_).index(True)]
            for name in bounds:
                process = process_of(name)
                if process is None:
                    continue
                mean, deviation = process.predict(places)
                at_mean = np.array([violation(self.exploration, name, float(value)) for value in mean])
                result = result * norm.cdf(-at_mean / np.maximum(deviation, 1e-12))
            return result

        return chance

    @cached_property
    def reference(self) -> np.ndarray:
        """Goals (g,) that are a little worse than those of the worst feasible design; of all designs where none is feasible."""
        known = self.goals[self.feasible] if self.feasible.any() else self.goals[np.isfinite(self.goals).all(axis=1)]
        return known.max(axis=0) + BEYOND * np.maximum(np.ptp(known, axis=0), 1e-12)

    @cached_property
    def front(self) -> np.ndarray:
        """Numbers of the designs on the front."""
        numbers = np.flatnonzero(self.feasible)
        return numbers[on_front(self.goals[numbers])] if len(numbers) else numbers

    def those(self, chosen: np.ndarray) -> Learned:
        """What some of the designs (a mask) teach."""
        numbers = np.flatnonzero(chosen)
        told, designs = ([each[k] for k in numbers] for each in (self.told, self.designs))
        return Learned(self.exploration, self.space, self.places[numbers], told, designs)

    def knowledge(self) -> Knowledge | None:
        """What a search needs; None where the goals have no surrogates yet."""
        processes = [self.process(name, sign) for name, sign in self.signed]
        if any(process is None for process in processes):
            return None
        return Knowledge(processes, self.chance(), self.goals[self.front], self.reference, self.places)


@dataclass(frozen=True)
class Corrected:
    """What the cheap preset taught, corrected by designs that the finer one solved."""

    cheap: Learned
    fine: Learned
    _cache: dict = field(default_factory=dict, repr=False)

    def process(self, quantity: str, sign: float = 1.0) -> TwoFidelities | None:
        """The surrogate of a quantity by the finer preset times a sign; None of too few values."""
        if (quantity, sign) not in self._cache:
            low, values = self.cheap.process(quantity, sign), sign * self.fine.values(quantity)
            known = self.fine.solved & np.isfinite(values)
            scatter = np.array([each.scatter[quantity] for each in self.fine.told], float)
            enough = low is not None and known.sum() >= LEARNED_FROM
            places = self.fine.places[known] if enough else None
            self._cache[quantity, sign] = (
                TwoFidelities(low, places, values[known], scatter[known], self.cheap.seed) if enough else None
            )
        return self._cache[quantity, sign]

    def knowledge(self) -> Knowledge | None:
        """What a search of designs for the finer preset needs; None where that has solved too few."""
        processes = [self.process(name, sign) for name, sign in self.cheap.signed]
        if any(process is None for process in processes) or not self.fine.feasible.any():
            return None
        chance = self.cheap.chance(lambda name: self.process(name) or self.cheap.process(name))
        return Knowledge(processes, chance, self.fine.goals[self.fine.front], self.fine.reference, self.fine.places)


@dataclass(frozen=True)
class Tested:
    """How good a surrogate is: by leaving each design out, and by designs that it never knew (NaN without any)."""

    left_out: Quality
    held_out: Quality
    is_used: bool


def quality_of(learned: Learned, held_out: Learned | None = None) -> Mapping[str, Tested]:
    """Of each quantity with a surrogate how good it is, and whether it is to be used; errors over the range of what it knows."""
    found = {}
    for name in (*learned.exploration.goals, *learned.exploration.constraints):
        if learned.exploration.constraints.get(name) == NEVER or (process := learned.process(name)) is None:
            continue
        left_out, unseen = process.quality(), Quality(np.nan, np.nan, 0)
        if held_out is not None and len(held_out.told):
            known = held_out.solved & np.isfinite(held_out.values(name))
            if known.any():
                mean, deviation = process.predict(held_out.places[known])
                deviation = np.hypot(deviation, process.noise)
                unseen = errors_of(held_out.values(name)[known], mean, deviation, float(np.ptp(process.values)))
        worst = np.nanmax([left_out.error, unseen.error])
        found[name] = Tested(left_out, unseen, bool(worst <= learned.exploration.trusted_below))
    return found
