"""Generated documents are those of their data, and the numbers of README.md come from these."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pandas as pd
import pytest
import xarray as xr

from limo.errors import LimoError, ResultError
from limo.reports import blocks, readme
from limo.reports.documents import DOCUMENTS, stale
from limo.terminal.cli import main


@pytest.mark.parametrize("name", DOCUMENTS)
def test_a_generated_document_is_that_of_its_data(root, monkeypatch, name):
    monkeypatch.chdir(root)
    assert DOCUMENTS[name](root) == (root / name).read_text(encoding="utf-8"), f"limo docs {name}"


def test_parts_are_made_anew_and_everything_else_stays():
    text = "a\n\n<!-- begin one -->\nold\n<!-- end one -->\n\nb\n<!-- begin two -->\n<!-- end two -->\n"
    made = blocks.renewed(text, {"one": lambda: "1", "two": lambda: "2\n\n3", "three": lambda: "4"})
    assert made == text.replace("old", "1").replace("two -->\n<!--", "two -->\n2\n\n3\n<!--")
    assert blocks.by_hand(made) == "a\n\n\n\nb\n\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<!-- begin four -->\n<!-- end four -->\n", "no part of this document is called four; there are one"),
        ("<!-- begin one -->\n", "<!-- begin one -->: a marker without its other half"),
        ("<!-- end one -->\n", "<!-- end one -->: a marker without its other half"),
        ("<!-- begin one -->\n<!-- end two -->\n", "begin one"),
    ],
)
def test_a_marker_that_is_wrong_is_an_error(text, message):
    with pytest.raises(ResultError, match=re.escape(message)):
        blocks.renewed(text, {"one": lambda: "1"})


def test_readme_has_all_parts_and_no_measured_number_outside_of_them(root):
    text = (root / "README.md").read_text(encoding="utf-8")
    assert set(re.findall(r"<!-- begin (\w+) -->", text)) == set(readme.parts(root))
    prose = re.sub(r"^```.*?^```", "", blocks.by_hand(text), flags=re.DOTALL | re.MULTILINE)
    assert re.findall(r"[^\n]*\d (?:s|min|minutes|hours|h|%|ml|MiB|GiB|times)\b[^\n]*", prose) == []


def test_every_part_names_mesh_level_and_where_it_has_times_the_machine(root):
    errors = xr.load_dataset(root / "docs/gallery/data/accuracy.nc").machine.values
    machines = {*pd.read_csv(root / "docs/data/performance.csv").machine, *map(str, errors), readme.UNKNOWN} - {""}
    for name, make in readme.parts(root).items():
        text = make()
        assert "mesh level" in text.lower(), name
        if re.search(r"\d (?:s|min|h) ", text):
            assert any(machine in text for machine in machines), name


@pytest.fixture
def copied(root, tmp_path):
    """A project's folder with the kept data, of which the tables of costs may be changed."""
    (tmp_path / "docs").mkdir()
    for name in ("config", "docs/gallery"):
        (tmp_path / name).symlink_to(root / name)
    shutil.copytree(root / "docs/data", tmp_path / "docs/data")
    return tmp_path


def as_recorded(copied: Path) -> tuple[Path, pd.DataFrame]:
    """The recorded costs, of runs that took as many iterations as those of the gallery's sweep, and their file."""
    file = copied / "docs/data/performance.csv"
    rows = pd.read_csv(file)
    with xr.open_dataset(copied / "docs/gallery/data/pressure_volume.nc") as dataset:
        for n in dataset.n_pouches.values:
            own = (rows.batch == "grid_preview_calculix") & (rows.n_pouches == n) & (rows.ventricular_pressure == 3.8)
            assert own.any()
            rows.loc[own, ["iterations_fit", "iterations_hold"]] = 0
            rows.loc[own, "iterations_ramp"] = int(dataset.iterations.sel(n_pouches=n).squeeze())
    return file, rows


def test_a_case_has_one_time_and_it_is_that_of_the_recorded_costs(copied):
    file, rows = as_recorded(copied)
    own = (rows.batch == "grid_preview_calculix") & (rows.n_pouches == 10) & (rows.ventricular_pressure == 3.8)
    rows.loc[own, "cpu_seconds"] = 1234.4
    rows.to_csv(file, index=False)
    parts = readme.parts(copied)
    parts = {name: parts[name]() for name in ("sweep", "sets", "presets", "times")}
    assert [line.split(" | ")[-1] for line in parts["sweep"].splitlines() if line.startswith("| 10 |")] == ["1234 s |"]
    assert "The sweep takes" in parts["sweep"]
    assert "| 1234 s |" in parts["times"]
    assert not [name for name, text in parts.items() if " 87 s" in text]


def test_the_time_of_another_run_is_not_shown(copied):
    file, rows = as_recorded(copied)
    rows.loc[(rows.batch == "grid_preview_calculix") & (rows.n_pouches == 4), "iterations_ramp"] += 1
    rows.to_csv(file, index=False)
    made = readme.parts(copied)["sweep"]()
    assert next(line for line in made.splitlines() if line.startswith("| 4 |")).endswith("| - |")
    assert "The sweep takes" not in made, "not known without one of its cases"
    rows.loc[rows.batch == "grid_preview_calculix", "iterations_ramp"] += 5
    rows.to_csv(file, index=False)
    assert "CPU" not in readme.parts(copied)["sweep"](), "nothing is known"


def test_the_command_writes_what_is_stale_and_says_which(root, copied, monkeypatch, capsys):
    monkeypatch.chdir(copied)
    names = ["docs/reliability.md", "docs/performance.md"]
    for name in names:
        shutil.copyfile(root / name, copied / name)
    assert main(["docs", *names, "--check"]) == 0
    page = copied / "docs/performance.md"
    page.write_text(page.read_text().replace("# What it costs", "# Costs"))
    assert main(["docs", *names, "--check"]) == 1
    assert capsys.readouterr().err == "not up to date: docs/performance.md; limo docs writes them\n"
    assert main(["docs", *names]) == 0
    assert capsys.readouterr().out == "docs/performance.md\n"
    assert page.read_text() == (root / "docs/performance.md").read_text()
    assert main(["docs", *names]) == 0
    assert capsys.readouterr().out == "all documents are up to date\n"


def test_a_document_that_is_none_is_one_message(root, tmp_path):
    with pytest.raises(LimoError, match="LICENSE: no generated document; there are README"):
        stale(root, ["LICENSE"])
    with pytest.raises(LimoError, match="run limo docs in the project's folder"):
        stale(tmp_path, ["README.md"])
