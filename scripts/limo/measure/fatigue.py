"""Cycles to failure from strain: Coffin, Manson and Basquin (paper, *Local stress concentration and fatigue risk*).

    eps_a = sigma_f' / E (2 N)^b + eps_f' (2 N)^c,     b < 0, c < 0

Right of it the amplitude falls strictly with N, so there is one N for every amplitude. The result is an index of risk for
comparing designs: the parameters are those of bulk TPU, not of a sealed seam.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

from limo.schema.fatigue import MORROW, NONE, SMITH_WATSON_TOPPER, Fatigue

FINITE, ENDURANCE, IMMEDIATE, NO_STRAIN = 0, 1, 2, 3
#: what the flag beside a number of cycles means
FLAGS = ("finite", "endurance", "immediate", "no_strain")
LOG_TOLERANCE = 1.0e-12
_ITERATIONS = 200
_NOTHING = 1e-12  # MPa: what is left of a strength that the mean stress takes
#: degrees between the directions of which a cycle's worst is taken
PLANE_STEP = 5.0


def strain_amplitude(cycles: np.ndarray, fatigue: Fatigue) -> tuple[np.ndarray, np.ndarray]:
    """Elastic and plastic amplitudes (...,) at N cycles (...,): sigma_f'/E (2N)^b and eps_f' (2N)^c."""
    reversals = 2.0 * np.asarray(cycles, float)
    elastic = fatigue.strength_coefficient.value / fatigue.youngs_modulus.value * reversals**fatigue.strength_exponent.value
    return elastic, fatigue.ductility_coefficient.value * reversals**fatigue.ductility_exponent.value


@dataclass(frozen=True)
class _Curve:
    """log(coefficient) and exponent of both branches over reversals, each a number or (n,): what ``damage`` is compared with."""

    elastic: np.ndarray | float
    elastic_exponent: float
    plastic: np.ndarray | float
    plastic_exponent: float

    def log(self, log_cycles: np.ndarray | float) -> tuple[np.ndarray, np.ndarray]:
        """log of the curve at log N, and its slope d/d(log N), which lies between the exponents."""
        log_reversals = log_cycles + np.log(2.0)
        elastic = self.elastic + self.elastic_exponent * log_reversals
        total = np.logaddexp(elastic, self.plastic + self.plastic_exponent * log_reversals)
        weight = np.exp(elastic - total)
        return total, weight * self.elastic_exponent + (1 - weight) * self.plastic_exponent

    def at(self, chosen: np.ndarray) -> _Curve:
        """The curves of chosen points (n,)."""
        return replace(self, elastic=np.broadcast_to(self.elastic, chosen.shape)[chosen])


def _curve(fatigue: Fatigue, correction: str, stress: np.ndarray | float) -> _Curve:
    strength, modulus = fatigue.strength_coefficient.value, fatigue.youngs_modulus.value
    ductility = fatigue.ductility_coefficient.value
    b, c = fatigue.strength_exponent.value, fatigue.ductility_exponent.value
    if correction == SMITH_WATSON_TOPPER:
        return _Curve(np.log(strength**2 / modulus), 2 * b, np.log(strength * ductility), b + c)
    if correction == MORROW:
        left = np.maximum(strength - np.maximum(stress, 0.0), _NOTHING)
        return _Curve(np.log(left / modulus), b, np.log(ductility), c)
    return _Curve(np.log(strength / modulus), b, np.log(ductility), c)


def damage(amplitude: np.ndarray, correction: str, largest_stress: np.ndarray | None) -> np.ndarray:
    """What the curve of a mean correction is compared with, (...,): eps_a, or sigma_max eps_a in MPa; zero in compression."""
    strain = np.asarray(amplitude, float)
    return np.maximum(largest_stress, 0.0) * strain if correction == SMITH_WATSON_TOPPER else strain


def cycles_to_failure(
    amplitude: np.ndarray,
    fatigue: Fatigue,
    correction: str = NONE,
    mean_stress: np.ndarray | None = None,
    largest_stress: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Cycles N_f (...,) and flags (...,) for strain amplitudes (...,).

    ``correction`` for the mean of a cycle, with stresses (...,) in MPa along the strain:

        none                  eps_a = sigma_f' / E (2 N)^b + eps_f' (2 N)^c
        morrow                eps_a = (sigma_f' - sigma_mean) / E (2 N)^b + eps_f' (2 N)^c,  a mean in compression counts as none
        smith_watson_topper   sigma_max eps_a = sigma_f'^2 / E (2 N)^2b + sigma_f' eps_f' (2 N)^(b + c)

    Newton's method in log N on a log-log curve that is monotone and convex, kept inside a shrinking bracket by bisection:
    exact to 1e-10 in log N between 1 and ``endurance_cycles``. Flags index ``FLAGS``: an amplitude at or below the curve at
    ``endurance_cycles`` has N_f = NaN and ``endurance``; one at or above the curve at one cycle has N_f = 1 and ``immediate``;
    one that is not positive (no tension anywhere during the loading) N_f = NaN and ``no_strain``. NaN stays NaN with
    ``no_strain``.
    """
    strain = damage(amplitude, correction, largest_stress)
    curve = _curve(fatigue, correction, 0.0 if mean_stress is None else mean_stress)
    cycles = np.full(strain.shape, np.nan)
    flags = np.full(strain.shape, NO_STRAIN, np.int8)
    first, last = (np.exp(curve.log(np.log(n))[0]) for n in (1.0, fatigue.endurance_cycles.value))
    positive = strain > 0
    flags[positive] = FINITE
    flags[positive & (strain <= last)] = ENDURANCE
    flags[strain >= first] = IMMEDIATE
    cycles[strain >= first] = 1.0
    wanted = flags == FINITE
    if wanted.any():
        log_strain, curve = np.log(strain[wanted]), curve.at(wanted)
        low, high = np.zeros_like(log_strain), np.full_like(log_strain, np.log(fatigue.endurance_cycles.value))
        x = 0.5 * (low + high)
        for _ in range(_ITERATIONS):
            value, slope = curve.log(x)
            misfit = value - log_strain
            low, high = np.where(misfit > 0, x, low), np.where(misfit > 0, high, x)
            newton = x - misfit / slope
            inside = (newton >= low) & (newton <= high)
            following = np.where(inside, newton, 0.5 * (low + high))
            change, x = np.abs(following - x), following
            if (change <= LOG_TOLERANCE).all():
                break
        cycles[wanted] = np.exp(x)
    return cycles, flags


@dataclass(frozen=True)
class StrainCycle:
    """A cycle at points (...,) along the direction in which it does most damage: amplitude and mean of the normal strain there,
    mean and largest normal stress in MPa, and the angle of the direction to the x axis in degrees."""

    amplitude: np.ndarray
    mean: np.ndarray
    mean_stress: np.ndarray
    largest_stress: np.ndarray
    angle: np.ndarray


def strain_cycle(strain: np.ndarray, stress: np.ndarray, correction: str = NONE) -> StrainCycle:
    """The worst direction in the fabric's plane of a cycle through strains and stresses (k, ..., 3): xx, yy, xy of tensors.

    Normal strain in a direction is eps = n . E n, normal stress sigma = n . S n. Of directions ``PLANE_STEP`` degrees apart the
    one with the largest ``damage`` is taken: the amplitude is at most 0.4 % of the largest range below that of all directions.
    Stress in MPa.
    """
    best: StrainCycle | None = None
    for angle in np.arange(-90.0, 90.0, PLANE_STEP):
        c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
        normal = np.array([c * c, s * s, 2 * c * s])
        along, bears = strain @ normal, stress @ normal
        high, low, most = along.max(axis=0), along.min(axis=0), bears.max(axis=0)
        one = StrainCycle(
            0.5 * (high - low), 0.5 * (high + low), 0.5 * (most + bears.min(axis=0)), most, np.full(high.shape, angle)
        )
        if best is None:
            best = one
            continue
        worse = damage(one.amplitude, correction, most) > damage(best.amplitude, correction, best.largest_stress)
        best = StrainCycle(**{f.name: np.where(worse, getattr(one, f.name), getattr(best, f.name)) for f in fields(StrainCycle)})
    return best


def largest_amplitude(principal_membrane_strain: np.ndarray) -> np.ndarray:
    """Largest principal membrane strain over the frames of an inflation, (frames, ...) -> (...,).

    The paper takes the maximum reached during inflation as the amplitude, not half of the range: a conservative choice.
    """
    return np.max(principal_membrane_strain, axis=0)
