"""The straight part of a curve and its slope, against lines that are known."""

from __future__ import annotations

import numpy as np
import pytest

from limo.bench.line import disturbed, find_line, fit_paper, fit_window, largest, through_origin

E = 267.0


def noisy(values: np.ndarray, scatter: float, seed: int = 3) -> np.ndarray:
    return values + np.random.default_rng(seed).normal(0, scatter, len(values))


def test_the_papers_line_is_the_least_squares_line_through_the_origin():
    strain = np.linspace(0.01, 0.1, 10)
    stress = noisy(E * strain, 0.3)
    modulus, error = through_origin(strain, stress)
    (expected,), *_ = np.linalg.lstsq(strain[:, None], stress, rcond=None)
    assert modulus == pytest.approx(expected)
    assert abs(modulus - E) < 4 * error < 20
    assert through_origin(strain, E * strain) == (pytest.approx(E), pytest.approx(0.0, abs=1e-10))


def test_the_papers_procedure_takes_all_strains_below_the_largest_and_the_window_no_others():
    strain = np.array([0.0, 0.02, 0.04, 0.08, 0.12, 0.2])
    stress = 200.0 * np.minimum(strain, 0.1) + 1.0
    line = fit_paper(strain, stress, 0.1)
    assert line.used.tolist() == [False, True, True, True, False, False]
    assert (line.modulus, line.intercept) == (pytest.approx(stress[1:4] @ strain[1:4] / (strain[1:4] @ strain[1:4])), 0.0)
    line = fit_window(strain, stress, (0.02, 0.08))
    assert (line.modulus, line.intercept) == (pytest.approx(200.0), pytest.approx(1.0))
    assert line.window == (0.02, 0.08)
    assert fit_window(strain, stress, (0.3, 0.4)) is None
    assert fit_paper(strain, stress, 0.03) is None


@pytest.mark.parametrize("count", [20, 60, 500, 20_000])
@pytest.mark.parametrize(
    "kind", ["line", "toe", "round toe", "preload", "break", "yield", "held", "return", "slack and break", "softening beyond"]
)
def test_the_straight_part_is_found_whatever_is_before_and_behind_it(kind, count):
    strain = np.linspace(0, 0.1, count)
    stress = E * strain
    if kind in ("toe", "slack and break"):
        stress = E * np.maximum(strain - 0.02, 0)
    if kind == "round toe":
        stress = E * 0.004 * np.logaddexp(0, (strain - 0.02) / 0.004)
    if kind == "preload":
        stress = stress + 3.0
    if kind == "yield":
        stress = E * np.minimum(strain, 0.06) + 0.1 * E * np.maximum(strain - 0.06, 0)
    if kind == "softening beyond":
        stress = np.where(strain < 0.07, stress, E * 0.07 + E * 0.02 * np.tanh((strain - 0.07) / 0.02))
    if kind == "held":
        strain, stress = np.append(np.zeros(count), strain), np.append(np.zeros(count), stress)
    if "break" in kind:
        strain, stress = np.append(strain, strain + 0.1), np.append(stress, np.full(count, 0.01))
    if kind == "return":
        strain, stress = np.append(strain, strain[::-1]), np.append(stress, np.maximum(stress[::-1] - 4, 0))
    for scatter in (0.0, 0.02):
        line = find_line(strain, noisy(stress, scatter), 0.1)
        assert line.modulus == pytest.approx(E, rel=0.01)
        assert line.r_squared > 0.999
        assert line.error < 0.02 * E
        assert abs(line.trend) < 0.1


def test_a_metal_is_fitted_where_it_is_elastic():
    strain = np.linspace(0, 0.1, 5000)
    stress = np.minimum(70_000 * strain, 200 + 600 * strain)
    assert find_line(strain, stress, 0.1).modulus == pytest.approx(70_000, rel=0.01)


def test_the_error_covers_the_truth_as_often_as_it_should():
    """Of many noisy tests, about 68 of 100 are within one standard error and nearly all within two."""
    away = []
    for seed in range(150):
        strain = np.linspace(0, 0.08, 60)
        line = find_line(strain, noisy(E * strain, 0.3, seed), 0.1)
        away.append(abs(line.modulus - E) / line.error)
    away = np.array(away)
    assert 0.6 < np.mean(away < 1) <= 0.99
    assert np.mean(away < 2.5) > 0.95


def test_the_error_grows_where_another_window_would_give_another_modulus():
    strain = np.linspace(0, 0.1, 400)
    straight, curved = E * strain, E * 0.05 * np.tanh(strain / 0.05)
    assert find_line(strain, curved, 0.1).error > 20 * find_line(strain, straight, 0.1).error
    line = fit_window(strain, curved, (0.0, 0.08))
    assert line.error_window > 5 * line.error_fit / 3
    assert line.trend < -0.3
    assert line.trend_probability < 1e-6
    assert fit_window(strain, noisy(straight, 0.1), (0.0, 0.08)).trend_probability > 1e-3


def test_what_is_nowhere_straight_is_said():
    strain = np.linspace(0, 0.1, 300)
    line = find_line(strain, 5000 * strain**2, 0.1)
    assert any("straight" in note for note in line.notes)


def test_a_disturbed_point_is_left_out():
    strain = np.linspace(0, 0.08, 50)
    for at, value in ((30, 500.0), (10, -40.0), (49, 900.0)):
        stress = E * strain
        stress[at] = value
        assert disturbed(stress).nonzero()[0].tolist() == [at]
        line = find_line(strain, stress, 0.1)
        assert line.modulus == pytest.approx(E, rel=1e-6)
        assert not line.used[at]
    assert not disturbed(np.append(E * strain, np.zeros(20))).any(), "a break is none"
    assert not any(disturbed(np.linspace(0, 20, count)).any() for count in range(9, 40)), "neither is the end of a line"
    assert largest(np.append(E * strain, np.zeros(20))) == 49


def test_no_line_is_made_of_too_little():
    for strain, stress in (([0, 1], [0, 1]), ([0, 0, 0, 0], [1, 2, 3, 4]), ([0, 1, 2, 3], [0, 0, 0, 0]), ([0, 1, 2], [3, 2, 1])):
        assert find_line(np.array(strain, float), np.array(stress, float), 10.0) is None
