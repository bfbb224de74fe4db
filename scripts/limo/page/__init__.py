"""``results/index.html``: one file to look at all studies in a browser, without a network or anything beside it."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

FILE = "index.html"  # in the folder of results
BUDGET = 20_000_000  # bytes of a page
FOLDER = Path(__file__).parent
TEMPLATES = ("page.html", "page.css", "page.js", "curves.js", "device.js")


def dataset_of(results: Path, study: str) -> Path:
    """Where a study's dataset is, once it has been gathered."""
    return results / "studies" / study / "study.nc"


def sources(results: Path, studies: Iterable[str]) -> list[str]:
    """What a page of those ``studies`` that have been gathered is made of, with whole paths."""
    gathered = [dataset_of(results, name) for name in studies if dataset_of(results, name).exists()]
    files = [f for dataset in gathered for f in (dataset, dataset.with_suffix(".csv"), *dataset.parent.glob("figures/*.png"))]
    files += (results / "cases").glob("*/*.nc") if gathered else ()
    return sorted(str(file.resolve()) for file in files if file.exists())
