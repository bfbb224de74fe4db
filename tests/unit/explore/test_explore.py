"""Samples, surrogates, sensitivities and the search, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm

from limo.errors import LimoError
from limo.explore import sensitivity
from limo.explore.front import dominated_volume, knee, on_front
from limo.explore.posterior import posterior
from limo.explore.sampling import sample
from limo.explore.search import Knowledge, improvement, propose
from limo.explore.space import Input, Space
from limo.explore.surrogate import Process, TwoFidelities

from .stand_in import REFERENCE, SPACE, goals

PLAIN = Space(tuple(Input(f"x{k}", 0.0, 1.0) for k in range(3)))


# --- samples --------------------------------------------------------------------------------------------------------------


def test_designs_and_places_are_each_other():
    places = sample(SPACE, 64, seed=1)
    designs = SPACE.from_unit(places)
    np.testing.assert_allclose(SPACE.to_unit(designs), places)
    assert {design["n_pouches"] for design in designs} == {4, 6, 8, 10}
    assert all(0.12 <= design["thickness"] <= 0.3 for design in designs)


def test_a_seed_gives_its_samples_and_more_of_them_begin_with_the_same():
    np.testing.assert_array_equal(sample(SPACE, 32, seed=3), sample(SPACE, 32, seed=3))
    assert np.abs(sample(SPACE, 32, seed=3) - sample(SPACE, 32, seed=4)).max() > 0.1


def test_samples_fill_the_space_more_evenly_than_chance():
    """Means of a Sobol sequence of 64 are within 0.02 of the middle; chance gives 0.036."""
    assert np.abs(sample(PLAIN, 64, seed=5).mean(axis=0) - 0.5).max() < 0.02


def test_what_cannot_be_made_is_left_out_and_an_empty_space_is_refused():
    designs = SPACE.from_unit(sample(SPACE, 40, 1, allowed=lambda design: design["n_pouches"] > 5))
    assert {design["n_pouches"] for design in designs} == {6, 8, 10}
    with pytest.raises(LimoError, match="widen the space"):
        sample(SPACE, 8, 1, allowed=lambda design: design["thickness"] > 0.31)


# --- surrogates -----------------------------------------------------------------------------------------------------------


def smooth(places: np.ndarray) -> np.ndarray:
    return np.sin(3 * places[:, 0]) + places[:, 1] ** 2


def test_a_process_finds_a_smooth_function_and_what_does_not_matter():
    places = sample(PLAIN, 48, seed=2)
    process, others = Process(places, smooth(places)), sample(PLAIN, 200, seed=9)
    mean, deviation = process.predict(others)
    assert np.abs(mean - smooth(others)).max() < 0.05
    assert (np.abs(mean - smooth(others)) < 4 * deviation + 0.01).mean() > 0.95
    assert process.lengths[2] > 3 * process.lengths[0], "the third input does nothing"
    assert process.quality().error < 0.02


def test_leaving_out_by_the_formula_is_leaving_out():
    places = sample(PLAIN, 16, seed=4)
    process = Process(places, smooth(places))
    mean, deviation = process.left_out()
    for k in (0, 7, 15):
        keep = np.arange(16) != k
        other = process.without(keep)
        found, spread = other.predict(places[k : k + 1])
        assert found[0] == pytest.approx(mean[k], abs=1e-6)
        assert np.hypot(spread[0], process.noise) == pytest.approx(deviation[k], rel=1e-3)


def test_known_scatter_is_no_signal():
    """Noise of 0.3 that is known: the mean is nearer to the function than the values are, and most intervals hold them."""
    random = np.random.default_rng(1)
    places = sample(PLAIN, 80, seed=6)
    noisy = smooth(places) + random.normal(0, 0.3, 80)
    process = Process(places, noisy, np.full(80, 0.3))
    mean, _ = process.predict(places)
    assert np.sqrt(np.mean((mean - smooth(places)) ** 2)) < 0.2
    assert 0.85 <= process.quality().coverage <= 1.0


def test_a_coarse_model_makes_few_fine_values_enough():
    """high = 1.3 low + a line: fourteen values of it and a hundred coarse ones beat the fourteen alone four times."""
    coarse, fine = sample(PLAIN, 100, seed=7), sample(PLAIN, 14, seed=8)
    others = sample(PLAIN, 200, seed=11)

    def low(x):
        return np.sin(7 * x[:, 0]) * np.cos(4 * x[:, 1])

    def high(x):
        return 1.3 * low(x) + 0.3 * x[:, 2] + 0.5

    both = TwoFidelities(Process(coarse, low(coarse)), fine, high(fine))
    alone = Process(fine, high(fine))
    errors = [np.sqrt(np.mean((each.predict(others)[0] - high(others)) ** 2)) for each in (both, alone)]
    assert errors[0] < 0.25 * errors[1]
    assert both.rho == pytest.approx(1.3, abs=0.2)
    assert both.quality().error < 0.05


def test_values_that_are_no_numbers_are_refused():
    places = sample(PLAIN, 8, seed=1)
    with pytest.raises(ValueError, match="numbers"):
        Process(places, np.append(smooth(places)[:-1], np.nan))
    with pytest.raises(ValueError, match="4 or more"):
        Process(places[:3], smooth(places[:3]))


# --- sensitivities --------------------------------------------------------------------------------------------------------


def ishigami(places: np.ndarray) -> np.ndarray:
    x, y, z = (np.pi * (2 * places - 1)).T
    return np.sin(x) + 7 * np.sin(y) ** 2 + 0.1 * z**4 * np.sin(x)


def test_indices_of_a_function_whose_indices_are_known():
    """Ishigami and Homma 1990, a = 7, b = 0.1: S = 0.314, 0.442, 0 and T = 0.558, 0.442, 0.244; x and z act together."""
    found = sensitivity.indices(PLAIN, ishigami)
    np.testing.assert_allclose(found.first, [0.314, 0.442, 0.0], atol=0.05)
    np.testing.assert_allclose(found.total, [0.558, 0.442, 0.244], atol=0.05)
    assert found.second[0, 2] == pytest.approx(0.244, abs=0.06)
    assert (found.total_within < 0.1).all()


def test_an_index_of_what_is_no_number_is_refused():
    """SALib itself returns an answer."""
    with pytest.raises(ValueError, match=r"1 of \d+ values are no numbers"):
        sensitivity.indices(PLAIN, lambda x: np.where(np.arange(len(x)) == 5, np.nan, x[:, 0]))
    with pytest.raises(ValueError, match="nothing explains it"):
        sensitivity.indices(PLAIN, lambda x: np.full(len(x), 3.0))


# --- fronts and the search ------------------------------------------------------------------------------------------------


def test_a_front_is_what_nothing_betters():
    values = np.array([[0, 3], [1, 1], [3, 0], [2, 2], [1, 1]], float)
    assert on_front(values).tolist() == [True, True, True, False, True]
    assert dominated_volume(values, np.array([4.0, 4.0])) == pytest.approx(4 + 6 + 1 + 0 + 0)
    assert dominated_volume(np.array([[5.0, 5.0]]), np.array([4.0, 4.0])) == 0
    assert knee(values[[0, 1, 2]]) == 1


def test_expected_improvement_is_that_of_drawn_values():
    random = np.random.default_rng(3)
    front, reference = np.array([[0.2, 0.9], [0.5, 0.5], [0.8, 0.3]]), np.array([1.0, 1.0])
    mean, deviation = np.array([[0.4, 0.45], [0.9, 0.9], [0.1, 0.2]]), np.array([[0.1, 0.2], [0.05, 0.1], [0.3, 0.1]])
    exact = improvement(mean, deviation, front, reference)
    before = dominated_volume(front, reference)
    for k in range(3):
        drawn = random.normal(mean[k], deviation[k], (4000, 2))
        gains = [dominated_volume(np.vstack([front, one]), reference) - before for one in drawn]
        assert np.mean(gains) == pytest.approx(exact[k], abs=4 * np.std(gains) / np.sqrt(len(gains)) + 1e-4)
    one = improvement(mean[:, :1], deviation[:, :1], front[:, :1], reference[:1])
    z = (0.2 - mean[:, 0]) / deviation[:, 0]
    np.testing.assert_allclose(one, deviation[:, 0] * (z * norm.cdf(z) + norm.pdf(z)))


def searched(seed: int, first: int, batches: int, size: int = 8) -> float:
    """Hypervolume after a search of the stand-in."""
    places = sample(SPACE, first, seed)
    for batch in range(batches):
        found = goals(places)
        surrogates = [Process(places, found[:, k], seed=seed) for k in range(2)]
        known = Knowledge(surrogates, lambda x: np.ones(len(x)), found[on_front(found)], REFERENCE, places)
        places = np.vstack([places, propose(SPACE, known, size, seed=100 * seed + batch).places])
    return dominated_volume(goals(places), REFERENCE)


def test_the_search_dominates_a_fifth_more_than_chance_at_the_same_budget():
    """Median of five seeds, 32 designs and four batches of eight beside 64 drawn at random."""
    ratios = []
    for seed in range(5):
        random = SPACE.snapped(np.random.default_rng(seed).random((64, len(SPACE.inputs))))
        ratios.append(searched(seed, 32, 4) / dominated_volume(goals(random), REFERENCE))
    assert np.median(ratios) > 1.2


def test_a_batch_has_no_design_twice_and_none_that_cannot_be():
    places = sample(SPACE, 24, seed=1)
    found = goals(places)
    surrogates = [Process(places, found[:, k]) for k in range(2)]
    only_eight = lambda design: design["n_pouches"] == 8  # noqa: E731
    known = Knowledge(surrogates, lambda x: np.ones(len(x)), found[on_front(found)], REFERENCE, places)
    proposal = propose(SPACE, known, 8, seed=1, allowed=only_eight)
    assert all(only_eight(design) for design in SPACE.from_unit(proposal.places))
    every = np.vstack([places, proposal.places])
    assert len(np.unique(every.round(6), axis=0)) == len(every)
    assert (proposal.expected > 0).any()
    never = Knowledge(surrogates, lambda x: np.zeros(len(x)), found[on_front(found)], REFERENCE, places)
    assert (propose(SPACE, never, 8, seed=1).expected == 0).all()


# --- what is believed of what nobody knows ------------------------------------------------------------------------------------


def test_a_belief_is_that_of_a_normal_prior_with_a_normal_penalty():
    """Prior N(0, 1), penalty ((x - 1) / 0.5)^2 / 2: the belief is N(0.8, 0.2) in x, and the prior in y."""
    space = Space((Input("x", -4.0, 4.0), Input("y", -4.0, 4.0)))
    places = sample(space, 4096, 1)
    x, y = (np.array([design[name] for design in space.from_unit(places)]) for name in "xy")
    found = posterior(space, places, -0.5 * (x**2 + y**2), 0.5 * ((x - 1) / 0.5) ** 2)
    assert found.mean == pytest.approx([0.8, 0.0], abs=0.01)
    assert found.deviation == pytest.approx([np.sqrt(0.2), 1.0], abs=0.01)
    assert found.interval[:, 0] == pytest.approx([0.8 - 1.645 * np.sqrt(0.2), 0.8 + 1.645 * np.sqrt(0.2)], abs=0.02)
    before, after = found.chance(x > 0.8)
    assert (before, after) == (pytest.approx(0.212, abs=0.005), pytest.approx(0.5, abs=0.01))
    assert 100 < found.effective < 4096
    with pytest.raises(ValueError, match="at every place"):
        posterior(space, places, np.full(len(places), np.nan), x)


# --- the paper's statements in a larger space ---------------------------------------------------------------------------------


def test_functions_drawn_from_a_process_have_its_mean_and_spread():
    places = sample(SPACE, 40, 1)
    process = Process(places, smooth(places), None, 1)
    line = sample(SPACE, 3, 7)
    drawn = process.drawn(line, 4000, np.random.default_rng(1))
    mean, deviation = process.predict(line)
    assert drawn.mean(axis=0) == pytest.approx(mean, abs=4 * deviation.max() / np.sqrt(4000))
    assert drawn.std(axis=0) == pytest.approx(deviation, rel=0.1)
