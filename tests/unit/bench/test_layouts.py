"""A known line in a hundred layouts comes back within 1 %; any bytes are one message or a table.

``LIMO_EXAMPLES`` says how many examples are tried.
"""

from __future__ import annotations

import os
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, note, settings
from hypothesis import strategies as st

from limo.bench.tensile import fit_tensile
from limo.errors import ConfigError
from limo.schema.bench import TensileTest

EXAMPLES = int(os.environ.get("LIMO_EXAMPLES", "100"))
many = settings(
    max_examples=EXAMPLES,
    deadline=None,
    derandomize=EXAMPLES <= 100,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow, HealthCheck.data_too_large],
)

#: units and how many of them a mm, a N, a strain of 1, a MPa are: by definition, not by the code under test
LENGTHS = {"mm": 1.0, "cm": 0.1, "m": 1e-3, "in": 1 / 25.4, "µm": 1e3}
FORCES = {"N": 1.0, "kN": 1e-3, "lbf": 1 / 4.4482216152605, "kgf": 1 / 9.80665, "mN": 1e3}
STRAINS = {"%": 100.0, "mm/mm": 1.0, "-": 1.0}
STRESSES = {"MPa": 1.0, "kPa": 1e3, "psi": 145.03773773, "N/mm²": 1.0}
NAMES = {
    "elongation": ["elongation", "Extension", "Weg", "Crosshead displacement", "Standardweg", "ELONGATION"],
    "strain": ["strain", "Dehnung", "Tensile strain", "STRAIN"],
    "force": ["force", "Load", "Kraft", "Standardkraft", "Axial Force", "FORCE"],
    "stress": ["stress", "Spannung", "Tensile stress"],
}
#: separators with the decimal mark and the mark between thousands that may go with them
MARKS = [
    (",", ".", ""), (";", ",", ""), (";", ".", ""), ("\t", ",", ""), ("\t", ".", ""), (" ", ".", ""), ("|", ".", ""),
    (";", ",", "."), ("\t", ".", ","), (";", ",", "\u202f"), (", ", ".", ""),
]  # fmt: skip


@dataclass(frozen=True)
class Layout:
    """How the file of a test is written."""

    moduli: tuple[float, ...]
    points: int
    reach: float
    noise: float
    toe: float
    preload: float
    ending: str
    columns: tuple[str, str]
    units: tuple[str, str]
    marks: tuple[str, str, str]
    header: str
    arrangement: str
    swapped: bool
    with_time: bool
    sign: int
    rows: str
    encoding: str
    newline: str
    remark: bool
    seed: int


@st.composite
def layouts(draw) -> Layout:
    far, hard = draw(
        st.sampled_from([("elongation", "force"), ("strain", "stress"), ("elongation", "stress"), ("strain", "force")])
    )
    lengths, forces = (LENGTHS if far == "elongation" else STRAINS), (FORCES if hard == "force" else STRESSES)
    units = draw(st.sampled_from(sorted(lengths))), draw(st.sampled_from(sorted(forces)))
    arrangement = draw(st.sampled_from(["one", "side", "stacked", "stacked with names", "named"]))
    count = 1 if arrangement == "one" else draw(st.integers(2, 3))
    marks = draw(st.sampled_from(MARKS))
    if marks[0] == " " and units[0] == "-":  # which nobody writes behind an underscore
        units = "%", units[1]
    encodings = ["utf-8", "utf-8-sig", "utf-16"] + ["cp1252"] * ("\u202f" not in marks[2])
    # pulls of one specimen below the other, without a word or a jump between them, are refused: test_tensile_files.py
    ending = draw(st.sampled_from(["none", "break", "break and on"] + ["return"] * (arrangement != "stacked")))
    return Layout(
        moduli=tuple(draw(st.floats(8, 4000)) for _ in range(count)),
        points=draw(st.integers(40, 160)),
        reach=draw(st.floats(0.03, 0.09)),
        noise=draw(st.sampled_from([0.0, 0.0005, 0.002])),
        toe=draw(st.sampled_from([0.0, 0.05, 0.2])),
        preload=draw(st.sampled_from([0.0, 0.02])),
        ending=ending,
        columns=(draw(st.sampled_from(NAMES[far])), draw(st.sampled_from(NAMES[hard]))),
        units=units,
        marks=marks,
        header=draw(st.sampled_from(["()", "[]", "row", "(row)"])) if marks[0] != " " else draw(st.sampled_from(["_", "row"])),
        arrangement=arrangement,
        swapped=draw(st.booleans()),
        with_time=draw(st.booleans()),
        sign=draw(st.sampled_from([1, -1])),
        rows=draw(st.sampled_from(["as tested", "reversed", "shuffled"])) if ending == "none" and count == 1 else "as tested",
        encoding=draw(st.sampled_from(encodings)),
        newline=draw(st.sampled_from(["\n", "\r\n", "\r"])),
        remark=draw(st.booleans()),
        seed=draw(st.integers(0, 10**6)),
    )


SIZE = {"length": 120.0, "width": 15.0, "thickness": 0.2}


def curve(layout: Layout, modulus: float, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Strain and stress: nothing in the toe, the line behind a preload, noise of the load cell, and how the test ended."""
    strain = np.linspace(0, layout.reach * (1 + layout.toe), layout.points)
    top = modulus * layout.reach
    stress = np.maximum(modulus * (strain - layout.toe * layout.reach), 0) + layout.preload * top
    if layout.ending.startswith("break"):
        more = strain[-1] + np.arange(1, 2 if layout.ending == "break" else 1 + layout.points // 3) * strain[1]
        strain, stress = np.append(strain, more), np.append(stress, np.full(len(more), 0.002 * top))
    if layout.ending == "return":
        strain, stress = np.append(strain, strain[::-1]), np.append(stress, np.maximum(stress[::-1] - 0.15 * top, 0))
    return strain, stress + rng.normal(0, 1, len(stress)) * layout.noise * top


def number(value: float, marks: tuple[str, str, str]) -> str:
    """Eight significant digits, grouped in thousands where the layout has a mark for that."""
    _, decimal, thousands = marks
    digits = max(0, 7 - int(np.floor(np.log10(abs(value) or 1.0))))
    text = f"{value:,.{digits}f}" if thousands else f"{value:.{digits}f}"
    return text.replace(",", "T").replace(".", decimal).replace("T", thousands)


def written(layout: Layout) -> str:
    """The text of the file."""
    rng = np.random.default_rng(layout.seed)
    far_factor = (LENGTHS | STRAINS)[layout.units[0]] * (SIZE["length"] if layout.units[0] in LENGTHS else 1.0)
    area = SIZE["width"] * SIZE["thickness"]
    hard_factor = FORCES[layout.units[1]] * area if layout.units[1] in FORCES else STRESSES[layout.units[1]]
    separator = layout.marks[0]
    blocks = []
    for modulus in layout.moduli:
        strain, stress = curve(layout, modulus, rng)
        pair = [strain * far_factor, layout.sign * stress * hard_factor]
        if layout.rows != "as tested":
            order = np.arange(len(strain))[::-1] if layout.rows == "reversed" else rng.permutation(len(strain))
            pair = [v[order] for v in pair]
        pair = pair[::-1] if layout.swapped else pair
        blocks.append([[number(v, layout.marks) for v in column] for column in pair])
    names = list(zip(layout.columns, layout.units, strict=True))
    names = names[::-1] if layout.swapped else names
    styles = {"()": "{} ({})", "[]": "{} [{}]", "_": "{}_{}", "row": "{}", "(row)": "{}"}
    head = [styles[layout.header].format(name.replace(" ", "_") if separator == " " else name, unit) for name, unit in names]
    below = [f"({u})" if layout.header == "(row)" else u for _, u in names]
    if layout.arrangement == "side":
        head, below = head * len(blocks), below * len(blocks)
        columns = [column for block in blocks for column in block]
        tables = [[list(row) for row in zip(*columns, strict=True)]]
    else:
        tables = [[list(row) for row in zip(*block, strict=True)] for block in blocks]
    if layout.with_time and layout.rows == "as tested":
        clock = "time_s" if separator == " " else "Time"
        head, below = [clock, *head], ["s", *below]
        tables = [[[number(0.1 * k + 0.1, layout.marks), *row] for k, row in enumerate(table)] for table in tables]
    if layout.arrangement == "named":
        head, below = ["specimen", *head], ["-", *below]
        tables = [[[f"strip_#{k + 1}", *row] for row in table] for k, table in enumerate(tables)]
    heads = [separator.join(head)] + ([separator.join(below)] if "row" in layout.header else [])
    lines = ["# 3 notes of the operator: all went well"] if layout.remark else []
    for k, table in enumerate(tables):
        if k == 0:
            lines += heads
        elif layout.arrangement == "stacked with names":
            lines += ["", f"Specimen {k + 1}", *heads]
        lines += [separator.join(row) for row in table]
    return layout.newline.join([*lines, ""])


@many
@given(layouts())
def test_a_known_line_comes_back_within_a_percent_from_any_layout(tmp_path, layout):
    file, text = tmp_path / "mine.txt", written(layout)
    file.write_bytes(text.encode(layout.encoding))
    note(text[:1500])
    fit = fit_tensile(TensileTest(data=str(file), **SIZE))
    assert fit.moduli == pytest.approx(layout.moduli, rel=0.01), "\n".join(fit.reading.understood)
    assert all(line.error < 0.05 * line.modulus for line in fit.lines)


@many
@given(content=st.one_of(st.binary(max_size=300), st.text("0123456789,.;\t\n\"#'-+eE kNm%", max_size=300).map(str.encode)))
@example(b'elongation,force\n"1,2\n3,4\n')
@example(b"elongation,force\n1e400,2\n2,3\n3,4\n4,5\n")
@example(b"elongation,force\n" + b"1,2\n" * 9)
@example(b"\xef\xbb\xbf,,,\n1,,,\n")
def test_any_bytes_are_a_modulus_or_one_message(tmp_path, content):
    file = tmp_path / "mine.csv"
    for text in (content, b"elongation,force\n" + content):
        file.write_bytes(text)
        try:
            fit = fit_tensile(TensileTest(data=str(file)))
        except ConfigError as error:
            said = str(error)
        else:
            said = str(file) if np.isfinite(fit.modulus) else "no number"
        assert str(file) in said
        assert len(said) < 3000


@many
@given(data=st.data())
def test_any_keys_with_a_good_file_are_a_modulus_or_one_message(tmp_path, data):
    file = tmp_path / "mine.csv"
    x = np.linspace(1, 12, 30)
    file.write_text("elongation,force\n" + "".join(f"{a:.3f},{25 * a:.3f}\n" for a in x))
    keys = data.draw(
        st.fixed_dictionaries(
            {},
            optional={
                "separator": st.sampled_from([",", ";", "tab", "space"]), "decimal": st.sampled_from([".", ","]),
                "thousands": st.sampled_from([",", ".", " ", "none"]), "header_row": st.integers(0, 40),
                "unit_row": st.integers(0, 40), "comment": st.sampled_from(["", "#", "e", "1"]),
                "data_rows": st.tuples(st.integers(0, 40), st.integers(0, 40)).map(sorted).map(tuple),
                "columns": st.dictionaries(st.sampled_from(["elongation", "force", "strain", "specimen"]), st.integers(1, 3)),
                "units": st.dictionaries(st.sampled_from(["elongation", "force"]), st.sampled_from(["mm", "kN", "%", ""])),
                "sign": st.sampled_from(["auto", "keep", "turn"]), "specimens": st.sampled_from(["auto", "one", "stacked"]),
            },
        )
    )  # fmt: skip
    try:
        fit = fit_tensile(TensileTest(data=str(file), **SIZE, **keys))
    except ConfigError as error:
        said = str(error)
    else:
        said = str(file) if np.isfinite(fit.modulus) else "no number"
    assert str(file) in said
