"""The tables of ``docs/beat.md`` from surfaces."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

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
    assert len(rows) == 2 * len(circulations) + 2, "one of them has a right device, too"
    assert sum(row.startswith("| two_devices, right |") for row in rows) == 2
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


def test_the_work_of_a_linear_surface_is_that_of_its_ramps(project):
    """W_a = 1.2 x 100^2 / 2 and W_v = -1.4 x 100 P_v."""
    p_v = np.linspace(0, 30, 7)
    given = np.broadcast_to(1.2 * 100**2 / 2 * np.array([[2.0], [1.0]]), (2, 7))
    of_ventricle = -1.4 * 100 * p_v * np.array([[2.0], [1.0]])
    dims, shape = ("n_pouches", "ventricular_pressure", "leg"), (2, 7, 1)
    study = xr.Dataset(
        {
            "leg_actuation_work": (dims, given.reshape(shape)),
            "leg_ventricular_work": (dims, of_ventricle.reshape(shape)),
            "leg_dissipated": (dims, 0.1 * given.reshape(shape)),
            "case_status": (dims[:2], np.full((2, 7), "converged")),
        },
        {"n_pouches": [6, 8], "ventricular_pressure": p_v, "leg": [0]},
    )
    (project / beats.LEGS).parent.mkdir(parents=True)
    study.to_netcdf(project / beats.LEGS)
    rows = [row.split(" | ")[1:] for row in beats.parts(project)["energy"]().splitlines()[2:]]
    assert [row[:2] for row in rows] == [["12000 to 12000", "10.0 to 10.0"], ["6000 to 6000", "10.0 to 10.0"]]
    assert [[abs(float(x)) for x in row[2].strip(" |").split(" to ")] for row in rows] == [[0, 0], [0, 0]]


def test_tables_of_cycles_and_syringes_are_those_of_the_kept_studies(root):
    parts = beats.parts(root)
    cycles, syringes = (parts[name]().splitlines()[2:] for name in ("cycles", "syringes"))
    assert len(cycles) == len(syringes) == 8
    assert all(float(row.split(" | ")[3]) > 0 for row in cycles), "no cycle makes energy"
    assert all(float(row.split(" | ")[6].strip("| ")) > 0 for row in syringes)


def test_without_surfaces_it_says_so(tmp_path):
    with pytest.raises(ResultError, match="no surfaces"):
        beats.parts(tmp_path)["surfaces"]()
