"""Show a sweep: a table that renews itself on a terminal, or lines about what changed in a log; and run one beside it."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import suppress

from rich.console import Console
from rich.live import Live
from rich.table import Table
from rich.text import Text

from limo.cases.cost import duration
from limo.store.statuses import CONVERGED, CRASHED, DEGRADED, DIVERGED, QUEUED, RUNNING, STALE, TIMED_OUT, WAITING
from limo.terminal.status import FAILED, STATUSES, CaseStatus, Sweep, short_names

LOG = "logs/sweep.log"  # in the folder of results
_STYLES = {
    RUNNING: "cyan",
    QUEUED: "blue",
    WAITING: "dim",
    CONVERGED: "green",
    DEGRADED: "yellow",
    STALE: "yellow",
} | dict.fromkeys((DIVERGED, TIMED_OUT, CRASHED), "red")
_WIDTH = 150  # columns where there is no terminal
_OTHERS = 8  # lines of a terminal that are not cases


def console() -> Console:
    """A console for standard output: as wide as the terminal, or wide enough in a file; no colours there."""
    return Console(highlight=False, soft_wrap=False, width=None if sys.stdout.isatty() else _WIDTH)


def failed(statuses: Sequence[CaseStatus]) -> bool:
    """Whether a case failed or was broken off."""
    return any(s.status in FAILED for s in statuses)


def table(sweep: Sweep, statuses: Sequence[CaseStatus], height: int | None = None) -> Table:
    """One line per case and the totals below. If more than ``height`` cases exist, waiting and finished ones are hidden first."""
    shown = list(statuses) if height is None else _most_telling(statuses, height)
    names = short_names(s.case for s in statuses)
    made = Table(box=None, pad_edge=False, caption=_totals(sweep, statuses, len(statuses) - len(shown)), caption_justify="left")
    made.add_column("case", no_wrap=True)
    varied = any(s.variant for s in statuses)
    for title in ("variant",) * varied + ("status", "stage"):
        made.add_column(title, no_wrap=True)
    for title in ("P_a \\[kPa]", "of", "incr", "cut", "iter", "iter/s", "time", "left"):
        made.add_column(title, no_wrap=True, justify="right")
    for s in shown:
        cells = (
            names[s.case],
            *(s.variant,) * varied,
            Text(s.status, style=_STYLES[s.status]),
            s.stage,
            _text(s.actuation_pressure, "{:.1f}"),
            _text(s.actuation_pressure_max, "{:g}"),
            *(_text(value, "{}") for value in (s.increments, s.cutbacks, s.iterations)),
            _text(s.iterations_per_second, "{:.1f}"),
            "" if s.seconds is None else duration(s.seconds),
            "" if s.seconds_left is None else duration(s.seconds_left),
        )
        made.add_row(*cells)
    return made


def _text(value: float | None, form: str) -> str:
    return "" if value is None else form.format(value)


def _most_telling(statuses: Sequence[CaseStatus], count: int) -> list[CaseStatus]:
    """At most ``count`` cases in their order: those that run or failed, then those that ended, then those that wait."""
    order = {RUNNING: 0, **dict.fromkeys(FAILED, 1), DEGRADED: 2, CONVERGED: 3, QUEUED: 4, WAITING: 5}
    kept = sorted(range(len(statuses)), key=lambda k: (order[statuses[k].status], k))[: max(count, 1)]
    return [statuses[k] for k in sorted(kept)]


def _totals(sweep: Sweep, statuses: Sequence[CaseStatus], hidden: int = 0) -> Text:
    totals = sweep.totals(statuses)
    parts = [f"{totals['cases']} cases", *(f"{totals[s]} {s}" for s in STATUSES if totals[s])]
    if totals["seconds_left"]:
        workers = max(sweep.workers, totals[RUNNING])
        parts.append(f"about {duration(totals['seconds_left'])} left, {workers} case{'s' * (workers > 1)} at a time")
    lines = [", ".join(parts), *[sweep.cluster] * bool(sweep.cluster)]
    if hidden:
        lines.append(f"({hidden} cases that wait or ended are not shown: limo status prints all)")
    return Text("\n".join([*lines, *_reasons(statuses)]), style="")


def _reasons(statuses: Sequence[CaseStatus]) -> list[str]:
    """Why cases failed, each reason once."""
    if not any(s.reason for s in statuses):
        return []
    names = short_names(s.case for s in statuses)
    names_by_reason: dict[str, list[str]] = {}
    for s in statuses:
        if s.reason:
            names_by_reason.setdefault(s.reason, []).append(names[s.case])
    return [
        f"  {', '.join(cases[:3])}{f' and {len(cases) - 3} more' * (len(cases) > 3)}: {reason}"
        for reason, cases in names_by_reason.items()
    ]


def show(sweep: Sweep, to: Console) -> list[CaseStatus]:
    """Print where all cases are; returns it."""
    statuses = sweep.look()
    to.print(table(sweep, statuses))
    return statuses


def watch(sweep: Sweep, to: Console, every: float, done: Callable[[], bool] | None = None) -> list[CaseStatus]:
    """Show a sweep every so many seconds until nothing runs or waits, or ``done`` says so; returns where all cases are then.

    A terminal that can move its cursor shows the table in place; anywhere else a line tells of each case whose status or stage
    has changed.
    """

    def over(statuses: Sequence[CaseStatus]) -> bool:
        return done() if done is not None else not any(s.status in (RUNNING, QUEUED, WAITING) for s in statuses)

    statuses = sweep.look()
    if to.is_terminal and not to.is_dumb_terminal:
        with Live(console=to, auto_refresh=False, transient=True) as live:
            while True:
                live.update(table(sweep, statuses, to.height - _OTHERS), refresh=True)
                if over(statuses):
                    break
                time.sleep(every)
                statuses = sweep.look()
    else:
        before: dict[str, CaseStatus] = {}
        while True:
            for line in changes(before, statuses):
                to.print(f"{time.strftime('%H:%M:%S')}  {line}")
            to.file.flush()
            if over(statuses):
                break
            before = {s.case: s for s in statuses}
            time.sleep(every)
            statuses = sweep.look()
    return show(sweep, to)


def changes(before: dict[str, CaseStatus], statuses: Sequence[CaseStatus]) -> list[str]:
    """A line for each case that changed its status or stage or came another tenth of P_a,max further. Waiting is no news."""
    names, lines = short_names(s.case for s in statuses), []
    for s in statuses:
        old = before.get(s.case)
        if s.status in (WAITING, QUEUED) or (old is not None and _milestone(old) == _milestone(s)):
            continue
        parts = [names[s.case], *(s.variant,) * bool(s.variant), s.status]
        if s.stage and s.actuation_pressure is not None and s.actuation_pressure_max is not None:
            parts.append(f"{s.stage}, P_a = {s.actuation_pressure:.1f} of {s.actuation_pressure_max:g} kPa")
        if s.iterations is not None:
            parts.append(f"{s.iterations} iterations")
        if s.seconds_left:
            parts.append(f"{duration(s.seconds_left)} left")
        lines.append("  ".join([*parts, s.reason]).rstrip())
    return lines


def _milestone(status: CaseStatus) -> tuple:
    pressure, maximum = status.actuation_pressure, status.actuation_pressure_max
    return status.status, status.stage, int(10 * pressure / maximum) if pressure and maximum else 0


def run_sweep(sweep: Sweep, config_file: str, studies: Sequence[str], options: Sequence[str], to: Console) -> bool:
    """Run Snakemake on some studies with ``options`` and show its cases meanwhile; returns whether it and all cases ended well.

    What Snakemake says goes to ``logs/sweep.log`` beside the results, and its end to standard error when it failed. It has a
    session of its own: Ctrl-C is handed on to it, and a terminal that is lost does not end it.
    """
    log = sweep.results.root / LOG
    log.parent.mkdir(parents=True, exist_ok=True)
    command = [sys.executable, "-m", "snakemake", *studies, *options, "--config"]
    # Snakemake reads it as YAML, where " #" would end it, and takes away quotes at the ends
    command.append(f"file= {json.dumps(config_file, ensure_ascii=False)} ")
    to.print(f"snakemake runs {', '.join(studies) or 'the studies of the configuration'}; what it says: {log}")
    with log.open("w", encoding="utf-8") as output:
        environment = os.environ | {"OMP_NUM_THREADS": "1"}
        process = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=output, stderr=subprocess.STDOUT, env=environment, start_new_session=True
        )
        try:
            statuses = watch(sweep, to, 2.0, lambda: process.poll() is not None)
        except BaseException:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGINT)
            process.wait()
            raise
    if process.returncode:
        tail = log.read_text(encoding="utf-8", errors="replace").splitlines()[-20:]
        print("\n".join([*tail, f"snakemake failed (exit code {process.returncode}); all it said: {log}"]), file=sys.stderr)
    return process.returncode == 0 and not failed(statuses)
