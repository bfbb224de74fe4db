"""What can be deleted from the results: what no study uses, and what killed solvers left.

Sizes are written by ``readable`` in powers of 1024, as those of memory are; rich knows powers of 1000 only.
"""

from __future__ import annotations

import shutil
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from limo.cases.plan import make_plan
from limo.config.builds import open_project
from limo.engines.find import find_engine
from limo.errors import LimoError
from limo.reliability.stress_cases import stress_cases
from limo.schema.section import ENGINES
from limo.store.progress import solving_since
from limo.store.results import Results

KINDS = ("leftovers", "cases")
OLD = 3600.0  # s after which nobody is still writing a file


@dataclass(frozen=True)
class Rubbish:
    """A file or folder that can go: why, and the bytes that this frees."""

    path: Path
    reason: str
    size: int


def find_rubbish(config_files: Sequence[str], results: Path, kinds: Sequence[str] = KINDS) -> list[Rubbish]:
    """What can go: ``leftovers`` of solvers, ``cases`` and meshes that no study of the configurations uses.

    A case that someone is solving stays, with its mesh.
    """
    folder = Results(results)
    every = sorted(folder.cases.glob("*"))
    cases = [p for p in every if solving_since(p) is None]
    leftover = _leftovers(cases) + _half_written(results) if "leftovers" in kinds else []
    if "cases" in kinds:
        used, meshes = _used(config_files, results)
        unused = [case for case in cases if case.name not in used]
        leftover = [r for r in leftover if not any(case in r.path.parents for case in unused)]
        leftover += [Rubbish(path, "a case that no study uses", size_of(path)) for path in unused]
        about = [path for case in unused for path in _about(folder, case.name)]
        leftover += [Rubbish(path, "of a case that no study uses", size_of(path)) for path in about]
        # someone may be solving a case of another configuration on any of them
        spare = [p for p in folder.meshes.glob("[!.]*.vtu") if p.stem not in meshes] if cases == every else []
        leftover += [Rubbish(path, "a mesh that no study uses", size_of(path)) for path in sorted(spare)]
    inside = results.resolve()
    for rubbish in leftover:  # nothing outside of the results, whatever links there are
        if not rubbish.path.parent.resolve().is_relative_to(inside):
            raise LimoError(f"{rubbish.path}: leads out of {results}; nothing was deleted")
    return leftover


def _about(results: Results, name: str) -> list[Path]:
    """Logs and benchmarks of a case that are there."""
    return [file for file in results.about(name) if file.exists()]


def _used(config_files: Sequence[str], results: Path) -> tuple[set[str], set[str]]:
    """Cases and meshes that the studies of some configurations use."""
    cases: set[str] = set()
    meshes: set[str] = set()
    for file in config_files:
        loaded = open_project(file, strict=True)  # nobody knows what a broken study uses
        plan = make_plan(loaded, results).with_cases(stress_cases(loaded).values())
        cases.update(plan.cases)
        meshes.update(case.mesh_id for case in plan.cases.values())
    return cases, meshes


def _leftovers(cases: Sequence[Path]) -> list[Rubbish]:
    folders = [case for case in cases if not case.is_symlink()]
    patterns = [pattern for name in ENGINES for pattern in find_engine(name).LARGE_FILES]
    files = {file: None for case in folders for pattern in patterns for file in (case / "run").glob(pattern)}
    return [Rubbish(file, "left by a solver", size_of(file)) for file in files]


def _half_written(results: Path) -> list[Rubbish]:
    """Files written aside by processes that are gone (``files.write_whole`` names them by their process)."""
    rubbish = []
    for path in sorted([*results.glob("*/.[0-9]*.*"), *results.glob("*/*/.[0-9]*.*"), *results.glob("*/*/run*/.[0-9]*.*")]):
        process = path.name.split(".")[1]
        gone = process.isdigit() and not Path(f"/proc/{process}").exists()
        if gone and time.time() - path.lstat().st_mtime > OLD:
            rubbish.append(Rubbish(path, "half written", size_of(path)))
    return rubbish


def size_of(path: Path) -> int:
    """Bytes of a file or of all files in a folder; links count as themselves."""
    if path.is_symlink() or not path.is_dir():
        return path.lstat().st_size
    return sum(size_of(p) for p in path.iterdir())


def delete(rubbish: Sequence[Rubbish]) -> None:
    """Delete it. A link goes, what it leads to stays."""
    for path in (r.path for r in rubbish):
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path)
        else:
            path.unlink(missing_ok=True)


def describe_rubbish(rubbish: Sequence[Rubbish], results: Path) -> str:
    """One line each, and the space that it frees."""
    if not rubbish:
        return f"nothing to delete in {results}"
    lines = [f"{readable(r.size):>9}  {r.path} ({r.reason})" for r in rubbish]
    return "\n".join([*lines, f"{readable(sum(r.size for r in rubbish)):>9}  in all, {len(rubbish)} files and folders"])


def readable(size: int) -> str:
    """Bytes for people: ``512 B``, ``3.4 MiB``."""
    value, unit = float(size), "B"
    for following in ("KiB", "MiB", "GiB", "TiB"):
        if value < 1000:
            break
        value, unit = value / 1024, following
    return f"{value:.0f} {unit}" if unit == "B" or value >= 100 else f"{value:.1f} {unit}"
