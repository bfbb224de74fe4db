"""The derivation of the outline: published counts that agree with each other, a result that has them, walks that repeat."""

import numpy as np
import pandas as pd
import pytest

from limo.geometry.pattern import flat_pattern
from limo.mesh import derivation
from limo.mesh.derivation import (
    CURVES,
    ELEMENTS,
    NODES,
    PATCHES,
    RANGES,
    Candidate,
    count_elements,
    fits,
    published_nodes,
    walk,
)
from limo.reports.geometry import TABLE
from limo.terminal.cli import main


@pytest.fixture(scope="module")
def kept(root):
    """The table that the project keeps."""
    return pd.read_csv(root / TABLE).set_index("name")


@pytest.fixture(scope="module")
def result(kept):
    return Candidate(kept.value[list(RANGES)].to_numpy(float))


def test_the_published_counts_make_the_published_mesh():
    assert published_nodes() == NODES
    assert 2 * (PATCHES["background"] + 4 * PATCHES["inner_pouch"] + 4 * PATCHES["outer_pouch"]) == ELEMENTS
    assert published_nodes(CURVES | {"array_top0": 2}) != NODES, "a curve with another count makes another number"


def test_the_kept_result_has_the_published_counts(result, kept):
    assert result.is_sound()
    counts = count_elements(result)
    assert fits(counts)
    assert {name: counts[name] for name in CURVES} == CURVES
    assert counts == {name: int(kept.value[name]) for name in counts}, "and those that the table says"
    assert max(abs(counts[name] - n) for name, n in PATCHES.items()) <= 2


def test_the_result_lies_within_what_remains_free(result, kept):
    low, high = kept.low[list(RANGES)].to_numpy(), kept.high[list(RANGES)].to_numpy()
    assert ((low <= result.values) & (result.values <= high)).all()
    assert (high - low > 0.01).all(), "no coordinate is known to three digits"


def test_the_device_is_the_kept_result(loaded, result):
    pattern = loaded.devices["limo"].pattern
    assert (pattern.length, pattern.width_scale) == (125.0, 1.0)
    corners = [pattern.outline[0][0], *(piece[-1] for piece in pattern.outline)]
    np.testing.assert_allclose(corners, result.outline, atol=5e-4)
    assert all(len(piece) == 2 for piece in (*pattern.outline, *pattern.pouch_array)), "straight pieces"
    border = [pattern.pouch_array[0][0], *(piece[-1] for piece in pattern.pouch_array)]
    np.testing.assert_allclose(border, np.delete(result.array, 6, axis=0), atol=5e-4)
    flat = flat_pattern(pattern, 8)
    seam = next(curve.points for curve in flat.curves if curve.name == "seam0") / pattern.length
    exact = result.seam_points(2000)
    apart = np.linalg.norm(seam[:, None] - exact[None], axis=2).min(axis=1)
    assert apart.max() < 2e-3, "the curve through points of the seam is the Bezier curve"


def test_lengths_and_areas_are_those_of_a_rectangle_with_a_straight_seam():
    names, values = list(RANGES), np.zeros(len(RANGES))

    def put(**given):
        for name, value in given.items():
            values[names.index(name)] = value

    put(outline_x1=0.4, outline_y1=0.3, outline_x2=0.4, outline_y2=0.7, outline_x3=0.4)
    put(array_y0=0.1, array_x1=0.05, array_y1=0.1, array_x2=0.1, array_y2=0.1, array_x3=0.3, array_y3=0.1)
    put(array_x4=0.3, array_y4=0.6, array_x5=0.2, array_y5=0.9, seam_x_top=0.05, seam_x_control=0.05, seam_y_control=0.5)
    square = Candidate(values)
    lengths = dict(zip(CURVES, square.lengths(), strict=True))
    assert lengths["outline_side"] == pytest.approx(0.4)
    assert lengths["apex_edge"] == pytest.approx(0.8)
    assert lengths["central_seam"] == pytest.approx(0.8)
    assert lengths["off_centre_seam"] == pytest.approx(0.8)
    inner = 0.05 * 0.8
    array = 0.3 * 0.5 + 0.5 * (0.3 + 0.2) * 0.3
    assert square.areas()[1:] == pytest.approx([inner, array - inner])


def test_a_walk_repeats_and_goes_where_counts_are_expected():
    first, again = (list(walk(3, 2)) for _ in range(2))
    assert len(first) == 2
    for (one, counts), (other, same) in zip(first, again, strict=True):
        np.testing.assert_array_equal(one.values, other.values)
        assert counts == same
    off = [sum(counts[c] != n for c, n in CURVES.items()) for _, counts in first]
    assert max(off) <= 2, "curves have their counts"
    assert not np.allclose(first[0][0].values, next(walk(4, 1))[0].values), "another start goes another way"


@pytest.mark.parametrize("change", [("outline_x1", 0.03), ("array_y4", 0.05), ("seam_x_control", 0.08)])
def test_another_pattern_does_not_fit(result, change):
    name, by = change
    values = result.values.copy()
    values[list(RANGES).index(name)] += by
    assert not fits(count_elements(Candidate(values)))


def test_a_pattern_that_cannot_be_cut_is_not_sound(result):
    values = result.values.copy()
    for name, value in {"seam_x_control": 0.70, "array_x3": 0.32, "array_x4": 0.32}.items():
        values[list(RANGES).index(name)] = value
    assert not Candidate(values).is_sound(), "the seam leaves the array"


def test_a_derivation_without_enough_meshes_says_so(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(derivation, "COOLING", 50)  # hot still: nothing fits
    assert main(["derive-outline", "--starts", "1", "--meshes", "1", "--table", str(tmp_path / "outline.csv")]) == 1
    assert "no candidate of 1 has the published counts" in capsys.readouterr().err
    assert main(["derive-outline", "--starts", "0"]) == 1
    assert "--starts" in capsys.readouterr().err
