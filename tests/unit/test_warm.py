"""Scripts that a warm process runs: as in a process of their own, but with what they import already there."""

import json
import os
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import pytest

from limo.warm import VARIABLE

SCRIPTS = Path(__file__).parents[2] / "scripts"
#: stands for a Snakemake: starts a server, then runs commands, one a line, and prints their exit codes
SNAKEMAKE = """
import json, os, subprocess, sys
from limo.warm import VARIABLE, start
server = start()
print(os.environ.get(VARIABLE), server and server.pid, flush=True)
for line in sys.stdin:
    command, change, wait = json.loads(line)
    process = subprocess.Popen(command, env=os.environ | change)
    print(process.wait() if wait else process.pid, flush=True)
"""
#: what every script begins with: its last line is what a server imports for it, and nothing else does before
HEAD = "import os, sys\nbefore = 'statistics' in sys.modules\nfrom limo.warm import warm\nwarm()\nfrom statistics import mean\n"

pytestmark = pytest.mark.skipif(not hasattr(os, "pidfd_open"), reason="no handles of processes here: scripts run as ever")


class Sweep:
    """A process that has a server and runs scripts."""

    def __init__(self, folder: Path, **environment: str):
        self.folder = folder
        there = os.environ | {"PYTHONPATH": str(SCRIPTS)} | environment
        self.process = subprocess.Popen(
            [sys.executable, "-c", SNAKEMAKE], stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=there, cwd=folder, text=True
        )
        self.address, self.server = self.process.stdout.readline().split()

    def script(self, text: str, head: str = HEAD) -> list[str]:
        """Command that runs a script of this text."""
        file = self.folder / "script.py"
        file.write_text(head + textwrap.dedent(text))
        return [sys.executable, str(file)]

    def run(self, text: str, head: str = HEAD, wait: bool = True, **environment: str) -> int:
        """Exit code of a script that was run, or its process where nobody waits for it."""
        return self.ask(self.script(text, head), environment, wait)

    def ask(self, command: list[str], environment: dict[str, str], wait: bool = True) -> int:
        """The same of any command."""
        self.process.stdin.write(json.dumps([command, environment, wait]) + "\n")
        self.process.stdin.flush()
        return int(self.process.stdout.readline())

    def end(self) -> None:
        self.process.stdin.close()
        self.process.wait(60)
        self.process.stdout.close()


@pytest.fixture
def sweep(tmp_path):
    started = Sweep(tmp_path)
    yield started
    started.end()
    assert not Path(started.address).parent.exists()
    assert ended(int(started.server))


def ended(process: int, within: float = 20) -> bool:
    """Whether a process ends in time; a zombie has."""
    until = time.monotonic() + within
    while time.monotonic() < until:
        try:
            if Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] == "Z":
                return True
        except OSError:
            return True
        time.sleep(0.05)
    return False


def read(file: Path, within: float = 20) -> str:
    """Content of a file that a script writes whole, once it is there."""
    until = time.monotonic() + within
    while not file.exists():
        assert time.monotonic() < until
        time.sleep(0.02)
    return file.read_text()


TELL = """
    open("told.tmp", "w").write(repr((before, os.getppid(), os.getcwd(), os.environ.get("WORD"), sys.argv[1:], __name__)))
    os.rename("told.tmp", "told")
"""


def test_a_script_finds_its_imports_and_its_own_place(sweep, tmp_path):
    assert sweep.run(TELL, WORD="one") == 0
    told = eval((tmp_path / "told").read_text())
    assert told == (True, int(sweep.server), str(tmp_path), "one", [], "__main__")


def test_nothing_is_left_of_a_script(sweep):
    sweep.run("import statistics; statistics.left = os.environ['LEFT'] = 'x'; os.chdir('/')")
    assert (
        sweep.run("import statistics; sys.exit(hasattr(statistics, 'left') or 'LEFT' in os.environ or os.getcwd() == '/')") == 0
    )


@pytest.mark.parametrize(
    ("text", "code"), [("sys.exit(3)", 3), ("sys.exit('a mistake')", 1), ("1 / 0", 1), ("os.kill(os.getpid(), 9)", -9)]
)
def test_it_ends_as_it_would(sweep, text, code):
    assert sweep.run(text) == code


def test_what_it_prints_arrives_where_it_would(sweep, tmp_path):
    out = tmp_path / "out"
    command = f"exec > {out} 2>&1; {' '.join(sweep.script('print(mean([1, 2])); sys.exit(chr(97))'))}"
    assert sweep.ask(["bash", "-c", command], {}) == 1
    assert sorted(out.read_text().split()) == ["1.5", "a"]


def test_several_run_at_once(sweep, tmp_path):
    wait = "import time\nwhile not os.path.exists('go'):\n    time.sleep(0.02)\nopen(f'{os.getpid()}.done', 'w')\n"
    scripts = [sweep.run(wait, wait=False) for _ in range(3)]
    (tmp_path / "go").touch()
    assert all(ended(script) for script in scripts)
    assert len(list(tmp_path.glob("*.done"))) == 3


SLEEP = "open('me.tmp', 'w').write(str(os.getpid()))\nos.rename('me.tmp', 'me')\nimport time\ntime.sleep(600)\n"


def test_a_script_that_is_killed_takes_its_fork_along(sweep, tmp_path):
    waits = sweep.run(SLEEP, wait=False)
    fork = int(read(tmp_path / "me"))
    assert fork != waits
    os.kill(waits, signal.SIGKILL)
    assert ended(fork)
    assert sweep.run("pass") == 0


def test_a_fork_ends_with_a_sweep_that_is_killed(tmp_path):
    sweep = Sweep(tmp_path)
    sweep.run(SLEEP, wait=False)
    fork = int(read(tmp_path / "me"))
    sweep.process.kill()
    assert ended(fork)
    assert ended(int(sweep.server))
    sweep.end()


def test_scripts_of_others_run_as_ever(sweep, tmp_path):
    """A job of a cluster has the environment of the process that submitted it, but is not its child."""
    done = subprocess.run(
        sweep.script(TELL), cwd=tmp_path, env=os.environ | {"PYTHONPATH": str(SCRIPTS), VARIABLE: sweep.address}
    )
    assert done.returncode == 0
    assert eval((tmp_path / "told").read_text())[:2] == (False, os.getpid())


def test_a_module_says_what_it_imports_late(sweep, tmp_path):
    (tmp_path / "early.py").write_text("LATE = ('fractions',)\n")
    head = HEAD.replace("warm()", "warm('early')").replace("'statistics'", "'fractions'").replace("from statistics", "from json")
    assert sweep.run(TELL, head.replace("import mean", "import dumps")) == 0
    assert eval((tmp_path / "told").read_text())[0] is True


@pytest.mark.parametrize(
    ("head", "environment"),
    [
        (HEAD.replace("warm()", "warm('limo.no_such_module')"), {}),
        (HEAD, {VARIABLE: "off"}),
        (HEAD, {VARIABLE: "/no/such/socket"}),
    ],
)
def test_what_cannot_be_warm_runs_as_ever(sweep, tmp_path, head, environment):
    assert sweep.run(TELL, head, **environment) == 0
    assert eval((tmp_path / "told").read_text())[:2] == (False, sweep.process.pid)


def test_no_server_where_a_user_wants_none(tmp_path):
    sweep = Sweep(tmp_path, **{VARIABLE: "off"})
    assert (sweep.address, sweep.server) == ("off", "None")
    assert sweep.run("pass") == 0
    sweep.end()


def test_no_server_where_there_cannot_be_a_socket(tmp_path):
    deep = tmp_path / ("x" * 100)
    deep.mkdir()
    sweep = Sweep(tmp_path, TMPDIR=str(deep))
    assert (sweep.address, sweep.server) == ("None", "None")
    assert not list(deep.iterdir())
    assert sweep.run("pass") == 0
    sweep.end()
