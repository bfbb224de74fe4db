"""A solve that takes a second and computes nothing, to measure what a sweep takes beside its solves.

It copies what was solved of another case on the same mesh. ``install`` puts it in the place of the real one in all processes
that get an environment: the rules and their scripts stay as they are.
"""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from limo.cases.case import Case, describe
from limo.store.files import read_json, stamp_of, write_json, write_whole
from limo.store.results import CaseFiles

#: seconds that a solve takes, and the folder of solved cases to copy from, by name of mesh
SECONDS, SOLVED = "LIMO_STAND_IN_SECONDS", "LIMO_STAND_IN_SOLVED"
#: what Python runs before anything else; the module is exchanged when it is imported
_HOOK = """import importlib.abc
import importlib.util
import sys


class _Exchange(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path, target=None):
        if name != "limo.solve.case":
            return None
        sys.meta_path.remove(self)
        spec = importlib.util.find_spec(name)
        load = spec.loader.exec_module

        def exec_module(module):
            load(module)
            from limo.reports.stand_in import solve_case

            module.solve_case = solve_case

        spec.loader.exec_module = exec_module
        return spec


sys.meta_path.insert(0, _Exchange())
"""


def install(folder: Path, solved: Path, seconds: float) -> dict[str, str]:
    """The environment in which solves take so many seconds; ``folder`` is an empty one for its file.

    ``solved`` has a folder of a solved case for each mesh, by the name of the mesh.
    """
    write_whole(folder / "sitecustomize.py", lambda aside: aside.write_text(_HOOK, encoding="utf-8"))
    path = os.pathsep.join([str(folder), str(Path(__file__).parents[2]), os.environ.get("PYTHONPATH", "")]).rstrip(os.pathsep)
    return os.environ | {"PYTHONPATH": path, SECONDS: str(seconds), SOLVED: str(solved)}


def solve_case(case: Case, mesh_file: Path, folder: Path, settings: Any, fit: Sequence[Path] = ()) -> dict[str, Any]:
    """In the place of ``limo.solve.case.solve_case``: wait, and copy."""
    time.sleep(float(os.environ[SECONDS]))
    return copy_solved(case, Path(os.environ[SOLVED]) / case.mesh_id, folder, settings.recovery)


def copy_solved(case: Case, solved: Path, folder: Path, recovery: str) -> dict[str, Any]:
    """Make the results of a case of those of another one; returns its status."""
    files, other = CaseFiles(folder), CaseFiles(solved)
    for source, target in ((other.volumes, files.volumes), (other.frames, files.frames)):
        write_whole(target, lambda aside, source=source: shutil.copy(source, aside), durable=False)
    write_json(files.described, describe(case), durable=False)
    stamps = {file.name: stamp_of(file) for file in (files.described, files.frames, files.volumes)}
    status = read_json(other.status) | {"case": case.case_id, "recovery": recovery, "files": stamps, "attempts": []}
    write_json(files.status, status, durable=False)
    return status
