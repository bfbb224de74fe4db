"""Units against their definitions."""

from __future__ import annotations

import subprocess
import sys

import pytest

from limo.bench import units

#: factors by definition: the international pound and inch, standard gravity, the conventional mmHg
FACTORS = {
    ("N", "force"): 1, ("kN", "force"): 1e3, ("KN", "force"): 1e3, ("mN", "force"): 1e-3, ("MN", "force"): 1e6,
    ("lbf", "force"): 0.45359237 * 9.80665, ("lbs", "force"): 0.45359237 * 9.80665, ("kg", "force"): 9.80665,
    ("kgf", "force"): 9.80665, ("g", "force"): 9.80665e-3, ("daN", "force"): 10, ("dyn", "force"): 1e-5,
    ("mm", "length"): 1, ("CM", "length"): 10, ("m", "length"): 1e3, ('"', "length"): 25.4, ("in", "length"): 25.4,
    ("µm", "length"): 1e-3, ("μm", "length"): 1e-3, ("ft", "length"): 304.8,
    ("%", "strain"): 1e-2, ("[%]", "strain"): 1e-2, ("mm/mm", "strain"): 1, ("-", "strain"): 1, ("µε", "strain"): 1e-6,
    ("MPa", "stress"): 1, ("MPA", "stress"): 1, ("N/mm²", "stress"): 1, ("N/mm^2", "stress"): 1, ("kPa", "stress"): 1e-3,
    ("mPa", "stress"): 1e-9, ("GPa", "stress"): 1e3, ("psi", "stress"): 0.45359237 * 9.80665 / 25.4**2,
    ("ksi", "stress"): 0.45359237 * 9.80665 / 25.4**2 * 1e3, ("kgf/cm²", "stress"): 0.0980665,
    ("kPa", "pressure"): 1, ("mmHg", "pressure"): 0.133322387415, ("mm Hg", "pressure"): 0.133322387415,
    ("Torr", "pressure"): 0.133322387415, ("bar", "pressure"): 100, ("mbar", "pressure"): 0.1, ("hPa", "pressure"): 0.1,
    ("psi", "pressure"): 6.894757293168, ("psig", "pressure"): 6.894757293168, ("cmH2O", "pressure"): 0.0980665,
    ("cm H2O", "pressure"): 0.0980665, ("atm", "pressure"): 101.325,
    ("ml", "volume"): 1, ("mL", "volume"): 1, ("cc", "volume"): 1, ("cm3", "volume"): 1, ("cm³", "volume"): 1,
    ("l", "volume"): 1e3, ("L", "volume"): 1e3, ("mm³", "volume"): 1e-3,
    ("oz", "volume"): 29.5735295625, ("fl. oz.", "volume"): 29.5735295625,
    ("in³", "volume"): 16.387064, ("s", "time"): 1, ("min", "time"): 60, ("ms", "time"): 1e-3,
}  # fmt: skip


@pytest.mark.parametrize(("text", "kind"), FACTORS)
def test_a_unit_is_what_it_is_by_definition(text, kind):
    assert units.factor(text, kind) == pytest.approx(FACTORS[text, kind], rel=2e-6)


@pytest.mark.parametrize(
    ("text", "kind"), [("mn", "force"), ("kN", "length"), ("V", "force"), ("", "force"), ("__import__('os')", "force")]
)
def test_what_is_no_unit_of_its_kind_is_refused(text, kind):
    with pytest.raises(ValueError, match=f"unit of {kind}"):
        units.factor(text, kind)


def test_pint_is_loaded_only_where_a_unit_is_not_the_wanted_one(root):
    code = "import sys; from limo.bench.units import factor; factor('N', 'force'); factor('%', 'strain'); "
    code += "print('pint' in sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, env={"PYTHONPATH": str(root / "scripts")}
    )
    assert done.stdout.strip() == "False"
