"""What a sweep takes besides solving: doing nothing where all is there, and planning a thousand cases."""

from __future__ import annotations

import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import pandas as pd
import yaml

from limo.cases.plan import make_plan
from limo.config.load import load_config
from limo.errors import LimoError
from limo.reports.markdown import rows_if_any
from limo.store.files import write_whole
from limo.store.machine import processor

#: runs of which the median is kept
RUNS = 3
COLUMNS = ("what", "cases", "wall_seconds", "runs", "machine")
NOTHING, PLANNING = "no_op", "dry_run"
#: 4 x 10 x 5 x 5 cases
THOUSAND = {
    "description": "a thousand cases",
    "outputs": ["volumes"],  # whatever a version measures by default, the same jobs
    "axes": {
        "n_pouches": [4, 6, 8, 10],
        "ventricular_pressure": [float(p) for p in range(10)],
        "aspect_ratio": [1.25, 1.5, 1.75, 2.0, 2.25],
        "stiffness_ratio": [0.25, 0.5, 0.75, 1.0, 1.25],
    },
    "actuation_pressure_max": 60.0,
}


def time_of_nothing(config: Path, folder: Path, snakefile: Path, runs: int = RUNS) -> dict[str, Any]:
    """Median wall time (s) of a run with nothing to do, of what ``config`` runs; raises ``LimoError`` where something is."""
    loaded = load_config(str(folder / config))
    plan = make_plan(loaded, folder / "results")
    cases = {case_id for name in loaded.config.studies for case_id in plan.of_study(name)}
    arguments = ["--cores", "2", "--config", f"file={config}"]
    if "Nothing to be done" not in _run([*arguments, "-n"], folder, snakefile)[1]:
        raise LimoError(f"{folder / config}: not all is solved and drawn; run `snakemake --cores 2 --config file={config}` first")
    return _row(NOTHING, len(cases), [_run(arguments, folder, snakefile)[0] for _ in range(runs)])


def time_of_planning(config: Path, folder: Path, snakefile: Path, runs: int = RUNS) -> dict[str, Any]:
    """Median wall time (s) of a dry run of a thousand cases beside the studies of ``config``, in a folder of its own."""
    with tempfile.TemporaryDirectory() as temporary:
        shutil.copytree((folder / config).parent, Path(temporary) / "config")
        study = Path(temporary) / "config" / "studies" / "thousand.yaml"
        study.write_text(yaml.safe_dump(THOUSAND), encoding="utf-8")
        arguments = ["thousand", "-n", "--quiet", "--config", f"file=config/{config.name}"]
        times = [_run(arguments, Path(temporary), snakefile)[0] for _ in range(runs)]
        plan = make_plan(load_config(str(Path(temporary) / "config" / config.name)), Path(temporary) / "results")
        return _row(PLANNING, len(plan.of_study("thousand")), times)


def record_overhead(config: Path, file: Path) -> str:
    """Measure both in the working folder and write them as CSV; says what it measured."""
    here, snakefile = Path(), Path("Snakefile").resolve()
    rows = pd.DataFrame([measure(config, here, snakefile) for measure in (time_of_nothing, time_of_planning)], columns=COLUMNS)
    write_whole(file, lambda path: rows.to_csv(path, index=False))
    return f"{file}: " + ", ".join(f"{r.what} of {r.cases} cases {r.wall_seconds:g} s" for r in rows.itertuples())


def read_overhead(file: Path) -> pd.DataFrame:
    """The rows that ``record_overhead`` wrote, none if there is no file. Raises ``ResultError``."""
    return rows_if_any(file, "measured times", COLUMNS)


def _run(arguments: list[str], folder: Path, snakefile: Path) -> tuple[float, str]:
    """Wall time (s) of Snakemake, and what it says. Raises ``LimoError`` where it fails."""
    command = [sys.executable, "-m", "snakemake", "--snakefile", str(snakefile), "--directory", ".", *arguments]
    start = time.perf_counter()
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    seconds = time.perf_counter() - start
    if done.returncode:
        raise LimoError(f"snakemake {' '.join(arguments)} failed: {(done.stdout + done.stderr).strip().splitlines()[-1:]}")
    return seconds, done.stdout + done.stderr


def _row(what: str, cases: int, seconds: list[float]) -> dict[str, Any]:
    return {
        "what": what,
        "cases": cases,
        "wall_seconds": round(statistics.median(seconds), 2),
        "runs": len(seconds),
        "machine": processor(),
    }
