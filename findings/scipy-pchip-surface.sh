#!/usr/bin/env bash
# scipy 1.17.1: RegularGridInterpolator(method="pchip") gives another surface when the axes of its table change places,
# and the surface can fall where the table only rises.
# PCHIP's slopes are not linear in the data, so the order of the axes matters; for linear and splines it does not.
# The documentation lists pchip among the tensor-product splines and says nothing of the order.
#   - table of 4 x 4 volumes from 15 to 195 ml, rising along both axes: up to 10.2 ml between f(p, a) and f(a, p);
#   - along one axis the surface falls by 2.2 ml.
# Why it matters: V(P_v, P_a) of a soft heart goes into circulation models in this way, because PCHIP keeps curves
# monotone. A falling stretch is a ventricle of negative compliance.
# What to do: PCHIP along the axis that matters and linearly along the other, or check the differences for their sign.
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"

python3 -m venv venv
venv/bin/pip install -qq --disable-pip-version-check numpy==2.4.6 scipy==1.17.1

cat > surface.py <<'END'
import sys

import numpy as np
from scipy.interpolate import RegularGridInterpolator

volume = np.array([[15.0, 35, 50, 80], [35, 40, 105, 130], [40, 135, 140, 150], [140, 145, 185, 195]])  # ml
assert all((np.diff(volume, axis=axis) > 0).all() for axis in (0, 1))
grid = np.arange(4.0)
fine = np.stack(np.meshgrid(np.linspace(0, 3, 61), np.linspace(0, 3, 61), indexing="ij"), axis=-1)
result = {}
for method in ("linear", "cubic", "pchip"):
    one = RegularGridInterpolator((grid, grid), volume, method=method)(fine)
    other = RegularGridInterpolator((grid, grid), volume.T, method=method)(fine[..., ::-1])
    fall = max((np.maximum.accumulate(one, axis) - one).max() for axis in (0, 1))
    result[method] = np.abs(one - other).max(), fall
    print(f"{method:6s}: axes exchanged {result[method][0]:6.3f} ml, largest fall along an axis {fall:6.3f} ml")
order, fall = result["pchip"]
seen = abs(order - 10.243) < 0.05 and abs(fall - 2.157) < 0.05 and max(result["linear"]) < 1e-9 and result["cubic"][0] < 1e-9
print("as described" if seen else "CHANGED: another surface")
sys.exit(not seen)
END
venv/bin/python surface.py
