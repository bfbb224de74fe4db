"""The tables of ``docs/fabric.md`` from studies over bending and yarns."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from limo.reports import fabric


@pytest.fixture
def bending() -> xr.Dataset:
    """Two branches of devices whose ratio is larger by a share of N_p (1 - f) %; the second branch lies 1 % above."""
    pressure, factors, pouches = np.linspace(0.0, 60.0, 61), np.array([0.2, 1.0]), np.array([4, 10])
    dims = "n_pouches", "ventricular_pressure", "bending_factor", "branch"
    share = 0.01 * pouches[:, None, None, None] * (1 - factors)[None, None, :, None]
    ratio = (1.5 + share * 1.5)[..., None] * np.array([1.0, 1.01])[:, None] * np.ones(61)
    ratio[..., pressure < 3.8] = 50.0
    shape = ratio.shape[:-1]
    curves = {
        n: ((*dims, "actuation_pressure"), ratio * s)
        for n, s in (("stroke_volume", 100), ("ventricle_volume", 200), ("io_ratio", 1))
    }
    energy = np.broadcast_to(np.arange(2.0)[:, None], ratio.shape)
    return xr.Dataset(
        curves
        | {"potential_energy": ((*dims, "actuation_pressure"), energy), "efficiency_90ml": (dims, np.full(shape, 0.5))}
        | {"case_status": (dims, np.full(shape, "converged"))},
        {
            "n_pouches": pouches,
            "ventricular_pressure": [3.8],
            "bending_factor": factors,
            "branch": [0, 1],
            "actuation_pressure": pressure,
        },
    )


def test_curves_are_compared_from_p_v_on_and_with_the_band(bending):
    text = fabric.growth(bending)
    rows = [line.strip("| ").split(" | ") for line in text.splitlines() if line.startswith("| ")][2:]
    assert rows == [["4", "7.9", "3.2", "1.0", "falls"], ["10", "80.3", "8.0", "1.0", "falls"]]
    assert text.splitlines()[-1].startswith(
        "From N_p = 4 to 10 the paper's error grows 10.2 times, and what f = 0.2 moves 2.5 times."
    )
    bending["io_ratio"] = bending.io_ratio.where(~((bending.n_pouches == 10) & (bending.bending_factor == 0.2)))
    assert "From N_p" not in fabric.growth(bending), "nothing is said of what is not solved"
    assert "| 10 | 80.3 | - | 1.0 | - |" in fabric.growth(bending)


def test_a_case_has_the_span_of_its_solutions(bending):
    table = fabric.numbers(bending, "bending_factor", "f")
    assert table[["N_p", "f"]].values.tolist() == [["4", "0.2"], ["4", "1"], ["10", "0.2"], ["10", "1"]]
    assert table["Stroke at P_a,max [ml]"].tolist()[1] == "150 to 152"
    assert table["Efficiency at 90 ml [%]"].tolist() == ["50"] * 4


def test_isotropic_fabric_stands_before_the_woven_one_at_the_same_load(bending):
    isotropic = bending.isel(bending_factor=[1], drop=True).squeeze("bending_factor", drop=True)
    isotropic = isotropic.assign_coords(n_pouches=[6, 8])
    woven = bending.rename(bending_factor="fabric_angle").assign_coords(fabric_angle=[0.0, 90.0], n_pouches=[6, 8])
    woven = xr.concat([woven, woven], "variant").assign_coords(variant=["ratio_2", "ratio_5"])
    longer = isotropic.reindex(actuation_pressure=np.append(isotropic.actuation_pressure, 100.0), fill_value=np.nan)
    table = fabric.angles(woven, longer)
    assert table.fabric.tolist() == ["isotropic"] * 2 + ["ratio_2"] * 4 + ["ratio_5"] * 4
    assert table.angle.tolist()[:4] == ["-", "-", "0", "90"]
    assert table["Stroke at P_a,max [ml]"].tolist()[:2] == ["150 to 152"] * 2


def test_the_kept_studies_have_a_row_for_every_case(root):
    made = fabric.parts(root)
    rows = made["bending"]().splitlines()[2:]
    assert len(rows) == 16
    assert len(made["angles"]().splitlines()[2:]) == 2 + 12
