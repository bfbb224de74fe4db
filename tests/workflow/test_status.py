"""A real sweep of the engine newton as ``limo status`` sees it: while it runs, killed, taken up again, and done."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import time

import pytest

from limo.terminal.cli import main

from .conftest import ROOT

PATIENCE = 300  # s


@pytest.fixture
def newton(project, monkeypatch):
    """A project in whose folder the engine newton goes far enough, and in steps small enough, to be looked at."""
    project.edit("config.yaml", lambda d: d.update(engine="newton"))
    steps = {"load_step": 0.05, "easy_steps": 1}
    project.edit("config.yaml", lambda d: d["numerics_presets"]["fast"].update(newton=steps))
    project.edit("studies/tiny.yaml", lambda d: d.update(actuation_pressure_max=100.0))
    monkeypatch.chdir(project.folder)
    return project


def start(*options: str) -> subprocess.Popen:
    command = [sys.executable, "-m", "limo.terminal.cli", "sweep", "tiny", "--cores", "1", *options, "--"]
    return subprocess.Popen(
        [*command, "--snakefile", str(ROOT / "Snakefile")], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )


def look(capsys) -> tuple[int, dict]:
    code = main(["status", "--json"])
    return code, json.loads(capsys.readouterr().out)


def wait_for(capsys, ready) -> dict:
    """Poll until ``ready`` likes one of the cases; returns that case."""
    until = time.monotonic() + PATIENCE
    while time.monotonic() < until:
        _, data = look(capsys)
        if found := [case for case in data["cases"] if ready(case)]:
            return found[0]
        time.sleep(0.3)  # a look takes as long as planning does
    raise AssertionError(f"not within {PATIENCE} s: {data}")


def solvers(folder) -> list[int]:
    """The processes that work in a folder."""
    found = []
    for entry in os.listdir("/proc"):
        try:
            if entry.isdigit() and int(entry) != os.getpid() and os.readlink(f"/proc/{entry}/cwd") == str(folder):
                found.append(int(entry))
        except OSError:
            continue
    return found


def test_a_sweep_is_seen_while_it_runs_when_it_is_killed_and_when_it_is_done(newton, capsys):
    assert look(capsys)[1]["totals"]["waiting"] == 2
    sweep = start()
    try:
        seen = wait_for(capsys, lambda case: case["status"] == "running" and case["stage"] == "ramp")
        assert 0 <= seen["actuation_pressure"] < seen["actuation_pressure_max"] == 100.0
        assert seen["iterations"] > 0
        later = wait_for(capsys, lambda c: c["case"] == seen["case"] and (c["iterations"] or 0) > seen["iterations"])
        assert later["actuation_pressure"] >= seen["actuation_pressure"]
        assert main(["status"]) == 0
        assert " running " in capsys.readouterr().out
    finally:
        while pids := solvers(newton.folder):  # one may start another before it is gone itself
            for pid in pids:
                with contextlib.suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)
            time.sleep(0.1)
        sweep.wait()
    code, data = look(capsys)
    killed = next(c for c in data["cases"] if c["case"] == seen["case"])
    assert (code, killed["status"]) == (3, "stale"), "at once, not after a while"
    assert killed["iterations"] >= seen["iterations"]
    assert data["totals"]["running"] == 0

    newton.edit("studies/tiny.yaml", lambda d: d.update(actuation_pressure_max=10.0))
    assert newton.snakemake("--unlock").returncode == 0
    again = start()
    said, _ = again.communicate(timeout=PATIENCE)
    assert again.returncode == 0, said
    assert "2 cases, 2 converged" in said
    assert "converged  ramp, P_a = 10.0 of 10 kPa" in said
    assert "results/index.html: 1 studies, 2 cases" in said
    code, data = look(capsys)
    assert code == 0
    assert data["totals"]["seconds_left"] == 0
    assert [c["actuation_pressure"] for c in data["cases"]] == [10.0, 10.0]
    assert (newton.folder / "results/logs/sweep.log").stat().st_size > 0


def test_a_sweep_that_snakemake_refuses_fails_and_says_why(newton):
    sweep = subprocess.run(
        [sys.executable, "-m", "limo.terminal.cli", "sweep", "--", "--snakefile", "nowhere"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert sweep.returncode == 3
    assert "nowhere" in sweep.stderr
    assert "Traceback" not in sweep.stderr
