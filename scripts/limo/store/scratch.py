"""The own disk of a cluster's node, where an engine writes while it runs: results lie on a file system that many share.

The folder of the run becomes a link to the node's disk. Small files are copied beside it every few seconds: other machines see
by them how far the run is. At its end they are moved to where they would have been.
"""

from __future__ import annotations

import os
import shutil
import signal
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from limo.store.results import CaseFiles

#: what a node's own disk must have free, and how large files may be that are copied while it runs and kept at its end (bytes)
ROOM, SMALL, KEPT = 2 << 30, 4 << 20, 64 << 20
EVERY = 10.0  # s between two copies
#: file systems that lie in a node's memory, of which a job has no more than it asked for
_IN_MEMORY = {"tmpfs", "ramfs"}


def own_disk(folder: Path) -> Path | None:
    """A folder on this node's own disk, None outside of a Slurm job and where there is none beside that of ``folder``.

    ``SLURM_TMPDIR`` is taken as it is; ``TMPDIR`` only on another disk than the results.
    """
    if "SLURM_JOB_ID" not in os.environ:
        return None
    for name in ("SLURM_TMPDIR", "TMPDIR"):
        if (disk := Path(os.environ.get(name) or "/nowhere")).is_dir() and os.access(disk, os.W_OK):
            with suppress(OSError):
                elsewhere = name == "SLURM_TMPDIR" or disk.stat().st_dev != folder.stat().st_dev
                if elsewhere and _file_system(disk) not in _IN_MEMORY and shutil.disk_usage(disk).free > ROOM:
                    return disk
    return None


def _file_system(path: Path) -> str:
    """The kind of file system that a path lies on, as /proc/mounts names it; "" where that says nothing."""
    real, found = os.path.realpath(path), ("", "")
    with suppress(OSError):
        for line in Path("/proc/mounts").read_text(encoding="utf-8").splitlines():
            _, where, kind, *_ = line.split(" ")
            if os.path.commonpath((real, where)) == where and len(where) >= len(found[0]):
                found = where, kind
    return found[1]


@contextmanager
def on_own_disk(files: CaseFiles) -> Iterator[None]:
    """Within the block the run of a case lies on the node's own disk, where there is one."""
    if files.run.is_symlink():  # of a job that was killed
        files.run.unlink()
    disk = own_disk(files.folder)
    if disk is None:
        yield
        return
    shutil.rmtree(files.run, ignore_errors=True)
    scratch = Path(tempfile.mkdtemp(prefix="limo_", dir=disk))
    files.run.symlink_to(scratch)
    over = threading.Event()
    mirror = threading.Thread(target=_mirror, args=(scratch, files.seen.run, over), daemon=True)
    mirror.start()
    before = _end_in_order() if threading.current_thread() is threading.main_thread() else None
    try:
        yield
    finally:
        if before is not None:
            signal.signal(signal.SIGTERM, before)
        over.set()
        mirror.join()
        files.run.unlink(missing_ok=True)
        _copy(scratch, files.run, KEPT)
        shutil.rmtree(scratch, ignore_errors=True)
        shutil.rmtree(files.seen.folder, ignore_errors=True)


def _end_in_order() -> Any:
    """Have a cancelled job end by an exception, so that nothing stays on the node's disk; returns what was done before."""

    def end(number: int, _: Any) -> None:
        raise SystemExit(128 + number)

    return signal.signal(signal.SIGTERM, end)


def _mirror(scratch: Path, seen: Path, over: threading.Event) -> None:
    while not over.wait(EVERY):
        with suppress(OSError):
            _copy(scratch, seen, SMALL)


def _copy(source: Path, target: Path, largest: int) -> None:
    """Copy files of at most so many bytes, with their times, each as a whole."""
    target.mkdir(parents=True, exist_ok=True)
    for file in source.iterdir():
        with suppress(OSError):
            if not file.name.startswith(".") and file.stat().st_size <= largest:
                aside = target / f".{os.getpid()}.{file.name}"
                shutil.copy2(file, aside)
                aside.replace(target / file.name)
