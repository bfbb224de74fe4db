"""What a pattern adds to the values of a tangent."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csc_array

from limo.engines.newton.pattern import Additions


def test_additions_are_the_product_of_a_sparse_matrix_to_the_bit():
    """Several sources go to one place and one source to several places; most places get nothing."""
    rng = np.random.default_rng(4)
    size, count = 5000, 300
    places, sources = rng.choice(np.arange(0, size, 17), 2000), rng.integers(0, count, 2000)
    factors, source = rng.choice([-1.0, 0.5, 1.0], 2000), rng.normal(size=count)
    before = rng.normal(size=size)
    additions, values = Additions.of(places, sources, factors), before.copy()
    additions.add(source, values)
    expected = csc_array((factors, (places, sources)), shape=(size, count)) @ source
    np.testing.assert_array_equal(values, before + expected)
    moved = np.sort(rng.choice(2 * size, size, replace=False))
    wider = np.zeros(2 * size)
    additions.moved(moved.astype(np.int32)).add(source, wider)
    np.testing.assert_array_equal(wider[moved], expected)


def test_a_model_without_faces_adds_nothing():
    none = np.empty(0, np.int32)
    values = np.ones(3)
    Additions.of(none, none, np.empty(0)).add(np.empty(0), values)
    assert values.tolist() == [1.0, 1.0, 1.0]
