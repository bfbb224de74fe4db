"""The door between Snakemake's scripts and the package: logging, and errors without tracebacks."""

from __future__ import annotations

import logging
import os
import select
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from limo.errors import LimoError


@contextmanager
def logged(log_file: str) -> Iterator[logging.Logger]:
    """Log to ``log_file``; a user's mistake ends the script with its one message, anything else with a traceback there."""
    _end_with_snakemake()
    Path(log_file).parent.mkdir(parents=True, exist_ok=True)
    logging.basicConfig(
        filename=log_file, filemode="w", level=logging.INFO, format="%(asctime)s %(levelname)s %(name)s: %(message)s", force=True
    )
    logging.getLogger("fontTools").setLevel(logging.WARNING)  # hundreds of lines for every PDF
    log = logging.getLogger("limo")
    try:
        yield log
    except LimoError as error:
        log.error("%s", error)
        sys.exit(str(error))
    except (OSError, MemoryError) as error:  # of the machine: a full disk, a folder that cannot be written, no memory
        log.error("%s", error or type(error).__name__)
        sys.exit(str(error) or type(error).__name__)
    except Exception:
        log.exception("unexpected")
        raise


def _end_with_snakemake() -> None:
    """Have this script ended when the Snakemake that started it is gone: killed, it cannot end its scripts itself."""
    ancestors, pid = [], os.getppid()
    for _ in range(3):  # a shell stands between, on clusters two
        try:
            ancestors.append((pid, os.pidfd_open(pid)))
            if b"snakemake" in Path(f"/proc/{pid}/cmdline").read_bytes():
                threading.Thread(target=_end_after, args=([handle for _, handle in ancestors],), daemon=True).start()
                return
            pid = parent_of(pid)
        except (OSError, AttributeError, ValueError):  # gone already, or not Linux
            break
    for _, handle in ancestors:
        os.close(handle)


def parent_of(process: int) -> int:
    """The process that started one. Raises ``OSError`` for one that is gone, and elsewhere than on Linux."""
    return int(Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[1])


def _end_after(processes: list[int]) -> None:
    """Wait for the end of the first of some processes, then ask this one to end."""
    select.select(processes, [], [])
    os.kill(os.getpid(), signal.SIGTERM)
