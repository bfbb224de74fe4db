"""Compare a CalculiX with the answers of the stock one: ``verify.py CCX`` (``verify.py --store CCX`` writes them anew).

Each deck beside this file has a table with the displacements of its last frame and, in the first line, its Newton iterations.
"""

from __future__ import annotations

import re
import shutil
import sys
import tempfile
from pathlib import Path

import numpy as np

from limo.engines.calculix import run as calculix
from limo.engines.calculix.frd import FrdFile
from limo.errors import ResultError
from limo.schema.solver import Solver

HERE = Path(__file__).parent
DECKS = tuple(sorted(HERE.glob("*.inp")))
#: largest difference of a displacement, over the largest displacement of the deck
TOLERANCE = 1e-6


def solve(deck: Path, command: Path, folder: Path) -> tuple[np.ndarray, int, str]:
    """Run a copy of ``deck`` in ``folder``: displacements (n, 3) in mm of its last frame, Newton iterations, and the log."""
    shutil.copy(deck, folder / f"{calculix.JOB}.inp")
    text = deck.read_text()
    nodes = text[: text.index("*ELEMENT")].split("*NODE", 1)[1].count("\n") - 1
    end_time = sum(float(t) for t in re.findall(r"^\*(?:STATIC|DYNAMIC).*\n[^,]+,\s*([^,\s]+)", text, re.MULTILINE))
    outcome = calculix.run(folder, command, Solver(), end_time)
    log = (folder / "ccx.log").read_text(errors="replace")
    if outcome.status != "converged":
        raise ResultError(f"{deck.name}: {outcome.status}, {outcome.reason}\n{log[-2000:]}")
    with FrdFile(folder / f"{calculix.JOB}.frd") as frd:
        return frd.displacements(frd.frames[-1], nodes), outcome.iterations, log


def answers(deck: Path) -> tuple[np.ndarray, int]:
    """The stored answers to a deck: displacements (n, 3) in mm, Newton iterations."""
    table = deck.with_suffix(".txt")
    return np.loadtxt(table), int(table.read_text().split(maxsplit=3)[2].rstrip(";"))


def difference(deck: Path, command: Path) -> tuple[float, int, int]:
    """Largest difference of a displacement over the largest one; iterations of ``command`` and of the stock solver."""
    wanted, usual = answers(deck)
    with tempfile.TemporaryDirectory() as folder:
        found, iterations, _ = solve(deck, command, Path(folder))
    return float(np.abs(found - wanted).max() / np.abs(wanted).max()), iterations, usual


def main() -> int:
    """Print a line for each deck; 1 if any answer differs."""
    store, command = "--store" in sys.argv, Path(sys.argv[-1]).absolute()
    failed = False
    for deck in DECKS:
        if store:
            with tempfile.TemporaryDirectory() as folder:
                found, iterations, _ = solve(deck, command, Path(folder))
            np.savetxt(deck.with_suffix(".txt"), found, fmt="%.7e", header=f"iterations {iterations}; displacements in mm")
            continue
        error, iterations, usual = difference(deck, command)
        print(f"{deck.name}: differs by {error:.1e} of the largest displacement; {iterations} iterations, stock {usual}")
        failed |= error > TOLERANCE
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
