"""Snakemake for tests: its own command, forked from a process that has imported what it and the Snakefile import.

``python -m snakemake`` spends most of a dry run on imports. Each run here is a process of its own, too, with arguments, folder,
environment and output of its own; it begins after the imports. What imports other code than this checkout's, or tests how
Snakemake starts, takes ``fresh=True``.
"""

from __future__ import annotations

import gc
import importlib
import json
import os
import re
import runpy
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[2]
TIMEOUT = 1800  # s
#: what Snakemake imports when it reads its arguments, the Snakefile, scripts and what it has noted of earlier runs
LATE = (
    *("snakemake.report.html_reporter", "snakemake.benchmark", "snakemake.profiles", "snakemake.storage"),
    *("smart_open", "nbformat", "pandas", "platformdirs"),
)


def run_snakemake(*arguments: str | Path, folder: Path, fresh: bool = False) -> subprocess.CompletedProcess[str]:
    """Run Snakemake with ``arguments`` in ``folder``; its exit code and what it printed."""
    words = [str(word) for word in arguments]
    if fresh:
        command = [sys.executable, "-m", "snakemake", *words]
        return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=TIMEOUT, check=False)
    with tempfile.TemporaryDirectory() as kept:
        out, err = Path(kept, "stdout"), Path(kept, "stderr")
        code = _ask(words, folder, [out, err])
        return subprocess.CompletedProcess(words, code, *(file.read_text(errors="replace") for file in (out, err)))


@dataclass(frozen=True)
class Started:
    """A run that goes on by itself: the leader of a process group of its own."""

    pid: int
    code: Path

    def wait(self, timeout: float = TIMEOUT) -> int:
        """Exit code, as ``subprocess`` has it, once the run has ended. Raises ``TimeoutError``."""
        until = time.monotonic() + timeout
        while not self.code.exists():
            if time.monotonic() > until:
                raise TimeoutError(f"process {self.pid} has not ended within {timeout} s")
            time.sleep(0.02)
        return int(self.code.read_text())


def start_snakemake(*arguments: str | Path, folder: Path, log: Path, fresh: bool = False) -> Started | subprocess.Popen:
    """Start Snakemake with ``arguments`` in ``folder``; what it prints goes to ``log``, and its exit code beside it."""
    words = [str(word) for word in arguments]
    if fresh:
        command = [sys.executable, "-m", "snakemake", *words]
        with log.open("w") as out:
            return subprocess.Popen(
                command, cwd=folder, stdout=out, stderr=subprocess.STDOUT, start_new_session=True, preexec_fn=_heed_interrupts
            )
    code = log.with_suffix(".code")
    code.unlink(missing_ok=True)
    return Started(_ask(words, folder, [log, log], code), code)


def _heed_interrupts() -> None:
    """Python heeds SIGINT only where it is not ignored when it starts, as shells have their background jobs do."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def _ask(words: list[str], folder: Path, files: list[Path], code: Path | None = None) -> int:
    """The server's answer to a request: the exit code of a run, or with ``code``, the file that takes this, its process."""
    request = {"words": words, "folder": str(folder), "environment": dict(os.environ), "files": [str(file) for file in files]}
    server = _server()
    server.stdin.write(json.dumps(request | ({"code": str(code)} if code else {})) + "\n")
    server.stdin.flush()
    return int(server.stdout.readline())


@cache
def _server() -> subprocess.Popen[str]:
    """The process that forks; it ends when its input does, that is with the tests."""
    # the last word lets it see the plugin that submits to a cluster (scripts/cluster.sh)
    command = [sys.executable, "-m", "tests.helpers.snakemake", "--executor"]
    return subprocess.Popen(command, cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)


def _imported_by_the_workflow() -> list[str]:
    """The package's modules that Snakefile and rules import."""
    files = [ROOT / "Snakefile", *sorted((ROOT / "workflow" / "rules").glob("*.smk"))]
    text = "\n".join(file.read_text(encoding="utf-8") for file in files)
    return sorted(set(re.findall(r"^from (limo[\w.]*) import", text, flags=re.MULTILINE)))


def _serve() -> None:
    """Fork for each line of the input, and answer with the exit code, or at once with the process that goes on by itself."""
    sys.path.insert(0, str(ROOT / "scripts"))
    for name in ("snakemake.cli", *LATE, *_imported_by_the_workflow()):
        importlib.import_module(name)
    sys.modules["snakemake.cli"].get_argument_parser()  # imports the plug-ins that there are
    gc.collect()
    gc.freeze()  # or a run's first collection writes to all pages that it shares with this process
    for line in sys.stdin:
        request = json.loads(line)
        if "code" in request:
            if not os.fork():
                if _keep(request):
                    return
                os._exit(0)
        elif child := os.fork():
            print(_wait(child), flush=True)
        else:
            _become(request)
            return
        _reap()


def _keep(request: dict) -> bool:
    """Start a run and write down its exit code when it has ended; True in the run itself."""
    if not (child := os.fork()):
        _become(request)
        return True
    code = Path(request["code"])
    aside = code.with_name(f"{code.name}.{child}")
    aside.write_text(str(_wait(child)))
    aside.replace(code)
    return False


def _reap() -> None:
    """Forget the keepers that are done."""
    try:
        while os.waitpid(-1, os.WNOHANG)[0]:
            pass
    except ChildProcessError:
        pass


def _become(request: dict) -> None:
    """Turn this process into one that was started as ``python -m snakemake``."""
    os.setsid()
    if "code" in request:
        print(os.getpid(), flush=True)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    for number, name in enumerate((os.devnull, *request["files"])):
        file = os.open(name, os.O_WRONLY | os.O_CREAT | os.O_APPEND if number else os.O_RDONLY)
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
