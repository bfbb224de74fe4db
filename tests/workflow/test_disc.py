"""A maker's disc with one pouch a face, whose pouch sheet comes to rest on the wrong side of the wall unless layers touch."""

import math

import pytest
import xarray as xr
import yaml

from .conftest import ROOT, make_project, run


def arc(radius: float, low: float, high: float, pieces: int = 12) -> list[list[float]]:
    """Points of a half circle around (0, 0.55), over the length, from one height to another one."""
    first, last = (math.asin(min(max((height - 0.55) / radius, -1.0), 1.0)) for height in (low, high))
    angles = [first + (last - first) * i / pieces for i in range(pieces + 1)]
    return [[round(radius * math.cos(a), 4), round(0.55 + radius * math.sin(a), 4)] for a in angles]


def disc() -> dict:
    """A device of 120 mm: a disc with a neck that holds the valve, its pouch array a smaller disc."""
    outline, pouch = arc(0.45, 0.1469, 1.0), arc(0.36, 0.2382, 0.8618)
    bottom, top = arc(0.36, 0.19, 0.2382, 3), arc(0.36, 0.8618, 0.91, 3)
    seams = {"fractions": {6: [1.0]}, "reference": [[0.09, 0.2014], [0.09, 0.8986]], "reference_position": 0.25}
    return {
        "material": {"areal_density": 58.0, "poisson_ratio": 0.4, "thickness": 0.06, "youngs_modulus": 200.0},
        "pattern": {
            "length": 120.0,
            "outline": [[[0.2, 0.0], outline[0]], outline],
            "pouch_array": [bottom, pouch, top],
            "seams": seams,
            "valve": {"flat_half_width_over_length": 0.2},
        },
    }


@pytest.fixture(scope="module")
def swept(tmp_path_factory):
    project = make_project(tmp_path_factory.mktemp("disc"))
    limits = yaml.safe_load((ROOT / "config/config.yaml").read_text())["limits"]
    project.edit("config.yaml", lambda c: c.update(limits=limits))
    (project.folder / "config/devices/disc.yaml").write_text(yaml.safe_dump(disc()))
    axes = {"n_pouches": [2], "ventricular_pressure": [2.0]}
    variants = {
        "newton": {"description": "layers pass each other", "engine": "newton"},
        "calculix": {"description": "the same", "engine": "calculix"},
        "touching": {"description": "layers touch", "engine": "newton", "numerics": "touching_at_once"},
    }
    project.study("tiny", device="disc", axes=axes, actuation_pressure_max=6.0, figures=[], variants=variants)
    run(project)
    return xr.load_dataset(project.folder / "results/studies/tiny/study.nc").squeeze().set_index(variant="variant")


def test_both_engines_find_the_same_disc(swept):
    """The same V_a at rest and the same ratio, within 2 %."""
    newton, calculix = (swept.sel(variant=name) for name in ("newton", "calculix"))
    rest = [float(one.actuation_volume.sel(actuation_pressure=0.0)) for one in (newton, calculix)]
    assert rest[0] == pytest.approx(rest[1], rel=0.02)
    ratios = [float(one.io_ratio.sel(actuation_pressure=6.0)) for one in (newton, calculix)]
    assert ratios[0] == pytest.approx(ratios[1], rel=0.02)


@pytest.mark.parametrize("engine", ["newton", "calculix"])
def test_a_pouch_sheet_on_the_wrong_side_is_told(swept, engine):
    one = swept.sel(variant=engine)
    assert float(one.actuation_volume.sel(actuation_pressure=0.0)) < -5
    assert str(one.case_status.values) == "degraded"
    assert "rests locked" in str(one.case_reason.values)
    for told in ("V_a below zero beyond the fabric's thickness", "endocardium and epicardium pass each other"):
        assert told in str(one.case_remarks.values)


def test_with_contact_it_is_on_the_right_side(swept):
    one = swept.sel(variant="touching")
    assert 0 < float(one.actuation_volume.sel(actuation_pressure=0.0)) < 0.01 * float(one.ventricle_volume[0])
    assert "pass each other" not in str(one.case_remarks.values)
