"""The notebooks of ``docs/notebooks`` are kept without outputs, and run on really solved cases."""

from __future__ import annotations

import nbformat
import pytest
from nbclient import NotebookClient

from .conftest import ROOT

NOTEBOOKS = sorted((ROOT / "docs" / "notebooks").glob("*.ipynb"))
PATIENCE = 600  # s a cell


@pytest.mark.parametrize("file", NOTEBOOKS, ids=lambda file: file.stem)
def test_notebooks_run_from_top_to_bottom(everything, file, tmp_path, monkeypatch):
    """Only the cell of parameters is another: it names the tiny study."""
    monkeypatch.setenv("IPYTHONDIR", str(tmp_path / "ipython"))
    monkeypatch.setenv("JUPYTER_RUNTIME_DIR", str(tmp_path / "runtime"))
    notebook = nbformat.read(file, as_version=4)
    nbformat.validate(notebook)
    (parameters,) = [cell for cell in notebook.cells if "parameters" in cell.metadata.get("tags", [])]
    folder = everything.folder / "results" / "studies"
    for study in ("pressure_volume", "branches", "stress"):
        parameters.source = parameters.source.replace(f"../../results/studies/{study}", str(folder / "tiny"))
    for kept in ("docs", "config"):
        parameters.source = parameters.source.replace(f"../../{kept}/", f"{ROOT / kept}/")
    assert "../.." not in parameters.source
    done = NotebookClient(notebook, timeout=PATIENCE, kernel_name="python3").execute()
    shown = [kind for cell in done.cells for output in cell.get("outputs", []) for kind in output.get("data", {})]
    assert "image/png" in shown, "a notebook ends in a picture"


@pytest.mark.parametrize("file", NOTEBOOKS, ids=lambda file: file.stem)
def test_notebooks_are_kept_without_outputs(file):
    for cell in nbformat.read(file, as_version=4).cells:
        if cell.cell_type == "code":
            assert cell.outputs == []
            assert cell.execution_count is None


def test_there_are_notebooks_and_the_readme_names_them():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert len(NOTEBOOKS) >= 3
    assert all(file.name in text for file in NOTEBOOKS)
