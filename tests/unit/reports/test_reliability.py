"""Tables of the stress test."""

from limo.reliability.stress_test import COLUMNS, write_rows
from limo.reports.reliability import stress_failures


def test_a_case_whose_files_are_damaged_is_a_row(tmp_path):
    numbers = dict.fromkeys(COLUMNS, 1.0) | {"box": "small", "engine": "newton", "status": "degraded", "reason": "far off"}
    lost = dict.fromkeys(COLUMNS, "") | {
        "box": "small",
        "number": 2,
        "engine": "newton",
        "status": "missing",
        "reason": "no file",
    }
    write_rows([numbers | {"number": 1}, lost], tmp_path / "stress_test.csv")
    found, missing = stress_failures(tmp_path).splitlines()[-2:]
    assert "| small 1, newton | 1 | 1 |" in found
    assert "| small 2, newton | - | - |" in missing
    assert missing.endswith("no file |")
