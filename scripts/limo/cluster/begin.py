"""Between planning and the first job of a sweep: refuse what cannot end well, and hand the plan to the jobs."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any

from limo.cases.plan import Plan
from limo.cluster.handed import hand
from limo.cluster.slurm import NoAnswer
from limo.cluster.start import SLURM, asked_of, check_orphans, check_slurm
from limo.config.project import Project
from limo.warm import start

log = logging.getLogger(__name__)

#: s that the job which looks at a node may wait for it
PATIENCE = 24 * 3600.0
_DEFAULT_RATE = (100, 1)  # jobs, s


def begin_sweep(workflow: Any, project: Project, plan: Plan) -> None:
    """Look at Snakemake's ``workflow``, which has planned its jobs and submitted none.

    On one machine only jobs of an earlier sweep on Slurm are looked for, and scripts get a warm process. Raises ``ClusterError``.
    """
    _without_rate(workflow)
    try:
        check_orphans(Path.cwd())
    except NoAnswer as error:
        if not workflow.local_exec:
            raise
        log.warning("%s; nobody knows whether jobs of an earlier sweep still run", error)
    if workflow.local_exec:
        if workflow.is_main_process:
            start()
        return
    file = hand(plan, project.builds)
    if workflow.executor_plugin.name != SLURM:
        return
    _ask_evenly(workflow)
    asked = asked_of(list(workflow.dag.needrun_jobs()))
    check_slurm(asked)
    if any(one.rule == "solve_case" for one in asked):
        from limo.cluster.probe import probe_node

        first = next(one for one in asked if one.rule == "solve_case")
        options = {"partition": first.partition, "account": first.account, "constraint": first.constraint, "qos": first.qos}
        options = {name: value for name, value in options.items() if value}
        probe_node(options, project.config.solver, file, project.builds, PATIENCE)


def _without_rate(workflow: Any) -> None:
    """Take away Snakemake's default limit of 100 new jobs a second, which none of our sweeps reaches.

    With it Snakemake 9.27 looks through all ready jobs once a second, and once more for each job that has ended: after some
    hundred of a thousand cases that takes a processor. A limit that was asked for stays.
    """
    asked = workflow.scheduling_settings.max_jobs_per_timespan
    if asked and (asked.max_jobs, asked.timespan) == _DEFAULT_RATE:
        workflow.scheduler.job_rate_limiter = None


def _ask_evenly(workflow: Any) -> None:
    """Have Slurm asked for its jobs as often as the profile says.

    The plugin waits 10 s longer after each question without news, up to 180 s, and Ctrl-C and the last dataset wait with it.
    """
    executor = workflow.scheduler._executor
    if seconds := getattr(workflow.executor_settings, "init_seconds_before_status_checks", None):
        even = property(lambda self: seconds, lambda self, longer: None)
        executor.__class__ = type("EvenlyAsking", (type(executor),), {"next_seconds_between_status_checks": even})
