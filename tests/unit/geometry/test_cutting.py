"""Cutting patterns to scale: what is on which layer, and that both files say the same."""

import io
import os
import re
import subprocess
import sys
import xml.etree.ElementTree as ET

import ezdxf
import numpy as np
import pytest
from shapely import LineString, Polygon

from limo.errors import ConfigError
from limo.geometry.cutting import BAR, DXF_VERSIONS, LAYERS, cutting_lines, dxf, svg
from limo.geometry.pattern import flat_pattern
from limo.terminal.cli import main
from limo.terminal.drawing import draw_studies, write_pattern

SVG = "{http://www.w3.org/2000/svg}"


@pytest.fixture(params=[("limo", 4), ("limo", 6), ("limo", 16), ("mini_limo", 6)], ids=str)
def pattern(request, loaded):
    device, n_pouches = request.param
    return flat_pattern(loaded.devices[device].pattern, n_pouches)


def on(lines, layer):
    return [line for line in lines if line.layer == layer]


def read_dxf(text):
    """Polylines of a DXF file without errors as (layer, closed, points)."""
    document = ezdxf.read(io.StringIO(text))
    assert not document.audit().has_issues
    entities = list(document.modelspace())
    assert {e.dxftype() for e in entities} == {"POLYLINE" if document.acad_release == "R12" else "LWPOLYLINE"}
    points = [e.points() if document.acad_release == "R12" else e.get_points("xy") for e in entities]
    return [(e.dxf.layer, e.is_closed, np.array(list(p))[:, :2]) for e, p in zip(entities, points, strict=True)]


def read_svg(text):
    """Paths of an SVG file by layer, y upwards, and its width and height with the scale of a unit in mm."""
    root = ET.fromstring(text.encode())
    paths = []
    for group in root.iter(f"{SVG}g"):
        for path in group.iter(f"{SVG}path"):
            points = np.array([[float(v) for v in p.split(",")] for p in re.findall(r"-?[\d.]+,-?[\d.]+", path.get("d"))])
            paths.append((group.get("id"), path.get("d").endswith("Z"), points * [1, -1]))
    box = [float(v) for v in root.get("viewBox").split()]
    sizes = [float(root.get(k).removesuffix("mm")) for k in ("width", "height")]
    return paths, [size / extent for size, extent in zip(sizes, box[2:], strict=True)], box


def test_all_files_draw_the_same_to_scale(pattern):
    lines = cutting_lines(pattern, allowance=3.0)
    paths, scale, (left, top, width, height) = read_svg(svg(lines, "a title"))
    assert scale == pytest.approx([1.0, 1.0]), "a unit is a mm"
    for found, precision in ((paths, 1e-4), *((read_dxf(dxf(lines, version)), 1e-6) for version in DXF_VERSIONS)):
        assert len(found) == len(lines)
        for (layer, closed, points), line in zip(sorted_lines(found), sorted_lines(plain(lines)), strict=True):
            assert (layer, closed) == line[:2]
            assert points.shape == line[2].shape
            assert np.abs(points - line[2]).max() < precision
    everything = np.vstack([points for _, _, points in paths])
    assert (everything[:, 0] >= left).all()
    assert (everything[:, 0] <= left + width).all()
    assert (-everything[:, 1] >= top).all()
    assert (-everything[:, 1] <= top + height).all()


@pytest.mark.parametrize("version", DXF_VERSIONS)
def test_a_dxf_file_has_units_extents_and_layers_with_their_colours(pattern, version):
    text = dxf(cutting_lines(pattern), version)
    document = ezdxf.read(io.StringIO(text))
    assert document.acad_release == version
    known = (ezdxf.units.MM, 1) if version != "R12" else (None, None)
    assert tuple(document.header.get(key) for key in ("$INSUNITS", "$MEASUREMENT")) == known, "R12 has no such keys"
    assert {layer.dxf.name: layer.dxf.color for layer in document.layers if layer.dxf.name not in ("0", "Defpoints")} == {
        name: color for name, (_, color, _) in LAYERS.items()
    }
    drawn = np.vstack([points for _, _, points in read_dxf(text)])
    for key, corner in (("$EXTMIN", drawn.min(axis=0)), ("$EXTMAX", drawn.max(axis=0))):
        assert document.header[key][:2] == tuple(corner)
    for entity in document.modelspace():
        assert entity.dxf.color == ezdxf.const.BYLAYER


def test_the_same_device_gives_the_same_bytes_in_the_version_that_is_asked_for(root, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(root)
    asked = ["pattern", "mini_limo", "6", "--to"]
    for version, options in (("R2010", []), ("R12", ["--dxf-version", "R12"])):
        assert main([*asked, str(tmp_path / f"first {version}"), *options]) == 0
        command = [sys.executable, "-m", "limo.terminal.cli", *asked, str(tmp_path / f"again {version}"), *options]
        said = subprocess.run(command, env=os.environ | {"PYTHONHASHSEED": "1"}, capture_output=True, text=True, check=True)
        assert said.stderr == ""
        first, again = (tmp_path / f"{when} {version}" / "mini_limo_np6.dxf" for when in ("first", "again"))
        assert first.read_bytes() == again.read_bytes()
        assert ezdxf.readfile(first).acad_release == version
    with pytest.raises(SystemExit) as caught:
        main([*asked, str(tmp_path), "--dxf-version", "R13"])
    assert caught.value.code == 2
    said = capsys.readouterr().err
    assert all(version in said for version in DXF_VERSIONS)


def plain(lines):
    return [(line.layer, line.closed, line.points) for line in lines]


def sorted_lines(lines):
    return sorted(lines, key=lambda line: (line[0], len(line[2]), tuple(np.round(line[2][0], 3) + 0.0)))


def test_the_sheets_are_as_large_as_the_pattern(pattern):
    lines = cutting_lines(pattern)
    (wall,), (pouches,), (bar,) = (on(lines, layer) for layer in ("CUT_WALL", "CUT_POUCHES", "SCALE"))
    regions = [pattern.polygon(region) for region in pattern.regions]
    assert Polygon(wall.points).area == pytest.approx(2 * sum(r.area for r in regions), rel=1e-5)
    assert Polygon(pouches.points).area == pytest.approx(2 * sum(r.area for r in regions[1:]), rel=1e-5)
    assert np.ptp(bar.points[:, 0]) == BAR
    (valve, other) = on(lines, "VALVE")
    assert LineString(valve.points).length + LineString(other.points).length == pytest.approx(2 * pattern.half_width)


def test_seams_divide_a_face_into_its_pouches(pattern):
    from shapely.ops import polygonize, unary_union

    seams = unary_union([LineString(np.round(line.points, 6)) for line in on(cutting_lines(pattern), "SEAMS")])
    assert len(list(polygonize(seams))) == pattern.n_pouches // 2


def test_an_allowance_moves_the_cuts_and_nothing_else(pattern):
    tight, wide = cutting_lines(pattern), cutting_lines(pattern, allowance=5.0)
    for layer in LAYERS:
        if layer.startswith("CUT"):
            (before,), (after,) = on(tight, layer), on(wide, layer)
            inner, outer = Polygon(before.points), Polygon(after.points)
            assert outer.contains(inner)
            assert inner.exterior.distance(outer.exterior) == pytest.approx(5.0, abs=1e-3)
        elif layer != "SCALE":
            assert [line.points.tolist() for line in on(tight, layer)] == [line.points.tolist() for line in on(wide, layer)]


def test_files_are_written_and_mistakes_are_one_message(root, tmp_path, monkeypatch):
    monkeypatch.chdir(root)
    config = "config/config.yaml"
    files = write_pattern(config, "limo", 6, tmp_path, width_scale=0.8)
    assert [f.name for f in files] == ["limo_np6_w0.8.svg", "limo_np6_w0.8.dxf"]
    (wall,) = [points for layer, _, points in read_dxf(files[1].read_text()) if layer == "CUT_WALL"]
    write_pattern(config, "limo", 6, tmp_path)
    (own,) = [points for layer, _, points in read_dxf((tmp_path / "limo_np6.dxf").read_text()) if layer == "CUT_WALL"]
    assert np.ptp(wall[:, 0]) < np.ptp(own[:, 0]), "the device's own scale is larger"
    for arguments, word in (
        (("nothing", 6), "DEVICE"),
        (("limo", 5), "N_P"),
        (("limo", 6, -1.0), "--width-scale"),
        (("limo", 6, 1.0, 0.0, "R13"), "--dxf-version"),
    ):
        with pytest.raises(ConfigError, match=word):
            write_pattern(config, *arguments[:2], tmp_path, *arguments[2:])


def test_every_study_has_a_picture_of_its_devices(root, tmp_path, monkeypatch):
    monkeypatch.chdir(root)
    (png,) = draw_studies("config/config.yaml", ["pressure_volume"], tmp_path)
    assert png.read_bytes().startswith(b"\x89PNG")
    (drawn,) = draw_studies("config/config.yaml", ["pressure_volume"], tmp_path, "svg")
    first = drawn.read_bytes()
    assert draw_studies("config/config.yaml", ["pressure_volume"], tmp_path, "svg") == [drawn]
    assert drawn.read_bytes() == first, "the same bytes for the same picture"
    assert len(re.findall(r'id="axes_\d+"', first.decode())) == 4, "a panel each for N_p = 4, 6, 8, 10"
    with pytest.raises(ConfigError, match="nowhere"):
        draw_studies("config/config.yaml", ["nowhere"], tmp_path)


def test_the_mesh_is_drawn_where_it_is_wanted(root, tmp_path, monkeypatch, loaded, device_mesh):
    from limo.terminal import drawing

    monkeypatch.chdir(root)
    monkeypatch.setattr(drawing, "mesh_device", lambda content: device_mesh("limo", 8, "quarter"))
    figures = [drawing.draw_study(loaded, "pressure_volume", tmp_path, meshes) for meshes in (False, True)]
    without, with_mesh = (len(f.axes[0].collections) for f in figures)
    assert with_mesh - without == 2, "both halves"
    assert "elements" in figures[1].axes[0].get_title(loc="left")
    for figure in figures:
        drawing.style.plt.close(figure)
