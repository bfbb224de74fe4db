"""Kratos beside engine newton: both solve the same cases in turns, and their rows go into docs/data/peer.csv.

    PYTHONPATH=scripts .venv/bin/python scripts/peer/kratos.py [--repeat 5] [--only airbag] [--keep docs/data/peer.csv]

Kratos is installed with pinned versions into .local/peer, the first time alone. Each solve is a process of its own, on one
thread. CPU time and memory are of the operating system's accounting. Other work on the machine burdens them; rows keep its load.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import venv
from pathlib import Path

import pandas as pd

from limo.reports.peer import COLUMNS, KEYS, read_peer
from limo.store.files import write_whole
from limo.store.machine import processor

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
VERSION = "10.4.4"
PACKAGES = (
    f"KratosMultiphysics=={VERSION}",
    f"KratosStructuralMechanicsApplication=={VERSION}",
    f"KratosConstitutiveLawsApplication=={VERSION}",
    "numpy==2.4.6",
)
#: what is solved, in this order in each round: case, code, model, n
RUNS = (
    ("airbag", "newton", "c3d20r", 8),
    ("airbag", "kratos", "relaxed_3n", 4),
    ("airbag", "newton", "shell8r", 8),
    ("airbag", "kratos", "relaxed_3n", 8),
    ("airbag", "newton", "c3d20r", 16),
    ("airbag", "newton", "shell8r", 16),
    ("airbag", "kratos", "relaxed_3n", 16),
    ("airbag", "newton", "c3d20r", 24),
    ("mylar", "newton", "c3d20r", 3),
    ("mylar", "newton", "c3d20r_via", 3),
    ("mylar", "kratos", "relaxed_3n", 4),
    ("mylar", "newton", "shell8r", 3),
    ("mylar", "newton", "shell8r_via", 3),
    ("mylar", "newton", "c3d20r", 8),
    ("mylar", "newton", "shell8r", 8),
    ("mylar", "newton", "shell8r_via", 8),
)


def environment(folder: Path) -> Path:
    """The Python that has Kratos, made if it is not there."""
    python, done = folder / "bin/python", folder / f"kratos-{VERSION}"
    if not done.exists():
        venv.create(folder, clear=True, with_pip=True)
        subprocess.run([python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", *PACKAGES], check=True)
        done.touch()
    return python


def solve(python: Path, case: str, code: str, model: str, n: int) -> dict:
    """What one solve printed, and the load of the machine at its end."""
    single = {"OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1", "PYTHONPATH": str(ROOT / "scripts")}
    program = sys.executable if code == "newton" else str(python)
    command = [program, str(HERE / f"{code}_solve.py"), case, model, str(n)]
    done = subprocess.run(command, cwd=ROOT, env=os.environ | single, capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(f"{' '.join(command)} failed: {(done.stdout + done.stderr)[-2000:]}")
    return json.loads(done.stdout.splitlines()[-1]) | {"load": os.getloadavg()[0]}


def row(case: str, code: str, model: str, n: int, found: list[dict]) -> dict:
    """Medians of several solves of one run; lengths in mm, volumes in l."""
    last = found[-1]
    lengths = {f"{key}_mm": 1e3 * last[key] for key in ("height", "rim", "draw_in", "smooth_draw_in") if key in last}
    measured = {key: round(value, 3) for key, value in lengths.items()}
    if "volume" in last:
        measured["volume_l"] = round(1e3 * last["volume"], 5)
    middle = {key: statistics.median(one[key] for one in found) for key in ("cpu_seconds", "memory_mib", "load")}
    return (
        {"case": case, "code": code, "model": model, "n": n}
        | measured
        | {key: last[key] for key in ("version", "elements", "iterations", "converged")}
        | {
            "cpu_seconds": round(middle["cpu_seconds"], 3),
            "memory_mib": round(middle["memory_mib"]),
            "load": round(middle["load"], 1),
        }
        | {"runs": len(found), "machine": processor()}
    )


def main() -> None:
    """Measure, and put the rows in place of earlier ones of the same runs."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeat", type=int, default=3, help="rounds, of which medians are kept")
    parser.add_argument("--only", choices=("airbag", "mylar"), help="one case alone")
    parser.add_argument("--keep", type=Path, default=ROOT / "docs/data/peer.csv", help="the table of rows")
    parser.add_argument("--environment", type=Path, default=ROOT / ".local/peer", help="where Kratos is installed")
    arguments = parser.parse_args()
    python = environment(arguments.environment)
    runs = [run for run in RUNS if arguments.only in (None, run[0])]
    found: dict[tuple, list[dict]] = {run: [] for run in runs}
    for _ in range(arguments.repeat):
        for run in runs:
            found[run].append(solve(python, *run))
            print(*run, f"{found[run][-1]['cpu_seconds']:.2f} s of CPU time", flush=True)
    rows = pd.DataFrame([row(*run, results) for run, results in found.items()], columns=COLUMNS)
    kept = read_peer(arguments.keep)
    table = pd.concat([kept, rows]).drop_duplicates(KEYS, keep="last") if len(kept) else rows
    write_whole(arguments.keep, lambda path: table.to_csv(path, index=False))


if __name__ == "__main__":
    main()
