"""The flat pattern and the valve ellipse: closed forms, tilings, scalings, and patterns that must be refused."""

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad
from shapely import LineString, Polygon, unary_union

from limo.config.yaml_file import parse
from limo.errors import ConfigError
from limo.geometry.pattern import flat_pattern, smooth
from limo.geometry.valve import ValveEllipse, quarter_perimeter
from limo.schema.device import Pattern

DEVICES = ("limo", "mini_limo")
EVERY_N_P = tuple(range(2, 17, 2))
# the paper's semi-axes over the device length
AXES = {1.0: (0.2525, 0.2525), 1.5: (0.3000, 0.2000), 2.0: (0.3275, 0.1638), 2.5: (0.3447, 0.1379), 3.0: (0.3561, 0.1187)}


def ellipse_arc(ellipse, phi):
    """Arc length from x = 0 by quadrature of the line element."""
    return quad(lambda t: np.hypot(ellipse.semi_x * np.cos(t), ellipse.semi_z * np.sin(t)), 0.0, phi, epsabs=1e-11)[0]


@pytest.fixture(params=[(d, n) for d in DEVICES for n in EVERY_N_P], ids=lambda p: f"{p[0]}-{p[1]}", scope="module")
def face(request, loaded):
    device, n_pouches = request.param
    return flat_pattern(loaded.devices[device].pattern, n_pouches)


# --------------------------------------------------------------------------------------------------------------------
# the valve


@pytest.mark.parametrize("aspect_ratio", AXES)
def test_semi_axes_of_the_valve_are_those_of_the_paper(loaded, aspect_ratio):
    pattern = loaded.devices["limo"].pattern
    ellipse = ValveEllipse.from_perimeter(quarter_perimeter(pattern), aspect_ratio)
    axes = np.array([ellipse.semi_x, ellipse.semi_z]) / pattern.length
    np.testing.assert_allclose(axes, AXES[aspect_ratio], atol=0.5e-4 * 1.02)


@pytest.mark.parametrize("aspect_ratio", [1.0, 1.0001, 2.0, 3.7, 10.0])
def test_perimeter_is_kept_for_every_aspect_ratio(aspect_ratio):
    ellipse = ValveEllipse.from_perimeter(55.5, aspect_ratio)
    assert ellipse_arc(ellipse, np.pi / 2) == pytest.approx(55.5, rel=1e-9)
    assert ellipse.semi_x / ellipse.semi_z == pytest.approx(aspect_ratio)


@pytest.mark.parametrize("aspect_ratio", [1.0, 2.0, 10.0])
def test_placed_points_lie_on_the_ellipse_at_their_arc_length(aspect_ratio):
    ellipse = ValveEllipse.from_perimeter(55.5, aspect_ratio)
    lengths = np.append(np.random.default_rng(3).uniform(0, 55.5, 20), [0.0, 55.5])
    x, z = ellipse.place(lengths).T
    np.testing.assert_allclose((x / ellipse.semi_x) ** 2 + (z / ellipse.semi_z) ** 2, 1.0, rtol=1e-12)
    phi = np.arctan2(x / ellipse.semi_x, z / ellipse.semi_z)
    np.testing.assert_allclose([ellipse_arc(ellipse, p) for p in phi], lengths, atol=1e-7)
    assert (x[-2], z[-2], x[-1], z[-1]) == pytest.approx((0.0, ellipse.semi_z, ellipse.semi_x, 0.0), abs=1e-12)


# --------------------------------------------------------------------------------------------------------------------
# curves


def test_smooth_curve_passes_through_its_points_densely_and_stays_straight_where_they_are():
    points = np.array([[0, 0], [10, 0], [20, 0], [25, 5], [25, 15], [25, 30]], float)
    curve = smooth(points)
    assert np.linalg.norm(np.diff(curve, axis=0), axis=1).max() < 1.5
    assert np.linalg.norm(curve[:, None] - points, axis=2).min(axis=0).max() < 1e-9
    flat = curve[curve[:, 0] <= 10]
    assert np.abs(flat[:, 1]).max() < 1e-9, "overshoots on a flat run"


# --------------------------------------------------------------------------------------------------------------------
# the face


def test_patches_tile_the_face(face):
    outer = next(c for c in face.curves if c.kind == "outer")
    whole = Polygon(np.vstack([[[0.0, 0.0]], outer.points]))
    patches = [face.polygon(r) for r in face.regions]
    assert all(p.is_valid and p.area > 1.0 for p in patches)
    assert sum(p.area for p in patches) == pytest.approx(whole.area, rel=1e-9)
    assert unary_union(patches).area == pytest.approx(whole.area, rel=1e-6), "patches overlap"


def test_borders_of_patches_run_anticlockwise_and_close(face):
    for region in face.regions:
        pieces = [face.curves[i].points[::d] for i, d in region.loop]
        gaps = [np.linalg.norm(b[0] - a[-1]) for a, b in zip(pieces, [*pieces[1:], pieces[0]], strict=True)]
        assert max(gaps) < 1e-9
        assert face.polygon(region).exterior.is_ccw


def test_pouches_and_seams_are_counted_right(face):
    on_axis = int(face.axis_is_seam)
    right = [r for r in face.regions if r.pouch >= 0]
    assert [r.pouch for r in right] == list(range(len(right)))
    per_face = 2 * len(right) - (1 - on_axis)  # a pouch on the axis counts once
    assert 2 * per_face == face.n_pouches
    inner = sum(c.name.startswith("seam") for c in face.curves)
    assert 2 * inner + on_axis == per_face - 1
    assert (next(c.kind for c in face.curves if c.name == "axis_mid") == "seam") == face.axis_is_seam


def test_seams_stay_inside_the_array(face):
    array = unary_union([face.polygon(r) for r in face.regions if r.pouch >= 0])
    inner = [LineString(c.points) for c in face.curves if c.name.startswith("seam")]
    for seam in inner:
        assert array.buffer(1e-6).contains(seam)
        assert max(array.exterior.distance(end) for end in seam.boundary.geoms) < 1e-6
    for k, seam in enumerate(inner):
        assert all(seam.distance(other) > 0.5 for other in inner[:k])


def test_even_numbers_that_are_not_listed_narrow_the_outer_pouches(loaded):
    """Equal widths for the straight seams of the mini device (p = 1), narrowing outwards for p > 1."""
    array_half_width = 0.40041 * 109.0
    equal = flat_pattern(loaded.devices["mini_limo"].pattern, 16)
    x = [0.0, *(c.points[0, 0] for c in equal.curves if c.name.startswith("seam"))]
    np.testing.assert_allclose(np.diff(x), array_half_width / 4, rtol=1e-3)
    pattern = loaded.devices["mini_limo"].pattern
    narrowing = pattern.model_copy(update={"seams": pattern.seams.model_copy(update={"spacing_exponent": 1.36})})
    x = [0.0, *(c.points[0, 0] for c in flat_pattern(narrowing, 16).curves if c.name.startswith("seam")), array_half_width]
    assert (np.diff(x, 2) < 0).all()


@pytest.mark.parametrize("scale", [0.8, 1.2])
def test_width_scale_stretches_x_away_from_the_valve_and_leaves_its_edge(loaded, scale):
    pattern = loaded.devices["limo"].pattern
    plain, scaled = (flat_pattern(pattern.model_copy(update={"width_scale": s}), 8) for s in (1.0, scale))
    assert scaled.half_width == plain.half_width
    before, after = ({c.name: c.points for c in p.curves} for p in (plain, scaled))
    np.testing.assert_array_equal(before["valve"], after["valve"])
    beyond = before["outer"][:, 1] >= pattern.width_blend * pattern.length
    np.testing.assert_allclose(after["outer"][beyond], before["outer"][beyond] * [scale, 1.0], rtol=1e-12)
    np.testing.assert_array_equal(before["outer"][0], after["outer"][0])
    b = np.clip(before["outer"][1:-1, 1] / (pattern.width_blend * pattern.length), 0, 1)
    factor = after["outer"][1:-1, 0] / before["outer"][1:-1, 0]
    np.testing.assert_allclose(factor, 1 + (scale - 1) * (3 * b**2 - 2 * b**3), rtol=1e-9, err_msg="not the smooth step")
    assert after["seam0"][:, 0].max() == pytest.approx(scale * before["seam0"][:, 0].max(), rel=1e-9)


# --------------------------------------------------------------------------------------------------------------------
# patterns that cannot be cut or sealed


def _with_seams(**changes):
    return lambda data: data["seams"].update(changes)


def _with(**changes):
    return lambda data: data.update(changes)


BOTTOM, SIDE, TOP = [[0.0, 0.2], [0.4, 0.2]], [[0.4, 0.2], [0.4, 0.9]], [[0.4, 0.9], [0.0, 0.9]]
BULGING_SIDE = [[0.4, 0.2], [0.5, 0.5], [0.4, 0.9]]
AT_VALVE = [[[0.0, 0.0], [0.35, 0.0]], [[0.35, 0.0], [0.35, 0.9]], [[0.35, 0.9], [0.0, 0.9]]]
LOW, HIGH = [0.13, 0.22193], [0.13, 0.9363]  # ends of the reference seam
LOOP = [[0.46, 0.0], [0.5, 0.6], [0.42, 0.5], [0.55, 0.45], [0.0, 1.0]]
REFUSED = {
    "seams that touch": (10, _with_seams(fractions={10: [1.0, 1.02]}), "seams"),
    "seam beyond the array": (10, _with_seams(fractions={10: [1.0, 4.0]}), "seams"),
    "seam along the axis": (6, _with_seams(fractions={6: [0.001]}), "seams"),
    "seam that crosses itself": (6, _with_seams(reference=[LOW, [0.15, 0.6], [0.05, 0.6], [0.15, 0.4], HIGH]), "seam"),
    "seam listed downwards": (6, _with_seams(reference=[HIGH, LOW]), "seam"),
    "seam with a point twice": (6, _with_seams(reference=[LOW, LOW, HIGH]), "seam"),
    "seam that is one point": (6, _with_seams(reference=[LOW, LOW]), "seam"),
    "outline that crosses itself": (6, _with(outline=[LOOP]), "outline"),
    "outline that starts above the valve": (6, _with(outline=[[[0.46411, 0.3], [0.46411, 0.95], [0.0, 1.0]]]), "outline"),
    "outline without end": (6, _with(outline=[[[0.46411, 0.0], [1e7, 0.5], [0.0, 1.0]]]), "outline"),
    "array beyond the outline": (6, _with(pouch_array=[BOTTOM, BULGING_SIDE, TOP]), "pouch_array"),
    "array on the valve edge": (2, _with(pouch_array=AT_VALVE), "pouch_array"),
    "array listed downwards": (2, _with(pouch_array=[TOP[::-1], SIDE[::-1], BOTTOM[::-1]]), "pouch_array"),
    "array of no area": (2, _with(pouch_array=[[[0.0, 0.5], [0.1, 0.6], [0.0, 0.5]]]), "pouch_array"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_pattern_that_cannot_be_made_is_one_config_error(loaded, name):
    n_pouches, spoil, key = REFUSED[name]
    data = loaded.devices["mini_limo"].pattern.model_dump(mode="json")
    spoil(data)
    with pytest.raises(ConfigError, match=key) as caught:
        flat_pattern(parse(Pattern, data, Path("pattern.yaml")), n_pouches, "pattern.yaml")
    assert "pattern.yaml" in str(caught.value)
