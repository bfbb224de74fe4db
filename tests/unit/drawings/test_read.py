"""Readers: known curves are where they are, in the unit that the file states, by layer and colour; bad files are one message."""

import math
import os

import ezdxf
import numpy as np
import pytest
import shapely
from ezdxf.addons import r12writer
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from shapely import LineString, Point, Polygon

from limo.drawings.read import UNITS, parse_unit, read_drawing
from limo.errors import ConfigError

from .make import write_dxf, write_svg

DISTANCE = 0.002
EXAMPLES = int(os.environ.get("LIMO_EXAMPLES", "40"))


@pytest.fixture
def dxf(tmp_path):
    """``dxf(draw, version)``: the drawing of what ``draw(modelspace, document)`` put into it."""

    def make(draw, version="R2010", units=4):
        document = ezdxf.new(version)
        document.units = units
        draw(document.modelspace(), document)
        document.saveas(tmp_path / "made.dxf")
        return read_drawing(tmp_path / "made.dxf")

    return make


@pytest.fixture
def svg(tmp_path):
    return lambda body, *root: read_drawing(write_svg(tmp_path / "made.svg", body, *root))


def lines_of(drawing, distance=DISTANCE):
    return [line for shape in drawing.shapes for line in shape.flatten(distance)]


def only(drawing, distance=DISTANCE):
    (line,) = lines_of(drawing, distance)
    return line


def assert_on_circle(points, center, radius, closed):
    """Points are on the circle, and chords between them no further than ``DISTANCE`` inside of it."""
    ring = np.vstack([points, points[:1]]) if closed else points
    middles = (ring[1:] + ring[:-1]) / 2
    assert np.linalg.norm(points - center, axis=1) == pytest.approx(radius, abs=1e-6)
    inside = radius - np.linalg.norm(middles - center, axis=1)
    assert (inside <= DISTANCE * 1.01).all()
    assert len(points) < 4 * math.pi / math.acos(1 - DISTANCE / radius), "far more points than needed"


# --------------------------------------------------------------------------------------------------------------------
# DXF


@pytest.mark.parametrize("version", ["R12", "R2000", "R2010", "R2018"])
def test_circles_and_arcs_of_dxf(dxf, version):
    points, closed = only(dxf(lambda space, _: space.add_circle((30, -20), 25), version))
    assert closed
    assert_on_circle(points, (30, -20), 25, closed)
    assert Polygon(points).area == pytest.approx(math.pi * 25**2, rel=1e-3)
    points, closed = only(dxf(lambda space, _: space.add_arc((3, 4), 12, 350, 80), version))
    assert not closed
    assert_on_circle(points, (3, 4), 12, closed)
    ends = [[3 + 12 * math.cos(math.radians(a)), 4 + 12 * math.sin(math.radians(a))] for a in (350, 80)]
    assert points[[0, -1]] == pytest.approx(np.array(ends))


@pytest.mark.parametrize("version", ["R12", "R2010"])
@pytest.mark.parametrize("bulge", [1.0, -1.0, 0.3, -math.tan(math.pi / 8)])
def test_bulges_of_polylines_are_arcs(dxf, version, bulge):
    """A bulge is the tangent of a quarter of the arc's angle: radius c (1 + b^2) / (4 b) over a chord c."""

    def draw(space, _):
        vertices = [(0, 0, bulge), (20, 0, 0), (20, 30, 0)]
        if version == "R12":
            space.add_polyline2d(vertices, format="xyb")
        else:
            space.add_lwpolyline(vertices, format="xyb")

    points, closed = only(dxf(draw, version))
    assert not closed
    arc = points[: int(np.flatnonzero((np.abs(points - [20, 0]) < 1e-9).all(axis=1))[0]) + 1]
    radius = 20 * (1 + bulge**2) / (4 * abs(bulge))
    center = np.array([10.0, math.copysign(1, bulge) * (radius - 10 * abs(bulge))])
    if abs(bulge) == 1:
        center[1] = 0.0
    assert_on_circle(arc, center, radius, False)
    assert np.sign(np.median(arc[:, 1])) == -np.sign(bulge), "positive bulges are to the right of the chord"


@pytest.mark.parametrize("version", ["R12", "R2010"])
def test_polylines_keep_their_points_and_closed_ones_say_so(dxf, version, tmp_path):
    points = np.array([[0, 0], [10, 0], [10, 5], [4, 8]], float)
    for closed in (False, True):
        drawing = read_drawing(write_dxf(tmp_path / "p.dxf", [("A", points, closed)], version=version))
        found, said = only(drawing)
        assert said == closed
        assert found == pytest.approx(points, abs=1e-9)


def test_ellipses_and_splines_of_dxf(dxf):
    points, closed = only(dxf(lambda space, _: space.add_ellipse((5, 6), major_axis=(0, 30), ratio=0.5)))
    assert closed
    assert ((points[:, 0] - 5) / 15) ** 2 + ((points[:, 1] - 6) / 30) ** 2 == pytest.approx(1.0, abs=1e-6)
    assert Polygon(points).area == pytest.approx(math.pi * 15 * 30, rel=1e-3)
    # a rational quadratic spline is an exact quarter of a circle
    control, weights = [(10, 0, 0), (10, 10, 0), (0, 10, 0)], [1, math.sqrt(0.5), 1]
    quarter = lambda space, _: space.add_rational_spline(control, weights, degree=2, knots=[0, 0, 0, 1, 1, 1])  # noqa: E731
    points, closed = only(dxf(quarter))
    assert not closed
    assert np.linalg.norm(points, axis=1) == pytest.approx(10.0, abs=1e-6)
    assert points[[0, -1]] == pytest.approx(np.array([[10, 0], [0, 10]]))
    through = [(0, 0), (10, 5), (20, 0), (30, -5)]
    points, _ = only(dxf(lambda space, _: space.add_spline(through)))
    assert shapely.distance(shapely.points(through), LineString(points)).max() < DISTANCE


def test_blocks_are_taken_apart_with_their_transforms_layers_and_colours(dxf):
    def draw(space, document):
        spaced = {"row_spacing": 5, "column_spacing": 20}
        block = document.blocks.new("B")
        block.add_line((0, 0), (10, 0), dxfattribs={"layer": "0", "color": 0})
        block.add_circle((0, 0), 5, dxfattribs={"layer": "OWN", "color": 1})
        outer = document.blocks.new("OUTER")
        outer.add_blockref("B", (1, 0), dxfattribs={"layer": "0", "color": 0})
        space.add_blockref("OUTER", (100, 50), dxfattribs={"layer": "EDGE", "color": 3, "rotation": 90, "xscale": 2, "yscale": 2})
        space.add_blockref("B", (0, 0), dxfattribs={"layer": "EDGE", "row_count": 2, "column_count": 3, **spaced})

    drawing = dxf(draw)
    line, circle, *others = drawing.shapes
    assert (line.layer, line.colors) == ("EDGE", ("#00ff00",)), "layer 0 and BYBLOCK take those of the insert, through two blocks"
    assert line.flatten(DISTANCE)[0][0] == pytest.approx(np.array([[100, 52], [100, 72]]))
    assert (circle.layer, circle.colors) == ("OWN", ("#ff0000",))
    assert_on_circle(circle.flatten(DISTANCE)[0][0], (100, 52), 10, True)
    assert len(others) == 12, "an array of six inserts"
    starts = sorted(tuple(s.flatten(DISTANCE)[0][0][0].round(9)) for s in others if s.kind == "LINE")
    assert starts == [(x, y) for x in (0, 20, 40) for y in (0, 5)]


def test_layers_that_are_off_or_frozen_are_not_drawn_and_neither_is_text(dxf):
    def draw(space, document):
        for name in ("SEEN", "OFF", "FROZEN"):
            document.layers.add(name)
            space.add_line((0, 0), (10, 0), dxfattribs={"layer": name})
        document.layers.get("OFF").off()
        document.layers.get("FROZEN").freeze()
        space.add_text("words", dxfattribs={"layer": "SEEN"})
        space.add_point((1, 1))

    drawing = dxf(draw)
    assert [shape.layer for shape in drawing.shapes] == ["SEEN"]
    assert drawing.left_out == {"hidden": 2, "TEXT": 1, "POINT": 1}


def test_colours_of_entities_layers_and_true_colours(dxf):
    def draw(space, document):
        document.layers.add("RED", color=1)
        document.layers.add("TRUE", true_color=ezdxf.rgb2int((1, 2, 3)))
        space.add_line((0, 0), (1, 0), dxfattribs={"layer": "RED"})
        space.add_line((0, 0), (1, 0), dxfattribs={"layer": "RED", "color": 5})
        space.add_line((0, 0), (1, 0), dxfattribs={"layer": "TRUE"})
        space.add_line((0, 0), (1, 0), dxfattribs={"layer": "RED", "true_color": ezdxf.rgb2int((16, 32, 48))})
        space.add_line((0, 0), (1, 0), dxfattribs={"layer": "RED", "color": 7})

    colors = [shape.colors for shape in dxf(draw).shapes]
    assert colors == [("#ff0000",), ("#0000ff",), ("#010203",), ("#102030",), ("#000000", "#ffffff")]


def test_drawings_seen_from_below_are_mirrored(dxf):
    arc = {"extrusion": (0, 0, -1)}
    points, _ = only(dxf(lambda space, _: space.add_arc((10, 0), 5, 0, 90, dxfattribs=arc)))
    assert points[[0, -1]] == pytest.approx(np.array([[-15, 0], [-10, 5]]), abs=1e-9)


def test_a_polyline_that_cad_smoothed_is_its_curve_without_the_frame(dxf):
    def draw(space, _):
        polyline = space.add_polyline2d([(0, 0), (5, 1), (10, 0)])
        polyline.dxf.flags |= 4
        frame = polyline.append_vertices([(5, 30)]) or polyline.vertices[-1]
        frame.dxf.flags |= 16

    points, _ = only(dxf(draw, "R2000"))
    assert points == pytest.approx(np.array([[0, 0], [5, 1], [10, 0]]))


@pytest.mark.parametrize(("code", "factor"), [(4, 1.0), (5, 10.0), (6, 1000.0), (1, 25.4), (2, 304.8), (0, None)])
def test_units_of_dxf(dxf, code, factor):
    assert dxf(lambda space, _: space.add_line((0, 0), (1, 0)), units=code).mm_per_unit == pytest.approx(factor)


def test_a_file_without_a_header_states_no_unit(tmp_path):
    """The smallest DXF there is: entities alone, which ezdxf reads with the header of a new drawing, in metres."""
    with r12writer(tmp_path / "small.dxf", fixed_tables=False) as file:
        file.add_line((0, 0), (30, 0), layer="A")
    drawing = read_drawing(tmp_path / "small.dxf")
    assert drawing.mm_per_unit is None
    assert drawing.shapes[0].colors == ("#000000", "#ffffff")


def test_r12_knows_no_unit(dxf):
    assert dxf(lambda space, _: space.add_line((0, 0), (1, 0)), "R12", 4).mm_per_unit is None


# --------------------------------------------------------------------------------------------------------------------
# SVG


def test_shapes_of_svg_are_where_they_are_with_y_upwards(svg):
    points, closed = only(svg('<circle cx="30" cy="20" r="25"/>'))
    assert closed
    assert_on_circle(points, (30, -20), 25, closed)
    points, closed = only(svg('<ellipse cx="5" cy="6" rx="15" ry="30"/>'))
    assert ((points[:, 0] - 5) / 15) ** 2 + ((points[:, 1] + 6) / 30) ** 2 == pytest.approx(1.0, abs=1e-6)
    points, closed = only(svg('<rect x="1" y="2" width="10" height="4"/>'))
    assert closed
    assert Polygon(points).equals(Polygon([(1, -2), (11, -2), (11, -6), (1, -6)]))
    for tag, said in (("polyline", False), ("polygon", True)):
        points, closed = only(svg(f'<{tag} points="0,0 10,0 10,5"/>'))
        assert (closed, points.tolist()) == (said, [[0, 0], [10, 0], [10, -5]])
    points, _ = only(svg('<line x1="1" y1="2" x2="3" y2="5"/>'))
    assert points.tolist() == [[1, -2], [3, -5]]


def test_curves_of_svg_paths(svg):
    points, _ = only(svg('<path d="M 10,0 A 10 10 0 0 1 0,10"/>'))
    assert_on_circle(points, (0, 0), 10, False)
    points, _ = only(svg('<path d="M 0,0 Q 10,20 20,0"/>'))
    t = np.linspace(0, 1, 2001)
    curve = np.column_stack([20 * t, -40 * t * (1 - t)])
    assert shapely.distance(shapely.points(curve), LineString(points)).max() < DISTANCE * 1.01
    points, _ = only(svg('<path d="M 0,0 C 0,20 30,-20 30,10"/>'))
    b = np.column_stack([(1 - t) ** 3, 3 * (1 - t) ** 2 * t, 3 * (1 - t) * t**2, t**3])
    curve = b @ np.array([[0, 0], [0, 20], [30, -20], [30, 10]]) * [1, -1]
    assert shapely.distance(shapely.points(curve), LineString(points)).max() < DISTANCE * 1.01
    assert len(points) < 400
    (triangle, first), (angle, second) = lines_of(svg('<path d="m 0,0 10,0 0,10 z m 20,0 h 5 v 5"/>'))
    assert (first, second) == (True, False)
    assert triangle == pytest.approx(np.array([[0, 0], [10, 0], [10, -10]]))
    assert angle == pytest.approx(np.array([[20, 0], [25, 0], [25, -5]]))


def test_transforms_view_box_and_references(svg):
    body = """<defs><g id="half"><path d="M 0,0 L 10,0"/></g></defs>
      <g transform="translate(100,50) rotate(90)"><g transform="scale(2)"><path d="M 1,0 L 11,0"/></g></g>
      <use xlink:href="#half" x="5" y="7"/><use xlink:href="#half" transform="scale(-1,1)"/>"""
    turned, moved, mirrored = (line for line, _ in lines_of(svg(body)))
    assert turned == pytest.approx(np.array([[100, -52], [100, -72]]))
    assert moved == pytest.approx(np.array([[5, -7], [15, -7]]))
    assert mirrored == pytest.approx(np.array([[0, 0], [-10, 0]]))
    root = 'width="50mm" height="25mm" viewBox="-20 10 200 100"'
    drawing = svg('<path d="M -20,10 L 180,110"/>', root)
    assert drawing.mm_per_unit == pytest.approx(0.25, rel=1e-12)
    assert only(drawing)[0] == pytest.approx(np.array([[-20, -10], [180, -110]]), abs=1e-5)


UNITLESS = [
    'width="100" height="100" viewBox="0 0 100 100"',
    'width="100px" height="100px" viewBox="0 0 100 100"',
    'width="100%" height="100%" viewBox="0 0 100 100"',
    'viewBox="0 0 100 100"',
    'width="100mm" viewBox="0 0 100 100"',
    'width="100mm" height="200mm" viewBox="0 0 100 100"',
    "",
]
SIZES = [
    ('width="10cm" height="5cm" viewBox="0 0 100 50"', 1.0),
    ('width="2in" height="1in" viewBox="0 0 100 50"', 0.508),
    ('width="72pt" height="72pt" viewBox="0 0 72 72"', 25.4 / 72),
    ('width="100mm" height="100mm"', 25.4 / 96),
]


@pytest.mark.parametrize("root", UNITLESS)
def test_svg_in_pixels_states_no_unit(svg, root):
    assert svg('<path d="M 0,0 L 10,0"/>', root).mm_per_unit is None


@pytest.mark.parametrize(("root", "factor"), SIZES)
def test_units_of_svg(svg, root, factor):
    drawing = svg('<path d="M 0,0 L 10,0"/>', root)
    assert drawing.mm_per_unit == pytest.approx(factor, rel=1e-9)
    assert only(drawing)[0] == pytest.approx(np.array([[0, 0], [10, 0]]), abs=1e-6), "in the file's own unit"


def test_names_and_colours_of_svg(svg):
    body = """<style>.weld {stroke: #00ff00}</style>
      <g id="layer1" inkscape:groupmode="layer" inkscape:label="EDGE"><g id="g7"><path id="p1" d="M0,0 1,0" stroke="red"/></g></g>
      <g id="plain"><path d="M0,0 1,0" style="fill:none;stroke:#0072B2"/><path d="M0,0 1,0" class="weld" fill="none"/></g>
      <path d="M0,0 1,0" fill="blue"/><text x="1" y="1">words</text>
      <path d="M0,0 1,0" visibility="hidden"/><g display="none"><path d="M0,0 1,0"/></g>"""
    drawing = svg(body)
    first, second, third, fourth = drawing.shapes
    assert (first.layer, first.names, first.colors) == ("EDGE", ("p1", "g7", "EDGE", "layer1"), ("#ff0000",))
    assert (second.layer, second.colors) == ("plain", ("#0072b2",))
    assert third.colors == ("#00ff00",)
    assert (fourth.layer, fourth.colors) == ("(no layer)", ("#0000ff",))
    assert drawing.left_out == {"text": 1, "hidden": 1}
    assert "EDGE (1 x #ff0000)" in drawing.layers()


# --------------------------------------------------------------------------------------------------------------------
# files that are no drawings


def test_files_that_cannot_be_read_are_one_message(tmp_path):
    for name, content, word in (
        ("absent.dxf", None, "readable"),
        ("drawing.dwg", b"AC1032", r"\.dxf or \.svg"),
        ("empty.dxf", b"", "whole"),
        ("words.dxf", b"this is no drawing\n", "whole"),
        ("dwg.dxf", b"AC1032\0\0\0\0\0", "whole"),
        ("empty.svg", b"", "whole"),
        ("html.svg", b"<html><body/></html>", "whole"),
        ("cut.svg", b"<svg xmlns='http://www.w3.org/2000/svg'><path d='M0,0", "whole"),
    ):
        if content is not None:
            (tmp_path / name).write_bytes(content)
        with pytest.raises(ConfigError, match=word) as caught:
            read_drawing(tmp_path / name)
        assert name in str(caught.value)
    (tmp_path / "folder.dxf").mkdir()
    with pytest.raises(ConfigError, match="not a file"):
        read_drawing(tmp_path / "folder.dxf")


def test_a_drawing_without_lines_says_what_is_in_it(dxf, svg):
    with pytest.raises(ConfigError, match="2 TEXT"):
        dxf(lambda space, _: [space.add_text("a"), space.add_text("b")])
    with pytest.raises(ConfigError, match="1 text"):
        svg("<text>a</text>")


def test_blocks_that_contain_themselves_are_refused(dxf, svg):
    def draw(space, document):
        document.blocks.new("A").add_blockref("A", (1, 1))
        space.add_blockref("A", (0, 0))

    with pytest.raises(ConfigError, match="blocks in blocks"):
        dxf(draw)
    with pytest.raises(ConfigError, match="whole"):
        svg('<g id="a"><path d="M0,0 1,0"/><use xlink:href="#a"/></g>')


def test_coordinates_of_no_drawing_are_refused_when_they_are_taken(svg):
    for path in ("M 0,0 L 1e200,0", "M 0,0 L 1e300,1e300"):
        drawing = svg(f'<path d="{path}"/>')
        with pytest.raises(ConfigError, match="coordinates"):
            drawing.lines(drawing.shapes[0], DISTANCE)


@settings(max_examples=EXAMPLES, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data(), kind=st.sampled_from(["dxf", "svg"]))
def test_damaged_files_are_one_message_or_a_drawing(tmp_path, data, kind):
    file = tmp_path / f"whole.{kind}"
    if not file.exists():
        if kind == "dxf":
            write_dxf(file, [("EDGE", np.array([[0, 0], [10, 0], [10, 5]], float), True)], version="R12")
        else:
            write_svg(file, '<g id="EDGE"><path d="M 0,0 C 0,20 30,-20 30,10 Z"/><circle r="5" transform="rotate(3)"/></g>')
    content = bytearray(file.read_bytes())
    start = data.draw(st.integers(0, len(content) - 1))
    content[start : start + data.draw(st.integers(0, 40))] = data.draw(st.binary(max_size=20))
    damaged = tmp_path / f"damaged.{kind}"
    damaged.write_bytes(content)
    try:
        drawing = read_drawing(damaged)
        lines = [line for shape in drawing.shapes for line in drawing.lines(shape, 0.01)]
    except ConfigError:
        return
    assert all(np.isfinite(points).all() and len(points) > 1 for points, _ in lines)


def test_unit_names_and_numbers():
    assert parse_unit("in") == 25.4
    assert parse_unit("0.2822") == 0.2822
    assert all(parse_unit(name) == factor for name, factor in UNITS.items())
    for text in ("furlong", "0", "-1", "nan", "inf", ""):
        with pytest.raises(ConfigError, match="--units"):
            parse_unit(text)


def test_a_circle_of_points_is_inside_of_it_by_the_distance_asked_for(dxf):
    drawing = dxf(lambda space, _: space.add_circle((0, 0), 100))
    for distance in (1.0, 0.1, 0.01):
        points, _ = only(drawing, distance)
        assert 100 - Polygon(points).exterior.distance(Point(0, 0)) == pytest.approx(distance, rel=0.7)
