"""The door between Snakemake's scripts and the package: logging, and errors without tracebacks."""

from __future__ import annotations

import logging
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from limo.errors import LimoError


@contextmanager
def logged(log_file: str) -> Iterator[logging.Logger]:
    """Log to ``log_file``; a user's mistake ends the script with its one message, anything else with a traceback there."""
    Path(log_file).parent.mkdir(parents=True, exist_ok=True)
    logging.basicConfig(
        filename=log_file, filemode="w", level=logging.INFO, format="%(asctime)s %(levelname)s %(name)s: %(message)s", force=True
    )
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
