"""Snakemake for tests: its own command, forked from a process that has imported what it and the Snakefile import.

``python -m snakemake`` spends most of a dry run on imports. Each run here is a process of its own, too, with arguments, folder,
environment and output of its own; it begins after the imports. What imports other code than this checkout's, or tests how
Snakemake starts, takes ``fresh=True``.
"""

from __future__ import annotations

import importlib
import json
import os
import re
import runpy
import signal
import subprocess
import sys
import tempfile
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[2]
TIMEOUT = 1800  # s
#: what Snakemake imports when it reads its arguments, the Snakefile and scripts
LATE = ("snakemake.report.html_reporter", "smart_open", "nbformat")


def run_snakemake(*arguments: str | Path, folder: Path, fresh: bool = False) -> subprocess.CompletedProcess[str]:
    """Run Snakemake with ``arguments`` in ``folder``; its exit code and what it printed."""
    words = [str(word) for word in arguments]
    if fresh:
        command = [sys.executable, "-m", "snakemake", *words]
        return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=TIMEOUT, check=False)
    with tempfile.TemporaryDirectory() as kept:
        out, err = Path(kept, "stdout"), Path(kept, "stderr")
        request = {"words": words, "folder": str(folder), "environment": dict(os.environ), "files": [str(out), str(err)]}
        server = _server()
        server.stdin.write(json.dumps(request) + "\n")
        server.stdin.flush()
        code = int(server.stdout.readline())
        return subprocess.CompletedProcess(words, code, *(file.read_text(errors="replace") for file in (out, err)))


@cache
def _server() -> subprocess.Popen[str]:
    """The process that forks; it ends when its input does, that is with the tests."""
    command = [sys.executable, "-m", "tests.helpers.snakemake"]
    return subprocess.Popen(command, cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)


def _imported_by_the_workflow() -> list[str]:
    """The package's modules that Snakefile and rules import."""
    files = [ROOT / "Snakefile", *sorted((ROOT / "workflow" / "rules").glob("*.smk"))]
    text = "\n".join(file.read_text(encoding="utf-8") for file in files)
    return sorted(set(re.findall(r"^from (limo[\w.]*) import", text, flags=re.MULTILINE)))


def _serve() -> None:
    """Fork for each line of the input, and answer with the exit code."""
    sys.path.insert(0, str(ROOT / "scripts"))
    for name in ("snakemake.cli", *LATE, *_imported_by_the_workflow()):
        importlib.import_module(name)
    for line in sys.stdin:
        request = json.loads(line)
        child = os.fork()
        if not child:
            _become(request)
            return
        print(_wait(child), flush=True)


def _become(request: dict) -> None:
    """Turn this process into one that was started as ``python -m snakemake``."""
    os.setsid()
    for number, name in enumerate((os.devnull, *request["files"])):
        file = os.open(name, os.O_WRONLY | os.O_CREAT if number else os.O_RDONLY)
        os.dup2(file, number)
        os.close(file)
    os.chdir(request["folder"])
    os.environ.clear()
    os.environ.update(request["environment"])
    sys.argv = ["snakemake", *request["words"]]
    runpy.run_module("snakemake", run_name="__main__", alter_sys=True)


def _wait(child: int) -> int:
    """Exit code of a child, which is ended with all that it started once its time is over."""

    def end(*_) -> None:
        os.killpg(child, signal.SIGKILL)

    signal.signal(signal.SIGALRM, end)
    signal.alarm(TIMEOUT)
    _, status = os.waitpid(child, 0)
    signal.alarm(0)
    return os.waitstatus_to_exitcode(status)


if __name__ == "__main__":
    _serve()
