"""What is made once in a session of tests, also where several workers of pytest-xdist share it."""

from __future__ import annotations

import fcntl
import os
import pickle
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

#: the folder that the workers have in common; ``tests/conftest.py`` sets it
FOLDER: Path | None = None


def common_folder(base: Path) -> Path:
    """The folder that all workers of a session have in common; ``base`` is this worker's own."""
    return base.parent if "PYTEST_XDIST_WORKER" in os.environ else base


def made_once(name: str, make: Callable[[Path], Any]) -> Path:
    """A folder of that name, filled by ``make`` of the worker that asks first; the others wait for it, and leave it as it is."""
    folder, done = FOLDER / name, FOLDER / f"{name}.done"
    with (FOLDER / f"{name}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not done.exists():
            shutil.rmtree(folder, ignore_errors=True)
            folder.mkdir()
            make(folder)
            done.touch()
    return folder


def kept(name: str, make: Callable[[], Any]) -> Any:
    """What ``make`` returns, made by the worker that asks first."""
    folder = made_once(name, lambda folder: (folder / "value").write_bytes(pickle.dumps(make())))
    return pickle.loads((folder / "value").read_bytes())
