"""The lock and the progress file of a case that is being solved."""

import json
import signal
import subprocess
import sys
import time

import pytest

from limo.errors import LimoError
from limo.store import progress
from limo.store.progress import report, solving, solving_since
from limo.store.results import CaseFiles

HOLD = """
import sys, time
from pathlib import Path
from limo.store.results import CaseFiles
from limo.store.progress import solving
with solving(Path(sys.argv[1])):
    print("held", flush=True)
    time.sleep(60)
"""


@pytest.fixture
def holder(tmp_path):
    """A process of its own that solves the case in ``tmp_path``."""
    with subprocess.Popen([sys.executable, "-c", HOLD, tmp_path], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline() == "held\n"
        yield process
        process.kill()


def test_a_case_is_solved_as_long_as_its_process_lives(tmp_path, holder):
    assert solving_since(tmp_path) == pytest.approx(time.time(), abs=30)
    holder.send_signal(signal.SIGKILL)
    holder.wait()
    assert (tmp_path / "lock").exists(), "a killed process cannot clean up"
    assert solving_since(tmp_path) is None
    with solving(tmp_path):
        pass


def test_two_processes_do_not_solve_the_same_case(tmp_path, holder, monkeypatch):
    monkeypatch.setattr(progress, "_TRIES", 2)
    with pytest.raises(LimoError, match="another process"), solving(tmp_path):
        pass
    assert solving_since(tmp_path) is not None, "the other still does"


def test_a_case_that_nobody_began_is_not_solved(tmp_path):
    assert solving_since(tmp_path) is None
    assert solving_since(tmp_path / "nowhere") is None


def test_reports_are_kept_while_a_case_is_solved_and_not_too_often(tmp_path, monkeypatch):
    file = CaseFiles(tmp_path).progress
    report(iterations=0)
    with solving(tmp_path):
        report(iterations=1)
        report(iterations=2)
        assert json.loads(file.read_text()) == {"iterations": 1}
        monkeypatch.setattr(progress, "INTERVAL", 0.0)
        report(iterations=3)
    report(iterations=4)
    assert json.loads(file.read_text()) == {"iterations": 3}
    assert sorted(p.name for p in tmp_path.iterdir()) == ["run"], "no lock and nothing half-written stays"
    assert solving_since(tmp_path) is None


def test_the_lock_is_given_back_when_solving_fails(tmp_path):
    def fail():
        with solving(tmp_path):
            assert solving_since(tmp_path) is not None
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail()
    assert solving_since(tmp_path) is None


def test_a_case_can_be_solved_where_the_file_system_has_no_locks(tmp_path, monkeypatch):
    def refuse(*_):
        raise OSError(95, "Operation not supported")

    monkeypatch.setattr(progress.fcntl, "flock", refuse)
    with solving(tmp_path):
        report(iterations=1)
        assert not (tmp_path / "lock").exists()
    assert (CaseFiles(tmp_path).progress).exists()
