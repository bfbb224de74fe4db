"""A stress test of three cases through the workflow, and the report of it."""

import pandas as pd
import pytest

from limo.reliability.repeatability import COLUMNS, append_rows
from limo.reports.reliability import TABLES, renewed
from limo.terminal.cli import main
from tests.helpers.shared import made_once

from .conftest import ROOT, Project, make_project, run

BOX = {
    "samples": 3, "n_pouches": [2, 4], "ventricular_pressure": [1.0, 10.0], "aspect_ratio": [1.0, 3.0],
    "stiffness_ratio": [0.5, 2.0], "thickness": [0.1, 0.3], "modulus_factor": [0.5, 5.0], "width_scale": [0.85, 1.1],
}  # fmt: skip


@pytest.fixture
def tested():
    def make(folder):
        project = make_project(folder)
        test = {"engines": ["newton"], "mesh": {"level": "tiny"}, "actuation_above": 3.0, "boxes": {"small": BOX}}
        project.edit("config.yaml", lambda d: d.update(stress_test=test))
        run(project, "stress_test")

    return Project(made_once("stress_test", make))


def test_every_case_is_right_or_marked_and_no_check_denies_it(tested):
    cases = pd.read_csv(tested.folder / "results/stress_test/cases.csv")
    assert len(cases) == 3
    assert set(cases.status) <= {"converged", "degraded"}
    assert (cases.forces_residual < 0.02).all()
    assert (cases.energy_created < 0.05).all()
    assert tested.planned("stress_test") == {}
    assert "solve_case" in tested.planned("tiny"), "no study runs them, and they are no cases of a study"


def test_what_was_found_is_recorded_and_reported(tested, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tested.folder)
    data = tmp_path / "data"
    data.mkdir()
    assert main(["reliability", "record", "--data", str(data)]) == 0
    assert "3 of 3 cases" in capsys.readouterr().out
    assert main(["clean", "cases"]) == 0
    assert "stress" not in capsys.readouterr().out
    values = ("branch", "newton", "0", "converged", "abc")
    rows = [dict(zip(COLUMNS, (*values, p, 300.0 - p, p), strict=True)) for p in (0.0, 5.0, 10.0)]
    append_rows(rows, data / "repeatability.csv")
    document = tmp_path / "reliability.md"
    document.write_text("".join(f"<!-- begin {name} -->\nold\n<!-- end {name} -->\n" for name in TABLES))
    assert main(["reliability", "report", str(document), "--data", str(data)]) == 0
    text = document.read_text()
    assert "old" not in text
    assert "| small | newton | 3 |" in text
    assert (tmp_path / "reliability_paths.png").stat().st_size > 5000


def test_the_document_shows_the_tables_of_its_data():
    text = (ROOT / "docs/reliability.md").read_text(encoding="utf-8")
    assert renewed(text, ROOT / "docs/data") == text, "limo reliability report docs/reliability.md"
