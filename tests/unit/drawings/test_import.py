"""From a drawing to a device: the same one again, however it lies and in any unit; what the model cannot carry is refused."""

import os
import re
from pathlib import Path

import ezdxf
import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from limo.config.load import load_config
from limo.config.yaml_file import parse, read_yaml
from limo.drawings.roles import FLATTENING
from limo.drawings.write import Request, import_pattern, read_pattern
from limo.errors import ConfigError
from limo.geometry.cutting import cutting_lines
from limo.geometry.pattern import flat_pattern
from limo.mesh.device import mesh_device
from limo.mesh.flat import smallest_jacobian
from limo.schema.device import Device, Pattern
from limo.terminal.cli import MISTAKE, main
from limo.terminal.drawing import draw_studies, write_pattern

from .make import box, difference, mirrored, moved, plain, simple, svg_lines, write_dxf, write_svg

EXAMPLES = int(os.environ.get("LIMO_EXAMPLES", "25"))
SAME = 0.1  # mm, within which a device comes back
TOLERANCE = 0.05


@pytest.fixture
def bring(tmp_path):
    """``bring(lines, *words, ...)``: the pattern of lines that were written to a DXF file; ``words`` are those of ``--map``."""

    def make(lines, *words, half=None, units=None, tolerance=TOLERANCE, **how):
        file = write_dxf(tmp_path / "drawing.dxf", lines, **how)
        return read_pattern(Request(file, None, words, units, tolerance, half))[1]

    return make


def flat(loaded, device, n_pouches):
    return flat_pattern(loaded.devices[device].pattern, n_pouches)


# --------------------------------------------------------------------------------------------------------------------
# the same device again

EVERY = [*(("limo", n) for n in range(2, 17, 2)), *(("mini_limo", n) for n in range(2, 17, 2))]


@pytest.mark.parametrize(("device", "n_pouches"), EVERY)
def test_the_own_files_come_back_as_the_same_device(root, loaded, tmp_path, monkeypatch, device, n_pouches):
    monkeypatch.chdir(root)
    before = flat(loaded, device, n_pouches)
    for file in write_pattern("config/config.yaml", device, n_pouches, tmp_path, allowance=4.0):
        roles, found = read_pattern(Request(file))
        assert difference(before, found.flat) < SAME
        assert max(found.deviations.values()) <= TOLERANCE
        assert found.flat.length == pytest.approx(before.length, abs=2e-4)
        assert found.drawn.asymmetry < 1e-3
        assert {unused.split()[0] for unused in roles.unused} == {"CUT_WALL", "CUT_POUCHES"}


@pytest.mark.parametrize("seams", ["closed", "both"])
@pytest.mark.parametrize("n_pouches", [2, 4, 10])
def test_closed_contours_say_the_same_as_lines(root, loaded, tmp_path, monkeypatch, n_pouches, seams):
    monkeypatch.chdir(root)
    for file in write_pattern("config/config.yaml", "limo", n_pouches, tmp_path, seams=seams):
        assert difference(flat(loaded, "limo", n_pouches), read_pattern(Request(file))[1].flat) < SAME


def test_straight_pieces_and_fillets_come_back_as_they_were(root, loaded, tmp_path, monkeypatch):
    monkeypatch.chdir(root)
    before = loaded.devices["mini_limo"].pattern
    for file in write_pattern("config/config.yaml", "mini_limo", 6, tmp_path):
        data = read_pattern(Request(file))[1].data
        for key in ("outline", "pouch_array"):
            drawn = getattr(before, key)
            assert [len(curve) > 2 for curve in data[key]] == [len(curve) > 2 for curve in drawn]
            corners = [curve[-1] for curve in data[key]]
            assert np.array(corners) == pytest.approx(np.array([curve[-1] for curve in drawn]), abs=1e-4)
        assert np.array(data["seams"]["reference"]) == pytest.approx(np.array(before.seams.reference), abs=1e-5)
        assert data["seams"]["reference_position"] == pytest.approx(before.seams.reference_position, abs=1e-5)
        assert data["seams"]["fractions"] == before.seams.fractions


@pytest.mark.parametrize("version", ["R12", "R2000", "R2010", "R2018"])
@pytest.mark.parametrize("exploded", [False, True], ids=["polylines", "lines"])
def test_dxf_of_every_version_in_polylines_and_single_lines(loaded, bring, version, exploded):
    before = flat(loaded, "limo", 4)
    found = bring(plain(cutting_lines(before)), version=version, exploded=exploded)
    assert difference(before, found.flat) < SAME


@pytest.mark.parametrize(("code", "name", "size"), [(4, "mm", 1.0), (5, "cm", 10.0), (1, "in", 25.4), (6, "m", 1000.0)])
def test_units_of_the_file_the_option_and_the_bar(loaded, tmp_path, code, name, size):
    before = flat(loaded, "mini_limo", 6)
    lines, small = plain(cutting_lines(before)), moved(scale=1 / size)
    without_bar = [line for line in lines if line[0] != "SCALE"]
    stated = write_dxf(tmp_path / "stated.dxf", without_bar, code=code, move=small)
    silent = write_dxf(tmp_path / "silent.dxf", without_bar, code=0, move=small)
    barred = write_dxf(tmp_path / "barred.dxf", lines, code=0, move=small)
    wrong = write_dxf(tmp_path / "wrong.dxf", lines, code=2, move=small)
    for file, units in ((stated, None), (silent, name), (silent, f"{size:g}"), (barred, None), (wrong, name)):
        assert difference(before, read_pattern(Request(file, units=units))[1].flat) < SAME
    with pytest.raises(ConfigError, match="--units mm"):
        read_pattern(Request(silent))
    with pytest.raises(ConfigError, match=rf"bar .* --units {name}"):
        read_pattern(Request(wrong))


def test_units_of_svg(loaded, tmp_path):
    before = flat(loaded, "mini_limo", 6)
    lines = [line for line in plain(cutting_lines(before)) if line[0] != "SCALE"]
    inches, pixels = moved(scale=1 / 25.4), moved(scale=96 / 25.4)
    for move, root, units in (
        (inches, 'width="10in" height="10in" viewBox="-5 -5 10 10"', None),
        (inches, 'width="10" height="10" viewBox="-5 -5 10 10"', "in"),
        (pixels, "", "px"),
        (pixels, 'width="500" height="500"', f"{25.4 / 96}"),
    ):
        file = write_svg(tmp_path / "unit.svg", svg_lines(lines, move), root)
        assert difference(before, read_pattern(Request(file, units=units))[1].flat) < SAME
        if units:
            with pytest.raises(ConfigError, match="--units"):
                read_pattern(Request(file))


@pytest.mark.parametrize("angle", [0.0, 30.0, 90.0, 180.0, 283.7])
@pytest.mark.parametrize("mirror", [False, True], ids=["as it is", "mirrored"])
@pytest.mark.parametrize("kind", ["dxf", "svg"])
def test_a_drawing_may_lie_anywhere_be_turned_and_be_mirrored(loaded, tmp_path, angle, mirror, kind):
    before = flat(loaded, "limo", 6)
    lines, move = plain(cutting_lines(before)), moved(angle, (250.0, -1234.5), 1.0, mirror)
    if kind == "dxf":
        file = write_dxf(tmp_path / "turned.dxf", lines, move=move)
    else:
        file = write_svg(tmp_path / "turned.svg", svg_lines(lines, move))
    assert difference(before, read_pattern(Request(file))[1].flat) < SAME


def test_layers_and_colours_by_a_mapping(loaded, bring):
    before = flat(loaded, "mini_limo", 6)
    wanted = [line for line in plain(cutting_lines(before)) if line[0] in ("EDGE", "VALVE", "SEAMS")]
    renamed = {"EDGE": "Aussenkante", "VALVE": "Klappe", "SEAMS": "Naht"}
    lines = [(renamed[layer], points, closed) for layer, points, closed in wanted]
    with pytest.raises(ConfigError, match=r"Aussenkante \(2 x"):
        bring(lines)
    assert difference(before, bring(lines, "outline=aussenkante", "valve=Klappe", "seams=NAHT").flat) < SAME
    colors = {"EDGE": 5, "VALVE": 6, "SEAMS": 1}
    found = bring(wanted, "outline=#0000FF", "valve=#ff00ff", "seams=#ff0000", colors=colors)
    assert difference(before, found.flat) < SAME
    with pytest.raises(ConfigError, match="--map seams = '#00ff00'"):
        bring(wanted, "outline=#0000ff", "valve=#ff00ff", "seams=#ff0000", "seams=#00ff00", colors=colors)


def test_the_border_of_the_array_may_be_on_a_layer_of_its_own(bring):
    lines = [("BORDER" if closed else layer, points, closed) for layer, points, closed in simple()]
    assert difference(bring(simple()).flat, bring(lines, "array=BORDER").flat) < 1e-9


def test_arcs_and_splines_become_curves_on_them(tmp_path):
    """A half-round face with a half-round array: radii, straight lines and a spline of CAD, none of them polylines."""
    document = ezdxf.new("R2010")
    document.units = 4
    space = document.modelspace()
    for layer, radius, low in (("EDGE", 60.0, 0.0), ("SEAMS", 50.0, 20.0)):
        look = {"layer": layer}
        space.add_arc((0, 60), radius, 0, 180, dxfattribs=look)
        for side in (radius, -radius):
            space.add_line((side, low), (side, 60), dxfattribs=look)
    space.add_line((-50, 20), (50, 20), dxfattribs={"layer": "SEAMS"})
    space.add_line((-60, 0), (60, 0), dxfattribs={"layer": "VALVE"})
    top = 60 + 50 * np.sin(np.arccos(0.3))  # where the border is at x = 15
    for side in (1, -1):
        space.add_spline([(10 * side, 20), (22 * side, 55), (15 * side, top)], dxfattribs={"layer": "SEAMS"})
    document.saveas(tmp_path / "round.dxf")
    found = read_pattern(Request(tmp_path / "round.dxf"))[1]
    curves = {curve.name: curve.points for curve in found.flat.curves}
    for name, radius in (("outer", 60.0), ("array_side", 50.0)):
        on_arc = curves[name][curves[name][:, 1] > 60]
        assert np.hypot(on_arc[:, 0], on_arc[:, 1] - 60) == pytest.approx(radius, abs=TOLERANCE)
        beside = curves[name][(curves[name][:, 1] < 60) & (curves[name][:, 1] > 20)]
        assert beside[:, 0] == pytest.approx(radius, abs=TOLERANCE)
    assert found.data["length"] == pytest.approx(120.0, abs=FLATTENING * TOLERANCE + 1e-4)
    assert np.linalg.norm(curves["seam0"] - [22, 55], axis=1).min() < 1.0
    assert found.drawn.n_pouches == 6


def test_a_closed_outline_loses_its_valve_edge(bring):
    _, (_, outline, _), *rest = simple()
    valve = ("VALVE", np.array([[-50.0, 0.0], [50.0, 0.0]]), False)
    for turn in range(len(outline)):
        closed = [valve, ("EDGE", np.roll(outline, turn, axis=0), True), *rest]
        assert difference(bring(simple()).flat, bring(closed).flat) < 1e-9


def test_one_half_is_enough_where_only_one_is_drawn(bring):
    valve = ("VALVE", np.array([[0.0, 0.0], [50.0, 0.0]]), False)
    outline = ("EDGE", np.array([[50.0, 0.0], [50.0, 90.0], [20.0, 120.0], [0.0, 120.0]]), False)
    array = ("SEAMS", np.array([[0.0, 20.0], [40.0, 20.0], [40.0, 95.0], [0.0, 95.0]]), False)
    seam = ("SEAMS", np.array([[15.0, 20.0], [15.0, 95.0]]), False)
    whole = bring(simple())
    for move in (moved(), moved(mirror=True), moved(77.0, (3.0, 4.0))):
        half = bring([valve, outline, array, seam], move=move)
        assert difference(whole.flat, half.flat) < 1e-3
        assert half.drawn.asymmetry is None


@pytest.mark.parametrize("half", ["right", "left"])
def test_halves_that_differ_are_refused_or_one_is_taken_for_both(bring, half):
    seams = [np.array([[x, 20.0], [x, 95.0]]) for x in (14.0, -18.0)]
    lines = [*simple()[:3], *(("SEAMS", seam, False) for seam in seams)]
    with pytest.raises(ConfigError, match=r"halves that differ by 4 mm .*--half right"):
        bring(lines)
    wanted = seams[0] if half == "right" else mirrored(seams[1])
    assert difference(bring(simple(wanted)).flat, bring(lines, half=half).flat) < 1e-3
    upside_down = bring(lines, half=half, move=moved(180.0))
    assert difference(bring(simple(wanted)).flat, upside_down.flat) < 1e-3, "right is right with the valve edge below"


def test_seams_of_one_shape_are_multiples_and_others_are_refused(bring):
    y = np.linspace(20, 95, 60)
    shape = 12 + 5 * np.sin((y - 20) / 75 * np.pi)
    seams = [np.column_stack([factor * shape, y]) for factor in (0.5, 1.0, 1.9)]
    found = bring(simple(*seams))
    multiples = found.data["seams"]["fractions"][14]
    assert np.array(multiples) / multiples[0] == pytest.approx([1.0, 2.0, 3.8], rel=1e-3)
    odd = [seams[0], np.column_stack([20 + 3 * np.sin((y - 20) / 25 * np.pi), y])]
    with pytest.raises(ConfigError, match="multiples in x") as caught:
        bring(simple(*odd))
    (needed,) = re.findall(r"--tolerance ([\d.]+)", str(caught.value))
    assert bring(simple(*odd), tolerance=float(needed)).drawn.n_pouches == 10, "the tolerance that the message names is enough"


def test_the_exponent_for_other_numbers_of_pouches_is_that_of_the_drawing(loaded, bring):
    """limo's N_p = 8 pattern has its seam where its exponent 1.36 puts it, within what its reference_position is rounded to."""
    found = bring(plain(cutting_lines(flat(loaded, "limo", 8))))
    assert found.data["seams"]["spacing_exponent"] == pytest.approx(1.36, abs=0.03)


@pytest.mark.parametrize("n_pouches", [2, 4])
@pytest.mark.parametrize("device", ["limo", "mini_limo"])
def test_a_drawing_without_seams_off_the_axis_still_makes_other_numbers(loaded, bring, device, n_pouches):
    found = bring(plain(cutting_lines(flat(loaded, device, n_pouches))))
    pattern = parse(Pattern, found.data, Path("made.yaml"))
    for other in (6, 8, 12):
        assert flat_pattern(pattern, other).n_pouches == other


# --------------------------------------------------------------------------------------------------------------------
# any pattern


@st.composite
def patterns(draw):
    """A device somewhere between round and square, with straight, bent and curved seams; and its number of pouches."""
    width, shoulder, waist = draw(st.floats(0.3, 0.6)), draw(st.floats(0.1, 0.9)), draw(st.floats(-0.05, 0.08))
    low, high, rim = draw(st.floats(0.08, 0.25)), draw(st.floats(0.8, 0.93)), draw(st.floats(0.6, 0.85))
    top = 0.3 + 0.6 * shoulder
    outline = [[[width, 0.0], [width + waist, 0.35], [width, 0.7]], [[width, 0.7], [top * width, 0.95], [0.0, 1.0]]]
    if draw(st.booleans()):
        outline = [[[width, 0.0], [width, 0.7]], [[width, 0.7], [top * width, 1.0]], [[top * width, 1.0], [0.0, 1.0]]]
    side = rim * min(width, width + waist) * 0.95
    end = 0.6 * min(side, top * width)
    array = [[[0.0, low], [0.8 * side, low]], [[0.8 * side, low], [side, 0.4], [end, high]], [[end, high], [0.0, high]]]
    at, bow = 0.35 * end, draw(st.floats(-0.1, 0.3)) * end
    middle = [[at + 0.5 * bow, low + 0.25 * (high - low)], [at + bow, (low + high) / 2]]
    reference = [[at, low], *(middle if draw(st.booleans()) else []), [at, high]]
    multiples = {2: [], 4: [0.0], 6: [1.0], 8: [0.0, 1.3], 10: [0.7, 1.6], 12: [0.0, 0.6, 1.5]}
    n_pouches = draw(st.sampled_from(list(multiples)))
    return {
        "length": draw(st.floats(40, 400)),
        "width_scale": draw(st.sampled_from([1.0, 0.85, 1.1])),
        "valve": {"flat_half_width_over_length": width},
        "outline": outline,
        "pouch_array": array,
        "seams": {"reference": reference, "reference_position": 0.5, "fractions": {n_pouches: multiples[n_pouches]}},
    }, n_pouches


@settings(
    max_examples=EXAMPLES, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.filter_too_much]
)
@given(
    made=patterns(),
    angle=st.floats(0, 360),
    mirror=st.booleans(),
    how=st.sampled_from(["R12", "R2010", "lines", "svg"]),
    seams=st.sampled_from(["lines", "closed"]),
)
def test_any_pattern_comes_back_from_its_drawing(tmp_path, made, angle, mirror, how, seams):
    data, n_pouches = made
    try:
        before = flat_pattern(parse(Pattern, data, Path("made.yaml")), n_pouches)
    except ConfigError:
        assume(False)
    lines, move = plain(cutting_lines(before, seams=seams)), moved(angle, (12.0, 7.0), 1.0, mirror)
    if how == "svg":
        file = write_svg(tmp_path / "any.svg", svg_lines(lines, move))
    else:
        version = "R2010" if how == "lines" else how
        file = write_dxf(tmp_path / "any.dxf", lines, version=version, exploded=how == "lines", move=move)
    found = read_pattern(Request(file, units="mm"))[1]
    assert difference(before, found.flat) < SAME
    assert max(found.deviations.values()) <= TOLERANCE


# --------------------------------------------------------------------------------------------------------------------
# what is refused


def row(y, x=40.0):
    return ("SEAMS", np.array([[-x, y], [x, y]]), False)


def weld(points, closed=True):
    return ("SEAMS", np.array(points, float), closed)


def valve(points, closed=False):
    return ("VALVE", np.array(points, float), closed)


def with_outline(*points):
    return [("EDGE", np.array(points, float), False) if layer == "EDGE" else (layer, p, c) for layer, p, c in simple()]


FRAME = simple()[:2]
BARE = simple()[:3]
AXIS = ("SEAMS", np.array([[0.0, 20.0], [0.0, 95.0]]), False)
GAP = [np.array([[50.0, 0.0], [50.0, 90.0]]), np.array([[50.0, 91.0], [0.0, 120.0], [-50.0, 90.0], [-50.0, 0.0]])]
BELOW = ([50, 0], [60, -9], [60, 90], [0, 120], [-60, 90], [-60, -9], [-50, 0])
BESIDE = ([55, 0], [55, 90], [0, 120], [-55, 90], [-55, 0])
CROSSED = ([50, 0], [-50, 90], [0, 130], [50, 90], [-50, 0])
UNEVEN = ([50, 0], [56, 90], [0, 120], [-50, 90], [-50, 0])
REFUSED = {
    "rows along the axis": ([*BARE, row(60.0)], "2 pouches in rows along the axis"),
    "a grid": ([*simple(), row(60.0)], "rows along the axis or otherwise, with seams that meet"),
    "a cross": ([*BARE, AXIS, row(60.0)], "4 pouches in rows"),
    "two arrays": (
        [*FRAME, weld(box(-40, 20, 40, 50)), weld(box(-40, 60, 40, 95))],
        "10 mm apart, in rows along the axis",
    ),
    "pouches with a gap": ([*FRAME, weld(box(-40, 20, -2, 95)), weld(box(2, 20, 40, 95))], "share no seam, 4 mm"),
    "groups": ([*BARE, row(60.0), weld(box(-20, 105, 20, 110))], "3 pouches in 2 groups"),
    "a pouch in a pouch": ([*BARE, weld(box(-10, 50, 10, 70))], "inside|hole"),
    "a pouch on one side": ([*FRAME, weld(box(5, 20, 40, 95))], "on one side of the axis"),
    "an open array": ([*FRAME, weld(box(-40, 20, 40, 95), closed=False)], "0 closed pouches"),
    "a seam that ends nowhere": ([*simple(), weld([[30, 20], [30, 70]], closed=False)], "1 lines that end nowhere"),
    "a seam twice, not alike": ([*simple(), weld([[15.02, 20], [15.02, 95]], closed=False)], "closer than"),
    "seams on one side only": (simple()[:-1], "1 seams on the right and 0 on the left"),
    "too many pouches": (simple(*([[x, 20.0], [x, 95.0]] for x in (4, 12, 20, 28, 36))), "11 pouches in a face"),
    "an outline in two pieces": ([*simple(), ("EDGE", np.array([[0, 130], [9, 140]]), False)], "2 lines that do not join"),
    "an outline with a gap": ([*simple()[:1], *(("EDGE", p, False) for p in GAP), *simple()[2:]], "2 lines that do not join"),
    "an outline beside the valve edge": (with_outline(*BESIDE), "ends of the valve edge"),
    "an outline below the valve edge": (with_outline(*BELOW), "9 mm below"),
    "an outline that crosses itself": (with_outline(*CROSSED), "lines that do not join"),
    "a closed outline off the valve edge": ([simple()[0], ("EDGE", box(-60, -5, 60, 130), True), *BARE[2:]], "no part lies on"),
    "an outline that is wider on the right": (with_outline(*UNEVEN), "halves that differ by"),
    "a valve edge that is bent": ([valve([[-50, 0], [0, -5], [50, 0]]), *simple()[1:]], "5 mm off straight"),
    "a valve edge that is closed": ([valve(box(-50, -5, 50, 0), closed=True), *simple()[1:]], "closed line"),
    "two valve edges": ([*simple(), valve([[-50, -30], [50, -30]])], "2 lines that do not join"),
    "no valve edge": (simple()[1:], "--map valve=NAME"),
    "nothing on its layer": ([("0", p, c) for _, p, c in simple()], "--map outline=NAME valve=NAME seams=NAME"),
    "no outline": ([simple()[0], *simple()[2:]], "--map outline=NAME"),
    "no pouches": (FRAME, "--map seams=NAME"),
    "an array at the outline": ([*FRAME, weld(box(-49.9, 20, 49.9, 80))], "0.5 mm inside the outline"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_the_model_cannot_carry_is_one_message(bring, name):
    lines, word = REFUSED[name]
    with pytest.raises(ConfigError, match=word) as caught:
        bring(lines)
    message = str(caught.value)
    assert "drawing.dxf" in message
    assert "expected" in message
    assert "for example" in message
    assert "\n" not in message
    if "pouches in" in word or "share no seam" in word:
        assert "side by side" in message, "says what the model can carry"


def test_every_refused_drawing_is_a_change_of_one_that_is_taken(bring):
    assert bring(simple()).drawn.n_pouches == 6
    assert bring([*BARE, AXIS]).drawn.n_pouches == 4
    assert bring(BARE).drawn.n_pouches == 2


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["walls=EDGE"], "ROLE=LAYER"),
        (["outline"], "ROLE=LAYER"),
        (["outline="], "ROLE=LAYER"),
        (["outline=#12"], "six hexadecimal digits"),
        (["outline=A", "seams=a"], "a is outline and seams"),
        (["outline=NOWHERE"], "none on NOWHERE"),
        (["outline=EDGE", "outline=NOWHERE"], "outline = 'NOWHERE'"),
    ],
)
def test_mappings_that_cannot_be_are_one_message(bring, words, says):
    with pytest.raises(ConfigError, match=says):
        bring(simple(), *words)


def test_sizes_of_no_device_ask_for_the_unit(bring):
    with pytest.raises(ConfigError, match="--units"):
        bring(simple(), code=6)
    with pytest.raises(ConfigError, match="--units"):
        bring(simple(), units="1e-5")


# --------------------------------------------------------------------------------------------------------------------
# the device


@pytest.fixture
def project(root, tmp_path, monkeypatch):
    """A folder with a configuration, one device and nothing else."""
    (tmp_path / "config/devices").mkdir(parents=True)
    (tmp_path / "config/studies").mkdir()
    text = (root / "config/config.yaml").read_text(encoding="utf-8")
    (tmp_path / "config/config.yaml").write_text(re.sub(r"^studies:.*?(?=^\S)", "studies: [hold]\n", text, flags=re.M | re.S))
    (tmp_path / "config/devices/limo.yaml").write_text((root / "config/devices/limo.yaml").read_text(encoding="utf-8"))
    monkeypatch.chdir(tmp_path)
    write_dxf(tmp_path / "my-purse.dxf", simple())
    return tmp_path


def test_the_command_writes_a_device_and_a_picture(project, capsys):
    assert main(["import-pattern", "my-purse.dxf"]) == 0
    said = capsys.readouterr().out
    device, picture = project / "config/devices/my_purse.yaml", project / "results/patterns/my_purse_import.png"
    assert said.splitlines()[0] == "config/devices/my_purse.yaml"
    assert said.splitlines()[-1] == "results/patterns/my_purse_import.png"
    for word in ("N_p = 6", "L = 120 mm", "Millimeters", "EDGE", "tolerance 0.05 mm"):
        assert word in said
    assert picture.read_bytes().startswith(b"\x89PNG")
    made = parse(Device, read_yaml(device), device)
    assert made.material == parse(Device, read_yaml(Path("config/devices/limo.yaml")), device).material
    text = device.read_text(encoding="utf-8")
    assert text.startswith("# Imported from my-purse.dxf (sha256 ")
    assert all(len(line) <= 130 for line in text.splitlines() if not line.startswith("#"))
    first = text, picture.read_bytes()
    assert main(["import-pattern", "my-purse.dxf", "--replace"]) == 0
    assert (device.read_text(encoding="utf-8"), picture.read_bytes()) == first, "the same bytes for the same drawing"


def test_the_file_says_what_was_found(project):
    found = read_pattern(Request(Path("my-purse.dxf")))[1]
    import_pattern(Request(Path("my-purse.dxf"), "purse"), "config/config.yaml", Path("out"))
    pattern = parse(Device, read_yaml(Path("config/devices/purse.yaml")), Path("purse.yaml")).pattern
    assert pattern == parse(Pattern, found.data, Path("purse.yaml"))
    corners = [[(0.416667, 0.0), (0.416667, 0.75)], [(0.416667, 0.75), (0.166667, 1.0)], [(0.166667, 1.0), (0.0, 1.0)]]
    assert pattern.outline == corners
    assert pattern.seams.reference == [(0.125, 0.166667), (0.125, 0.791667)]


def test_a_study_of_the_device_is_valid_can_be_drawn_and_meshed(project):
    import_pattern(Request(Path("my-purse.dxf"), "purse"), "config/config.yaml", Path("out"))
    study = "device: purse\naxes: {n_pouches: [6], ventricular_pressure: [3.8]}\nactuation_pressure_max: 30\n"
    (project / "config/studies/hold.yaml").write_text(study, encoding="utf-8")
    loaded = load_config("config/config.yaml")
    (picture,) = draw_studies("config/config.yaml", ["hold"], Path("results"))
    assert picture.exists()
    pattern = loaded.devices["purse"].pattern
    level = loaded.config.mesh_levels["preview"].model_dump(mode="json")
    content = {"pattern": pattern.model_dump(mode="json"), "n_pouches": 6, "level": level, "symmetry": "quarter"}
    mesh = mesh_device(content)
    assert smallest_jacobian(mesh.nodes[:, :2], mesh.quads).min() > 0
    assert mesh.nodes[:, 0].max() == pytest.approx(50.0, abs=1e-3)
    assert mesh.nodes[:, 1].max() == pytest.approx(120.0, abs=1e-3)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--name", "limo"], "--replace"),
        (["--name", "1st"], "a letter first"),
        (["--tolerance", "0"], "--tolerance"),
        (["--tolerance", "nan"], "--tolerance"),
        (["--fabric", "silk"], "one of: limo"),
        (["--map", "outline=WALL"], "WALL|wall"),
        (["--units", "yard"], "--units"),
    ],
)
def test_mistakes_are_one_message_and_nothing_is_written(project, capsys, words, says):
    before = sorted(project.rglob("*"))
    assert main(["import-pattern", "my-purse.dxf", *words]) == MISTAKE
    error = capsys.readouterr().err
    assert re.search(says, error)
    assert error.count("\n") == 1
    assert sorted(project.rglob("*")) == before


# --------------------------------------------------------------------------------------------------------------------
# any drawing

coordinates = st.one_of(st.sampled_from([-50.0, 0.0, 15.0, 20.0, 50.0, 95.0, 120.0, 15.02, 1e-5]), st.floats(-150, 150))
some_points = st.lists(st.tuples(coordinates, coordinates), min_size=2, max_size=6).map(lambda p: np.array(p, float))
scribbles = st.tuples(st.sampled_from(["EDGE", "VALVE", "SEAMS"]), some_points, st.booleans())


@st.composite
def spoiled(draw):
    """The simple pattern with lines left out, moved, bent or added."""
    lines = simple() if draw(st.booleans()) else simple(*([[f * 8.0, 20.0], [f * 11.0, 60.0], [f * 8.0, 95.0]] for f in (1, 2)))
    kept = []
    for layer, points, closed in lines:
        points = points.copy()
        if draw(st.integers(0, 5)) == 0:
            k = draw(st.integers(0, len(points) - 1))
            points[k] += draw(st.tuples(*[st.one_of(st.floats(-0.2, 0.2), st.floats(-30, 30))] * 2))
        if draw(st.integers(0, 14)):
            kept.append((layer, points, closed ^ (draw(st.integers(0, 14)) == 0)))
    return kept + draw(st.lists(scribbles, max_size=2))


@settings(max_examples=4 * EXAMPLES, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(lines=st.one_of(spoiled(), st.lists(scribbles, max_size=6)), half=st.sampled_from([None, None, "right", "left"]))
def test_any_drawing_is_one_message_or_a_device_within_the_tolerance(tmp_path, lines, half):
    file = write_dxf(tmp_path / "any.dxf", lines)
    try:
        roles, found = read_pattern(Request(file, half=half))
    except ConfigError:
        return
    assert max(found.deviations.values()) <= TOLERANCE
    assert len(roles.lines["valve"]) > 0
    assert flat_pattern(parse(Pattern, found.data, file), found.drawn.n_pouches).n_pouches == found.drawn.n_pouches
