"""When the pattern of a path changes with the layers that touch."""

from __future__ import annotations

import numpy as np

from limo.engines.newton.coupling import LOOKED_BACK, Coupling


class Layers:
    """Pairs whose gap is their place (q,), in the role of ``Touching``."""

    def near(self, x: np.ndarray, beyond: float = 0.0) -> np.ndarray:
        return x < beyond


def test_pairs_that_stay_apart_lose_their_entries_after_some_states_at_rest():
    coupling, known = Coupling(Layers(), 1.0), np.ones(10, bool)
    x = np.where(np.arange(10) < 3, -0.1, 5.0)
    for _ in range(LOOKED_BACK - 1):
        assert coupling.at_rest(x, known) is None
    kept = coupling.at_rest(x, known)
    np.testing.assert_array_equal(kept, np.arange(10) < 3)
    assert coupling.at_rest(x, kept) is None, "there is nothing to win"
    assert coupling.wanted(x, kept) is None


def test_pairs_within_the_margin_and_those_that_touched_lately_stay():
    coupling, known = Coupling(Layers(), 1.0), np.ones(10, bool)
    x = np.full(10, 5.0)
    x[0] = 0.9
    coupling.at_rest(np.where(np.arange(10) == 4, -0.1, 5.0), known)
    for _ in range(LOOKED_BACK - 1):
        kept = coupling.at_rest(x, known)
    np.testing.assert_array_equal(np.flatnonzero(kept), [0, 4])


def test_what_comes_back_joins_with_its_neighbours_and_the_second_time_with_all():
    coupling, known = Coupling(Layers(), 1.0), np.arange(10) < 3
    x = np.where(np.arange(10) < 3, -0.1, 5.0)
    x[5], x[6] = -0.1, 0.5
    wider = coupling.wanted(x, known)
    np.testing.assert_array_equal(np.flatnonzero(wider), [0, 1, 2, 5, 6])
    assert coupling.wanted(x, wider) is None
    x[8] = -0.1
    assert coupling.wanted(x, wider).all()
    coupling.at_rest(x, np.ones(10, bool))
    x[9] = -0.1
    assert not coupling.wanted(x, wider).all(), "after a state at rest it is the first time again"


def test_without_pairs_nothing_changes():
    coupling, none = Coupling(Layers(), 1.0), np.empty(0, bool)
    for _ in range(2 * LOOKED_BACK):
        assert coupling.at_rest(np.empty(0), none) is None
    assert coupling.wanted(np.empty(0), none) is None
