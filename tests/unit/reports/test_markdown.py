"""Tables and numbers of documents and of the terminal."""

from __future__ import annotations

import numpy as np
import pandas as pd
from hypothesis import given
from hypothesis import strategies as st

from limo.reports.markdown import markdown_table, number, percent, shown, signed_percent, text_table


def test_cells_stand_as_they_are_without_padding():
    table = pd.DataFrame({"name": ["long name", "b"], "w_M [mm]": ["1.50", "-"], "count": [7, 10], "share": [0.1, np.nan]})
    assert markdown_table(table).splitlines() == [
        "| name | w_M [mm] | count | share |",
        "| --- | --- | --- | --- |",
        "| long name | 1.50 | 7 | 0.1 |",
        "| b | - | 10 | nan |",
    ]
    assert markdown_table(table.iloc[:0]) == "Not measured."


WORDS = st.text(st.characters(codec="ascii", categories=("L", "N", "P", "S")), min_size=1)


@given(st.lists(st.tuples(WORDS, WORDS), min_size=1))
def test_whatever_a_cell_says_it_stays_one(rows):
    lines = markdown_table(pd.DataFrame(rows, columns=["a", "b|c"])).splitlines()
    assert lines[:2] == ["| a | b/c |", "| --- | --- |"]
    found = [tuple(line.removeprefix("| ").removesuffix(" |").split(" | ")) for line in lines[2:]]
    assert found == [tuple(cell.replace("|", "/") for cell in row) for row in rows]


def test_a_table_of_the_terminal_has_its_names_to_the_left_and_its_numbers_to_the_right():
    lines = text_table(("", "stroke [ml]", "b"), [("a longer name", "1.50", "007"), ("x", "-", "1e3")], left=1).splitlines()
    assert [line.split() for line in lines[1:]] == [["a", "longer", "name", "1.50", "007"], ["x", "-", "1e3"]]
    assert lines[2].startswith("x ")
    assert {len(line) for line in lines} == {len(lines[0])}


def test_what_is_not_known_is_a_dash():
    assert [f(np.nan) for f in (number, signed_percent, percent)] == ["-"] * 3
    assert [shown(v, ".2f") for v in (np.inf, 1.005, -2)] == ["-", "1.00", "-2.00"]
    assert (number(1234.56), number(0.456, 2), signed_percent(0.0149), signed_percent(-1)) == (
        "1234.6",
        "0.46",
        "+1.5%",
        "-100.0%",
    )
    assert (percent(0.25), percent(0.0025)) == ("25.0%", "0.25%")
