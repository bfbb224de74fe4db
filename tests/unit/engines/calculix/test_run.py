"""Finding CalculiX, running it under watch, and judging how a run ended; with small scripts in its place."""

import contextlib
import itertools
import json
import os
import select
import signal
import subprocess
import sys

import pytest

from limo.engines.calculix import build as ccx_build
from limo.engines.calculix import run as calculix
from limo.engines.calculix.build import build_id, find_ccx, solver_build
from limo.engines.calculix.run import judge, run
from limo.engines.calculix.sta import Increment, read_sta
from limo.errors import ConfigError, SolverNotFoundError
from limo.schema.solver import Solver

STA = """SUMMARY OF JOB INFORMATION
  STEP      INC     ATT  ITRS     TOT TIME     STEP TIME      INC TIME
     1          1     1     2  0.500000E+00  0.500000E+00  0.500000E+00
"""


@pytest.fixture
def solver_script(tmp_path, monkeypatch):
    """``solver_script(lines)``: an executable shell script that stands for ccx, watched closely; no tuned build is about."""
    monkeypatch.setattr(calculix, "_POLL", 0.01)
    monkeypatch.setattr(ccx_build, "TUNED", tmp_path / "ccx-tuned" / "bin" / "ccx")

    def make(lines, name="ccx"):
        path = tmp_path / name
        path.write_text(f"#!/bin/sh\n{lines}\n")
        path.chmod(0o755)
        return path

    return make


END = 0.5  # s, where the increment in STA ends


def accept_one_increment(extra=""):
    return f"cat > deck.sta <<'end'\n{STA}end\n{extra}"


# --------------------------------------------------------------------------------------------------------------------
# the .sta file


def test_sta_lines_of_a_real_run_are_read_with_rejected_attempts(root):
    increments = read_sta(root / "tests/fixtures/increments.sta")
    assert increments[:2] == (
        Increment(1, 1, 1, False, 4, 0.0, 0.0, 0.04),
        Increment(1, 1, 2, True, 8, 0.01, 0.01, 0.01),
    )
    assert len(increments) == 10
    accepted = [i for i in increments if i.accepted]
    assert [i.increment for i in accepted] == list(range(1, 10))
    for before, after in itertools.pairwise(accepted):
        assert after.total_time == pytest.approx(before.total_time + after.size, rel=1e-5)


def test_a_line_that_is_half_written_is_left_out_wherever_it_ends(tmp_path):
    path = tmp_path / "deck.sta"
    line = "     1          2     1     3  0.205000E+02  0.205000E+02  0.200000E+02"
    path.write_text(STA)
    first = read_sta(path)
    assert len(first) == 1
    for cut in range(len(line)):
        path.write_text(STA + line[:cut])
        assert read_sta(path) == first, f"took {line[:cut]!r} for a whole line"
    path.write_text(STA + line + "\n")
    assert read_sta(path)[1:] == (Increment(1, 2, 1, True, 3, 20.5, 20.5, 20.0),)


def test_sta_file_that_is_absent_or_full_of_stars_has_no_increments(tmp_path):
    assert read_sta(tmp_path / "absent.sta") == ()
    (tmp_path / "deck.sta").write_text("     1          2     1     3  ************  0.205000E+02  0.200000E+02\n")
    assert read_sta(tmp_path / "deck.sta") == ()


def test_the_last_lines_of_a_sta_file_are_whole_ones(tmp_path):
    path = tmp_path / "deck.sta"
    lines = [f"     1  {n:9d}     1     3  0.205000E+02  0.205000E+02  0.200000E+02\n" for n in range(1, 51)]
    path.write_text("SUMMARY OF JOB INFORMATION\n" + "".join(lines))
    everything = read_sta(path)
    assert [i.increment for i in everything] == list(range(1, 51))
    for last in (len(lines[0]) // 2, 3 * len(lines[0]), 3 * len(lines[0]) + 5, path.stat().st_size, 10**6):
        found = read_sta(path, last)
        assert found == everything[len(everything) - len(found) :]
        assert len(found) == min(max(0, (last - 1) // len(lines[0])), 50)


# --------------------------------------------------------------------------------------------------------------------
# the verdict

ACCEPTED = (Increment(1, 1, 1, True, 2, 0.5, 0.5, 0.5),)
EARLY = (Increment(1, 1, 1, True, 2, 0.2, 0.2, 0.2),)
REJECTED = (Increment(1, 1, 1, False, 9, 0.0, 0.0, 0.5),)
ERROR = " *ERROR: too many cutbacks\n        in step 1\n\nmore\n"
VERDICTS = {
    "end of the last step": (0, "Job finished\n", ACCEPTED, "", "converged", ""),
    "error in spite of exit code 0": (0, ERROR + "Job finished\n", ACCEPTED, "", "diverged", "too many cutbacks in step 1"),
    "end before the end of the step": (0, "Job finished\n", EARLY, "", "diverged", "ended at 0.2 s of 0.5 s"),
    "log that breaks off": (0, "iteration 1\n", ACCEPTED, "", "diverged", "exit code 0"),
    "missing deck": (0, "Job finished\n", (), "", "crashed", "no increment was accepted"),
    "only rejected attempts": (201, ERROR, REJECTED, "", "diverged", "too many cutbacks"),
    "divergence": (201, ERROR, ACCEPTED, "", "diverged", "*ERROR: too many cutbacks in step 1"),
    "malformed deck": (139, "", (), "", "crashed", "exit code 139"),
    "segmentation fault on the way": (139, "", ACCEPTED, "", "crashed", "exit code 139"),
    "signal": (-9, "Job finished\n", ACCEPTED, "", "crashed", "signal 9"),
    "time limit": (-9, "", ACCEPTED, "stopped after the time limit", "timed_out", "time limit"),
}


@pytest.mark.parametrize("name", VERDICTS)
def test_verdict(name):
    exit_code, log, increments, stopped, status, reason = VERDICTS[name]
    found = judge(exit_code, log, increments, 0.5, stopped)
    assert found[0] == status
    assert reason in found[1]
    assert (found[1] == "") == (status == "converged")


# --------------------------------------------------------------------------------------------------------------------
# runs


def test_run_that_converges_is_measured(solver_script, tmp_path):
    script = solver_script(accept_one_increment("echo threads $OMP_NUM_THREADS $1\necho Job finished"))
    outcome = run(tmp_path, script, Solver(threads=3), END)
    assert (outcome.status, outcome.reason, outcome.exit_code) == ("converged", "", 0)
    assert outcome.iterations == 2
    assert outcome.memory > 0
    assert outcome.wall_seconds > 0
    assert "threads 3 deck" in (tmp_path / "ccx.log").read_text()


@pytest.mark.parametrize(
    ("lines", "limits", "status", "reason"),
    [
        (accept_one_increment("exec sleep 60"), {"stall_limit": 0.003}, "timed_out", "without a Newton iteration"),
        (
            accept_one_increment("for i in $(seq 600); do echo iteration; sleep 0.05; done"),
            {"time_limit": 0.003},
            "timed_out",
            "time limit of 0.003 min",
        ),
        (accept_one_increment("kill -11 $$"), {}, "crashed", "signal 11"),
        (accept_one_increment("echo '*ERROR: divergence'; exit 201"), {}, "diverged", "*ERROR: divergence"),
        ("echo '*ERROR reading *ELEMENT'; exit 201", {}, "crashed", "*ERROR reading *ELEMENT"),
        ("echo Job finished", {}, "crashed", "no increment was accepted"),
    ],
    ids=["stall", "time limit", "signal", "divergence", "bad deck", "missing deck"],
)
def test_run_that_fails_has_a_status_and_a_reason(solver_script, tmp_path, lines, limits, status, reason):
    outcome = run(tmp_path, solver_script(lines), Solver(**limits), END)
    assert outcome.status == status
    assert reason in outcome.reason
    assert outcome.wall_seconds < 30


def crawl(size: float) -> str:
    """A shell script's lines: a solver that accepts one increment after the other, of ``size`` s each, and is slow to end."""
    line = f"     1 %10d     1     2  0.100000E-01  0.100000E-01  {size:.6E}"
    return f"for i in $(seq {2 * calculix.CRAWLING}); do printf '{line}\\n' $i; done > deck.sta\nsleep 2"


@pytest.mark.parametrize(("pace", "reason"), [(0.5, f"{calculix.CRAWLING} increments took it"), (2.0, "exit code 0")])
def test_a_run_that_iterates_and_gets_nowhere_is_stopped(monkeypatch, solver_script, tmp_path, pace, reason):
    monkeypatch.setattr(calculix, "_LOOK_AT_STA", 0.0)
    size = pace * calculix.CRAWLED * END / calculix.CRAWLING
    outcome = run(tmp_path, solver_script(crawl(size)), Solver(), END)
    assert outcome.status == ("timed_out" if pace < 1 else "diverged")
    assert reason in outcome.reason


def test_progress_in_the_log_alone_is_no_stall(solver_script, tmp_path):
    lines = accept_one_increment("for i in 1 2 3 4 5; do echo iteration $i >> deck.cvg; sleep 0.2; done; echo Job finished")
    assert run(tmp_path, solver_script(lines), Solver(stall_limit=0.7 / 60), END).status == "converged"


# a process that watches a solver, and says so once it does
RUNNER = """
import signal, sys
from pathlib import Path
from limo.schema.solver import Solver
from limo.door import logged
from limo.engines.calculix import run as calculix
signal.signal(signal.SIGINT, signal.default_int_handler)  # a background shell may have it ignored
folder, watch = Path(sys.argv[1]), calculix._watch
def announced(*args):
    (folder / "watching").write_text("yes")
    return watch(*args)
calculix._watch = announced
with logged(str(folder / "run.log")):
    calculix.run(folder, folder / "ccx", Solver(), 1.0)
"""


def wait_for_word(path):
    """What is written to a new named pipe; the returned function waits for it."""
    os.mkfifo(path)
    pipe = os.open(path, os.O_RDONLY | os.O_NONBLOCK)

    def wait():
        try:
            assert select.select([pipe], [], [], 60)[0], f"nobody wrote to {path.name}"
            return os.read(pipe, 100).decode()
        finally:
            os.close(pipe)

    return wait


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM], ids=lambda s: s.name)
def test_interrupt_leaves_no_solver_behind(solver_script, tmp_path, number):
    """The solver and what it started end with the process that watches them (Ctrl-C, or a scheduler's SIGTERM)."""
    solver_script("sleep 300 &\necho $$ $! > started\nwait")
    started, watching = wait_for_word(tmp_path / "started"), wait_for_word(tmp_path / "watching")
    watcher = subprocess.Popen([sys.executable, "-c", RUNNER, tmp_path], stderr=subprocess.DEVNULL)
    leader, child = map(int, started().split())
    watching()
    handles = [os.pidfd_open(p) for p in (leader, child)]
    try:
        watcher.send_signal(number)
        assert watcher.wait(timeout=30) != 0
        for handle in handles:
            assert select.select([handle], [], [], 2)[0], "a process of the solver outlived its watcher"
    finally:
        for handle in handles:
            with contextlib.suppress(ProcessLookupError):
                signal.pidfd_send_signal(handle, signal.SIGKILL)
            os.close(handle)


# --------------------------------------------------------------------------------------------------------------------
# the executable


def test_named_command_is_preferred_and_must_exist(solver_script, tmp_path):
    script = solver_script("exit 0", "my_ccx")
    assert find_ccx(Solver(command=str(script))) == script
    (tmp_path / "not_executable").write_text("")
    for wrong in (tmp_path / "absent", tmp_path / "not_executable"):
        with pytest.raises(ConfigError, match=r"other\.yaml: solver\.command"):
            find_ccx(Solver(command=str(wrong)), "other.yaml")


def test_command_is_found_on_the_path_then_in_the_project_then_nowhere(solver_script, tmp_path, monkeypatch):
    script = solver_script("exit 0")
    monkeypatch.setattr(ccx_build, "LOCAL", tmp_path / "local_ccx")
    monkeypatch.setenv("PATH", str(tmp_path))
    assert find_ccx(Solver()) == script
    monkeypatch.setenv("PATH", str(tmp_path / "empty"))
    with pytest.raises(SolverNotFoundError, match="/usr/bin/ccx"):
        find_ccx(Solver())
    local = solver_script("exit 0", "local_ccx")
    assert find_ccx(Solver()) == local


@pytest.fixture
def tuned_script(solver_script, tmp_path):
    """``tuned_script(lines, processor)``: the same in the place of the tuned build, described as made for ``processor``."""

    def make(lines="echo This is Version 2.99", processor=None):
        path = tmp_path / "ccx-tuned" / "bin"
        path.mkdir(parents=True)
        facts = {"processor": processor or ccx_build._processor(), "patches": "c0ffee", "mkl": "2026"}
        (path.parent / "build.json").write_text(json.dumps(facts))
        return solver_script(lines, "ccx-tuned/bin/ccx")

    return make


def test_tuned_build_is_preferred_to_the_path_but_not_to_a_named_command(solver_script, tuned_script, tmp_path, monkeypatch):
    stock, tuned, named = solver_script("exit 0"), tuned_script(), solver_script("exit 0", "my_ccx")
    monkeypatch.setenv("PATH", f"{tmp_path}:/usr/bin:/bin")
    assert find_ccx(Solver()) == find_ccx(Solver(build="tuned")) == tuned
    assert find_ccx(Solver(build="stock")) == stock
    assert find_ccx(Solver(command=str(named), build="tuned")) == named


@pytest.mark.parametrize(
    "broken", [{"processor": "another one"}, {"lines": "echo libmkl_core.so.3: cannot open shared object file >&2; exit 127"}]
)
def test_tuned_build_that_cannot_run_here_is_passed_over(solver_script, tuned_script, tmp_path, monkeypatch, broken):
    stock, _ = solver_script("exit 0"), tuned_script(**broken)
    monkeypatch.setenv("PATH", f"{tmp_path}:/usr/bin:/bin")
    assert find_ccx(Solver()) == stock
    with pytest.raises(SolverNotFoundError, match="make ccx-tuned"):
        find_ccx(Solver(build="tuned"))


def test_build_says_whether_it_is_tuned_and_of_what(solver_script, tuned_script):
    assert solver_build(solver_script("echo Version 2.99"))["build"] == "stock"
    build = solver_build(tuned_script())
    assert (build["build"], build["version"], build["patches"], build["mkl"]) == ("tuned", "2.99", "c0ffee", "2026")


def test_command_given_relative_to_the_project_runs_in_a_case_folder(solver_script, tmp_path, monkeypatch):
    (tmp_path / "tools").mkdir()
    (tmp_path / "case").mkdir()
    solver_script(accept_one_increment("echo Job finished"), "tools/ccx")
    monkeypatch.chdir(tmp_path)
    command = find_ccx(Solver(command="tools/ccx"))
    assert run(tmp_path / "case", command, Solver(), END).status == "converged"


def test_build_names_version_and_hash(solver_script):
    script = solver_script("echo; echo This is Version 2.99p1; exit 1")
    build = solver_build(script)
    assert build["version"] == "2.99p1"
    assert len(build["sha256"]) == 16
    other = solver_build(solver_script("echo This is Version 2.99p1", "other"))
    assert other["sha256"] != build["sha256"]


def test_build_is_the_same_wherever_the_executable_lies(solver_script):
    builds = [build_id(solver_script("echo This is Version 2.99p1", name)) for name in ("here", "there")]
    assert builds[0] == builds[1]
    assert builds[0].startswith("2.99p1-")
    assert build_id(solver_script("echo This is Version 2.99p1; true", "other")) != builds[0]


def test_a_file_that_is_gone_has_no_bytes(tmp_path):
    """CalculiX removes files while it is looked at, to write them anew."""
    (tmp_path / "deck.cvg").write_text("four")
    assert (calculix._bytes(tmp_path / "deck.cvg"), calculix._bytes(tmp_path / "deck.sta")) == (4, 0)
