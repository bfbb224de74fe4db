"""Whole files or none."""

import netCDF4
import numpy as np
import pytest
import xarray as xr

from limo.errors import ResultError
from limo.store.files import read_json, write_json, write_netcdf, write_whole


def test_nothing_is_left_when_writing_fails(tmp_path):
    path = tmp_path / "result.nc"
    path.write_text("earlier")

    def fails(aside):
        aside.write_text("half")
        raise RuntimeError("disk full")

    with pytest.raises(RuntimeError, match="disk full"):
        write_whole(path, fails)
    assert [p.name for p in tmp_path.iterdir()] == ["result.nc"]
    assert path.read_text() == "earlier"


def test_result_appears_only_when_it_is_whole_and_keeps_its_ending(tmp_path):
    path = tmp_path / "new/folder/result.nc"
    seen = []

    def write(aside):
        seen.extend([path.exists(), aside.suffix, aside.parent == path.parent])
        aside.write_text("all")

    write_whole(path, write)
    assert seen == [False, ".nc", True]
    assert path.read_text() == "all"
    assert len(list(path.parent.iterdir())) == 1


def test_json_round_trip(tmp_path):
    data = {"a": 1.5, "b": [1, None], "c": {"d": "é"}}
    write_json(tmp_path / "a.json", data)
    assert read_json(tmp_path / "a.json") == data


@pytest.mark.parametrize("text", [b"", b"{", b"[1, 2]", b"\xff", b"null"])
def test_damaged_json_is_a_result_error(tmp_path, text):
    (tmp_path / "a.json").write_bytes(text)
    with pytest.raises(ResultError, match=r"a\.json"):
        read_json(tmp_path / "a.json")
    with pytest.raises(ResultError, match=r"absent\.json"):
        read_json(tmp_path / "absent.json")


def test_datasets_are_plain_netcdf_and_come_back_as_they_were(tmp_path):
    texts = np.array([["", "a longer one"], ["é β", ""]])
    variables = {
        "said": (("x", "y"), texts),
        "empty": ("x", np.array(["", ""])),
        "one": ((), "hey"),
        "e": ("z", np.array([], str)),
    }
    numbers = {"value": (("x", "y"), np.array([[1.0, np.nan], [3.0, 4.0]]), {"units": "mm"}), "k": ("x", np.array([1, 2]))}
    dataset = xr.Dataset(variables | numbers, coords={"x": ["u", "v"], "y": [0.5, 1.5]}, attrs={"title": "t"})
    write_netcdf(dataset, tmp_path / "a.nc")
    write_netcdf(dataset, tmp_path / "b.nc", {"value": {"zlib": True}}, checked=False)
    for file in ("a.nc", "b.nc"):
        again = xr.load_dataset(tmp_path / file)
        assert again.attrs == {"title": "t", "Conventions": "CF-1.11"}
        xr.testing.assert_equal(again.astype(object), dataset.astype(object))
        with netCDF4.Dataset(tmp_path / file) as plain:
            assert plain["said"].dtype == "S1"
            assert "_FillValue" not in plain["y"].ncattrs()
            assert plain["value"].filters()["fletcher32"] == (file == "a.nc")
            assert plain["value"].filters()["zlib"] == (file == "b.nc")
    xr.load_dataset(tmp_path / "a.nc").to_netcdf(tmp_path / "classic.nc", format="NETCDF3_CLASSIC")
    write_netcdf(xr.load_dataset(tmp_path / "a.nc").isel(y=[0, 0, 1]), tmp_path / "c.nc")
    assert xr.load_dataset(tmp_path / "c.nc").said.values[0].tolist() == ["", "", "a longer one"]


def test_whole_numbers_are_of_types_that_classic_netcdf_has_unless_they_are_too_large(tmp_path):
    numbers = {"long": [1, -(2**31)], "huge": [1, 2**31]}
    numbers |= {"unsigned": np.array([1, 2], np.uint16), "short": np.array([1, 2], np.int16)}
    dataset = xr.Dataset({name: ("x", values) for name, values in numbers.items()}, coords={"x": [4, 6], "branch": 3})
    write_netcdf(dataset, tmp_path / "a.nc")
    with netCDF4.Dataset(tmp_path / "a.nc") as plain:
        found = {name: str(variable.dtype) for name, variable in plain.variables.items()}
    small = {"long": "int32", "unsigned": "int32", "short": "int16", "x": "int32", "branch": "int32"}
    assert found == small | {"huge": "int64"}
    xr.testing.assert_equal(xr.load_dataset(tmp_path / "a.nc"), dataset)
