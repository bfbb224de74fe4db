"""The machine that results were made on: processor and memory."""

from __future__ import annotations

import os
import platform
import re
from pathlib import Path


def processor() -> str:
    """The name of this machine's processor."""
    try:
        collected = re.search(r"^model name\s*: (.+)$", Path("/proc/cpuinfo").read_text(encoding="utf-8"), re.MULTILINE)
    except OSError:
        collected = None
    return collected.group(1) if collected else platform.processor()


def machine_memory() -> float:
    """MiB of memory that this machine has."""
    return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**20
