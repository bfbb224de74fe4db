"""What `limo check`, `limo sweep` and `limo jobs` do on a cluster."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from limo.cases.plan import make_plan
from limo.cluster import slurm
from limo.cluster.estimate import estimate, estimate_text, longest
from limo.cluster.profile import Profile, read_profile, require_plugin
from limo.cluster.start import SLURM, check_orphans, check_slurm, require_slurm
from limo.config.builds import open_project


def check_on(name: str, config_file: str, studies: Sequence[str], results: Path) -> str:
    """Jobs, core hours and the largest job of a sweep of studies (none named: those that the configuration runs).

    Where there is a Slurm, raises ``ClusterError`` if its partition does not take the longest case.
    """
    profile = read_profile(name)
    project = open_project(config_file, studies, "limo check --on slurm pressure_volume")
    plan, asked = make_plan(project, results), studies or project.config.studies
    text = estimate_text(estimate(project, plan, asked), profile)
    if profile.executor == SLURM and slurm.is_here():
        try:
            check_slurm(longest(plan, asked, profile.partition))
        except slurm.NoAnswer as error:
            text += f"\n  partitions were not looked at: {error}"
    return text


def ready(name: str, left: str) -> Profile:
    """The profile of a cluster that can take a sweep of this folder; jobs that are left are adopted, cancelled or refused.

    Raises ``ClusterError``.
    """
    profile = read_profile(name)
    if profile.executor == SLURM:
        require_slurm()
    require_plugin(profile.executor)
    if profile.executor == SLURM:
        if left != "refuse":
            print((adopt_jobs if left == "adopt" else cancel_jobs)(Path.cwd()), flush=True)
        check_orphans(Path.cwd())
    return profile


def list_jobs(folder: Path) -> str:
    """One line for each job of a folder. Raises ``ClusterError`` where there is no Slurm."""
    jobs = slurm.jobs_of(folder)
    lines = [f"{job.number}  {job.state.lower()}  {job.case or '-'}  {job.reason}".rstrip() for job in jobs]
    return "\n".join([*lines, f"{len(jobs)} jobs wait or run"])


def adopt_jobs(folder: Path) -> str:
    """Wait until a folder has no jobs any more: what they solved is found by the next sweep."""
    before = len(slurm.jobs_of(folder))
    slurm.wait_for_end(folder, said=lambda jobs: print(f"{len(jobs)} of {before} jobs wait or run", file=sys.stderr))
    return f"{before} jobs have ended; their results count"


def cancel_jobs(folder: Path) -> str:
    """Cancel the jobs of a folder, and return when they are gone."""
    jobs = slurm.jobs_of(folder)
    slurm.cancel(jobs)
    slurm.wait_for_end(folder, 1.0)
    return f"{len(jobs)} jobs were cancelled"
