"""Shape functions, node tables and quadrature of the two elements."""

from itertools import product

import numpy as np
import pytest

from limo.mesh.elements import (
    HEX20,
    HEX20_BOTTOM,
    HEX20_TOP,
    QUAD8,
    QUAD8_MIRROR,
    QUAD8_TRIANGLES,
    gauss,
    hex20_shape,
    quad8_shape,
)

ELEMENTS = pytest.mark.parametrize(("shape", "nodes"), [(quad8_shape, QUAD8), (hex20_shape, HEX20)], ids=["quad8", "hex20"])
# corner pairs of the mid-side nodes 9 to 20 in the CalculiX manual, counted from one
C3D20_EDGES = [(1, 2), (2, 3), (3, 4), (4, 1), (5, 6), (6, 7), (7, 8), (8, 5), (1, 5), (2, 6), (3, 7), (4, 8)]


@ELEMENTS
def test_shape_functions_are_one_at_their_node_and_zero_at_the_others(shape, nodes):
    np.testing.assert_allclose(shape(nodes)[0], np.eye(len(nodes)), atol=1e-14)


@ELEMENTS
def test_shape_functions_reproduce_every_quadratic(shape, nodes):
    """Partition of unity (degree 0), rigid motion and linear fields (1), and quadratic completeness."""
    local = np.random.default_rng(1).uniform(-1, 1, (30, nodes.shape[1]))
    values, _ = shape(local)
    for powers in product(range(3), repeat=nodes.shape[1]):
        if sum(powers) <= 2:
            np.testing.assert_allclose(values @ (nodes**powers).prod(axis=1), (local**powers).prod(axis=1), atol=1e-13)


@ELEMENTS
def test_derivatives_match_central_differences(shape, nodes):
    local = np.random.default_rng(2).uniform(-1, 1, (20, nodes.shape[1]))
    _, derivatives = shape(local)
    step = 1e-5
    for k in range(nodes.shape[1]):
        shift = step * np.eye(nodes.shape[1])[k]
        differences = (shape(local + shift)[0] - shape(local - shift)[0]) / (2 * step)
        np.testing.assert_allclose(derivatives[:, :, k], differences, atol=1e-9)


@pytest.mark.parametrize(("points", "dimensions"), list(product((1, 2, 3), (1, 2, 3))))
def test_gauss_rule_is_exact_to_degree_2n_minus_1_in_each_coordinate(points, dimensions):
    local, weights = gauss(points, dimensions)
    for powers in product(range(2 * points), repeat=dimensions):
        exact = np.prod([0.0 if p % 2 else 2.0 / (p + 1) for p in powers])
        assert weights @ (local**powers).prod(axis=1) == pytest.approx(exact, abs=1e-13)


def test_gauss_points_run_fastest_in_the_first_coordinate():
    local, _ = gauss(2, 3)
    assert (np.sign(local[:4]) == [[-1, -1, -1], [1, -1, -1], [-1, 1, -1], [1, 1, -1]]).all()


def test_mirror_table_lands_on_the_mirrored_nodes_and_keeps_the_normal():
    np.testing.assert_array_equal(QUAD8[QUAD8_MIRROR], QUAD8 * [-1, 1])
    x, y = (QUAD8[QUAD8_MIRROR[:4]] * [-1, 1]).T
    assert (x * np.roll(y, -1) - y * np.roll(x, -1)).sum() / 2 == pytest.approx(4.0)


@pytest.mark.parametrize(("face", "height"), [(HEX20_BOTTOM, -1), (HEX20_TOP, 1)], ids=["bottom", "top"])
def test_faces_of_the_brick_are_listed_in_quadrilateral_order(face, height):
    np.testing.assert_array_equal(HEX20[face], np.column_stack([QUAD8, np.full(8, height)]))


def test_brick_nodes_stand_in_calculix_order():
    np.testing.assert_array_equal(HEX20[:8, 2], [-1] * 4 + [1] * 4)
    np.testing.assert_array_equal(HEX20[8:], [(HEX20[a - 1] + HEX20[b - 1]) / 2 for a, b in C3D20_EDGES])


def test_triangles_tile_the_quadrilateral_without_overlap():
    a, b, c = np.moveaxis(QUAD8[QUAD8_TRIANGLES], 1, 0)
    areas = 0.5 * ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
    assert (areas > 0).all()
    assert areas.sum() == pytest.approx(4.0)
