"""A study as one table."""

import numpy as np
import pandas as pd
import pytest
import xarray as xr

from limo.datasets.export import tidy, write_csv

PRESSURES = [0.0, 10.0, 20.0]


@pytest.fixture
def dataset():
    """Two cases, of which the second failed before its ramp; frames, sides and events of the first."""
    shape = (2, 1)
    stroke = np.array([[[0.0, 5.0, 1.23456789]], [[np.nan] * 3]])
    peak = np.array([[[[1.0, 2.0], [3.0, 4.0], [3.0, 4.0]]], [[[np.nan] * 2] * 3]])
    dims = ("n_pouches", "ventricular_pressure")
    return xr.Dataset(
        {
            "stroke_volume": ((*dims, "actuation_pressure"), stroke, {"units": "ml"}),
            "efficiency_90ml": (dims, np.array([[0.5], [np.nan]]), {"units": "1"}),
            "case_id": (dims, np.array([["a"], ["b"]])),
            "case_status": (dims, np.array([["converged"], ["diverged"]])),
            "case_reason": (dims, np.array([[""], ['no increment, "small"']])),
            "frame_pressure": ((*dims, "frame"), np.array([[[0.0, 13.8, 13.8]], [[np.nan] * 3]]), {"units": "kPa"}),
            "strain_peak": ((*dims, "frame", "side"), peak, {"units": "1"}),
            "buckling_jump": (
                (*dims, "event"),
                np.where(np.arange(3) < 1, [[[7.0]], [[np.nan]]], np.full((*shape, 3), np.nan)),
                {"units": "ml"},
            ),
        },
        coords={
            "n_pouches": ("n_pouches", [4, 6], {"units": "1"}),
            "ventricular_pressure": ("ventricular_pressure", [3.8], {"units": "kPa"}),
            "actuation_pressure": ("actuation_pressure", PRESSURES, {"units": "kPa"}),
            "frame": ["0", "P_v + 10", "max"],
            "side": ["endocardial", "epicardial"],
            "event": [0, 1, 2],
            "width_scale": 0.9,
        },
    )


def test_a_row_is_a_case_at_a_pressure(dataset):
    table = tidy(dataset)
    first = table[table["n_pouches [1]"] == 4]
    assert list(first["actuation_pressure [kPa]"]) == [0.0, 10.0, 13.8, 20.0]
    assert list(first["stroke_volume [ml]"].round(3).fillna(-1)) == [0.0, 5.0, -1, 1.235]
    assert list(first["strain_peak epicardial [1]"].fillna(-1)) == [2.0, -1, 4.0, -1]
    assert list(first["efficiency_90ml [1]"]) == [0.5] * 4
    assert list(first["buckling_jump 0 [ml]"]) == [7.0] * 4
    assert not [c for c in table if c.startswith(("buckling_jump 1", "width_scale", "frame_pressure"))]


def test_a_case_without_a_ramp_has_one_row_with_its_reason(dataset):
    failed = tidy(dataset)[lambda t: t["n_pouches [1]"] == 6]
    assert len(failed) == 1
    assert failed.iloc[0]["case_status"] == "diverged"
    assert np.isnan(failed.iloc[0]["actuation_pressure [kPa]"])


def test_the_file_is_read_back(dataset, tmp_path):
    write_csv(dataset, tmp_path / "study.csv")
    table = pd.read_csv(tmp_path / "study.csv")
    assert list(table.columns[:4]) == ["n_pouches [1]", "ventricular_pressure [kPa]", "case_id", "case_status"]
    assert table["case_reason"].iloc[-1] == 'no increment, "small"'
    assert table["stroke_volume [ml]"].max() == 5.0


def test_a_study_of_volumes_alone_has_a_table(dataset):
    plain = dataset.drop_vars(["frame_pressure", "strain_peak", "buckling_jump"]).drop_dims(["frame", "side", "event"])
    assert len(tidy(plain)) == 4
