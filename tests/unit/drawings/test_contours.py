"""Seams as one closed contour a pouch."""

import re
from xml.etree import ElementTree

import numpy as np
import pytest
from shapely import LineString, Polygon, unary_union

from limo.geometry.cutting import LAYERS, cutting_lines, pouch_contours, svg
from limo.geometry.pattern import flat_pattern
from limo.terminal.cli import main

CLOSED = "SEAMS_CLOSED"


@pytest.fixture(params=[("limo", n) for n in (2, 4, 6, 8, 16)] + [("mini_limo", 6), ("mini_limo", 8)], ids=str)
def pattern(request, loaded):
    device, n_pouches = request.param
    return flat_pattern(loaded.devices[device].pattern, n_pouches)


def on(lines, *layers):
    return [line for line in lines if line.layer in layers]


def test_there_is_one_contour_a_pouch_and_together_they_are_the_array(pattern):
    contours = [Polygon(line.points) for line in pouch_contours(pattern)]
    assert len(contours) == pattern.n_pouches // 2
    assert all(contour.is_valid for contour in contours)
    (array,) = (Polygon(line.points) for line in on(cutting_lines(pattern), "CUT_POUCHES"))
    assert sum(contour.area for contour in contours) == pytest.approx(array.area, rel=1e-5), "they overlap or leave a gap"
    assert unary_union([c.buffer(1e-6) for c in contours]).symmetric_difference(array).area < 1e-2


def test_contours_run_along_the_seams_and_along_all_of_them(pattern):
    seams = unary_union([LineString(line.points) for line in on(cutting_lines(pattern), "SEAMS")])
    contours = unary_union([Polygon(line.points).exterior for line in pouch_contours(pattern)])
    assert contours.hausdorff_distance(seams) < 1e-9
    assert contours.length == pytest.approx(seams.length, rel=1e-9)


def test_contours_are_the_same_left_and_right(pattern):
    contours = [line.points for line in pouch_contours(pattern)]
    corners = {tuple(point) for points in contours for point in np.round(points, 6) + 0.0}
    assert corners == {(-x + 0.0, y) for x, y in corners}


def test_a_choice_says_which_seams_are_drawn(pattern):
    kept = {choice: {line.layer for line in cutting_lines(pattern, 2.0, choice)} for choice in ("lines", "closed", "both")}
    others = set(LAYERS) - {"SEAMS", CLOSED}
    assert kept == {"lines": others | {"SEAMS"}, "closed": others | {CLOSED}, "both": others | {"SEAMS", CLOSED}}
    closed = on(cutting_lines(pattern, 2.0, "closed"), CLOSED)
    assert all(line.closed for line in closed)
    layers = {group.get("id") for group in ElementTree.fromstring(svg(closed, "t").encode()) if group.tag.endswith("}g")}
    assert layers == {CLOSED, "NOTES"}, "no empty layers, and no note of one that is not there"


def test_the_command_writes_them_into_both_files(root, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(root)
    assert main(["pattern", "mini_limo", "6", "--seams", "both", "--to", str(tmp_path)]) == 0
    files = [tmp_path / "mini_limo_np6.svg", tmp_path / "mini_limo_np6.dxf"]
    assert capsys.readouterr().out.split() == [str(file) for file in files]
    group = re.search(rf'<g id="{CLOSED}".*?</g>', files[0].read_text(), re.DOTALL)[0]
    assert len(re.findall(r'<path d="M[^"]*Z"/>', group)) == 3
    import ezdxf

    drawn = [e for e in ezdxf.readfile(files[1]).modelspace() if e.dxf.layer == CLOSED]
    assert len(drawn) == 3
    assert all(getattr(e, "is_closed", False) or getattr(e, "closed", False) for e in drawn)
