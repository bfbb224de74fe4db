"""``results/index.html``: one file to look at all studies in a browser, without a network or anything beside it."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from limo.store.results import Results

FILE = "index.html"  # in the folder of results
BUDGET = 20_000_000  # bytes of a page
FOLDER = Path(__file__).parent
TEMPLATES = ("page.html", "page.css", "page.js", "curves.js", "device.js")


def dataset_of(results: Path, study: str) -> Path:
    """Where a study's dataset is, once it has been gathered."""
    return Results(results).study(study).dataset


def sources(results: Path, studies: Iterable[str]) -> list[str]:
    """What a page of those ``studies`` that have been gathered, and of explorations, is made of, with whole paths."""
    folder = Results(results)
    gathered = [files for files in map(folder.study, studies) if files.dataset.exists()]
    files = [f for study in gathered for f in (study.dataset, study.table, *study.figure("*", "png").parent.glob("*.png"))]
    files += folder.cases.glob("*/*.nc") if gathered else ()
    files += [f for found in folder.explorations.glob("*/exploration.nc") for f in (found, *found.parent.glob("*.png"))]
    return sorted(str(file.resolve()) for file in files if file.exists())
