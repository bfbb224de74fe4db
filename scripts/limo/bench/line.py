"""The straight part of a stress-strain curve and its slope, with an error that knows how the part was chosen.

Three methods: ``found`` looks for the part, ``window`` takes the strains that are stated, and ``paper`` is the line through the
origin of the paper (*Material model calibration*).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import combinations, pairwise

import numpy as np
from scipy import stats

#: a window is sought among the edges of so many parts of the curve, on the curve made of at most so many means
_PARTS, _MEANS = 48, 600
#: a window holds so many means, and such a share of the largest stress
_FEWEST, _SMALLEST_SHARE = 5, 0.2
#: slopes of its thirds differ from its own by at most this share (more by steps where no window is that straight) ...
_STRAIGHT = 0.02
#: ... and its slope is at most this share below the steepest one: a toe and what follows a yield are straight as well
_STEEPEST = 0.03
#: what counts as the begin of loading, over the largest stress of the test and of the strains that are looked at
_ONSET, _ONSET_THERE = 0.02, 0.05
#: share of the stress that a straight part reaches over, below which that is said
_SMALL = 0.4
#: how far a point is from the median of its neighbours, over the range of all, to be a disturbance and no measurement
_DISTURBED = 0.3


@dataclass(frozen=True)
class Line:
    """sigma = intercept + modulus * eps (MPa) over the strains of ``window``, fitted to the points ``used`` (n,).

    ``error_fit``: standard error of the slope by the scatter of the points, which are not taken as independent where their
    residuals follow each other. ``error_window``: standard deviation of the slopes of other windows that are as good. ``trend``:
    change of the slope over the window by a parabola, over the slope; ``trend_probability``: of such a trend by chance.
    """

    modulus: float
    intercept: float
    error_fit: float
    error_window: float
    r_squared: float
    window: tuple[float, float]
    used: np.ndarray
    trend: float
    trend_probability: float
    notes: tuple[str, ...] = ()

    @property
    def error(self) -> float:
        """Standard error of the modulus (MPa): fit and choice of the window together."""
        return float(np.hypot(self.error_fit, self.error_window))

    @property
    def points(self) -> int:
        """How many points were fitted."""
        return int(self.used.sum())


def through_origin(strain: np.ndarray, stress: np.ndarray) -> tuple[float, float]:
    """E = sum(sigma eps) / sum(eps^2), the least-squares line through the origin, and its standard error.

    Nominal strains and stresses (n,), n > 1; both numbers in the unit of the stress.
    """
    modulus = float(stress @ strain / (strain @ strain))
    scatter = stress - modulus * strain
    return modulus, float(np.sqrt(scatter @ scatter / (len(strain) - 1) / (strain @ strain)))


def disturbed(stress: np.ndarray) -> np.ndarray:
    """Which points (n,) of a curve stand alone, far from their neighbours on both sides, as a load cell's errors do."""
    if len(stress) < 9:
        return np.zeros(len(stress), bool)
    middle = np.median(np.lib.stride_tricks.sliding_window_view(stress, 5), axis=1)
    spread = np.ptp(middle) * (len(stress) - 1) / (len(stress) - 5)  # medians do not reach the ends of a line
    middle = np.pad(middle, 2, mode="edge")
    return np.abs(stress - middle) > _DISTURBED * (spread or 1.0)


def largest(stress: np.ndarray) -> int:
    """Where a curve (n,) has its largest stress: behind it lie the break and the return of the crosshead."""
    return int(np.argmax(np.where(disturbed(stress), -np.inf, stress)))


def fit_paper(strain: np.ndarray, stress: np.ndarray, largest_strain: float) -> Line | None:
    """The paper's line through the origin over all 0 < eps < ``largest_strain``; None with fewer than three points."""
    used = (strain > 0) & (strain < largest_strain)
    if used.sum() < 3:
        return None
    modulus, error = through_origin(strain[used], stress[used])
    others = []
    for share in np.linspace(2 / 3, 1, 6)[:-1]:
        part = used & (strain < share * strain[used].max())
        if part.sum() >= 3:
            others.append(through_origin(strain[part], stress[part])[0])
    residuals = stress[used] - modulus * strain[used]
    trend, probability = _trend(strain[used], stress[used])
    return Line(
        modulus, 0.0, error * _dependence(residuals), _spread(modulus, others), _explained(stress[used], residuals),
        (0.0, largest_strain), used, trend, probability,
    )  # fmt: skip


def fit_window(strain: np.ndarray, stress: np.ndarray, window: tuple[float, float]) -> Line | None:
    """A line with intercept over a window of strains, as far as the largest stress; None with fewer than three points there."""
    used = (strain >= window[0]) & (strain <= window[1])
    used[largest(stress) + 1 :] = False
    used &= ~disturbed(stress)
    if used.sum() < 3 or not np.ptp(strain[used]):
        return None
    line = _fitted(strain, stress, used)
    low, high = strain[used].min(), strain[used].max()
    edges = np.linspace(low, high, 13)
    slopes = []
    for a, b in _within(13, 8):
        part = used & (strain >= edges[a]) & (strain <= edges[b])
        if part.sum() >= 3 and np.ptp(strain[part]):
            slopes.append(np.polyfit(strain[part], stress[part], 1)[0])
    return replace(line, window=window, error_window=_spread(line.modulus, slopes))


def find_line(strain: np.ndarray, stress: np.ndarray, largest_strain: float) -> Line | None:
    """The line with intercept over the widest straight window that is as steep as any; None where there are too few points.

    A curve (n,) is looked at from its first point to its largest stress and no further than ``largest_strain`` from the begin of
    loading. A window is straight where the slopes of its thirds are its own but for 2 %, or for their standard errors. Of the
    straight windows that are as steep as the steepest but for 3 %, the one that reaches furthest is taken: a toe (slack, crimp)
    and what follows yielding are less steep.
    """
    last = largest(stress)
    kept = ~disturbed(stress) & (np.arange(len(strain)) <= last)
    x, y = strain[kept], stress[kept]
    if len(x) < 3 or not y[-1] > 0:
        return None
    base = np.median(y[: max(1, len(y) // 50)])
    level = base + _ONSET * (y.max() - base)
    for _ in range(4):
        below = np.flatnonzero(y < level)
        onset = x[below[-1]] if len(below) and len(below) < len(y) else x[0]
        level = min(level, base + _ONSET_THERE * (y[x <= onset + largest_strain].max() - base))
    kept &= strain <= onset + largest_strain
    x, y = strain[kept], stress[kept]
    if len(x) < 3 or not np.ptp(x) > 0 or not np.ptp(y) > 0:
        return None
    level = np.maximum.accumulate(y)
    reach = (np.maximum.accumulate(x) - x.min()) / np.ptp(x) + (level - level[0]) / (level[-1] - level[0] or 1.0)
    means = _means(x, y, reach)
    if len(means[0]) < _FEWEST:
        line = _fitted(strain, stress, kept)
        return replace(line, notes=(f"only {len(x)} points up to the largest force: all of them are fitted",))
    chosen, slopes, tolerance = _search(*means)
    low, high = means[2][chosen[0]], means[2][chosen[1]]
    used = np.zeros(len(strain), bool)
    used[np.flatnonzero(kept)[(reach >= low) & (reach <= high)]] = True
    line = _fitted(strain, stress, used)
    notes = ()
    if tolerance > 2 * _STRAIGHT:
        notes = (f"no part of the curve is straight: slopes of the thirds of the window differ by up to {tolerance:.0%}",)
    elif (share := np.ptp(line.modulus * strain[used]) / np.ptp(y)) < _SMALL:
        notes = (f"the straight part reaches over {share:.0%} of the stress only; window states another one",)
    return replace(line, error_window=_spread(line.modulus, slopes), notes=notes)


# --------------------------------------------------------------------------------------------------------------------
# the search


def _means(x: np.ndarray, y: np.ndarray, reach: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Means of strain, stress and reach over at most ``_MEANS`` parts of the curve, and how many points each is of."""
    if len(x) <= _MEANS:
        return x, y, reach, np.ones(len(x))
    part = np.minimum((reach / reach[-1] * _MEANS).astype(int), _MEANS - 1)
    count = np.bincount(part, minlength=_MEANS)
    some = count > 0
    x, y, reach = (np.bincount(part, v, minlength=_MEANS)[some] / count[some] for v in (x, y, reach))
    return x, y, reach, count[some].astype(float)


def _search(x: np.ndarray, y: np.ndarray, reach: np.ndarray, weight: np.ndarray) -> tuple[tuple[int, int], list[float], float]:
    """First and last mean of the window, the slopes of other windows as good, and how straight it had to be."""
    if len(x) <= _PARTS + 1:
        edges = np.arange(len(x))
    else:
        edges = np.unique(np.searchsorted(reach, np.linspace(reach[0], reach[-1], _PARTS + 1)).clip(0, len(x) - 1))
    fewest = min(_FEWEST, len(x))
    least = _SMALLEST_SHARE * np.ptp(y)
    windows, slopes, errors, bends, doubts = [], [], [], [], []
    sums, noise = _Sums(x, y, weight), _noise(x, y)
    for a, b in combinations(edges.tolist(), 2):
        if b - a + 1 < fewest or abs(y[b] - y[a]) < least:
            continue
        slope, error = sums.line(a, b)
        if not slope > 0:
            continue
        bend, doubt = 0.0, 0.0
        for lower, upper in _thirds(a, b, x):
            part, part_error = sums.line(lower, upper, noise)
            bend = max(bend, abs(part - slope) / slope - 2.5 * part_error / slope)
            doubt = max(doubt, part_error / slope)
        windows.append((a, b))
        slopes.append(slope)
        errors.append(error)
        bends.append(bend)
        doubts.append(doubt)
    if not windows:
        return (0, len(x) - 1), [], np.inf
    windows, slopes, errors, bends, doubts = map(np.array, (windows, slopes, errors, bends, doubts))
    tolerance = _STRAIGHT
    known = doubts < 0.25  # a window within the noise says nothing
    while not (straight := (bends <= tolerance) & known).any():
        tolerance *= 2
        if tolerance > 4:
            straight = known = np.ones(len(windows), bool)
            break
    steepest = (slopes - 2 * errors)[straight].max()
    good = straight & (
        slopes + 2 * errors >= (1 - max(_STEEPEST, min(tolerance, 0.5) if tolerance > _STRAIGHT else 0)) * steepest
    )
    span = reach[windows[:, 1]] - reach[windows[:, 0]]
    best = int(np.argmax(np.where(good, span, -1.0)))
    a, b = windows[best]
    inside = (windows[:, 0] >= a) & (windows[:, 1] <= b)
    near = (good | (inside & known)) & (span >= 2 / 3 * span[best])
    return (int(a), int(b)), slopes[near].tolist(), tolerance


def _thirds(a: int, b: int, x: np.ndarray) -> Iterator[tuple[int, int]]:
    """The thirds of a window, or its halves where it holds few means."""
    parts = 3 if b - a + 1 >= 9 else 2
    edges = np.linspace(a, b, parts + 1).round().astype(int)
    for lower, upper in pairwise(edges):
        if upper - lower >= 1 and x[upper] > x[lower]:
            yield int(lower), int(upper)


class _Sums:
    """Lines over any window in constant time, from running sums."""

    def __init__(self, x: np.ndarray, y: np.ndarray, weight: np.ndarray):
        x, y = x - x.mean(), y - y.mean()
        self.sums = np.stack(
            [np.concatenate([[0.0], np.cumsum(weight * v)]) for v in (np.ones(len(x)), x, y, x * x, x * y, y * y)]
        )

    def line(self, a: int, b: int, noise: float | None = None) -> tuple[float, float]:
        """Slope over the means a to b and its standard error, by the scatter about the line or by a known ``noise``."""
        n, sx, sy, sxx, sxy, syy = self.sums[:, b + 1] - self.sums[:, a]
        xx, xy, yy = sxx - sx * sx / n, sxy - sx * sy / n, syy - sy * sy / n
        if not xx > 0:
            return 0.0, np.inf
        slope = xy / xx
        scatter = np.sqrt(max(yy - slope * xy, 0.0) / max(b - a - 1, 1)) if noise is None else noise
        return slope, scatter / np.sqrt(xx)


def _noise(x: np.ndarray, y: np.ndarray) -> float:
    """Standard deviation of a point of a curve (n,), from its distance to the line through its neighbours; kinks count little."""
    if len(x) < 6:
        return 0.0
    gap = np.where(x[2:] > x[:-2], x[2:] - x[:-2], 1.0)
    share = np.where(x[2:] > x[:-2], (x[1:-1] - x[:-2]) / gap, 0.5)
    away = y[1:-1] - (1 - share) * y[:-2] - share * y[2:]
    return float(np.quantile(np.abs(away) / np.sqrt(1 + share**2 + (1 - share) ** 2), 0.75) / 1.15)


def _within(count: int, least: int) -> Iterator[tuple[int, int]]:
    """Pairs of edges (of ``count``) that are ``least`` or more apart."""
    return ((a, b) for a, b in combinations(range(count), 2) if b - a >= least)


# --------------------------------------------------------------------------------------------------------------------
# what a fit says


def _fitted(strain: np.ndarray, stress: np.ndarray, used: np.ndarray) -> Line:
    x, y = strain[used], stress[used]
    found = stats.linregress(x, y)
    residuals = y - found.intercept - found.slope * x
    error = float(found.stderr) if len(x) > 2 and np.isfinite(found.stderr) else 0.0
    trend, probability = _trend(x, y)
    return Line(
        float(found.slope), float(found.intercept), error * _dependence(residuals), 0.0, _explained(y, residuals),
        (float(x.min()), float(x.max())), used, trend, probability,
    )  # fmt: skip


def _trend(x: np.ndarray, y: np.ndarray) -> tuple[float, float]:
    """Change of the slope over the points by a parabola, over the slope of their line, and its probability by chance (F test)."""
    if len(x) < 4 or len(np.unique(x)) < 3:
        return 0.0, 1.0
    t = (x - x.mean()) / np.ptp(x)
    line, parabola = np.polynomial.Polynomial.fit(t, y, 1), np.polynomial.Polynomial.fit(t, y, 2)
    rest = [float(np.sum((y - p(t)) ** 2)) for p in (line, parabola)]
    slopes = parabola.deriv()(t.min()), parabola.deriv()(t.max())
    slope = line.convert().coef[1]
    change = float((slopes[1] - slopes[0]) / slope) if slope else 0.0
    if rest[1] <= 1e-20 * float(y @ y):
        return change, 1.0 if rest[0] <= 1e-20 * float(y @ y) else 0.0
    ratio = (rest[0] - rest[1]) / (rest[1] / (len(x) - 3))
    return change, float(stats.f.sf(max(ratio, 0.0), 1, len(x) - 3))


def _dependence(residuals: np.ndarray) -> float:
    """By which a standard error grows where residuals follow each other: sqrt((1 + r) / (1 - r)), r of neighbours, 0 to 0.95."""
    if len(residuals) < 8:
        return 1.0
    total = float(residuals @ residuals)
    r = float(residuals[1:] @ residuals[:-1]) / total if total > 0 else 0.0
    r = min(max(r, 0.0), 0.95)
    return float(np.sqrt((1 + r) / (1 - r)))


def _explained(y: np.ndarray, residuals: np.ndarray) -> float:
    """R^2: the share of the variance that is explained."""
    about = float(np.sum((y - y.mean()) ** 2))
    return 1.0 - float(residuals @ residuals) / about if about > 0 else 0.0


def _spread(modulus: float, others: list[float]) -> float:
    """How far slopes of other windows are from the modulus, root mean square."""
    return float(np.sqrt(np.mean((np.array(others) - modulus) ** 2))) if others else 0.0
