"""What is looked at before the first job is submitted: each thing that would fail a thousand jobs is one message.

``begin.begin_sweep`` calls it when Snakemake knows all its jobs and has submitted none.
"""

from __future__ import annotations

import math
import shutil
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from limo.cluster import slurm
from limo.cluster.handed import was_handed
from limo.cluster.resources import TIME_MARGIN
from limo.errors import ClusterError

#: what submits, by the name of Snakemake's executor
SLURM = "slurm"
_NAMED = 5  # jobs that a message names


@dataclass(frozen=True)
class Asked:
    """What one job asks for: its rule and what it is about, minutes, MiB, predicted seconds, and the keys of a site.

    An empty ``partition`` is the default one.
    """

    rule: str
    about: str
    minutes: float
    memory: float
    seconds: float = 0.0
    partition: str = ""
    account: str = ""
    constraint: str = ""
    qos: str = ""


def check_orphans(folder: Path) -> None:
    """Raise ``ClusterError`` if jobs of an earlier sweep of a folder wait or run: both would write the same files.

    Slurm is not asked about a folder that never had a sweep on a cluster.
    """
    if left := slurm.jobs_of(folder) if slurm.is_here() and was_handed(folder) else []:
        numbers = ", ".join(job.number for job in left[:_NAMED]) + f" and {len(left) - _NAMED} more" * (len(left) > _NAMED)
        raise ClusterError(
            f"{len(left)} Slurm job{'s' * (len(left) > 1)} of an earlier sweep in this folder still wait or run ({numbers}): "
            "`limo jobs adopt` waits for their results, `limo jobs cancel` ends them; then start again"
        )


def check_slurm(asked: Iterable[Asked]) -> None:
    """Raise ``ClusterError`` for the first job that no partition takes, or that would be ended before its time."""
    require_slurm()
    known = slurm.partitions()
    for job in asked:
        _check_job(job, known)


def require_slurm() -> None:
    """Raise ``ClusterError`` where jobs cannot be submitted."""
    for program in ("sbatch", "squeue", "sinfo", "scancel"):
        if shutil.which(program) is None:
            raise ClusterError(
                f"{program}: no such program here; a sweep on Slurm starts on a login node of the cluster, and without one "
                "`limo sweep` without --on solves on this machine"
            )


def _check_job(job: Asked, known: Mapping[str, slurm.Partition]) -> None:
    partition = known.get(job.partition)
    if partition is None:
        names = ", ".join(name for name in known if name) or "none"
        what = f"slurm_partition = {job.partition!r}: no such partition" if job.partition else "Slurm has no default partition"
        example = next((name for name in known if name), "main")
        raise ClusterError(f"{what}; there are {names}; for example --default-resources slurm_partition={example}")
    what = f"{job.rule} of {job.about}" if job.about else job.rule
    if 60 * job.minutes < job.seconds:
        raise ClusterError(
            f"{what}: a time limit of {job.minutes:g} min is below the {math.ceil(job.seconds / 60)} min that are predicted; "
            f"for example --set-resources {job.rule}:runtime={math.ceil(TIME_MARGIN * job.seconds / 60)}"
        )
    if job.minutes > partition.minutes:
        raise ClusterError(
            f"{what} asks for {job.minutes:g} min, and partition {partition.name} ends jobs after {partition.minutes:g} min "
            f"({math.ceil(job.seconds / 60)} min are predicted); choose another partition (slurm_partition), a coarser mesh, or "
            f"dare it with --set-resources {job.rule}:runtime={math.floor(partition.minutes)}"
        )
    if job.memory > partition.memory:
        raise ClusterError(
            f"{what} asks for {job.memory:g} MiB, and no node of partition {partition.name} has more than {partition.memory:g} "
            "MiB; choose another partition (slurm_partition) or a coarser mesh"
        )


def asked_of(jobs: Sequence) -> list[Asked]:
    """What Snakemake's jobs ask for, of those that are submitted; the longest first.

    The rules of one case are one job and ask for the sum of their minutes: all of it is said of the solve.
    """
    found: list[Asked] = []
    of_cases: dict[str, list[Asked]] = {}
    for job in jobs:
        if job.is_local or job.is_norun:
            continue
        asks = job.resources
        numbers = (asks.get(name, 0) for name in ("runtime", "mem_mb", "predicted_seconds"))
        keys = (str(asks.get(name) or "") for name in ("slurm_partition", "slurm_account", "constraint", "qos"))
        case_id = getattr(job.wildcards, "case", "")
        one = Asked(job.rule.name, case_id or next(iter(job.wildcards), ""), *numbers, *keys)
        (of_cases.setdefault(case_id, []) if case_id else found).append(one)
    for parts in of_cases.values():
        first = max(parts, key=lambda part: (part.rule == "solve_case", part.minutes))
        most = max(part.memory for part in parts)
        found.append(replace(first, minutes=sum(part.minutes for part in parts), memory=most))
    return sorted(found, key=lambda one: -one.minutes)
