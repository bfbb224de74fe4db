"""One potential for both volumes of a device, V_v = dpsi/dP_v and V_a = dpsi/dP_a, fitted to what a study has.

psi(P_v, P_a) = P_v V_v + P_a V_a - U is the complementary energy. A sheet that has one gives back over a closed way of both
pressures what it took. Interpolated each for itself, V_v and V_a would make energy. psi is a cubic tensor spline, with the P_v of
the study and even P_a as its knots. Its gradient is fitted to both volumes by least squares under conditions:

- V_v rises with P_v, V_a rises with P_a, and V_v falls with P_a;
- the matrix of their slopes is positive: the device is stable in a closed loop.

The second derivatives that this is about are linear in the coefficients. Where the matrix has an eigenvalue that is too small,
its eigenvector gives one more linear condition, until there is none (a cutting plane method). Least squares under linear
inequalities are a problem of least distance, which non-negative least squares solve (Lawson and Hanson 1974, chapter 23;
``nnls`` of scipy).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import BSpline
from scipy.optimize import nnls

#: kPa between knots over P_a
SPACING = 4.0
#: ml/kPa that a device gives way at least in any direction of both pressures, and what of it may be missing in the end: less than
#: full pouches do at 100 kPa (0.12), or the potential fills them with air that they do not take
LEAST_COMPLIANCE, _MISSING = 0.1, 0.05
#: places between two knots over P_v and P_a at which slopes are looked at, and rounds of that at most
_PLACES, _ROUNDS = (4, 2), 30
#: weight of the third derivative over P_v, which keeps the spline from swinging between the P_v of the study
_SMOOTH = 0.1
_TINY = 1e-6


@dataclass(frozen=True)
class Potential:
    """``coefficients`` (a, b) of psi in mJ on cubic splines with the knots ``ventricular`` and ``actuation`` (kPa)."""

    ventricular: np.ndarray
    actuation: np.ndarray
    coefficients: np.ndarray

    @cached_property
    def _bases(self) -> tuple[BSpline, BSpline]:
        return _basis(self.ventricular), _basis(self.actuation)

    def volumes(self, ventricular: np.ndarray, actuation: np.ndarray) -> np.ndarray:
        """V_v and V_a (2, m, n) in ml at pressures (m,) and (n,) in kPa."""
        one, other = self._bases
        first = one(ventricular, 1) @ self.coefficients @ other(actuation).T
        return np.stack([first, one(ventricular) @ self.coefficients @ other(actuation, 1).T])


def _basis(knots: np.ndarray) -> BSpline:
    """All cubic B-splines of knots as one vector."""
    padded = np.concatenate([[knots[0]] * 3, knots, [knots[-1]] * 3])
    return BSpline(padded, np.eye(len(padded) - 4), 3)


def fitted(ventricular: np.ndarray, actuation: np.ndarray, volumes: np.ndarray) -> Potential:
    """The potential of volumes (2, m, n) in ml, V_v and V_a, at pressures (m,) and (n,) in kPa."""
    knots = np.linspace(actuation[0], actuation[-1], 1 + max(1, round((actuation[-1] - actuation[0]) / SPACING)))
    one, other = _basis(ventricular), _basis(knots)
    between = np.linspace(ventricular[0], ventricular[-1], 4 * len(ventricular))
    rows = [
        _products(one(ventricular, 1), other(actuation)),
        _products(one(ventricular), other(actuation, 1)),
        _SMOOTH * _products(one(between, 3), other(knots)),
    ]
    size = rows[0].shape[1]
    matrix = np.vstack([*rows, _TINY * np.eye(size)])
    right = np.concatenate([volumes[0].ravel(), volumes[1].ravel(), np.zeros(len(rows[2]) + size)])
    slopes = _Slopes.of(one, other, ventricular, knots)
    conditions = _signs(one, other)
    least = np.zeros(len(conditions))
    found = least_squares_under(matrix, right, conditions, least)
    for _ in range(_ROUNDS):
        more = slopes.lacking(found)
        if not len(more):
            break
        conditions, least = np.vstack([conditions, more]), np.append(least, np.full(len(more), LEAST_COMPLIANCE))
        found = least_squares_under(matrix, right, conditions, least)
    return Potential(ventricular, knots, found.reshape(len(one.c), len(other.c)))


def _products(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Rows (m n, a b) of values of products of splines from those of the splines (m, a), (n, b)."""
    return np.einsum("ik,jl->ijkl", first, second).reshape(len(first) * len(second), -1)


def _signs(one: BSpline, other: BSpline) -> np.ndarray:
    """Rows g of conditions g c >= 0: V_v rises with P_v, V_a with P_a, and V_v falls with P_a."""
    steeper_v, steeper_a = (_differences(basis, 2) for basis in (one, other))
    return np.vstack(
        [
            np.kron(steeper_v, np.eye(len(other.c))),
            np.kron(np.eye(len(one.c)), steeper_a),
            -np.kron(_differences(one), _differences(other)),
        ]
    )


@dataclass(frozen=True)
class _Slopes:
    """What gives the slopes dV_v/dP_v, dV_v/dP_a, dV_a/dP_a from coefficients: rows (p, a b) of each at some places."""

    own: np.ndarray
    mixed: np.ndarray
    other: np.ndarray

    @classmethod
    def of(cls, one: BSpline, other: BSpline, ventricular: np.ndarray, actuation: np.ndarray) -> _Slopes:
        """At the knots and between them."""
        places = [_between(knots, count) for knots, count in zip((ventricular, actuation), _PLACES, strict=True)]
        return cls(*(_products(one(places[0], 2 - k), other(places[1], k)) for k in range(3)))

    def lacking(self, coefficients: np.ndarray) -> np.ndarray:
        """Rows g of conditions g c >= ``LEAST_COMPLIANCE`` that coefficients lack, each along an eigenvector."""
        a, b, d = (rows @ coefficients for rows in (self.own, self.mixed, self.other))
        values, vectors = np.linalg.eigh(np.stack([np.stack([a, b], -1), np.stack([b, d], -1)], -2))
        bad = np.flatnonzero(values[:, 0] < LEAST_COMPLIANCE - _MISSING)
        x, y = vectors[bad, 0, 0][:, None], vectors[bad, 1, 0][:, None]
        return x * x * self.own[bad] + 2 * x * y * self.mixed[bad] + y * y * self.other[bad]


def _between(knots: np.ndarray, count: int) -> np.ndarray:
    """The knots, and places within each interval of them."""
    shares = np.arange(count) / count
    return np.append((knots[:-1, None] + np.diff(knots)[:, None] * shares).ravel(), knots[-1])


def _differences(basis: BSpline, times: int = 1) -> np.ndarray:
    """Coefficients of a derivative from those of splines: (a - times, a)."""
    knots, degree, count = basis.t, basis.k, len(basis.c)
    result = np.eye(count)
    for order in range(times):
        inner, left = knots[order : len(knots) - order], degree - order
        scale = left / (inner[left + 1 : left + count - order] - inner[1 : count - order])
        result = scale[:, None] * np.diff(result, axis=0)
    return result


def least_squares_under(matrix: np.ndarray, right: np.ndarray, conditions: np.ndarray, least: np.ndarray) -> np.ndarray:
    """The x that brings matrix x nearest to ``right`` with conditions x >= least; ``matrix`` (p, q) has rank q.

    Raises ``ValueError`` where no x meets the conditions.
    """
    orthogonal, triangular = np.linalg.qr(matrix)
    free = orthogonal.T @ right
    turned = np.linalg.solve(triangular.T, conditions.T)  # (q, r)
    dual = np.vstack([turned, least - turned.T @ free])
    wanted = np.zeros(len(dual))
    wanted[-1] = 1.0
    weights, _ = nnls(dual, wanted, maxiter=20 * dual.shape[1])
    rest = dual @ weights - wanted
    if abs(rest[-1]) < _TINY**2:
        raise ValueError("no coefficients meet the conditions")
    return np.linalg.solve(triangular, free - rest[:-1] / rest[-1])
