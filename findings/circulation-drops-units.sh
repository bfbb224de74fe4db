#!/usr/bin/env bash
# circulation 0.4.0 takes pint quantities as parameters, as its own defaults are, and drops their units unconverted.
#   - filling pressure 8 mmHg: stroke volume 60 ml; the same pressure as 1.0666 kPa is used as 1.0666 mmHg: 8 ml;
#   - heart rate 1.25 Hz: 60 ml; the same rate as 75 per minute beats 75 times a second: 0.03 ml.
# Nothing warns, and parameters.json holds the bare number. add_units=True, which should keep units, ends with an error
# in this model.
# Why it matters: the package closes the loop around a heart model in mmHg. Whoever simulates an artificial heart in kPa
# hands it quantities, because pint is there to make that safe.
# What to do: convert each value to the unit of the model's default first, q.to(default.units).
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"

python3 -m venv venv
venv/bin/pip install -qq --disable-pip-version-check circulation==0.4.0 pint==0.25.3 numpy==2.4.6 scipy==1.17.1

cat > heart.py <<'END'
import json
import logging
import pathlib
import sys

from circulation.units import ureg
from circulation.windkessel import ThreeElementWindkessel

logging.disable(logging.CRITICAL)


def beat(**parameters):
    """Stroke volume [ml] and heart rate [Hz] as used, once the model beats evenly."""
    model = ThreeElementWindkessel(parameters=parameters, outdir=pathlib.Path("out"))
    volume = model.solve(T=12.0, dt=1e-3, dt_eval=1e-3)["V_LV"][-800:]
    return float(max(volume) - min(volume)), float(model.HR)


mmhg = 8.0 * ureg("mmHg")
kpa = mmhg.to("kPa")
hertz = 1.25 * ureg("Hz")
per_minute = hertz.to("1/minute")
assert abs(kpa - mmhg) < 1e-9 * mmhg  # pint: they are the same
assert abs(per_minute - hertz) < 1e-9 * hertz
cases = {}
for name, parameters in {
    f"P_venous = {mmhg:.4f~P}": {"P_venous": mmhg},
    f"P_venous = {kpa:.4f~P}": {"P_venous": kpa},
    f"HR = {hertz:.4f~P}": {"HR": hertz},
    f"HR = {per_minute:.4f~P}": {"HR": per_minute},
}.items():
    cases[name] = beat(**parameters)
    stored = json.loads(pathlib.Path("out/parameters.json").read_text())[next(iter(parameters))]
    print(f"{name:24s} stroke {cases[name][0]:6.2f} ml at {cases[name][1]:6.2f} Hz; parameters.json: {stored:.4f}")
(right, _), (low, _), (same, slow), (_, fast) = cases.values()
seen = 55 < right < 65 and abs(same - right) < 1e-9 and 6 < low < 10 and abs(slow - 1.25) < 1e-9 and abs(fast - 75) < 1e-6
print("as described" if seen else "CHANGED: units are treated in another way")
sys.exit(not seen)
END
venv/bin/python heart.py
