"""Inkscape and LibreCAD open the cutting patterns at true size. Skipped where they are not installed (both are in Debian)."""

import os
import re
import shutil
import subprocess
import zlib

import numpy as np
import pytest

from limo.drawings.write import Request, read_pattern
from limo.geometry.cutting import BAR, cutting_lines
from limo.geometry.pattern import flat_pattern
from limo.terminal.drawing import write_pattern

from .make import difference

PX = 25.4 / 96  # mm of a pixel of Inkscape's
STROKE = 0.2  # mm, the width of the lines in the SVG files
DEVICE, N_POUCHES, SEAMS = "limo", 10, "both"


def program(name):
    found = shutil.which(name)
    return pytest.param(found, id=name, marks=pytest.mark.skipif(found is None, reason=f"{name} is not installed"))


@pytest.fixture
def run(tmp_path):
    """``run(words...)``: what a program printed, without a display and with a home of its own."""
    environment = os.environ | {"HOME": str(tmp_path), "XDG_RUNTIME_DIR": str(tmp_path), "QT_QPA_PLATFORM": "offscreen"}

    def one(*words):
        done = subprocess.run(
            [str(word) for word in words], env=environment, cwd=tmp_path, capture_output=True, text=True, timeout=300, check=False
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    return one


@pytest.fixture
def pattern(loaded):
    return flat_pattern(loaded.devices[DEVICE].pattern, N_POUCHES)


@pytest.fixture
def files(root, tmp_path, monkeypatch):
    """The SVG and the DXF file of a pattern."""
    monkeypatch.chdir(root)
    return write_pattern("config/config.yaml", DEVICE, N_POUCHES, tmp_path / "made", seams=SEAMS)


def sizes(pattern):
    """Width and height of every layer, in mm."""
    points = {}
    for line in cutting_lines(pattern, seams=SEAMS):
        points.setdefault(line.layer, []).append(line.points)
    return {layer: np.ptp(np.vstack(parts), axis=0) for layer, parts in points.items()}


@pytest.mark.parametrize("inkscape", [program("inkscape")])
def test_inkscape_opens_the_svg_at_true_size_with_its_layers(inkscape, run, files, pattern):
    rows = [line.split(",") for line in run(inkscape, "--query-all", files[0]).splitlines() if line.count(",") == 4]
    boxes = {name: np.array([float(width), float(height)]) * PX for name, _, _, width, height in rows}
    for layer, size in sizes(pattern).items():
        assert boxes[layer] == pytest.approx(size, abs=1.5 * STROKE), layer
    assert boxes["SCALE"][0] == pytest.approx(BAR, abs=0.01), "the bar"


@pytest.mark.parametrize("inkscape", [program("inkscape")])
def test_what_inkscape_saves_comes_back_as_the_same_device(inkscape, run, files, pattern, tmp_path):
    saved = tmp_path / "saved.svg"
    run(inkscape, "--export-plain-svg", "--export-type=svg", f"--export-filename={saved}", files[0])
    assert difference(pattern, read_pattern(Request(saved))[1].flat) < 0.1


def lines_of_pdf(content):
    """Line segments (n, 2, 2) that a PDF file of Qt's draws, in mm: pairs of `x y m` and `x y l` under one scale."""
    for stream in re.findall(rb"stream\r?\n(.*?)endstream", content, re.DOTALL):
        try:
            text = zlib.decompress(stream).decode("latin-1")
        except zlib.error:
            continue
        scale = re.search(r"([\d.]+) 0 0 -([\d.]+) 0 [\d.]+ cm", text)
        found = re.findall(r"(-?\d+) (-?\d+) m\n(-?\d+) (-?\d+) l\nS", text)
        if scale and found:
            return np.array(found, float).reshape(-1, 2, 2) * float(scale[1]) * 25.4 / 72
    raise AssertionError("no lines in the PDF file")


@pytest.mark.parametrize("librecad", [program("librecad")])
def test_librecad_prints_the_dxf_at_true_size(librecad, run, files, pattern, tmp_path):
    run(librecad, "dxf2pdf", "-s", "1", "-t", tmp_path, files[1])
    lines = lines_of_pdf((tmp_path / f"{files[1].stem}.pdf").read_bytes())
    level = lines[np.ptp(lines[:, :, 1], axis=1) == 0]

    def height_of(length):
        """Where the level line of a length is; it must be there."""
        nearest = level[np.abs(np.ptp(level[:, :, 0], axis=1) - length).argmin()]
        assert np.ptp(nearest[:, 0]) == pytest.approx(length, abs=0.05)
        return nearest[0, 1]

    (low,) = {line.points[0, 1] for line in cutting_lines(pattern, seams=SEAMS) if line.layer == "SCALE"}
    assert height_of(BAR) - height_of(2 * pattern.half_width) == pytest.approx(-low, abs=0.05), "from the bar to the valve edge"
