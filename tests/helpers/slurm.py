"""A Slurm of this machine for tests: all of it in one folder, and gone with the tests."""

from __future__ import annotations

import os
import re
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from limo.cluster.profile import require_plugin
from limo.errors import ClusterError

ROOT = Path(__file__).parents[2]
SCRIPT = ROOT / "scripts" / "slurm.sh"
#: what has to be there for it; ``make test`` installs both
PROGRAMS = ("munged", "slurmctld", "slurmd", "sbatch", "squeue")


def lacks() -> str:
    """What a Slurm needs and is not here; "" where all is."""
    folders = [*os.environ["PATH"].split(os.pathsep), "/usr/sbin", "/sbin"]
    for program in PROGRAMS:
        if not any(os.access(Path(folder) / program, os.X_OK) for folder in folders):
            return f"{program} (scripts/slurm.sh install)"
    try:
        require_plugin("slurm")
    except ClusterError:
        return "snakemake-executor-plugin-slurm (make cluster)"
    return ""


@contextmanager
def one_folder_slurm(
    folder: Path, disk: Path, cpus: int = 4, memory: int = 8000, hidden: Path | None = None
) -> Iterator[dict[str, str]]:
    """The variables by which this process's children find a Slurm that runs as long as the block, and this process, last.

    ``memory`` in MiB. Jobs find the folder ``disk`` as their node's own disk. The folder ``hidden`` is empty on the node, which
    takes root.
    """
    environment = os.environ | {"OWNER": str(os.getpid()), "NODE_DISK": str(disk)} | ({"HIDDEN": str(hidden)} if hidden else {})
    subprocess.run(["bash", SCRIPT, "up", folder, str(cpus), str(memory)], env=environment, check=True, timeout=90)
    try:
        text = (folder / "env.sh").read_text(encoding="utf-8")
        found = dict(re.findall(r'(\w+)="([^"]*)"', text))
        yield {"SLURM_CONF": found["SLURM_CONF"], "PATH": found["PATH"].replace("$PATH", os.environ["PATH"])}
    finally:
        subprocess.run(["bash", SCRIPT, "down", folder], check=False, timeout=90)


def daemons(folder: Path) -> list[int]:
    """Processes that a Slurm in a folder has started and that are still there."""
    found = []
    for entry in filter(str.isdigit, os.listdir("/proc")):
        try:
            command = Path(f"/proc/{entry}/cmdline").read_bytes().decode(errors="replace")
        except OSError:
            continue
        if str(folder) in command and any(name in command for name in ("munged", "slurmctld", "slurmd", "slurmstepd")):
            found.append(int(entry))
    return found
