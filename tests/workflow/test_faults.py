"""Real sweeps that are killed, starved and damaged: started again they finish, solve nothing twice and leave nobody behind.

``LIMO_ROUNDS`` repeats the kills at other random moments; ``LIMO_RECORD`` names a CSV that takes a row a fault, of which
docs/reliability.md is made.
"""

from __future__ import annotations

import csv
import os
import random
import shlex
import signal
import subprocess
import time
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

from limo.engines.calculix import build as ccx_build
from limo.schema.solver import Solver
from limo.store.files import read_json
from tests.helpers.shared import made_once
from tests.helpers.snakemake import Started, start_snakemake

from .conftest import ROOT, copied, make_project, run

PATIENCE = 900.0  # s; machines are shared
ROUNDS = int(os.environ.get("LIMO_ROUNDS", "1"))
RESULTS = ("case.json", "status.json", "volumes.nc", "frames.nc")
root_only = pytest.mark.skipif(os.geteuid() != 0, reason="mounting takes root")


@pytest.fixture
def tiny(tmp_path):
    """``tiny(engine, cases)``: an unsolved project with one or two cases that take seconds."""

    def make(engine="newton", cases=1):
        project = make_project(tmp_path / "project")
        axes = {"n_pouches": [2, 4][:cases], "ventricular_pressure": [3.8]}
        project.edit(
            "studies/tiny.yaml", lambda d: d.update(axes=axes, actuation_pressure_max=5.0, figures=[], frames=[0, "max"])
        )
        project.edit("config.yaml", lambda d: d.update(engine=engine) or d.pop("stress_test"))
        return project

    return make


@pytest.fixture
def record(request):
    """``record(what, then)``: keep what a fault did and what the restart did, when asked to."""
    began = time.monotonic()

    def keep(what: str, then: str) -> None:
        if file := os.environ.get("LIMO_RECORD"):
            with Path(file).open("a", newline="", encoding="utf-8") as handle:
                test = request.node.originalname.removeprefix("test_").replace("_", " ")
                csv.writer(handle, lineterminator="\n").writerow([test, what, then, round(time.monotonic() - began)])

    return keep


def start(project, *, fresh: bool = False) -> Started:
    """A sweep in a process group of its own."""
    words = ("--snakefile", ROOT / "Snakefile", "--cores", "1", "--config", f"file={project.config_file}")
    return start_snakemake(*words, folder=project.folder, log=project.folder / "snakemake.log", fresh=fresh)


def said(project) -> str:
    """What Snakemake said so far; a forked one may not have begun to."""
    log = project.folder / "snakemake.log"
    return log.read_text(errors="replace") if log.exists() else ""


def inside(project) -> dict[int, str]:
    """Processes that work in a project's folder, by what they run."""
    found = {}
    for entry in filter(str.isdigit, os.listdir("/proc")):
        with suppress(OSError):
            if int(entry) != os.getpid() and os.readlink(f"/proc/{entry}/cwd").startswith(str(project.folder)):
                found[int(entry)] = Path(f"/proc/{entry}/cmdline").read_bytes().replace(b"\0", b" ").decode()
    return found


def wait_for(ready, why: str):
    until = time.monotonic() + PATIENCE
    while time.monotonic() < until:
        if found := ready():
            return found
        time.sleep(0.02)
    raise AssertionError(f"not within {PATIENCE} s: {why}")


def solvers(project) -> list[int]:
    return [pid for pid, command in inside(project).items() if command.split()[:1] and "ccx deck" in command]


def iterating(project) -> bool:
    """Whether some engine has made a step."""
    folder = project.folder / "results" / "cases"
    return any(f.stat().st_size > 0 for p in ("*/run/progress.json", "*/run/deck.cvg") for f in folder.glob(p))


def random_moment(seed: int) -> None:
    time.sleep(random.Random(seed).uniform(0.0, 2.0))


def nobody_left(project) -> None:
    wait_for(lambda: not inside(project), f"processes left: {inside(project)}")


def solved(project) -> dict[str, str]:
    """The cases that converged, and their statuses, in which the seconds of another solve would be others."""
    folder = project.folder / "results" / "cases"
    found = {}
    for file in folder.glob("*/status.json"):
        if read_json(file)["status"] == "converged":
            found[file.parent.name] = file.read_text()
    return found


def whole(project) -> None:
    """What bears the name of a result is one: a case has all of its files or no status."""
    for folder in (project.folder / "results" / "cases").glob("*"):
        if (folder / "status.json").exists():
            assert all((folder / name).exists() for name in RESULTS), sorted(p.name for p in folder.iterdir())


def finishes(project, before: dict[str, str] | None = None) -> None:
    """Started again the sweep ends well, and what had converged before was left alone."""
    run(project, cores=1)
    now = solved(project)
    assert len(now) == len(project.plan().cases)
    assert {name: now[name] for name in before or {}} == (before or {}), "solved a second time"
    assert project.planned() == {}
    assert not list((project.folder / "results").rglob("*.frd"))
    nobody_left(project)


@contextmanager
def ended(process: Started):
    """Whatever happens, no process of a sweep outlives the test."""
    try:
        yield process
    finally:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()


# --------------------------------------------------------------------------------------------------------------------
# kills


@pytest.mark.parametrize("seed", range(ROUNDS))
def test_kill_9_of_ccx(tiny, record, seed):
    project = tiny("calculix", 2)
    with ended(start(project)) as sweep:
        wait_for(lambda: iterating(project) and solvers(project), said(project))
        random_moment(seed)
        (pid,) = wait_for(lambda: solvers(project), "a solver")
        os.kill(pid, signal.SIGKILL)
        assert sweep.wait(PATIENCE) == 0, said(project)
    before = solved(project)
    (broken,) = [
        s for s in map(read_json, (project.folder / "results/cases").glob("*/status.json")) if s["status"] != "converged"
    ]
    assert (broken["status"], broken["interrupted"]) == ("crashed", True)
    assert "killed from outside by signal 9" in broken["reason"]
    assert project.planned()["solve_case"] == 1
    finishes(project, before)
    record("the case is `crashed`, the other one converges", "that case is solved")


@pytest.mark.parametrize("engine", ["newton", "calculix"])
@pytest.mark.parametrize("victim", ["snakemake", "process group"])
@pytest.mark.parametrize("seed", range(ROUNDS))
def test_kill_9_of_a_sweep(tiny, record, engine, victim, seed):
    if ROUNDS == 1 and (engine == "newton") == (victim == "snakemake"):
        pytest.skip("each once; LIMO_ROUNDS takes all")
    project = tiny(engine)
    with ended(start(project, fresh=True)) as sweep:  # its scripts look for the process of this name
        wait_for(lambda: iterating(project), said(project))
        random_moment(seed)
        (os.kill if victim == "snakemake" else os.killpg)(sweep.pid, signal.SIGKILL)
        sweep.wait()
        began = time.monotonic()
        nobody_left(project)
    took = time.monotonic() - began
    whole(project)
    finishes(project, solved(project))
    record(f"{victim}, {engine}: nobody left after {took:.1f} s", "finished, no unlocking by hand")


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGKILL])
def test_ended_between_a_result_and_its_report(tiny, record, how):
    """All files of a case are written, and Snakemake does not know yet: it removes them before it starts the job again."""
    project = tiny("newton")
    with ended(start(project)) as sweep:
        wait_for(lambda: list((project.folder / "results/cases").glob("*/.kept/status.json")), said(project))
        os.killpg(sweep.pid, how)
        sweep.wait(60)
        nobody_left(project)
    before = solved(project)
    assert len(before) == 1
    finishes(project, before)
    record(f"{signal.Signals(how).name} when a case has just been written", "finished, the case is taken as it is")


@pytest.mark.parametrize("engine", ["newton", "calculix"])
def test_ctrl_c(tiny, record, engine):
    if ROUNDS == 1 and engine == "newton":
        pytest.skip("LIMO_ROUNDS takes both")
    project = tiny(engine)
    with ended(start(project)) as sweep:
        wait_for(lambda: iterating(project), said(project))
        random_moment(7)
        os.killpg(sweep.pid, signal.SIGINT)
        assert sweep.wait(60) != 0
        nobody_left(project)
    whole(project)
    finishes(project, solved(project))
    record(f"{engine}: ends at once, nobody left", "finished")


# --------------------------------------------------------------------------------------------------------------------
# a machine that lacks something


@contextmanager
def small_disk(folder: Path, size: str):
    """``folder`` on a file system of its own; yields a function that mounts it again with other options."""
    folder.mkdir(parents=True)
    if subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", folder], capture_output=True).returncode:
        pytest.skip("this machine lets nobody mount")
    try:
        yield lambda options: subprocess.run(["mount", "-o", f"remount,{options}", folder], check=True)
    finally:
        subprocess.run(["umount", "-l", folder], check=True)


@root_only
def test_full_disk(tiny, record):
    project = tiny("calculix")
    with small_disk(project.folder / "results", "500k") as remount:
        with ended(start(project)) as sweep:
            code = sweep.wait(PATIENCE)
        assert not solved(project)
        whole(project)
        nobody_left(project)
        remount("size=500m")
        finishes(project)
    record(f"snakemake ends with exit code {code}, no result", "finished once there is room")


@root_only
def test_read_only_results(tiny, record):
    project = tiny("newton")
    with small_disk(project.folder / "results", "100m") as remount:
        remount("ro")
        with ended(start(project)) as sweep:
            assert sweep.wait(PATIENCE) != 0
        assert "Read-only file system" in said(project)
        remount("rw")
        finishes(project)
    record("snakemake names the file it cannot write", "finished once it may write")


def test_no_memory(tiny, record, tmp_path):
    """First the solver's libraries find no room, then its arrays."""
    project = tiny("calculix")
    ccx, limit = ccx_build.find_ccx(Solver()), tmp_path / "limit"
    command = tmp_path / "ccx"
    lines = '[ "$1" = deck ] && [ -f {limit} ] && ulimit -v $(cat {limit})\nexec {ccx} "$@"'
    command.write_text("#!/bin/sh\n" + lines.format(limit=shlex.quote(str(limit)), ccx=shlex.quote(str(ccx))) + "\n")
    command.chmod(0o755)
    project.edit("config.yaml", lambda d: d.update(solver={"command": str(command)}))
    for kilobytes in (60_000, 200_000):
        limit.write_text(str(kilobytes))
        done = project.snakemake(cores=1)
        assert done.returncode == 0, done.stdout + done.stderr
        (status,) = map(read_json, (project.folder / "results/cases").glob("*/status.json"))
        assert (status["status"], status["interrupted"]) == ("crashed", True), status["reason"]
        assert "not enough memory" in status["reason"]
    limit.unlink()
    finishes(project)
    record("`crashed`: not enough memory", "solved once there is memory")


def test_a_solver_that_hangs(tiny, record):
    """Stopped, not ended: it makes no iteration any more, and a second attempt does."""
    project = tiny("calculix")
    project.edit("config.yaml", lambda d: d.update(solver={"stall_limit": 0.25}))
    with ended(start(project)) as sweep:
        wait_for(lambda: iterating(project) and solvers(project), said(project))
        os.kill(solvers(project)[0], signal.SIGSTOP)
        assert sweep.wait(PATIENCE) == 0, said(project)
    (status,) = map(read_json, (project.folder / "results/cases").glob("*/status.json"))
    first, *rest = status["attempts"]
    assert first["status"] == "timed_out"
    assert "without a Newton iteration" in first["reason"]
    assert rest
    assert status["status"] == "converged"
    finishes(project, solved(project))
    record(f"`timed_out`, then the rung {rest[-1]['rung']} converges", "nothing to do")


# --------------------------------------------------------------------------------------------------------------------
# files, clocks, company


@pytest.fixture
def finished(tmp_path):
    """A copy of a project with two solved cases."""

    def make(folder):
        project = make_project(folder)
        axes = {"n_pouches": [2], "ventricular_pressure": [3.8, 4.8]}
        changes = {"axes": axes, "actuation_pressure_max": 5.0, "figures": [], "frames": [0, "max"]}
        project.edit("studies/tiny.yaml", lambda d: d.update(changes))
        project.edit("config.yaml", lambda d: d.update(engine="newton") or d.pop("stress_test"))
        run(project, cores=1)
        assert len(solved(project)) == 2

    return copied(made_once("two_cases", make), tmp_path / "copy")


def truncate(file: Path) -> None:
    os.truncate(file, file.stat().st_size // 2)


def flip(file: Path) -> None:
    data = bytearray(file.read_bytes())
    data[2 * len(data) // 3] ^= 0xFF
    file.write_bytes(data)


def garbage(file: Path) -> None:
    file.write_bytes(b'{"status": ["\xff')


@pytest.mark.parametrize(
    ("name", "damage"),
    [("volumes.nc", truncate), ("frames.nc", flip), ("status.json", truncate), ("status.json", garbage), ("case.json", garbage)],
)
def test_damaged_files(finished, record, name, damage):
    if ROUNDS == 1 and (name, damage) not in (("frames.nc", flip), ("status.json", truncate)):
        pytest.skip("LIMO_ROUNDS takes all")
    victim, other = sorted(solved(finished))
    damage(finished.folder / "results" / "cases" / victim / name)
    assert finished.planned()["solve_case"] == 1
    before = {other: (finished.folder / "results/cases" / other / "status.json").read_text()}
    finishes(finished, before)
    record(f"{name}, {damage.__name__}: the plan notices", "that case is solved")


@pytest.mark.parametrize("jump", ["back", "ahead"])
def test_a_clock_that_jumps(finished, record, jump):
    """Half of the files seem to be older than the meshes, or of tomorrow.

    Not older than the project's scripts: what seems to be, Snakemake itself takes for made by other code.
    """
    before = solved(finished)
    written = max(f.stat().st_mtime for f in (ROOT / "scripts").glob("*.py"))
    then = written + 1 if jump == "back" else time.time() + 24 * 3600
    for folder in before:
        for name in ("volumes.nc", "frames.nc"):
            os.utime(finished.folder / "results" / "cases" / folder / name, (then, then))
    planned = finished.planned()
    assert "solve_case" not in planned
    finishes(finished, before)
    record(f"{jump}: {', '.join(planned) or 'nothing'} to do", "nothing solved")


def test_two_sweeps_at_once(tiny, record):
    project = tiny("newton")
    with ended(start(project)) as first:
        wait_for(lambda: iterating(project), said(project))
        os.killpg(first.pid, signal.SIGSTOP)  # or a slow second finds that the first has finished
        second = project.snakemake(cores=1)
        os.killpg(first.pid, signal.SIGCONT)
        assert second.returncode != 0
        assert "lock" in (second.stdout + second.stderr).lower()
        assert first.wait(PATIENCE) == 0, said(project)
    finishes(project, solved(project))
    record("the second says that the folder is locked and ends, the first finishes", "nothing to do")
