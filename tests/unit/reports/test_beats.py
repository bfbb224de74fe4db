"""The tables of ``docs/beat.md`` from surfaces."""

from __future__ import annotations

import numpy as np
import pytest

from limo.beat.surface import Surface, write_surfaces
from limo.errors import ResultError
from limo.reports import beats


@pytest.fixture
def project(root, tmp_path):
    """A folder with the shipped circulations and surfaces of two devices that are linear, the second one twice as wide."""
    (tmp_path / "config").mkdir()
    (tmp_path / "config/beats").symlink_to(root / "config/beats")
    p_v, p_a = np.linspace(0, 30, 7), np.arange(0.0, 101.0)
    x, y = np.meshgrid(p_v, p_a, indexing="ij")
    ventricle, actuation = 250 + 6 * x - 1.4 * y, 60 - 1.4 * x + 1.2 * y
    volumes = np.stack([np.stack([ventricle, actuation])] * 2)
    surfaces = {n: Surface(f"N_p = {n}", p_v, p_a, scale * volumes) for n, scale in ((6, 2.0), (8, 1.0))}
    (tmp_path / beats.KEPT).parent.mkdir(parents=True)
    write_surfaces(surfaces, tmp_path / beats.KEPT)
    return tmp_path


def test_every_device_stands_in_every_circulation(project, root):
    text = beats.parts(project)["devices"]()
    circulations = [file.stem for file in (root / "config/beats").glob("*.yaml")]
    rows = [line for line in text.splitlines() if line.startswith("| ")][2:]
    assert len(rows) == 2 * len(circulations)
    assert all(any(row.startswith(f"| {name} | {n} |") for row in rows) for name in circulations for n in (6, 8))


def test_a_linear_device_is_its_linear_law(project):
    text = beats.parts(project)["linear"]()
    assert "R2 = 1.00, root mean square error 0.0 mmHg" in text
    own, law = (line.split(" | ")[2:6] for line in text.splitlines()[-2:])
    assert own[:2] == law[:2]


def test_sheets_and_errors_of_linear_surfaces_are_none(project):
    rows = beats.parts(project)["surfaces"]().splitlines()[2:]
    assert [row.split(" | ")[2:] for row in rows] == [["0.0, 0", "0.0, 0", "0.0, 0", "0.0, 0", "0.0, 0 |"]] * 2


def test_more_afterload_wants_more_pressure(project):
    text = beats.parts(project)["rule"]()
    held = [line.split(" | ")[3] for line in text.splitlines() if line.startswith("| ")][2:]
    pressures = [float(each) for each in held if each != "not reached"]
    assert len(pressures) >= 3
    assert pressures == sorted(pressures)
    assert "Output held at " in text


def test_without_surfaces_it_says_so(tmp_path):
    with pytest.raises(ResultError, match="no surfaces"):
        beats.parts(tmp_path)["surfaces"]()
