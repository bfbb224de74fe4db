"""Displacement frames from .frd files: made by hand, and by CalculiX itself."""

import re

import numpy as np
import pytest

from limo.engines.calculix.frd import FrdFile
from limo.errors import ResultError
from limo.mechanics.kinematics import deformation_gradient, energy_and_extremes, green_lagrange
from limo.mesh.elements import gauss

NUMBERS = np.array([1, 2, 4, 7])
FRAMES = [(1, 1, 0.5), (1, 2, 12.25), (2, 1, 20020.0)]  # step, increment, time


def displacement(k):
    return np.random.default_rng(k).normal(size=(len(NUMBERS), 3)).astype(np.float32)


@pytest.fixture
def written(frd_bytes, tmp_path):
    """``written(kind, ...)``: path of a file with three frames and the byte at which the last frame starts."""

    def make(kind="f4"):
        frames = [(*f, NUMBERS, displacement(k)) for k, f in enumerate(FRAMES)]
        data = frd_bytes(frames, kind)
        path = tmp_path / "deck.frd"
        path.write_bytes(data)
        return path, data.rindex(b"    1PSTEP")

    return make


@pytest.mark.parametrize("kind", ["f4", "f8"])
def test_frames_come_back_as_they_were(written, kind):
    path, _ = written(kind)
    with FrdFile(path) as frd:
        assert [(f.step, f.increment, f.time) for f in frd.frames] == FRAMES
        for k, frame in enumerate(frd.frames):
            u = frd.displacements(frame, 9)
            np.testing.assert_array_equal(u[NUMBERS - 1], displacement(k))
            assert not u[[2, 4, 5, 7, 8]].any(), "nodes that are not in the file stay at zero"


def test_unfinished_last_frame_is_left_out_wherever_it_ends(written):
    """A solver that is killed may stop in the middle of any line or record; what came before it is still good."""
    path, last = written()
    data = path.read_bytes()
    end = len(data) - len(b" 9999\n")
    for cut in range(last + 1, end):
        path.write_bytes(data[:cut])
        with FrdFile(path) as frd:
            assert [(f.step, f.increment) for f in frd.frames] == [f[:2] for f in FRAMES[:2]], f"cut {cut - last} bytes into it"


def test_file_without_frames_has_none(frd_bytes, tmp_path):
    (tmp_path / "deck.frd").write_bytes(frd_bytes([]))
    with FrdFile(tmp_path / "deck.frd") as frd:
        assert frd.frames == []


def test_files_that_are_no_binary_frd_are_result_errors(frd_bytes, tmp_path):
    ascii_frame = (
        b"    1C\n    1PSTEP                         1           1           1          \n"
        b"  100CL  101 5.00000E-01          20                     0    1           1\n"
        b" -4  DISP        4    1\n -5  D1          1    2    1    0\n -5  D2          1    2    2    0\n"
        b" -5  D3          1    2    3    0\n -5  ALL         1    2    0    0    1ALL\n"
        b" -1         1 0.00000E+00 0.00000E+00 0.00000E+00\n -3\n 9999\n"
    )
    for content in (b"", b"\x89PNG\r\n", b"1C", b"<VTKFile>", ascii_frame):
        (tmp_path / "deck.frd").write_bytes(content)
        with pytest.raises(ResultError, match=r"deck\.frd"):
            FrdFile(tmp_path / "deck.frd")
    for path in (tmp_path / "absent.frd", tmp_path):
        with pytest.raises(ResultError):
            FrdFile(path)


@pytest.mark.parametrize("numbers", [[1, 2, 3, 10], [0, 1, 2, 3], [-5, 1, 2, 3]])
def test_node_beyond_the_model_is_a_result_error(frd_bytes, tmp_path, numbers):
    path = tmp_path / "deck.frd"
    path.write_bytes(frd_bytes([(1, 1, 0.5, np.array(numbers), displacement(0))]))
    # the file closes while the error is on its way
    with pytest.raises(ResultError, match=r"deck\.frd"), FrdFile(path) as frd:
        frd.displacements(frd.frames[0], 9)


# --------------------------------------------------------------------------------------------------------------------
# a brick that CalculiX solved (tests/fixtures/brick.inp)


@pytest.fixture(scope="module")
def brick(root):
    """Nodes (20, 3), frames of displacements (2, 20, 3), and the tables of the .dat file by their first word."""
    folder = root / "tests/fixtures"
    deck = (folder / "brick.inp").read_text()
    block = deck[deck.index("*NODE,") : deck.index("*ELEMENT")].splitlines()[1:]
    nodes = np.array([[float(c) for c in line.split(",")[1:]] for line in block])
    with FrdFile(folder / "brick.frd") as frd:
        frames = np.array([frd.displacements(f, 20) for f in frd.frames])
        times = [(f.step, f.increment, f.time) for f in frd.frames]
    tables = {}
    for title, body in re.findall(r"\n (\w+)[^\n]*\n\n((?:[ \d.Ee+-]+\n)+)", (folder / "brick.dat").read_text()):
        tables.setdefault(title, []).append(np.array([[float(c) for c in line.split()] for line in body.splitlines()]))
    return nodes, frames, times, tables


def test_displacements_are_those_that_calculix_printed(brick):
    _, frames, times, tables = brick
    assert times == [(1, 1, 0.5), (1, 2, 1.0)]
    for u, printed in zip(frames, tables["displacements"], strict=True):
        np.testing.assert_allclose(u, printed[:, 1:], rtol=1e-6, atol=1e-9)
    assert frames[1][8, 2] == pytest.approx(7.533974e-03, rel=1e-6), "u_z of node 9"


def test_strains_at_integration_points_are_those_that_calculix_printed(brick):
    """Green-Lagrange strain at the 2 x 2 x 2 points of C3D20R, first coordinate fastest."""
    nodes, frames, _, tables = brick
    for u, printed in zip(frames, tables["strains"], strict=True):
        strain = green_lagrange(deformation_gradient(nodes, np.arange(20)[None], u, gauss(2, 3)[0])[0])[0]
        components = np.stack([strain[:, a, b] for a, b in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))], axis=1)
        np.testing.assert_allclose(_by_point(components), _by_point(printed[:, 2:]), rtol=2e-4, atol=2e-7)


def _by_point(values):
    """Rows in an order that does not depend on that of the integration points."""
    return values[np.lexsort(values.round(4).T)]


def test_strain_energy_is_that_which_calculix_printed(brick):
    nodes, frames, _, tables = brick
    for u, printed in zip(frames, tables["total"], strict=True):
        energy, *_ = energy_and_extremes(nodes, np.arange(20)[None], u, np.array([267.0]), 0.33)
        assert energy == pytest.approx(printed.item(), rel=1e-5)
