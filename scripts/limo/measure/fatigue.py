"""Cycles to failure from strain: Coffin, Manson and Basquin (paper, *Local stress concentration and fatigue risk*).

    eps_a = sigma_f' / E (2 N)^b + eps_f' (2 N)^c,     b < 0, c < 0

Right of it the amplitude falls strictly with N, so there is one N for every amplitude. The result is an index of risk for
comparing designs: the parameters are those of bulk TPU, not of a sealed seam.
"""

from __future__ import annotations

import numpy as np

from limo.schema.fatigue import Fatigue

FINITE, ENDURANCE, IMMEDIATE, NO_STRAIN = 0, 1, 2, 3
#: what the flag beside a number of cycles means
FLAGS = ("finite", "endurance", "immediate", "no_strain")
LOG_TOLERANCE = 1.0e-12
_ITERATIONS = 200


def strain_amplitude(cycles: np.ndarray, fatigue: Fatigue) -> tuple[np.ndarray, np.ndarray]:
    """Elastic and plastic amplitudes (...,) at N cycles (...,): sigma_f'/E (2N)^b and eps_f' (2N)^c."""
    reversals = 2.0 * np.asarray(cycles, float)
    elastic = fatigue.strength_coefficient.value / fatigue.youngs_modulus.value * reversals**fatigue.strength_exponent.value
    return elastic, fatigue.ductility_coefficient.value * reversals**fatigue.ductility_exponent.value


def _log_misfit(log_cycles: np.ndarray, log_amplitude: np.ndarray, fatigue: Fatigue) -> tuple[np.ndarray, np.ndarray]:
    """log of the curve minus log of the amplitude, and its slope d/d(log N), which lies between c and b."""
    b, c = fatigue.strength_exponent.value, fatigue.ductility_exponent.value
    log_reversals = log_cycles + np.log(2.0)
    elastic = np.log(fatigue.strength_coefficient.value / fatigue.youngs_modulus.value) + b * log_reversals
    plastic = np.log(fatigue.ductility_coefficient.value) + c * log_reversals
    total = np.logaddexp(elastic, plastic)
    weight = np.exp(elastic - total)
    return total - log_amplitude, weight * b + (1 - weight) * c


def cycles_to_failure(amplitude: np.ndarray, fatigue: Fatigue) -> tuple[np.ndarray, np.ndarray]:
    """Cycles N_f (...,) and flags (...,) for strain amplitudes (...,).

    Newton's method in log N on a log-log curve that is monotone and convex, kept inside a shrinking bracket by bisection:
    exact to 1e-10 in log N between 1 and ``endurance_cycles``. Flags index ``FLAGS``: an amplitude at or below the curve at
    ``endurance_cycles`` has N_f = NaN and ``endurance``; one at or above the curve at one cycle has N_f = 1 and ``immediate``;
    one that is not positive (no tension anywhere during the loading) N_f = NaN and ``no_strain``. NaN stays NaN with
    ``no_strain``.
    """
    strain = np.asarray(amplitude, float)
    cycles = np.full(strain.shape, np.nan)
    flags = np.full(strain.shape, NO_STRAIN, np.int8)
    first, last = (sum(strain_amplitude(np.array(n), fatigue)) for n in (1.0, fatigue.endurance_cycles.value))
    positive = strain > 0
    flags[positive] = FINITE
    flags[positive & (strain <= last)] = ENDURANCE
    flags[strain >= first] = IMMEDIATE
    cycles[strain >= first] = 1.0
    wanted = flags == FINITE
    if wanted.any():
        log_amplitude = np.log(strain[wanted])
        low, high = np.zeros_like(log_amplitude), np.full_like(log_amplitude, np.log(fatigue.endurance_cycles.value))
        x = 0.5 * (low + high)
        for _ in range(_ITERATIONS):
            misfit, slope = _log_misfit(x, log_amplitude, fatigue)
            low, high = np.where(misfit > 0, x, low), np.where(misfit > 0, high, x)
            newton = x - misfit / slope
            inside = (newton >= low) & (newton <= high)
            following = np.where(inside, newton, 0.5 * (low + high))
            change, x = np.abs(following - x), following
            if (change <= LOG_TOLERANCE).all():
                break
        cycles[wanted] = np.exp(x)
    return cycles, flags


def largest_amplitude(principal_membrane_strain: np.ndarray) -> np.ndarray:
    """Largest principal membrane strain over the frames of an inflation, (frames, ...) -> (...,).

    The paper takes the maximum reached during inflation as the amplitude, not half of the range: a conservative choice.
    """
    return np.max(principal_membrane_strain, axis=0)
