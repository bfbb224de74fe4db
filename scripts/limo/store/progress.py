"""How far a case has come while it is solved: what an engine reports, and a lock that tells whether anyone still solves it.

What is watched decides no result, so engines call ``report`` and know nothing of files: outside of ``solving`` nobody listens.
The kernel gives the lock back however the process ends, so it never tells of a process that is gone. It is flock itself and no
library's: a sweep shares its lock, and whoever asks for one must not make its file.
"""

from __future__ import annotations

import fcntl
import os
import socket
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import IO

from limo.errors import LimoError
from limo.store.files import write_json
from limo.store.results import CaseFiles
from limo.store.scratch import on_own_disk

SWEEP = ".sweep"  # in the folder of results
INTERVAL = 0.3  # s between two progress files
_TRIES, _PAUSE = 20, 0.05  # a reader holds the lock for an instant
_listener: ContextVar[Callable[[dict[str, object]], None] | None] = ContextVar("listener", default=None)


def report(**where: object) -> None:
    """Tell whoever listens where an engine is, in plain data; costs nothing when called often."""
    if (listener := _listener.get()) is not None:
        listener(where)


@contextmanager
def solving(folder: Path) -> Iterator[None]:
    """Within the block the case in ``folder`` counts as running, and what is reported stands in its file of progress.

    Raises ``LimoError`` when another process solves the case.
    """
    folder.mkdir(parents=True, exist_ok=True)
    files, written = CaseFiles(folder), -INTERVAL

    def keep(where: dict[str, object]) -> None:
        nonlocal written
        if time.monotonic() - written >= INTERVAL:
            write_json(files.progress, where, durable=False)
            written = time.monotonic()

    with files.lock.open("a", encoding="utf-8") as lock:
        if not _taken(lock.fileno(), folder):
            files.lock.unlink()
        lock.truncate(0)
        lock.write(f"process {os.getpid()} on {socket.gethostname()}\n")
        lock.flush()
        token = _listener.set(keep)
        try:
            with on_own_disk(files):
                yield
        finally:
            _listener.reset(token)
        # only now: a lock that nobody holds tells of a solve that was broken off
        files.lock.unlink(missing_ok=True)


def enter_sweep(results: Path, snakemake_locks: Path) -> IO[str] | None:
    """Take part in the sweeps of a folder as long as the file that is returned stays open; None where it cannot be written.

    Snakemake's own locks outlive a sweep that is killed. Whoever comes when nobody else is here removes them.
    """
    try:
        results.mkdir(parents=True, exist_ok=True)
        here = (results / SWEEP).open("a", encoding="utf-8")
        try:
            fcntl.flock(here.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            pass
        else:
            for stale in snakemake_locks.glob("*.lock"):
                stale.unlink(missing_ok=True)
        fcntl.flock(here.fileno(), fcntl.LOCK_SH)
    except OSError:
        return None
    return here


def _taken(handle: int, folder: Path) -> bool:
    """Take the lock; False where the file system knows none."""
    for _ in range(_TRIES):
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            return True
        except BlockingIOError:
            time.sleep(_PAUSE)
        except OSError:
            return False
    raise LimoError(f"{folder}: another process is solving this case")


def solving_since(folder: Path) -> float | None:
    """When (s since 1970) the process that is solving the case in ``folder`` began; None when there is no such process."""
    try:
        with CaseFiles(folder).lock.open("rb") as lock:
            try:
                fcntl.flock(lock.fileno(), fcntl.LOCK_SH | fcntl.LOCK_NB)
            except BlockingIOError:
                return os.fstat(lock.fileno()).st_mtime
    except OSError:
        pass
    return None
