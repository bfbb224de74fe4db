"""Curves of a pattern from drawn polylines: within the tolerance, straight where they are straight, corners kept."""

import os
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapely import LineString, polygonize_full

from limo.drawings.fit import STRAIGHT, curves_of, spline_points
from limo.drawings.lines import apart, chains, noded
from limo.geometry.pattern import smooth

EXAMPLES = int(os.environ.get("LIMO_EXAMPLES", "40"))
tried = settings(max_examples=EXAMPLES, deadline=None)


def drawn_by(curves):
    """What the model makes of curves, end to start."""
    for before, after in pairwise(curves):
        assert (before[-1] == after[0]).all(), "they meet"
    return np.vstack([smooth(curve) for curve in curves])


def arc(center, radius, start, end, step=1.0):
    angle = np.radians(np.linspace(start, end, 2 + int(abs(np.radians(end - start)) * radius / step)))
    return np.asarray(center) + radius * np.column_stack([np.cos(angle), np.sin(angle)])


def test_straight_lines_are_two_points_however_many_were_drawn():
    points = np.column_stack([np.linspace(3, 40, 50), 2 * np.linspace(3, 40, 50)])
    (curve,) = curves_of(points, 0.05)
    assert curve.tolist() == points[[0, -1]].tolist()


@pytest.mark.parametrize("radius", [3.0, 7.0, 20.0])
@pytest.mark.parametrize("tolerance", [0.02, 0.05, 0.2])
def test_fillets_between_straight_lines_begin_and_end_at_them(radius, tolerance):
    points = np.vstack([[[50, 0]], arc((50 - radius, 80 - radius), radius, 0, 90, 0.3), [[0, 80]]])
    first, *bend, last = curves_of(points, tolerance)
    along = np.sqrt(8 * radius * STRAIGHT * tolerance)  # a chord that is as near to the arc as straight lines may be
    assert first == pytest.approx(np.array([[50, 0], [50, 80 - radius]]), abs=along)
    assert last == pytest.approx(np.array([[50 - radius, 80], [0, 80]]), abs=along)
    assert len(bend) == 1
    assert 3 <= len(bend[0]) <= 20
    assert apart(drawn_by([first, *bend, last]), points)[0] <= tolerance


def test_fewer_points_with_a_larger_tolerance():
    points = arc((0, 0), 60, 0, 170, 0.5)
    counts = [len(spline_points(points, tolerance)) for tolerance in (0.5, 0.1, 0.02, 0.005)]
    assert counts == sorted(counts)
    assert counts[0] < 8
    assert counts[-1] > 12


@pytest.mark.parametrize("turn", [20.0, 40.0, 90.0, 130.0])
def test_corners_between_curves_are_kept(turn):
    first = arc((0, 0), 60, 0, 60)
    heading = np.radians(60 + 90 + turn)  # a second arc, that bends likewise, from the end of the first one
    center = first[-1] + 30 * np.array([-np.sin(heading), np.cos(heading)])
    start = np.degrees(np.arctan2(*(first[-1] - center)[::-1]))
    second = arc(center, 30, start, start + 70)
    points = np.vstack([first, second[1:]])
    curves = curves_of(points, 0.05)
    assert len(curves) == 2
    assert curves[0][-1] == pytest.approx(first[-1])
    assert apart(drawn_by(curves), points)[0] <= 0.05


def test_polygons_stay_polygons():
    angle = np.radians(np.linspace(0, 180, 13))
    points = 50 * np.column_stack([np.cos(angle), np.sin(angle)])
    curves = curves_of(points, 0.05)
    assert [len(curve) for curve in curves] == [2] * 12


@st.composite
def waves(draw):
    """A smooth curve, drawn with points of uneven spacing."""
    amplitudes = draw(st.lists(st.floats(-6, 6), min_size=1, max_size=4))
    spacing = draw(st.floats(0.05, 1.0))
    x = np.cumsum(spacing * (0.6 + 0.8 * np.random.default_rng(draw(st.integers(0, 99))).random(int(80 / spacing))))
    return np.column_stack([x, sum(a * np.sin((k + 1) * np.pi * x / 80 + k) for k, a in enumerate(amplitudes))])


@tried
@given(points=waves(), tolerance=st.sampled_from([0.01, 0.05, 0.3]))
def test_curves_are_within_the_tolerance_of_smooth_drawings(points, tolerance):
    curves = curves_of(points, tolerance)
    assert (curves[0][0] == points[0]).all()
    assert (curves[-1][-1] == points[-1]).all()
    assert apart(drawn_by(curves), points)[0] <= 1.02 * tolerance
    assert sum(map(len, curves)) <= len(points) + len(curves)


@tried
@given(
    corners=st.lists(st.tuples(st.floats(2, 30), st.floats(-120, 120)), min_size=1, max_size=12),
    tolerance=st.sampled_from([0.01, 0.05, 0.3]),
)
def test_curves_are_within_the_tolerance_of_angular_drawings(corners, tolerance):
    heading = np.radians(np.cumsum([turn for _, turn in corners]))
    steps = np.array([length for length, _ in corners])[:, None] * np.column_stack([np.cos(heading), np.sin(heading)])
    points = np.vstack([[[0, 0]], np.cumsum(steps, axis=0)])
    curves = curves_of(points, tolerance)
    assert apart(drawn_by(curves), points)[0] <= 1.02 * tolerance


# --------------------------------------------------------------------------------------------------------------------
# lines, before curves are made of them


def box(x0, y0, x1, y1):
    return [LineString([a, b]) for a, b in pairwise([(x0, y0), (x1, y0), (x1, y1), (x0, y1), (x0, y0)])]


@pytest.mark.parametrize("gap", [0.0, 0.00005, 0.03])
def test_ends_that_almost_meet_are_joined(gap):
    lines = [LineString([(0, 0), (10, 0)]), LineString([(20, 5), (10, gap)]), LineString([(20 + gap, 5), (30, 40)])]
    (chain,) = chains(lines, 0.05)
    assert chain.length == pytest.approx(sum(line.length for line in lines), abs=0.1)
    assert len(chains([*lines[:2], LineString([(20.2, 5), (30, 40)])], 0.05)) == 2, "0.2 mm are a gap"


def test_a_line_whose_own_ends_almost_meet_is_closed():
    (chain,) = chains([LineString([(0.03, 0), (10, 0), (10, 10), (0, 10), (0, 0)])], 0.05)
    assert chain.is_closed


def test_lines_drawn_twice_count_once():
    lines = [LineString([(0, 0), (10, 0)]), LineString([(10, 0), (0, 0)]), LineString([(4, 0), (10, 0), (10, 5)])]
    (chain,) = chains(lines, 0.05)
    assert chain.length == pytest.approx(15)


@pytest.mark.parametrize("short", [-0.03, 0.0, 0.03])
def test_an_end_that_almost_reaches_a_line_cuts_it(short):
    """A wall in a box that stops before the side or goes beyond it by 0.03 mm parts the box."""
    pieces = noded([*box(0, 0, 10, 10), LineString([(4, 0 + short), (5, 10 - short)])], 0.05)
    parts, *leftovers = polygonize_full(pieces)
    assert sorted(part.area for part in parts.geoms) == pytest.approx([45, 55], abs=0.2)
    assert all(left.is_empty for left in leftovers), "nothing sticks out"
