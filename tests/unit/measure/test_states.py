"""Which of several solutions is the lowest, and which device rests otherwise than others."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from limo.measure.states import folded_otherwise, lowest, remarked, state_variables
from limo.store.files import write_netcdf

POUCHES = [4, 6, 8, 10]


def study(energies, status="converged", **statuses):
    """A study of devices (N_p) with solutions (branches) of some energies at rest; others by ``N_p_branch``."""
    energies = np.array(energies, float)
    shape = energies.shape
    found = np.full(shape, status, object)
    for place, other in statuses.items():
        n_pouches, branch = map(int, place.removeprefix("at_").split("_"))
        found[POUCHES.index(n_pouches), branch] = other
    curves = np.stack([energies, energies - 100], axis=-1)[:, None]
    return xr.Dataset(
        {
            "potential_energy": (("n_pouches", "ventricular_pressure", "branch", "actuation_pressure"), curves),
            "case_status": (("n_pouches", "ventricular_pressure", "branch"), found[:, None]),
        },
        coords={
            "n_pouches": POUCHES[: shape[0]],
            "ventricular_pressure": [3.8],
            "branch": range(shape[1]),
            "actuation_pressure": [0.0, 60.0],
        },
    )


def test_of_each_case_the_solution_of_least_energy_at_rest_is_shown():
    dataset = study([[-1000, -1010], [-1020, -1019], [-1005, -1005], [-990, np.nan]])
    shown = lowest(dataset)
    assert "branch" not in shown.dims
    np.testing.assert_array_equal(shown.potential_energy.isel(actuation_pressure=0).squeeze(), [-1010, -1020, -1005, -990])
    assert state_variables(dataset).lowest_branch.squeeze().values.tolist() == [1, 0, 0, 0]


def test_texts_of_frames_are_shown_from_a_file_that_is_open_lazily(tmp_path):
    dataset = study([[-1000, -1010], [-1020, -1019]])
    zones = np.broadcast_to(np.array(["seam", "wall"])[:, None], (2, 1, 2, 3))
    dataset["zone"] = (("n_pouches", "ventricular_pressure", "branch", "frame"), zones)
    write_netcdf(dataset, tmp_path / "study.nc")
    with xr.open_dataset(tmp_path / "study.nc") as opened:
        shown = lowest(opened)
    assert shown.zone[:, 0, 0].values.tolist() == ["wall", "seam"]


def test_a_solution_that_cannot_be_used_is_not_the_lowest():
    dataset = study([[-1000, -1010]], at_4_1="diverged")
    assert float(lowest(dataset).potential_energy[0, 0, 0]) == -1000


def test_a_dataset_from_before_energies_were_kept_shows_the_first_solution():
    dataset = study([[-1000, -1010]]).drop_vars("potential_energy")
    assert "branch" not in lowest(dataset).dims
    assert folded_otherwise(dataset) == []


@pytest.mark.parametrize(("energy", "named"), [(-1000.0, False), (-985.0, False), (-960.0, True), (-1060.0, False)])
def test_a_device_that_rests_above_others_is_named(energy, named):
    dataset = study([[-1010], [-1005], [-1000], [energy]])
    lines = folded_otherwise(dataset)
    assert len(lines) == named
    assert not named or lines[0].startswith("N_p = 10, P_v = 3.8 kPa: folded otherwise")


def test_a_second_solution_can_clear_a_device():
    assert folded_otherwise(study([[-1010, -1010], [-1005, -1005], [-1000, -1001], [-960, -1003]])) == []


def test_two_devices_have_no_median():
    assert folded_otherwise(study([[-1010], [-800]])) == []


def test_what_is_remarked_on_cases_is_said_once_with_its_number_of_cases():
    dims = ("n_pouches",)
    dataset = xr.Dataset({"case_remarks": (dims, np.array(["layers pass: on 3 %; V_a below: -7 ml", "layers pass: on 5 %", ""]))})
    assert remarked(dataset) == ["layers pass, in 2 of 3 cases", "V_a below, in 1 of 3 cases"]
    assert remarked(dataset.isel(n_pouches=0)) == ["layers pass: on 3 %", "V_a below: -7 ml"]
    assert remarked(dataset.drop_vars("case_remarks")) == [], "of a dataset from before remarks were kept"
