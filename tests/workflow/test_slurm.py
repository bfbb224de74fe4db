"""Sweeps through a real Slurm: the same results as here, and whatever happens to jobs nothing is lost or solved twice."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest
import xarray as xr
import yaml

from limo.cluster import slurm as slurm_room
from limo.reports.cluster import STUDY, WORDS, measure_sweep
from limo.store.files import read_json
from limo.store.results import Results
from limo.terminal.cli import main
from limo.terminal.monitor import LOG
from tests.helpers.slurm import daemons, lacks, one_folder_slurm
from tests.helpers.snakemake import Started, start_snakemake

from .conftest import ROOT, Project, make_project
from .test_explore import write_small

pytestmark = pytest.mark.skipif(bool(lacks()), reason=f"sweeps on Slurm are not tested: there is no {lacks()}")
PATIENCE = 300.0  # s; machines are shared
#: of a study whose cases take minutes
LONG = {"actuation_pressure_max": 60.0, "engine": "calculix", "mesh": {"level": "preview"}}
#: of a dataset what differs between two solves of one case
TIMES = ("solver_time", "python_time", "solver_memory")


@pytest.fixture(scope="module")
def cluster(tmp_path_factory):
    """A Slurm with two processors, to which this process's children submit; yields a folder that its node does not see."""
    folder = tmp_path_factory.mktemp("slurm")
    hidden, disk = folder / "hidden", folder / "disk"
    hidden.mkdir()
    disk.mkdir()
    unseen = hidden if os.geteuid() == 0 else None
    with one_folder_slurm(folder / "daemons", disk, 2, 8000, unseen) as variables, pytest.MonkeyPatch.context() as patch:
        for name, value in variables.items():
            patch.setenv(name, value)
        yield hidden
    assert not daemons(folder / "daemons")


@pytest.fixture(scope="module")
def one_folder(tmp_path_factory) -> Path:
    """The folder in which one sweep follows the other: its node is looked at once."""
    return tmp_path_factory.mktemp("project")


@pytest.fixture
def tiny(cluster, one_folder, monkeypatch):
    """``tiny(cases, ...)``: an unsolved project of cases that take seconds, in whose folder this process then is."""

    def make(cases=2, folder=one_folder, **study):
        project = tiny_project(folder, cases, **study)
        monkeypatch.chdir(folder)
        return project

    return make


def tiny_project(folder: Path, cases: int, **study):
    """The project anew; meshes that are there stay."""
    for old in ("config", "results/cases", "results/studies", "results/logs"):
        shutil.rmtree(folder / old, ignore_errors=True)
    project = make_project(folder)
    axes = {"n_pouches": [2], "ventricular_pressure": [3.8 + 0.2 * k for k in range(cases)]}
    keys = {"axes": axes, "actuation_pressure_max": 5.0, "figures": [], "frames": [0, "max"], **study}
    project.edit("studies/tiny.yaml", lambda d: d.update(keys))
    project.edit("config.yaml", lambda d: d.update(engine="newton") or d.pop("stress_test"))
    return project


@pytest.fixture(scope="module")
def quick(tmp_path_factory) -> Path:
    """The project's profile, asking more often than people may."""
    profile = yaml.safe_load((ROOT / "workflow/profiles/slurm/config.yaml").read_text())
    profile |= {"jobs": 4, "slurm-init-seconds-before-status-checks": 1, "latency-wait": 10, "retries": 1}
    folder = tmp_path_factory.mktemp("profile")
    (folder / "config.yaml").write_text(yaml.safe_dump(profile))
    return folder


def start(project, quick, *options: str, target: str = "tiny") -> Started:
    """A sweep in a process group of its own."""
    (project.folder / "snakemake.log").unlink(missing_ok=True)
    words = ("--snakefile", ROOT / "Snakefile", "--workflow-profile", quick, target, *options)
    words += ("--config", f"file={project.config_file}")
    return start_snakemake(*words, folder=project.folder, log=project.folder / "snakemake.log")


def limo_sweep(project, *options: str) -> subprocess.Popen:
    """`limo sweep --on slurm tiny`, likewise."""
    command = [sys.executable, "-m", "limo.terminal.cli", "sweep", "--on", "slurm", *options, "tiny", "--"]
    command += ["--snakefile", str(ROOT / "Snakefile"), "--slurm-init-seconds-before-status-checks", "1", "--latency-wait", "10"]
    with (project.folder / "snakemake.log").open("w") as log:
        return subprocess.Popen(command, cwd=project.folder, stdout=log, stderr=subprocess.STDOUT, start_new_session=True)


@pytest.fixture(scope="module")
def unseen(cluster, quick):
    """A sweep in a folder that the node does not see. It waits long for an answer, so another test that waits runs beside it."""
    folder = cluster / "project"
    folder.mkdir()
    project = tiny_project(folder, 1)
    with ended(start(project, quick), project) as sweep:
        yield project, sweep


def said(project) -> str:
    log = project.folder / "snakemake.log"
    return log.read_text(errors="replace") if log.exists() else ""


@contextmanager
def ended(process: Started | subprocess.Popen, project):
    """Whatever happens, neither a sweep nor its jobs outlive the test."""
    try:
        yield process
    finally:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        for pid in snakemakes(project):  # that of `limo sweep` is of no other's group
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        slurm_room.cancel(slurm_room.jobs_of(project.folder))


def snakemakes(project) -> list[int]:
    """Processes of Snakemake that work in a project's folder, those of jobs included."""
    found = []
    for entry in filter(str.isdigit, os.listdir("/proc")):
        with suppress(OSError):
            words = Path("/proc", entry, "cmdline").read_bytes().split(b"\0")
            if words[1:3] == [b"-m", b"snakemake"] and os.readlink(f"/proc/{entry}/cwd") == os.path.realpath(project.folder):
                found.append(int(entry))
    return found


def wait_for(ready, why):
    until = time.monotonic() + PATIENCE
    while time.monotonic() < until:
        if found := ready():
            return found
        time.sleep(0.1)
    raise AssertionError(f"not within {PATIENCE} s: {why()}")


def cases_with_jobs(project, queued: bool = False) -> dict[str, str]:
    """Numbers of jobs of cases that run, or wait, by case."""
    jobs = slurm_room.jobs_of(project.folder)
    return {job.case: job.number for job in jobs if job.case and job.is_queued == queued}


def numbers(project) -> set[str]:
    """Numbers of jobs of cases that wait or run."""
    return {job.number for job in slurm_room.jobs_of(project.folder) if job.case}


def all_submitted(project, count: int, more_than_run: bool = True) -> bool:
    """Whether so many cases have jobs, some of which wait."""
    jobs = [job for job in slurm_room.jobs_of(project.folder) if job.case]
    return len(jobs) == count and (not more_than_run or any(job.is_queued for job in jobs))


def statuses(project) -> dict[str, dict]:
    """What ``status.json`` says of the cases that have one."""
    return {file.parent.name: read_json(file) for file in (project.folder / "results/cases").glob("*/status.json")}


def finishes(project, quick, before: dict[str, dict]) -> None:
    """Started again the sweep ends well, what was solved was left alone, and nobody is left."""
    with ended(start(project, quick), project) as sweep:
        assert sweep.wait(PATIENCE) == 0, said(project)
    now, wanted = statuses(project), project.plan().cases
    assert {name: now[name]["status"] for name in wanted} == dict.fromkeys(wanted, "converged")
    assert {name: now[name] for name in before} == before, "solved a second time"
    assert not slurm_room.jobs_of(project.folder)
    assert project.planned("tiny") == {}


def look(capsys, *studies: str) -> dict[str, str]:
    """Status of each case by ``limo status``."""
    main(["status", "--json", *studies])
    return {case["case"]: case["status"] for case in json.loads(capsys.readouterr().out)["cases"]}


# --------------------------------------------------------------------------------------------------------------------
# sweeps that end well


def test_a_sweep_on_slurm_gives_what_a_local_one_gives_and_is_seen_meanwhile(tiny, tmp_path, capsys):
    fails = {"numerics": {"newton": {"iterations": 5}}}
    project = tiny(2, outputs=["volumes", "stress"], variants={"plain": {}, "fails": fails})
    project.edit("config.yaml", lambda d: d.update(recovery={"newton": [], "calculix": []}))
    assert main(["check", "--on", "slurm", "tiny"]) == 0
    checked = capsys.readouterr().out
    assert "on slurm: 6 jobs, at most 100 at once" in checked, "four cases, their dataset, and a look at the node"
    assert "core hours are predicted" in checked
    local = Project(tmp_path / "local")
    shutil.copytree(project.folder / "config", local.folder / "config")
    beside = start_snakemake(
        *("--snakefile", ROOT / "Snakefile", "--cores", "1", "tiny", "--config", f"file={local.config_file}"),
        folder=local.folder, log=local.folder / "snakemake.log",
    )  # fmt: skip
    sweep = limo_sweep(project)
    seen, runs = set(), set()

    def watched() -> bool:
        seen.update(look(capsys, "tiny").values())
        runs.update(run.parent for run in (project.folder / "results/cases").glob("*/run") if run.is_symlink())
        return sweep.poll() is not None

    with ended(sweep, project):
        wait_for(watched, lambda: said(project))
    assert sweep.returncode == 3, "some cases failed: " + said(project)
    assert runs, "on the node's own disk"
    assert all((case / "run").is_dir() and not (case / "run").is_symlink() for case in runs)
    assert {"waiting", "queued", "running", "converged", "diverged"} <= seen, "two processors, four cases"
    assert beside.wait(PATIENCE) == 0, said(local)
    here, there = (xr.load_dataset(p.folder / "results/studies/tiny/study.nc").drop_vars(TIMES) for p in (local, project))
    for dataset in (here, there):
        dataset.attrs.pop("git_commit", None)  # someone may commit meanwhile
    xr.testing.assert_identical(here, there)
    assert sorted(map(str, here.case_status.values.ravel())) == ["converged", "converged", "diverged", "diverged"]
    assert list(Results(project.folder / "results").slurm_logs.rglob("*.log")) == []


def test_an_exploration_goes_round_by_round_on_slurm(cluster, quick, tmp_path):
    """Its designs are jobs as all cases are; what each round proposes is learned from those before."""
    project = tiny_project(tmp_path / "project", 1)
    write_small(
        project,
        space={"n_pouches": 4, "aspect_ratio": [1.5, 2.5]},
        budget={"quick": 6, "finer": 1},
        first=4,
        held_out=0,
        baseline=None,
    )
    with ended(start(project, quick, target="small"), project) as sweep:
        assert sweep.wait(PATIENCE) == 0, said(project)
    with xr.open_dataset(project.folder / "results/explorations/small/exploration.nc") as dataset:
        assert dataset.sizes["design"] == 6
        assert dataset.status.isin(["converged", "degraded"]).all()
        assert (dataset.sizes["recommended"], str(dataset.recommended_status.values[0])) == (1, "converged")
    submitted = said(project).count("has been submitted with SLURM jobid")
    assert submitted >= 7, "each design is a job"


def test_twenty_cases_with_a_stand_in_for_the_solve(cluster, quick, tmp_path):
    rows = {row["what"]: row["value"] for row in measure_sweep(tmp_path / "many", 20, ROOT, quick, 4, 0.1)}
    assert rows.keys() < WORDS.keys()
    found = [read_json(file) for file in (tmp_path / "many/results/cases").glob("*/status.json")]
    assert len(found) == 20
    assert xr.open_dataset(tmp_path / f"many/results/studies/{STUDY}/study.nc").case_status.size == 20
    assert rows["job_cpu"] < 10, "s; a busy machine takes more than the figures of docs/performance.md"
    assert rows["job_memory"] < 400


# --------------------------------------------------------------------------------------------------------------------
# jobs that end otherwise


def test_too_much_memory_and_a_cancelled_job_are_tried_again_with_more(tiny, quick):
    project = tiny(2)
    more = ("--retries", "2", "--set-resources", "solve_case:mem_mb=200*attempt**3")
    with ended(start(project, quick, *more), project) as sweep:
        first = wait_for(lambda: all_submitted(project, 2, False) and numbers(project), lambda: said(project))
        second = wait_for(lambda: numbers(project) - first, lambda: said(project))
        assert "Trying to restart" in said(project), "200 MiB are too little"
        subprocess.run(["scancel", second.pop()], check=True)
        assert sweep.wait(PATIENCE) == 0, said(project)
    assert said(project).count("Trying to restart") == 3
    finishes(project, quick, statuses(project))


@pytest.mark.usefixtures(*["unseen"] * (os.geteuid() == 0))
def test_a_case_beyond_its_time_fails_alone_and_is_solved_by_the_next_sweep(tiny, quick, capsys):
    project = tiny(2)
    with ended(start(project, quick, "--retries", "0"), project) as sweep:
        wait_for(lambda: len(solvers(project)) > 0, lambda: said(project))
        victim, pid = next(iter(solvers(project).items()))
        os.kill(pid, signal.SIGSTOP)
        # a limit is a minute at least, and its end may be put forward
        job = cases_with_jobs(project)[victim]
        subprocess.run(["scontrol", "update", f"JobId={job}", "EndTime=now+2"], check=True)
        assert sweep.wait(PATIENCE) != 0
    found = look(capsys, "tiny")
    assert sorted(found.values()) == ["converged", "crashed"]
    assert found[victim] == "crashed"
    main(["status", "tiny"])
    assert "its job ran out of time" in capsys.readouterr().out
    finishes(project, quick, statuses(project))


def solvers(project) -> dict[str, int]:
    """Processes that solve, by case: whoever holds the lock."""
    found = {}
    for lock in (project.folder / "results/cases").glob("*/lock"):
        with suppress(OSError, IndexError, ValueError):
            found[lock.parent.name] = int(lock.read_text().split()[1])
    return found


def test_ctrl_c_ends_all_jobs_and_those_of_a_killed_sweep_can_be_cancelled(tiny, quick, capsys):
    project = tiny(3)
    with ended(start(project, quick), project) as sweep:
        wait_for(lambda: all_submitted(project, 3), lambda: said(project))
        os.killpg(sweep.pid, signal.SIGINT)
        assert sweep.wait(PATIENCE) != 0
        wait_for(lambda: not slurm_room.jobs_of(project.folder), lambda: slurm_room.jobs_of(project.folder))
    before = statuses(project)
    with ended(start(project, quick), project) as sweep:
        wait_for(lambda: cases_with_jobs(project), lambda: said(project))
        os.killpg(sweep.pid, signal.SIGKILL)
        sweep.wait()
        with ended(limo_sweep(project, "--left", "cancel"), project) as again:
            assert again.wait(PATIENCE) == 0, said(project)
    assert re.search("[1-3] jobs were cancelled", said(project))
    assert "Solve limo_np" in sweep_log(project)
    assert main(["jobs", "cancel"]) == 0
    assert "0 jobs were cancelled" in capsys.readouterr().out
    finishes(project, quick, before)


def test_after_kill_9_no_case_is_solved_twice(tiny, quick, capsys):
    project = tiny(3)
    with ended(start(project, quick), project) as sweep:
        wait_for(lambda: all_submitted(project, 3), lambda: said(project))
        os.killpg(sweep.pid, signal.SIGKILL)
        sweep.wait()
        assert len(slurm_room.jobs_of(project.folder)) == 3, "Slurm's jobs run on"
        for refused in (project.snakemake("tiny", "--workflow-profile", str(quick), cores=None), project.snakemake("tiny")):
            assert refused.returncode != 0
            assert "`limo jobs adopt` waits for their results" in refused.stdout + refused.stderr
        assert main(["jobs"]) == 0
        assert "jobs wait or run" in capsys.readouterr().out
        assert set(look(capsys, "tiny").values()) <= {"queued", "running", "converged"}
        with ended(limo_sweep(project, "--left", "adopt"), project) as again:
            assert again.wait(PATIENCE) == 0, said(project)
    assert "jobs have ended; their results count" in said(project)
    log = sweep_log(project)
    assert ("Solve limo_np" in log, "Gather tiny" in log) == (False, True)
    assert len(statuses(project)) == 3
    assert main(["jobs", "adopt"]) == 0
    finishes(project, quick, statuses(project))


def sweep_log(project) -> str:
    """What Snakemake said below `limo sweep`."""
    return (project.folder / "results" / LOG).read_text()


# --------------------------------------------------------------------------------------------------------------------
# what is refused before the first job


@pytest.mark.parametrize(
    ("options", "says", "study"),
    [
        (["--default-resources", "slurm_partition=nowhere"], ("no such partition", "there are main"), {}),
        (["--set-resources", "solve_case:runtime=120"], ("asks for 120 min", "ends jobs after 60 min", "runtime=60"), {}),
        (["--set-resources", "solve_case:mem_mb=9000"], ("asks for 9000 MiB", "no node"), {}),
        (["--set-resources", "solve_case:runtime=1"], ("limit of 1 min is below the", "min that are predicted"), LONG),
    ],
)
def test_what_would_end_a_thousand_jobs_is_one_message(tiny, quick, options, says, study):
    project = tiny(1, **study)
    done = project.snakemake("tiny", "--workflow-profile", str(quick), *options, cores=None)
    assert done.returncode != 0
    assert all(text in done.stderr + done.stdout for text in says), done.stderr
    assert "has been submitted" not in done.stderr + done.stdout
    assert "Traceback" not in done.stderr + done.stdout


def test_without_sbatch_it_is_one_message(tiny, monkeypatch, capsys):
    tiny(1)
    monkeypatch.setenv("PATH", str(Path(sys.executable).parent))
    assert main(["sweep", "--on", "slurm", "tiny"]) == 1
    assert "sbatch: no such program here" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("lines", "says"),
    [
        pytest.param(
            "echo Version 2.20", "solver.command",
            marks=pytest.mark.skipif(os.geteuid() != 0, reason="a build is hidden from the node by root only"),
        ),
        ('[ "$1" != -v ] && kill -s ILL $$; echo Version 2.20', "calculix does not iterate here (crashed: ended by signal 4)"),
    ],
    ids=["hidden", "signal"],
)  # fmt: skip
def test_a_build_that_does_not_run_on_the_node_is_one_message(tiny, quick, cluster, tmp_path, lines, says):
    ccx = (cluster if says == "solver.command" else tmp_path) / "ccx"
    ccx.write_text(f"#!/bin/sh\n{lines}\n")
    ccx.chmod(0o755)
    project = tiny(1)
    project.edit("config.yaml", lambda d: d.update(engine="calculix", solver={"command": str(ccx)}))
    done = project.snakemake("tiny", "--workflow-profile", str(quick), cores=None)
    assert done.returncode != 0
    assert says in done.stderr + done.stdout
    assert "node " in done.stderr + done.stdout
    assert "has been submitted" not in done.stderr + done.stdout


@pytest.mark.skipif(os.geteuid() != 0, reason="a folder is hidden from the node by root only")
def test_a_folder_that_the_node_does_not_see_is_one_message(unseen):
    project, sweep = unseen
    assert sweep.wait(PATIENCE) != 0
    assert "is not shared with the nodes" in said(project)
    assert "has been submitted" not in said(project)
