"""``docs/results.md`` against every kind of file that a sweep really makes, and those against plain netCDF-4 and CF."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from pathlib import Path

import meshio
import netCDF4
import numpy as np
import pandas as pd
import pytest
import xarray as xr

from tests.helpers.results_page import DOCUMENT, rows, section, table

#: sections of the document and the netCDF files that they describe
DATASETS = {
    "study.nc": "studies/*/study.nc",
    "shapes.nc": "studies/*/shapes.nc",
    "volumes.nc": "cases/*/volumes.nc",
    "frames.nc": "cases/*/frames.nc",
    "measures.nc": "cases/*/measures.nc",
    "airbag.nc": "airbags/*/airbag.nc",
    "tensile_test.nc": "material/tensile_test.nc",
}
#: numbers and texts that netCDF's classic formats have
CLASSIC = {"S1", "int8", "int16", "int32", "float32", "float64"}
#: what a file has only where a device snapped, which the tiny one does not
ONLY_AFTER_A_SNAP = {"measures.nc": {"buckling_difference"}}


#: what only statuses of devices say that are fitted on coarser meshes first, or by several ways
NESTED = {"begun_at", "fit_cpu_seconds", "not_begun_at", "ways[].via", "ways[].potential_energy_mj"}


def files(everything, pattern: str) -> list[Path]:
    found = sorted((everything.folder / "results").glob(pattern))
    assert found, pattern
    return found


def keys(data: dict, depth: int, before: str = "") -> set[str]:
    """Keys of a JSON object joined by dots, down to ``depth`` levels; those of the objects in a list once."""
    found = set()
    for key, value in data.items():
        inner = value[0] if isinstance(value, list) and value and isinstance(value[0], dict) else value
        name = f"{before}{key}" + "[]" * (inner is not value)
        found |= keys(inner, depth - 1, f"{name}.") if isinstance(inner, dict) and inner and depth > 1 else {name}
    return found


@pytest.mark.parametrize("name", DATASETS)
def test_every_variable_of_a_dataset_is_documented_as_it_is(everything, name):
    documented, found = table(name), {}
    for file in files(everything, DATASETS[name]):
        found |= rows(file)
    missing = [f"| `{key}` | {' | '.join(row)} |" for key, row in found.items() if documented.get(key) != row]
    assert not missing, f"rows for {DOCUMENT.name}, `{name}`:\n" + "\n".join(missing)
    assert set(documented) - set(found) <= ONLY_AFTER_A_SNAP.get(name, set())


@pytest.mark.parametrize("name", DATASETS)
def test_every_attribute_of_a_dataset_is_documented(everything, name):
    documented = re.findall(r"^Attributes: (.*)$", section(name), flags=re.MULTILINE)
    listed = set(re.findall(r"`(\w+)`", documented[0]))
    found = set()
    for file in files(everything, DATASETS[name]):
        with netCDF4.Dataset(file) as data:
            found |= set(data.ncattrs())
    assert found == listed


def test_every_key_of_a_status_and_of_a_case_is_documented(everything):
    for name, depth in (("status.json", 2), ("case.json", 2)):
        found = set()
        for file in files(everything, f"cases/*/{name}"):
            data = json.loads(file.read_text(encoding="utf-8"))
            found |= keys({k: v if k != "files" else "" for k, v in data.items()}, depth)
        documented = set(table(name))
        assert found <= documented, f"not documented: {sorted(found - documented)}"
        # a stock build of the solver has not what a tuned one says of itself, and these devices are fitted on one mesh
        absent = {key for key in documented - found if not key.startswith("solver.")} - NESTED
        assert not absent, sorted(absent)


def test_every_column_of_a_table_is_a_documented_variable(everything):
    documented = table("study.nc")
    (file,) = files(everything, "studies/tiny/study.csv")
    columns = pd.read_csv(file, nrows=0).columns
    assert len(columns) > 60
    for column in columns:
        name, _, unit = column.removesuffix("]").partition(" [")
        name = name.split(" ")[0]
        assert name in documented, column
        assert documented[name][1] in (unit, "text"), column


def test_every_field_for_paraview_is_documented(everything):
    for name, pattern in (("fields/*.vtu", "cases/*/fields/*.vtu"), ("meshes/*.vtu", "meshes/*.vtu")):
        found = set()
        for file in files(everything, pattern):
            mesh = meshio.read(file)
            found |= {re.sub(r"pouch\d+", "pouch<k>", n) for n in (*mesh.point_data, *mesh.cell_data)}
        assert found == set(table(name)), name


@pytest.mark.parametrize("name", DATASETS)
def test_datasets_are_plain_netcdf_with_the_attributes_of_cf(everything, name):
    for file in files(everything, DATASETS[name]):
        with netCDF4.Dataset(file) as data:
            assert data.data_model == "NETCDF4"
            found = {**data.groups, **data.cmptypes, **data.vltypes, **data.enumtypes}
            assert not found, "one flat file of simple types"
            assert data.Conventions == "CF-1.11"
            for key, variable in data.variables.items():
                assert isinstance(variable.dtype, np.dtype), f"{file.name}, {key}: a string of any length"
                assert variable.dtype.kind in "Sif", (key, variable.dtype)
                assert re.fullmatch(r"[A-Za-z]\w*", key)
                given = variable.ncattrs()
                if variable.dtype.kind == "f":
                    # velocities and accelerations share one array
                    assert "units" in given or key == "motion", f"{file.name}, {key}"
                if variable.dtype.kind != "S":
                    assert "long_name" in given, f"{file.name}, {key}"
                if key in data.dimensions:
                    assert "_FillValue" not in given, f"{file.name}, {key}: an axis has no gaps"
        with xr.open_dataset(file) as dataset:
            assert dataset.sizes


@pytest.mark.parametrize("name", DATASETS)
def test_datasets_can_be_turned_into_classic_netcdf(everything, name, tmp_path):
    for file in files(everything, DATASETS[name]):
        with netCDF4.Dataset(file) as data, netCDF4.Dataset(tmp_path / "classic.nc", "w", format="NETCDF3_CLASSIC") as classic:
            for key, dimension in data.dimensions.items():
                classic.createDimension(key, len(dimension))
            for key, variable in data.variables.items():
                kind = variable.dtype.str[1:] if variable.dtype.kind == "S" else str(variable.dtype)
                assert kind in CLASSIC, f"{file.name}, {key}: {kind}"
                copy = classic.createVariable(key, variable.dtype, variable.dimensions)
                copy.setncatts({k: variable.getncattr(k) for k in variable.ncattrs() if k != "_FillValue"})
            classic.setncatts({k: data.getncattr(k) for k in data.ncattrs()})
        if shutil.which("nccopy"):
            subprocess.run(["nccopy", "-k", "classic", file, tmp_path / "copied.nc"], check=True)


@pytest.mark.skipif(not shutil.which("octave"), reason="Octave is not installed")
def test_the_documented_line_for_texts_works_in_octave(everything, tmp_path):
    """The remedy of docs/troubleshooting.md, on a study of several dimensions and with the words that Python reads."""
    (remedy,) = re.findall(r"`(t = ncread.*?)`", DOCUMENT.with_name("troubleshooting.md").read_text(encoding="utf-8"))
    (file,) = files(everything, "studies/tiny/study.nc")
    script = f"pkg load netcdf; file = '{file}'; {remedy}; for k = 1:rows(t) disp(t(k, :)); end"
    done = subprocess.run(["octave", "--no-gui", "--quiet", "--eval", script], capture_output=True, text=True, check=False)
    if "netcdf" in done.stderr and "not" in done.stderr:
        pytest.skip("Octave has no package netcdf")
    assert done.returncode == 0, done.stderr
    with xr.open_dataset(file) as dataset:
        assert done.stdout.replace("\0", "").split() == dataset.case_status.values.ravel().tolist()
