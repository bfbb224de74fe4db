"""What it takes to enter the project: imports, help, doing nothing, planning a thousand cases, testing; beside another checkout.

Both checkouts are measured in one batch, one after the other in each round, so that a busy machine burdens both.
"""

from __future__ import annotations

import ast
import json
import resource
import shutil
import statistics
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pandas as pd
import yaml

from limo.errors import LimoError
from limo.reports.markdown import markdown_table, rows_if_any
from limo.reports.overhead import THOUSAND
from limo.store.files import write_whole
from limo.store.machine import processor

RUNS = 5
COLUMNS = ("what", "other_seconds", "seconds", "ratio", "kind", "runs", "other", "machine")
CONFIG = Path("config/grids/preview_newton.yaml")  # 19 cases, whose results both checkouts must have
#: executes the import lines of a Snakefile, with the package on the path that it sets
_IMPORTS = """
import ast, sys
sys.path.insert(0, "scripts")
tree = ast.parse(open("Snakefile").read().partition("CONFIG_FILE =")[0])
lines = [node for node in tree.body if isinstance(node, ast.ImportFrom) and node.module.startswith("limo")]
exec(compile(ast.Module(lines, []), "Snakefile", "exec"))
"""
#: what a solve by engine newton imports, one after the other, and the CPU time of each; libraries before what needs them
_SOLVE = """
import json, sys, time
sys.path.insert(0, "scripts")
laps = {"start": time.process_time()}
def lap(name):
    laps[name] = time.process_time() - sum(laps.values())
from snakemake import script
lap("snakemake")
import numpy
lap("numpy")
import pandas, xarray
lap("xarray")
import scipy.sparse
lap("scipy")
import numba
lap("numba")
from limo.engines.newton import kernels
lap("kernels")
import meshio, netCDF4
lap("files")
IMPORTS
from limo.engines.newton import iteration
lap("rest")
laps["all"] = sum(laps.values())
print(json.dumps(laps))
"""
#: a script that a warm process runs prints its CPU time when a solve by engine newton could begin
_SCRIPT = """
import sys, time
sys.path.insert(0, SCRIPTS)
from snakemake import script
from limo.warm import warm
warm("limo.engines.newton.engine")
IMPORTS
from limo.engines.newton import iteration
print(time.process_time())
"""
#: runs it in the place of Snakemake, once for the imports and once that counts: its CPU time and that of the script that waits
_WARM = """
import resource, subprocess, sys
sys.path.insert(0, "scripts")
from limo.warm import start
start()
def spent():
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return children.ru_utime + children.ru_stime
for _ in range(2):
    before = spent()
    done = subprocess.run([sys.executable, sys.argv[1]], capture_output=True, text=True, check=True)
    found = float(done.stdout) + spent() - before
print(found)
"""
#: laps of a solve that is not warm in words
_LAPS = {
    "all": "imports of a solve by engine newton, Python included",
    "start": "of these: Python",
    "snakemake": "of these: what Snakemake puts before a script",
    "numpy": "of these: NumPy",
    "xarray": "of these: xarray and pandas, of which volumes and frames are made",
    "scipy": "of these: scipy.sparse",
    "numba": "of these: Numba",
    "kernels": "of these: the first compiled kernel from Numba's cache",
    "files": "of these: meshio and netCDF4",
    "rest": "of these: all else, schemas and LIMO itself",
}
WORDS = {
    "python": "Python that does nothing",
    "imports": "imports of the Snakefile, Python included",
    "help": "`limo --help`",
    "no_op": "a sweep of 19 solved cases with nothing to do",
    "dry_run": "dry run of 1,000 cases",
    "tests": "`make test` in a fresh clone, set-up apart",
    **{f"solve_{name}": words for name, words in _LAPS.items()},
    "solve_warm": "a solve of a sweep by engine newton, whose process a warm one forks: Python and Snakemake's part, twice",
}


def compare(here: Path, other: Path, runs: int = RUNS) -> pd.DataFrame:
    """Median CPU seconds of each task of ``WORDS`` but the tests, in this checkout and another one; both are set up.

    Raises ``LimoError`` where a command fails or something is left to do.
    """
    rows = []
    for what, task in _TASKS.items():
        with task(here) as one, task(other) as two:
            seconds = [(_cpu_seconds(*one), _cpu_seconds(*two)) for _ in range(runs)]
        rows.append(row(what, *pd.DataFrame(seconds).median(), "CPU", runs, other))
    return pd.DataFrame(rows, columns=COLUMNS)


def compare_solve_imports(here: Path, other: Path, runs: int = RUNS) -> pd.DataFrame:
    """Median CPU seconds of what a solve by engine newton imports, part by part, in this checkout and another one.

    The last row is what a solve of a sweep takes before it begins, here beside a process that has imported all that; the other
    checkout may have none.
    """
    _laps(here), _laps(other)  # compiles kernels, where that was not done
    pairs = [(_laps(here), _laps(other)) for _ in range(runs)]
    rows = []
    for name in _LAPS:
        seconds, others = (statistics.median(pair[k][name] for pair in pairs) for k in (0, 1))
        rows.append(row(f"solve_{name}", seconds, others, "CPU", runs, other))
    warm = statistics.median(_warm_seconds(here) for _ in range(runs))
    rows.append(row("solve_warm", warm, statistics.median(laps["all"] for _, laps in pairs), "CPU", runs, other))
    return pd.DataFrame(rows, columns=COLUMNS)


def _laps(folder: Path) -> dict[str, float]:
    """CPU time (s) of the parts of ``_LAPS``."""
    return json.loads(_run([str(folder / ".venv/bin/python"), "-c", _of(_SOLVE, folder)], folder).splitlines()[-1])


def _warm_seconds(folder: Path) -> float:
    """CPU time (s) before a solve that a warm process runs, with that of the script that waits for it."""
    with tempfile.TemporaryDirectory() as temporary:
        script = Path(temporary) / "solve_case.py"
        script.write_text(_of(_SCRIPT, folder), encoding="utf-8")
        return float(_run([str(folder / ".venv/bin/python"), "-c", _WARM, str(script)], folder).splitlines()[-1])


def _of(text: str, folder: Path) -> str:
    """A script with what a checkout's solve imports and where its scripts are."""
    scripts = folder.resolve() / "scripts"
    tops = ast.parse((scripts / "solve_case.py").read_text(encoding="utf-8")).body
    imports = "\n".join(ast.unparse(node) for node in tops if isinstance(node, ast.ImportFrom))
    return text.replace("IMPORTS", imports).replace("SCRIPTS", repr(str(scripts)))


def compare_tests(here: Path, other: Path) -> pd.DataFrame:
    """Wall seconds of ``make test``, once in each checkout, this one first; both are set up."""
    seconds = []
    for folder in (here, other):
        start = time.perf_counter()
        _run(["make", "test"], folder)
        seconds.append(time.perf_counter() - start)
    return pd.DataFrame([row("tests", *seconds, "wall", 1, other)], columns=COLUMNS)


def row(what: str, seconds: float, other_seconds: float, kind: str, runs: int, other: Path) -> dict[str, object]:
    """One line of the table: ``kind`` is CPU or wall time; the other checkout is named by its commit."""
    return {
        "what": what,
        "other_seconds": round(other_seconds, 2),
        "seconds": round(seconds, 2),
        "ratio": round(seconds / max(other_seconds, 1e-3), 3),
        "kind": kind,
        "runs": runs,
        "other": _run(["git", "rev-parse", "--short", "HEAD"], other).strip(),
        "machine": processor(),
    }


def keep(rows: pd.DataFrame, file: Path) -> None:
    """Write rows into a CSV file; those of the same tasks there are replaced."""
    kept = read_entry(file)
    merged = pd.concat([kept[~kept.what.isin(rows.what)], rows], ignore_index=True) if len(kept) else rows
    write_whole(file, lambda path: merged.to_csv(path, index=False))


def read_entry(file: Path) -> pd.DataFrame:
    """The rows that ``keep`` wrote, none if there is no file. Raises ``ResultError``."""
    return rows_if_any(file, "measured times", COLUMNS)


def entry_table(rows: pd.DataFrame) -> str:
    """The rows as a markdown table."""
    lines = [
        {
            "what": WORDS.get(row.what, row.what),
            "here": f"{row.seconds:g} s",
            "before": f"{row.other_seconds:g} s (`{row.other}`)",
            "ratio": f"{row.ratio:.2f}",
            "time": row.kind,
            "runs": row.runs,
            "machine": row.machine,
        }
        for row in rows.itertuples()
    ]
    return markdown_table(pd.DataFrame(lines))


Command = tuple[list[str], Path]


@contextmanager
def _python(folder: Path) -> Iterator[Command]:
    yield [str(folder / ".venv/bin/python"), "-c", "pass"], folder


@contextmanager
def _imports(folder: Path) -> Iterator[Command]:
    yield [str(folder / ".venv/bin/python"), "-c", _IMPORTS], folder


@contextmanager
def _help(folder: Path) -> Iterator[Command]:
    yield [str(folder / ".venv/bin/limo"), "--help"], folder


@contextmanager
def _no_op(folder: Path) -> Iterator[Command]:
    command = [*_snakemake(folder), "--cores", "2", "--config", f"file={CONFIG}"]
    if "Nothing to be done" not in _run([*command, "-n"], folder):
        raise LimoError(f"{folder / CONFIG}: not all is solved and drawn; run `{' '.join(command)}` first")
    yield command, folder


@contextmanager
def _dry_run(folder: Path) -> Iterator[Command]:
    with tempfile.TemporaryDirectory() as temporary:
        shutil.copytree((folder / CONFIG).parent, Path(temporary) / "config")
        (Path(temporary) / "config" / "studies" / "thousand.yaml").write_text(yaml.safe_dump(THOUSAND), encoding="utf-8")
        options = ["thousand", "-n", "--quiet", "--config", f"file=config/{CONFIG.name}"]
        yield [*_snakemake(folder), *options], Path(temporary)


_TASKS: dict[str, Callable[[Path], object]] = {
    "python": _python,
    "imports": _imports,
    "help": _help,
    "no_op": _no_op,
    "dry_run": _dry_run,
}


def _snakemake(folder: Path) -> list[str]:
    return [str(folder / ".venv/bin/python"), "-m", "snakemake", "--snakefile", str(folder / "Snakefile"), "--directory", "."]


def _cpu_seconds(command: list[str], folder: Path) -> float:
    """CPU time (s) of a command and its children."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    _run(command, folder)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime


def _run(command: list[str], folder: Path) -> str:
    """What a command prints. Raises ``LimoError`` where it fails."""
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode:
        raise LimoError(f"{' '.join(command)} failed: {(done.stdout + done.stderr).strip().splitlines()[-1:]}")
    return done.stdout + done.stderr
