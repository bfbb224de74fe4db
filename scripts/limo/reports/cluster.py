"""What a sweep on a cluster takes beside its solves: many cases, with a stand-in for the solve behind the real rules."""

from __future__ import annotations

import os
import re
import resource
import shutil
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import pandas as pd
import yaml

from limo.cases.plan import Plan, make_plan
from limo.cluster import slurm
from limo.cluster.profile import read_profile
from limo.config.builds import open_project
from limo.errors import LimoError
from limo.reports import stand_in
from limo.reports.markdown import markdown_table, rows_if_any
from limo.store.files import write_whole
from limo.store.machine import processor
from limo.store.results import Results

COLUMNS = ("what", "cases", "value", "unit", "bound", "runs", "machine")
STUDY = "many"
#: what is measured, in words
WORDS = {
    "sweep": "a sweep of cases that take one second, wall time of each",
    "in_flight": "most jobs that waited or ran at once",
    "job_cpu": "a job beside its solve: CPU time of Snakemake, of Slurm's commands and of the start of the script",
    "main_cpu": "Snakemake on the login node: CPU time of each case",
    "overhead": "both: CPU time of each case beside its solve",
    "job_memory": "a job beside its script: memory",
    "dry_run_local": "dry run on one machine",
    "dry_run": "dry run for the cluster",
    "dry_run_ratio": "dry run for the cluster over that on one machine",
    "status": "`limo status`, wall time",
    "status_cpu": "`limo status`, CPU time",
    "gather_time": "gathering",
    "gather_memory": "gathering, memory",
    "page_time": "page of results",
    "page_memory": "page of results, memory",
    "page_size": "page of results, size",
    "page_left_out": "cases that its 3D view leaves out, and says so",
}
#: the most that each may take, in its unit
BOUNDS = {
    "overhead": 5.0, "job_memory": 300.0, "dry_run_ratio": 1.5, "status": 2.0, "gather_time": 120.0, "gather_memory": 2048.0,
}  # fmt: skip
_EVERY, _ASK = 0.2, 2.0  # s between two looks at processes, and between two questions to Slurm
_TICK = os.sysconf("SC_CLK_TCK")


# --------------------------------------------------------------------------------------------------------------------
# the study


def make_folder(folder: Path, cases: int, root: Path, pouches: Sequence[int], pressure: float) -> None:
    """A folder with the project's configuration and a study of so many cases of very coarse devices.

    They are as many for each number of ``pouches``, and are inflated up to a ``pressure`` in kPa.
    """
    shutil.copytree(root / "config", folder / "config")
    for study in (folder / "config" / "studies").iterdir():
        study.unlink()
    pressures = [round(3 + 0.02 * k * len(pouches) / 4, 3) for k in range(cases // len(pouches))]
    axes = {"n_pouches": [*pouches], "ventricular_pressure": pressures}
    study = {"description": "many cases", "axes": axes, "actuation_pressure_max": pressure, "figures": [], "outputs": ["volumes"]}
    (folder / "config" / "studies" / f"{STUDY}.yaml").write_text(yaml.safe_dump(study), encoding="utf-8")
    file = folder / "config" / "config.yaml"
    data = yaml.safe_load(file.read_text(encoding="utf-8"))
    data["mesh_levels"]["tiny"] = {"degrees_of_freedom": 3000, "grading": 1.0}
    data |= {"studies": [STUDY], "engine": "newton", "mesh": {**data["mesh"], "level": "tiny"}}
    data.pop("stress_test", None)
    file.write_text(yaml.safe_dump(data), encoding="utf-8")


def solve_one_a_mesh(folder: Path, plan: Plan, snakefile: Path) -> Path:
    """Solve one case of each mesh for real, on this machine; returns a folder of them by the names of their meshes."""
    first = {plan.cases[case_id].mesh_id: case_id for case_id in reversed(plan.of_study(STUDY))}
    results, solved = Results(folder / "results"), folder / "solved"
    targets = [str(results.case(case_id).status.relative_to(folder)) for case_id in first.values()]
    _snakemake([*targets, "--cores", "2"], folder, snakefile, os.environ | {"OMP_NUM_THREADS": "1"})
    solved.mkdir()
    for mesh_id, case_id in first.items():
        shutil.move(results.case(case_id).folder, solved / mesh_id)
    return solved


def pretend(folder: Path, plan: Plan, solved: Path) -> None:
    """Results of all cases without a sweep."""
    results = Results(folder / "results")
    for case_id in plan.of_study(STUDY):
        case = plan.cases[case_id]
        stand_in.copy_solved(case, solved / case.mesh_id, results.case(case_id).folder, plan.recovery_of(case_id))


# --------------------------------------------------------------------------------------------------------------------
# measurements


def measure(name: str, few: int, many: int, runs: int = 3, profile: Path | None = None) -> pd.DataFrame:
    """A sweep of ``few`` cases on the cluster of a profile, the rest of the measurements with ``many``; 0 leaves a part out.

    Processes are looked at on this machine: its nodes must be this machine.
    """
    root, found = Path(__file__).parents[3], read_profile(name)
    rows = []
    with tempfile.TemporaryDirectory(prefix="limo_cluster_") as temporary:
        if few:
            rows += measure_sweep(Path(temporary) / "few", few, root, profile or found.folder, found.jobs)
        if many:
            rows += measure_many(Path(temporary) / "many", many, root, found.folder, runs)
    return pd.DataFrame(rows, columns=[*COLUMNS])


def measure_sweep(folder: Path, cases: int, root: Path, profile: Path, jobs: int, seconds: float = 1.0) -> list[dict[str, Any]]:
    """Run a sweep of so many cases through the cluster, ``jobs`` at once at most, and look at its processes.

    A solve takes so many ``seconds``.
    """
    plan, solved = _prepared(folder, cases, root, [4], 10.0)
    environment = stand_in.install(folder / "stand_in", solved, seconds)
    start = time.monotonic()
    with watched(folder) as seen:
        _snakemake([STUDY, "--workflow-profile", str(profile)], folder, root / "Snakefile", environment)
    wall = time.monotonic() - start
    solving = [job for job in seen.jobs.values() if job.solved]
    lacking = [c for c in plan.of_study(STUDY) if not Results(folder / "results").case(c).status.exists()]
    if lacking or not solving:
        raise LimoError(f"{folder}: {len(lacking)} of {cases} cases have no result")
    job_cpu, main_cpu = statistics.mean(job.cpu for job in solving), seen.main / cases
    return [
        row("sweep", cases, wall / cases, "s"),
        row("in_flight", cases, seen.most, "", bound=jobs),
        row("job_cpu", cases, job_cpu, "s"),
        row("main_cpu", cases, main_cpu, "s"),
        row("overhead", cases, job_cpu + main_cpu, "s"),
        row("job_memory", cases, max(job.memory for job in solving), "MiB"),
    ]


def measure_many(folder: Path, cases: int, root: Path, profile: Path, runs: int = 3) -> list[dict[str, Any]]:
    """Plan a sweep of so many cases, look at it when all is solved, and gather it."""
    plan, solved = _prepared(folder, cases, root, [4, 6, 8, 10], 30.0)
    snakefile, environment = root / "Snakefile", dict(os.environ)
    local, cluster = [], []
    for _ in range(runs):  # in turns: a busy machine burdens both
        words = [STUDY, "-n", "--quiet", "--cores", "1"]
        local.append(_times(lambda words=words: _snakemake(words, folder, snakefile, environment))[1])
        words = [STUDY, "-n", "--quiet", "--workflow-profile", str(profile)]
        cluster.append(_times(lambda words=words: _snakemake(words, folder, snakefile, environment))[1])
    pretend(folder, plan, solved)
    status = [sys.executable, "-m", "limo.terminal.cli", "status"]
    looks = [_times(lambda: _run(status, folder, _with_package(environment, root))) for _ in range(runs)]
    done = []
    for task in ("gather", "page"):
        code = f"import limo.reports.cluster as c; print(c.{task}({STUDY!r}))"
        said = _run([sys.executable, "-c", code], folder, _with_package(environment, root)).splitlines()[-1]
        done.append([float(number) for number in said.split()])
    (seconds, memory), (page_seconds, page_memory, size, shown) = done
    before, here = statistics.median(local), statistics.median(cluster)
    return [
        row("dry_run_local", cases, before, "s CPU", runs),
        row("dry_run", cases, here, "s CPU", runs),
        row("dry_run_ratio", cases, here / before, "", runs),
        row("status", cases, statistics.median(wall for wall, _ in looks), "s", runs),
        row("status_cpu", cases, statistics.median(cpu for _, cpu in looks), "s CPU", runs),
        row("gather_time", cases, seconds, "s"),
        row("gather_memory", cases, memory, "MiB"),
        row("page_time", cases, page_seconds, "s"),
        row("page_memory", cases, page_memory, "MiB"),
        row("page_size", cases, size, "MB"),
        row("page_left_out", cases, cases - shown, ""),
    ]


def gather(study: str) -> str:
    """Gather a study as its rule does, in this process: wall time in s, peak memory in MiB."""
    from limo.datasets.study import gather_study
    from limo.store.files import write_netcdf

    start = time.monotonic()
    project = open_project("config/config.yaml")
    plan = make_plan(project)
    dataset = gather_study(project, study, Path("results/cases"), plan.sources(study))
    write_netcdf(dataset, Results(Path("results")).study(study).dataset, checked=False)
    return f"{time.monotonic() - start:.2f} {_most_memory():.1f}"


def page(study: str) -> str:
    """Write the page of a gathered study, in this process: wall time in s, peak memory in MiB, MB, cases in its 3D view."""
    from limo.page.write import write_page

    start = time.monotonic()
    project = open_project("config/config.yaml")
    said = write_page(Path("results"), {study: project.studies[study]})
    cases, size = re.search(r"(\d+) cases in three dimensions, ([\d.]+) MB", said).groups()
    return f"{time.monotonic() - start:.2f} {_most_memory():.1f} {size} {cases}"


def _most_memory() -> float:
    """Peak memory of this process in MiB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def row(what: str, cases: int, value: float, unit: str, runs: int = 1, bound: float | None = None) -> dict[str, Any]:
    """A line of the table; the bound is in the same unit, NaN where there is none."""
    bound = BOUNDS.get(what, float("nan")) if bound is None else float(bound)
    shown = round(value, 2)
    return {"what": what, "cases": cases, "value": shown, "unit": unit, "bound": bound, "runs": runs, "machine": processor()}


def _prepared(folder: Path, cases: int, root: Path, pouches: Sequence[int], pressure: float) -> tuple[Plan, Path]:
    make_folder(folder, cases, root, pouches, pressure)
    before = Path.cwd()
    os.chdir(folder)  # a plan is one of the folder in which it is made
    try:
        plan = make_plan(open_project("config/config.yaml"))
    finally:
        os.chdir(before)
    return plan, solve_one_a_mesh(folder, plan, root / "Snakefile")


# --------------------------------------------------------------------------------------------------------------------
# processes


class Job:
    """What the processes of one Slurm job took: CPU time in s, and MiB at once of all but its script; whether it solved."""

    def __init__(self) -> None:
        self.cpu, self.memory, self.solved = 0.0, 0.0, False

    def saw(self, processes: Sequence[tuple[int, int, float, float, str]]) -> None:
        """Take account of its processes at one moment: number, that of the parent, s, MiB, command.

        The time of a process has that of its children that have ended. A process that has not yet become another program shares
        the memory of its parent.
        """
        self.cpu = max(self.cpu, sum(cpu for _, _, cpu, _, _ in processes))
        commands = {pid: command for pid, *_, command in processes}
        own = [p for p in processes if commands.get(p[1]) != p[4] and "scripts/tmp" not in p[4]]
        self.memory = max(self.memory, sum(memory for *_, memory, _ in own))
        self.solved = self.solved or any("solve_case.py" in command for command in commands.values())


class Seen:
    """The jobs of a folder by their numbers, most at once, and CPU time (s) of the process that submits them."""

    def __init__(self) -> None:
        self.jobs: dict[str, Job] = defaultdict(Job)
        self.main, self.most = 0.0, 0


@contextmanager
def watched(folder: Path) -> Iterator[Seen]:
    """Look at the processes that work in a folder on this machine as long as the block lasts.

    What a job takes after the last look at it is missed: a tenth of a second in the mean.
    """
    seen, over = Seen(), threading.Event()

    def look() -> None:
        asked = 0.0
        while not over.wait(_EVERY):
            _look(os.path.realpath(folder), seen)
            if time.monotonic() > asked + _ASK:
                asked = time.monotonic()
                with suppress(LimoError):  # Slurm may be busy
                    seen.most = max(seen.most, len(slurm.jobs_of(folder)))

    watcher = threading.Thread(target=look, daemon=True)
    watcher.start()
    try:
        yield seen
    finally:
        over.set()
        watcher.join()


def _look(folder: str, seen: Seen) -> None:
    now: dict[str, list[tuple[int, int, float, float, str]]] = defaultdict(list)
    for entry in filter(str.isdigit, os.listdir("/proc")):
        process = Path("/proc") / entry
        with suppress(OSError, ValueError):
            if os.readlink(process / "cwd") != folder:
                continue
            variables = dict(v.partition(b"=")[::2] for v in (process / "environ").read_bytes().split(b"\0"))
            numbers = (process / "stat").read_text().rpartition(")")[2].split()
            cpu = sum(map(int, numbers[11:15])) / _TICK
            command = (process / "cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace")
            if job := variables.get(b"SLURM_JOB_ID", b"").decode():
                memory = int(numbers[21]) * os.sysconf("SC_PAGE_SIZE") / 2**20
                now[job].append((int(entry), int(numbers[1]), cpu, memory, command))
            elif "-m snakemake" in command:
                seen.main = max(seen.main, cpu)
    for job, processes in now.items():
        seen.jobs[job].saw(processes)


def _with_package(environment: dict[str, str], root: Path) -> dict[str, str]:
    path = os.pathsep.join(filter(None, [str(root / "scripts"), environment.get("PYTHONPATH", "")]))
    return environment | {"PYTHONPATH": path, "OMP_NUM_THREADS": "1"}


def _snakemake(words: Sequence[str], folder: Path, snakefile: Path, environment: dict[str, str]) -> str:
    command = [sys.executable, "-m", "snakemake", "--snakefile", str(snakefile), *words, "--config", "file=config/config.yaml"]
    return _run(command, folder, environment)


def _run(command: Sequence[str], folder: Path, environment: dict[str, str]) -> str:
    """What a command prints. Raises ``LimoError`` where it fails."""
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    if done.returncode:
        said = "\n".join((done.stdout + done.stderr).strip().splitlines()[-5:])
        raise LimoError(f"{' '.join(command)} failed: {said}")
    return done.stdout


def _times(task: Callable[[], Any]) -> tuple[float, float]:
    """Wall time and CPU time (s) of a task's processes."""
    start, before = time.perf_counter(), resource.getrusage(resource.RUSAGE_CHILDREN)
    task()
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.perf_counter() - start, after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime


# --------------------------------------------------------------------------------------------------------------------
# kept rows


def keep(rows: pd.DataFrame, file: Path) -> pd.DataFrame:
    """Write rows as CSV, in the place of those of the same in the file; returns all. Raises ``ResultError``."""
    before = read_cluster(file)
    every = pd.concat([rows, before[~before.what.isin(rows.what)]]) if len(before) else rows
    every = every.sort_values("what", key=lambda column: column.map({what: k for k, what in enumerate(WORDS)}), kind="stable")
    write_whole(file, lambda path: every.to_csv(path, index=False))
    return every


def read_cluster(file: Path) -> pd.DataFrame:
    """The rows that ``keep`` wrote, none if there is no file. Raises ``ResultError``."""
    return rows_if_any(file, "measured sweeps on a cluster", COLUMNS)


def cluster_table(rows: pd.DataFrame) -> str:
    """The rows as a markdown table."""
    lines = []
    for r in rows.itertuples():
        bounded = r.bound == r.bound
        met = ("yes" if r.value <= r.bound else "no") if bounded else "-"
        unit = "" if r.unit != r.unit else r.unit
        bound = f"at most {r.bound:g} {unit}".rstrip() if bounded else "-"
        lines.append((WORDS.get(r.what, r.what), r.cases, f"{r.value:g} {unit}".rstrip(), bound, met, r.runs))
    return markdown_table(pd.DataFrame(lines, columns=["what", "cases", "measured", "bound", "met", "runs"]))
