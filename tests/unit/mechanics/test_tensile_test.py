"""The modulus of the fabric from a tensile test."""

from __future__ import annotations

import numpy as np
import pytest

from limo.errors import ConfigError
from limo.figures.tensile_test import draw
from limo.mechanics.tensile_test import fit_modulus, tensile_test
from limo.schema.device import TensileTest


def test_the_fit_is_the_least_squares_line_through_the_origin():
    strain, noise = np.linspace(0.01, 0.1, 10), np.random.default_rng(3).normal(0, 0.3, 10)
    modulus, error = fit_modulus(strain, 267.0 * strain + noise)
    (expected,), *_ = np.linalg.lstsq(strain[:, None], 267.0 * strain + noise, rcond=None)
    assert modulus == pytest.approx(expected)
    assert abs(modulus - 267.0) < 4 * error < 20
    assert fit_modulus(strain, 267.0 * strain) == (pytest.approx(267.0), pytest.approx(0.0, abs=1e-10))


def test_points_beyond_the_largest_strain_are_kept_and_not_fitted(tmp_path):
    file = tmp_path / "mine.csv"
    lines = [f"{100 * e},{1000.0 * min(e, 0.1)}" for e in (0.0, 0.02, 0.04, 0.08, 0.12, 0.2)]
    file.write_text("elongation,force\n" + "\n".join(lines) + "\n")
    test = TensileTest(data=str(file), length=100.0, width=10.0, thickness=0.5, largest_strain=0.1)
    dataset = tensile_test(test)
    assert float(dataset.youngs_modulus) == pytest.approx(200.0)
    assert dataset.fitted.values.tolist() == [0, 1, 1, 1, 0, 0]
    assert dataset.attrs["synthetic"] == "False"


def test_the_example_is_marked_as_synthetic_and_gives_the_modulus_of_the_paper(root):
    dataset = tensile_test(TensileTest(data=str(root / TensileTest().data)))
    assert dataset.attrs["synthetic"] == "True"
    assert abs(float(dataset.youngs_modulus) - 267.0) < 2.0
    labels = [text.get_text() for text in draw(dataset).axes[0].get_legend().get_texts()]
    assert labels[0] == "synthetic data, no measurement"
    assert "MPa" in labels[-1]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (None, "a CSV file"),
        ("strain,stress\n1,2\n", "elongation"),
        ("elongation,force\n1,a\n", "numbers"),
        ("elongation,force\n1,2\n2,4\n", "three or more"),
    ],
)
def test_a_file_that_is_no_tensile_test_is_one_message(tmp_path, text, says):
    file = tmp_path / "mine.csv"
    if text is not None:
        file.write_text(text)
    with pytest.raises(ConfigError, match=says) as caught:
        tensile_test(TensileTest(data=str(file)))
    assert "mine.csv" in str(caught.value)
