#!/usr/bin/env bash
# xarray 2026.9.0: polyfit(cov=True) takes skipped points for measured ones, so a short curve gets too small an error.
# Curves of unequal length in one array are filled up with NaN. The coefficients leave the NaN out and are right.
# The covariance does not: it uses the pressures of all curves and their number.
#   - 21 points from 0 to 40 mmHg beside a curve to 120 mmHg: standard error of the slope 8.73 times too small;
#   - beside a curve to 240 mmHg it is 34.6 times too small, from the same 21 points;
#   - of 2,000 curves beside the one to 120 mmHg, 18 % hold the true slope in their 95 % interval; with numpy's errors 94 %.
# The scatter of the 2,000 slopes and sigma / sqrt(sum of (p - mean)^2) both confirm numpy. cov="unscaled" is wrong as well.
# The documentation says that polyfit replicates numpy.polyfit and removes invalid values before each fit.
# It has a word on NaN and the rank of the matrix, and none on the covariance.
# Why it matters: one dataset holds the pressure-volume curves of many devices, and few reach the same pressure.
# The error of a compliance shrinks when a longer neighbour joins the dataset. Weighted means then follow the shortest curve.
# What to do: dropna along the pressure and fit every curve for itself, or take the errors from numpy.polyfit.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"

python3 -m venv venv
venv/bin/pip install -qq --disable-pip-version-check numpy==2.4.6 pandas==3.0.6 packaging==26.4 xarray==2026.9.0

cat > errors.py <<'END'
import sys

import numpy as np
import xarray as xr

SLOPE, START, NOISE, TESTS = 0.5, 10.0, 2.0, 2000  # ml/mmHg, ml, ml
rng = np.random.default_rng(7)


def curves(top, number):
    """Volumes measured every 2 mmHg from 0 to top: true line and noise."""
    p = np.arange(0.0, top + 1, 2)
    volume = START + SLOPE * p + rng.normal(0, NOISE, (number, p.size))
    return xr.DataArray(volume, dims=("test", "p"), coords={"p": p})


def error(fit):
    return np.sqrt(fit.polyfit_covariance.isel(cov_i=0, cov_j=0)).values


def spread(top):
    p = np.arange(0.0, top + 1, 2)
    return p.size - 2, ((p - p.mean()) ** 2).sum()


short = curves(40, TESTS)
p = short.p.values
by_numpy = np.array([np.polyfit(p, v, 1, cov=True)[1][0, 0] for v in short.values]) ** 0.5
alone = short.polyfit("p", 1, cov=True)
slopes = alone.polyfit_coefficients.sel(degree=1).values
free, square = spread(40)
exact = NOISE / square**0.5
print(f"standard error of the slope, 21 points to 40 mmHg, mean of {TESTS} tests (ml/mmHg)")
print(f"  exact {exact:.4f}, scatter of the slopes {slopes.std():.4f}, numpy {by_numpy.mean():.4f}")


def cover(errors, slopes):
    return (np.abs(slopes - SLOPE) < 2.093 * errors).mean()  # 2.093: Student, 19 degrees of freedom, 95 %


seen = np.allclose(error(alone), by_numpy) and abs(slopes.std() / exact - 1) < 0.05
share = [cover(by_numpy, slopes)]
print(f"  xarray, alone                       {error(alone).mean():.4f}  95 % intervals that hold 0.5: {share[0]:.0%}")
for top, factor in ((120, 8.733), (240, 34.65)):
    both = xr.concat([short, curves(top, 1)], dim="test", join="outer")
    fit = both.polyfit("p", 1, cov=True)
    same = np.allclose(fit.polyfit_coefficients.sel(degree=1)[:-1], slopes)
    given = error(fit)[:-1]
    free_all, square_all = spread(top)
    wrong = (free_all * square_all / (free * square)) ** 0.5  # all points in place of the valid ones
    share.append(cover(given, slopes))
    print(f"  xarray, beside a curve to {top} mmHg  {given.mean():.4f}  95 % intervals that hold 0.5: {share[-1]:.0%}"
          f"  too small by {(by_numpy / given).mean():.2f}, same slopes: {same}")
    seen &= same and np.allclose(by_numpy / given, wrong) and abs(wrong / factor - 1) < 1e-3
    dropped = both[0].dropna("p").polyfit("p", 1, cov=True)
    seen &= bool(np.isclose(error(dropped), by_numpy[0]))
    unscaled = both.polyfit("p", 1, cov="unscaled").polyfit_covariance.values[0, 0]
    seen &= bool(np.allclose(unscaled, 1 / square_all))
seen &= share[0] > 0.93 and share[1] < 0.25 and share[2] < 0.1
print("as described" if seen else "CHANGED: other errors")
sys.exit(not seen)
END
venv/bin/python errors.py
