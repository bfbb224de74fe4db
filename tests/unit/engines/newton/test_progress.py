"""How far a run of the engine newton is, by what it reports."""

import pytest

from limo.engines.newton.progress import place
from limo.store.files import write_json
from limo.store.results import CaseFiles


@pytest.mark.parametrize(
    ("stage", "maximum", "shares"),
    [
        ("fit", 0.0, (0.5, 0.0, 0.0)),
        ("cycle", 0.0, (1.0, 1.0, 1.0)),
        ("fit", 60.0, (0.5, 0.0, 0.0)),
        ("ramp", 60.0, (1.0, 1.0, 0.25)),
        ("cycle", 60.0, (1.0, 1.0, 0.25)),
    ],
)
def test_shares_of_the_stages_also_without_a_ramp(tmp_path, stage, maximum, shares):
    file = CaseFiles(tmp_path).progress
    file.parent.mkdir(parents=True, exist_ok=True)
    pressure = 15.0 if stage in ("ramp", "cycle") else 0.0
    write_json(file, {"stage": stage, "fitted": 0.5, "actuation_pressure": pressure, "increments": 3, "iterations": 9})
    found = place(tmp_path, maximum)
    assert (found.stage, found.shares, found.increments, found.iterations) == (stage, shares, 3, 9)


def test_nothing_is_known_of_a_run_that_reported_nothing(tmp_path):
    assert place(tmp_path, 60.0) is None
