"""What it takes to enter the project, beside another checkout: commands are timed for real, rows are kept and shown."""

import sys

import pandas as pd
import pytest

from limo.errors import LimoError, ResultError
from limo.reports import entry
from limo.reports.entry import COLUMNS, WORDS, compare, compare_solve_imports, entry_table, keep, read_entry


def rows(**values) -> pd.DataFrame:
    one = {"what": "help", "other_seconds": 0.4, "seconds": 0.1, "ratio": 0.25, "kind": "CPU", "runs": 5, "other": "c0ffee1"}
    return pd.DataFrame([one | {"machine": "a"} | values], columns=COLUMNS)


def test_cpu_time_is_that_of_the_command_and_its_children(tmp_path):
    work = "import subprocess, sys; subprocess.run([sys.executable, '-c', 'sum(i * i for i in range(3_000_000))'])"
    idle = entry._cpu_seconds([sys.executable, "-c", "pass"], tmp_path)
    assert entry._cpu_seconds([sys.executable, "-c", work], tmp_path) > 2 * idle


def test_a_command_that_fails_is_an_error(tmp_path):
    with pytest.raises(LimoError, match="failed"):
        entry._cpu_seconds([sys.executable, "-c", "raise SystemExit('no')"], tmp_path)


def test_every_task_has_words_and_the_imports_are_those_of_the_snakefile(root):
    assert {*entry._TASKS, "tests", *(f"solve_{name}" for name in [*entry._LAPS, "warm"])} == WORDS.keys()
    lines = "print('\\n'.join(sorted(m for m in sys.modules if m.startswith('limo.'))))"
    loaded = entry._run([sys.executable, "-c", entry._IMPORTS + lines], root).split()
    assert "limo.cases.plan" in loaded


def test_imports_of_a_solve_are_shares_of_all_of_them(root):
    rows = compare_solve_imports(root, root, runs=1).set_index("what").seconds
    assert len(rows) == len(entry._LAPS) + 1
    parts = rows.drop(["solve_all", "solve_warm"])
    assert rows["solve_all"] == pytest.approx(parts.sum(), abs=0.06), "each is rounded to a hundredth"
    assert parts["solve_numba"] > 0
    assert 0 < rows["solve_warm"] < rows["solve_all"]


def test_rows_are_replaced_by_newer_ones_of_the_same_task(tmp_path):
    file = tmp_path / "entry.csv"
    assert read_entry(file).empty
    for row in (rows(), rows(what="imports"), rows(seconds=0.2)):
        keep(row, file)
    kept = read_entry(file)
    assert dict(zip(kept.what, kept.seconds, strict=True)) == {"imports": 0.1, "help": 0.2}
    table = entry_table(kept)
    assert "`limo --help`" in table
    assert "0.25" in table
    assert "`c0ffee1`" in table


def test_a_file_that_is_no_table_of_them_is_an_error(tmp_path):
    (tmp_path / "entry.csv").write_text("a,b\n1,2\n")
    with pytest.raises(ResultError, match="no columns"):
        read_entry(tmp_path / "entry.csv")


def test_a_checkout_that_is_not_set_up_is_an_error(tmp_path, root):
    with pytest.raises((LimoError, OSError)):
        compare(root, tmp_path, runs=1)
