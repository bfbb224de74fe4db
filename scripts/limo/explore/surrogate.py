"""What a result is between designs that were solved: Gaussian processes, of one fidelity or of two.

A process has a constant mean and a Matern 5/2 covariance with a length for each input (``scikit-learn``). The scatter of branches
is noise that is known at each design; what is left is a noise that is fitted. Two fidelities are tied by

    high(x) = rho low(x) + delta(x)

with low and delta processes of their own, fitted one after the other (Kennedy and O'Hagan 2000; Le Gratiet and Garnier 2014). The
error of a process is told by leaving each design out, for which its hyperparameters stay (Rasmussen and Williams 2006, section
5.4.2).
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np
from sklearn.exceptions import ConvergenceWarning
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import ConstantKernel, Matern, WhiteKernel

#: lengths in the unit cube, and noise over the variance of the values
LENGTHS, NOISE = (0.08, 20.0), (1e-6, 0.5)
#: starts of the search for hyperparameters beside the first
RESTARTS = 2
#: designs that a process needs at least
FEWEST = 4
#: standard deviations of an interval that 95 % of normal values lie in
WIDE = 1.959964


@dataclass(frozen=True)
class Quality:
    """How good a surrogate is, by designs that it did not know.

    ``error``: root mean square over the range of the values; ``coverage``: share of designs within their interval of 95 %;
    ``designs``: how many there were.
    """

    error: float
    coverage: float
    designs: int


class Process:
    """A Gaussian process of values (n,) at places (n, d), with a standard deviation (n,) of each that is known.

    Raises ``ValueError`` for fewer than ``FEWEST`` values, and for values that are no numbers.
    """

    def __init__(self, places: np.ndarray, values: np.ndarray, scatter: np.ndarray | None = None, seed: int = 0):
        if len(values) < FEWEST or not (np.isfinite(values).all() and np.isfinite(places).all()):
            raise ValueError(f"{FEWEST} or more numbers")
        self.places, self.values = np.asarray(places, float), np.asarray(values, float)
        self._mean, self._scale = float(self.values.mean()), float(self.values.std()) or 1.0
        known = np.zeros(len(values)) if scatter is None else np.nan_to_num(np.asarray(scatter, float)) / self._scale
        dimension = self.places.shape[1]
        kernel = ConstantKernel(1.0, (1e-3, 1e3)) * Matern(np.full(dimension, 0.5), [LENGTHS] * dimension, nu=2.5)
        self._process = GaussianProcessRegressor(
            kernel + WhiteKernel(1e-3, NOISE), alpha=known**2 + 1e-10, n_restarts_optimizer=RESTARTS, random_state=seed
        )
        with warnings.catch_warnings():  # an input without an effect has the longest length there is
            warnings.simplefilter("ignore", ConvergenceWarning)
            self._process.fit(self.places, (self.values - self._mean) / self._scale)
        self._noise = float(self._process.kernel_.k2.noise_level)

    def predict(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean and standard deviation (m,) at places (m, d) of what a mean over branches would be: without noise."""
        mean, deviation = self._process.predict(np.atleast_2d(places), return_std=True)
        without = np.sqrt(np.maximum(deviation**2 - self._noise, 1e-12))
        return self._mean + self._scale * mean, self._scale * without

    def drawn(self, places: np.ndarray, count: int, random: np.random.Generator) -> np.ndarray:
        """Values (count, m) at places (m, d) of functions drawn from the process, without noise."""
        mean, covariance = self._process.predict(np.atleast_2d(places), return_cov=True)
        covariance = covariance - self._noise * np.eye(len(mean))
        values, vectors = np.linalg.eigh(0.5 * (covariance + covariance.T))
        root = vectors * np.sqrt(np.maximum(values, 0.0))
        return self._mean + self._scale * (mean + random.standard_normal((count, len(mean))) @ root.T)

    @property
    def lengths(self) -> np.ndarray:
        """The lengths (d,) in the unit cube: the shorter, the more an input does."""
        return np.asarray(self._process.kernel_.k1.k2.length_scale)

    def left_out(self) -> tuple[np.ndarray, np.ndarray]:
        """Mean and standard deviation (n,) of each value from all others, its noise included."""
        inverse = np.linalg.inv(self._process.L_ @ self._process.L_.T)
        diagonal = np.diag(inverse)
        residual = (inverse @ self._process.y_train_) / diagonal
        return self.values - self._scale * residual, self._scale / np.sqrt(diagonal)

    def quality(self) -> Quality:
        """What leaving each design out tells."""
        return errors_of(self.values, *self.left_out())

    @property
    def noise(self) -> float:
        """Standard deviation of a value about the mean over branches that was fitted, beside the known one."""
        return self._scale * float(np.sqrt(self._noise))

    def with_values(self, places: np.ndarray, values: np.ndarray) -> Process:
        """The same process, its hyperparameters as they are, with more values (k,) at places (k, d)."""
        known = np.append(self._process.alpha, np.full(len(values), 1e-10))
        return self._like(np.vstack([self.places, places]), np.append(self.values, values), known)

    def without(self, keep: np.ndarray) -> Process:
        """The same process, its hyperparameters as they are, with those values alone that a mask (n,) keeps."""
        return self._like(self.places[keep], self.values[keep], self._process.alpha[keep])

    def _like(self, places: np.ndarray, values: np.ndarray, known: np.ndarray) -> Process:
        other = object.__new__(Process)
        other.places, other.values = places, values
        other._mean, other._scale, other._noise = self._mean, self._scale, self._noise
        other._process = GaussianProcessRegressor(self._process.kernel_, alpha=known, optimizer=None)
        other._process.fit(places, (values - self._mean) / self._scale)
        return other


class TwoFidelities:
    """A process of values of the higher fidelity, which are few, on one of the lower."""

    def __init__(self, low: Process, places: np.ndarray, values: np.ndarray, scatter: np.ndarray | None = None, seed: int = 0):
        self.low, self.places, self.values = low, np.asarray(places, float), np.asarray(values, float)
        cheap, _ = low.predict(self.places)
        centred = cheap - cheap.mean()
        # a slope of few values is not trusted further than that they belong together at all
        self.rho = float(np.clip((centred @ values) / max(centred @ centred, 1e-300), 0.0, 2.0)) if len(values) > 2 else 1.0
        self.delta = Process(self.places, self.values - self.rho * cheap, scatter, seed)

    def predict(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Mean and standard deviation (m,) at places (m, d)."""
        low, low_deviation = self.low.predict(places)
        difference, deviation = self.delta.predict(places)
        return self.rho * low + difference, np.hypot(self.rho * low_deviation, deviation)

    def with_values(self, places: np.ndarray, values: np.ndarray) -> TwoFidelities:
        """The same, its hyperparameters as they are, with more values (k,) of the higher fidelity at places (k, d)."""
        cheap, _ = self.low.predict(places)
        other = object.__new__(TwoFidelities)
        other.low, other.rho = self.low, self.rho
        other.places, other.values = np.vstack([self.places, places]), np.append(self.values, values)
        other.delta = self.delta.with_values(places, values - self.rho * cheap)
        return other

    def quality(self) -> Quality:
        """What leaving each value of the higher fidelity out tells, the lower one as it is."""
        mean, deviation = self.delta.left_out()
        cheap = self.values - self.delta.values
        return errors_of(self.values, cheap + mean, deviation)


def errors_of(values: np.ndarray, mean: np.ndarray, deviation: np.ndarray, span: float | None = None) -> Quality:
    """The quality of predictions (n,) with standard deviations (n,) of values (n,) that they did not know, over a range."""
    error = float(np.sqrt(np.mean((values - mean) ** 2)) / (span or np.ptp(values) or 1.0))
    inside = np.abs(values - mean) <= WIDE * np.maximum(deviation, 1e-300)
    return Quality(error, float(inside.mean()), len(values))
