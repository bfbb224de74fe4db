"""A run on the node's own disk: its files are where they would have been, and are seen meanwhile."""

import os
import signal
import time

import pytest

from limo.store import scratch
from limo.store.progress import report, solving
from limo.store.results import CaseFiles


@pytest.fixture
def node(tmp_path, monkeypatch):
    """A node with an own disk, and the folder of a case."""
    disk = tmp_path / "disk"
    disk.mkdir()
    monkeypatch.setenv("SLURM_JOB_ID", "7")
    monkeypatch.setenv("SLURM_TMPDIR", str(disk))
    monkeypatch.setattr(scratch, "_file_system", lambda path: "ext4")
    monkeypatch.setattr(scratch, "EVERY", 0.05)
    return disk, CaseFiles(tmp_path / "results/cases/one")


def test_a_run_lies_on_the_own_disk_and_comes_back(node, monkeypatch):
    disk, files = node
    monkeypatch.setattr(scratch, "KEPT", 1000)
    with solving(files.folder):
        assert files.run.is_symlink()
        assert files.run.resolve().parent == disk
        files.run.joinpath("deck.frd").write_bytes(bytes(2000))
        report(stage="ramp")
        until = time.monotonic() + 10
        while not files.seen.progress.exists() and time.monotonic() < until:
            time.sleep(0.02)
        assert "ramp" in files.seen.progress.read_text()
    assert not files.run.is_symlink()
    assert [file.name for file in files.run.iterdir()] == ["progress.json"], "large files stay behind"
    assert not list(disk.iterdir())
    assert not files.seen.folder.exists()


def test_a_job_that_is_cancelled_leaves_nothing_on_the_disk(node):
    disk, files = node

    def cancelled() -> None:
        with solving(files.folder):
            os.kill(os.getpid(), signal.SIGTERM)
            time.sleep(5)

    with pytest.raises(SystemExit):
        cancelled()
    assert not list(disk.iterdir())
    assert files.lock.exists(), "broken off"
    assert signal.getsignal(signal.SIGTERM) == signal.SIG_DFL


def test_a_link_of_a_job_that_was_killed_is_in_nobodys_way(node, monkeypatch):
    disk, files = node
    files.folder.mkdir(parents=True)
    files.run.symlink_to(disk / "gone")
    monkeypatch.delenv("SLURM_JOB_ID")
    with solving(files.folder):
        files.run.mkdir(parents=True, exist_ok=True)
        assert not files.run.is_symlink()


@pytest.mark.parametrize("change", ["outside", "memory", "full", "same"])
def test_where_there_is_no_own_disk_a_run_stays(node, monkeypatch, change):
    _, files = node
    if change == "outside":
        monkeypatch.delenv("SLURM_JOB_ID")
    elif change == "memory":
        monkeypatch.setattr(scratch, "_file_system", lambda path: "tmpfs")
    elif change == "full":
        monkeypatch.setattr(scratch, "ROOM", 1 << 60)
    else:
        monkeypatch.delenv("SLURM_TMPDIR")
        monkeypatch.setenv("TMPDIR", str(files.folder.parents[2]))
    with solving(files.folder):
        assert not files.run.is_symlink()
        assert scratch.own_disk(files.folder) is None


def test_the_kind_of_a_file_system_is_read():
    assert scratch._file_system("/proc/self") == "proc"
