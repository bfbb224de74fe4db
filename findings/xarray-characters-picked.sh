#!/usr/bin/env bash
# xarray 2026.9.0: text kept as characters cannot be picked by an array of indices as long as the file is open lazily.
# netCDF classic files keep text as characters, as do netCDF-4 files with fixed widths (dtype S1): flags of stations, of profiles,
# of cases of a sweep. `Dataset.isel(solution=best)` with an array `best` takes of each case its own best solution.
#   - numbers of the same shape are picked; so are texts of variable length (netCDF-4 strings);
#   - characters are, too, if the array has every other dimension of the text;
#   - if one dimension is left whole, it ends in "ValueError: zip() argument 2 is longer than argument 1",
#     in whichever order the dimensions are;
#   - slices, single indices and lists of them work, and everything does after `load`.
# So one flag per case and instant makes the whole dataset fail, though each number in it can be picked. The message names neither
# the variable nor the dimension. The dimension of characters, which xarray hides, is the one that is counted too many.
# Why it matters: what works in memory, in tests, and on netCDF-4 strings fails on the file of a colleague.
# What to do: `load_dataset`, or drop the texts before picking.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"

python3 -m venv venv
venv/bin/pip install -qq --disable-pip-version-check numpy==2.4.6 pandas==3.0.6 packaging==26.4 \
  netCDF4==1.7.5.1.post1 xarray==2026.9.0

cat > pick.py <<'END'
import itertools
import sys

import numpy as np
import xarray as xr

SIZES = {"case": 3, "solution": 2, "instant": 4}
best = xr.DataArray([0, 1, 0], dims="case")


def dataset(dims):
    shape = [SIZES[d] for d in dims]
    count = int(np.prod(shape))
    flags = np.array([f"flag {k:02d}" for k in range(count)]).reshape(shape)
    return xr.Dataset({"flag": (dims, flags), "volume": (dims, np.arange(float(count)).reshape(shape))})


def outcome(opened, made, name, index):
    try:
        found = opened[name].isel(solution=index)
        same = (found.values == made[name].isel(solution=index).transpose(*found.dims).values).all()
        return "picked" if same else "other values"
    except ValueError as error:
        return f"ValueError: {error}"


FAILS = "ValueError: zip() argument 2 is longer than argument 1"
CLASSIC, FIXED, STRINGS = {"format": "NETCDF3_64BIT"}, {"encoding": {"flag": {"dtype": "S1"}}}, {}
ways = {"classic": CLASSIC, "netCDF-4, fixed width": FIXED, "netCDF-4 strings": STRINGS}
seen = True
for kind, how in ways.items():
    expected = "picked" if kind == "netCDF-4 strings" else FAILS
    found = []
    for dims in itertools.permutations(SIZES):
        made = dataset(dims)
        made.to_netcdf("flags.nc", engine="netcdf4", **how)
        with xr.open_dataset("flags.nc", engine="netcdf4") as opened:
            found.append(outcome(opened, made, "flag", best))
            seen &= outcome(opened, made, "volume", best) == "picked"
            seen &= outcome(opened, made, "flag", 1) == outcome(opened, made, "flag", [1, 0]) == "picked"
            seen &= outcome(opened.load(), made, "flag", best) == "picked"
    print(f"{kind}, text of each case and instant, six orders of dimensions: {sorted(set(found))}")
    seen &= found == [expected] * 6
    flat = dataset(("case", "solution"))
    flat.to_netcdf("flags.nc", engine="netcdf4", **how)
    with xr.open_dataset("flags.nc", engine="netcdf4") as opened:
        print(f"{kind}, text of each case: {outcome(opened, flat, 'flag', best)}")
        seen &= outcome(opened, flat, "flag", best) == "picked"
print("numbers of the same shapes, slices and lists, and all of it after load: picked" if seen else "CHANGED")
sys.exit(not seen)
END
venv/bin/python pick.py
