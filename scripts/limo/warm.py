"""Scripts run in a process that has imported what they need already: of a small case, imports are what takes longest.

A server stands beside the Snakemake that started it (``start``) and imports what is asked for, once. A script that calls
``warm`` before its own imports is run by a fork of the server, with its folder, environment and files; it waits for that
and ends as it did. Where there is no server, as on the nodes of a cluster or elsewhere than on Linux, scripts run as ever.

No pool of workers: each fork runs one script, so nothing is left of it, and its time and memory are its own. What a
standard library has for this, ``multiprocessing``'s fork server, serves one program and not the scripts of another.
"""

from __future__ import annotations

import ast
import atexit
import contextlib
import gc
import importlib
import json
import os
import runpy
import selectors
import shlex
import shutil
import signal
import socket
import struct
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from limo.door import parent_of

#: address of the server, in the environment of the Snakemake that has one; a user may set it so that there is none
VARIABLE, OFF = "LIMO_WARM", "off"
_FILES = (0, 1, 2)
_HEAD, _CODE = struct.Struct("!I"), struct.Struct("!i")  # length of a request, and its answer
_PEER = struct.Struct("3i")  # process, user and group at the other end of a socket
_ANCESTORS = 4  # a shell stands between a script and its Snakemake


def start() -> subprocess.Popen | None:
    """Start a server for the scripts of this process, with which it ends. None where there cannot be one, or is to be none."""
    if os.environ.get(VARIABLE) == OFF:
        return None
    try:
        os.close(os.pidfd_open(os.getpid()))
    except (AttributeError, OSError):  # not Linux, or one that has no handles of processes
        return None
    scripts = str(Path(__file__).resolve().parents[1])
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, [scripts, os.environ.get("PYTHONPATH")]))}
    # a thread that a library starts would be lacking in a fork
    environment |= dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    python = shlex.split(sys.executable)[0]  # the Snakefile quotes it
    folder = Path(tempfile.mkdtemp(prefix="limo-"))  # nobody else may enter it
    address = str(folder / "socket")
    try:
        with socket.socket(socket.AF_UNIX) as listener:
            listener.bind(address)
            listener.listen(64)
            command = [python, "-m", "limo.warm", address, str(listener.fileno())]
            server = subprocess.Popen(command, stdin=subprocess.PIPE, env=environment, pass_fds=[listener.fileno()])
    except OSError:  # such as a path that is too long for a socket
        shutil.rmtree(folder)
        return None
    os.environ[VARIABLE] = address
    atexit.register(_end, server)
    return server


def _end(server: subprocess.Popen) -> None:
    server.stdin.close()
    server.wait()


def warm(*modules: str) -> None:
    """Have a warm process run this script, which has just begun, and end as it does there. Returns where none does that.

    The server has imported what the script imports at its top, and ``modules``, with those that they name as ``LATE``.
    """
    if (address := os.environ.get(VARIABLE, OFF)) == OFF:
        return
    request = {
        "script": os.path.abspath(sys.argv[0]),  # Snakemake's copy, which says what is asked; __file__ is the original
        "modules": modules,
        "words": sys.argv,
        "path": sys.path,
        "prefix": sys.prefix,
        "folder": os.getcwd(),
        "environment": {name: value for name, value in os.environ.items() if name != VARIABLE},
    }
    text, answer = json.dumps(request).encode(), b""
    heeded = signal.signal(signal.SIGINT, signal.SIG_IGN)  # a terminal interrupts the fork, too
    with contextlib.suppress(OSError), socket.socket(socket.AF_UNIX) as server:
        server.connect(address)
        socket.send_fds(server, [_HEAD.pack(len(text))], _FILES)
        server.sendall(text)
        answer = server.recv(_CODE.size)
    signal.signal(signal.SIGINT, heeded)
    if len(answer) < _CODE.size:
        return
    if (code := _CODE.unpack(answer)[0]) < 0:
        with contextlib.suppress(OSError):  # not for SIGKILL
            signal.signal(-code, signal.SIG_DFL)
        os.kill(os.getpid(), -code)
    os._exit(code)


@dataclass
class _Fork:
    """A script that is run: its process, that process's handle, and the socket of the script that waits for it."""

    process: int
    handle: int
    asks: socket.socket


class Server:
    """Imports and forks for what comes in by ``listener`` until standard input ends."""

    def __init__(self, listener: socket.socket):
        self.listener, self.forks = listener, []
        self.events = selectors.DefaultSelector()
        self.events.register(sys.stdin.fileno(), selectors.EVENT_READ)
        self.events.register(listener, selectors.EVENT_READ)

    def serve(self) -> dict[str, Any] | None:
        """Returns the request in a fork, which is to run it, and None in the server when it is over."""
        while True:
            for key, _ in self.events.select():
                if key.fd == sys.stdin.fileno():
                    for fork in self.forks:
                        os.kill(fork.process, signal.SIGTERM)
                    return None
                if key.fd == self.listener.fileno():
                    if request := self.fork():
                        return request
                elif key.data in self.forks:
                    self.told(key.data, ended=key.fd == key.data.handle)

    def fork(self) -> dict[str, Any] | None:
        """Fork for the next script; returns its request in the fork. One that is not served gets no answer."""
        asks, _ = self.listener.accept()
        request, files = _received(asks)
        if request is None or not _is_served(request, asks):
            child = 0
        elif not (child := os.fork()):
            self.events.close()
            for inherited in [asks, *(fork.asks for fork in self.forks)]:
                inherited.close()
            return request | {"files": files}
        for file in files:
            os.close(file)
        if not child:
            asks.close()
            return None
        fork = _Fork(child, os.pidfd_open(child), asks)
        self.forks.append(fork)
        self.events.register(fork.handle, selectors.EVENT_READ, fork)
        self.events.register(asks, selectors.EVENT_READ, fork)
        return None

    def told(self, fork: _Fork, *, ended: bool) -> None:
        """Answer with the exit code of a fork that has ended; end one whose script has been."""
        if not ended:
            self.events.unregister(fork.asks)
            fork.asks.close()
            os.kill(fork.process, signal.SIGTERM)
            return
        _, status = os.waitpid(fork.process, 0)
        self.events.unregister(fork.handle)
        os.close(fork.handle)
        self.forks.remove(fork)
        if fork.asks.fileno() >= 0:
            self.events.unregister(fork.asks)
            with contextlib.suppress(OSError):
                fork.asks.sendall(_CODE.pack(os.waitstatus_to_exitcode(status)))
            fork.asks.close()


def _received(asks: socket.socket) -> tuple[dict[str, Any] | None, list[int]]:
    """A request and the files that came with it; None where a script was gone before it had asked."""
    head, files, _, _ = socket.recv_fds(asks, _HEAD.size, len(_FILES))
    text = b""
    if len(head) == _HEAD.size:
        with asks.makefile("rb") as stream:
            text = stream.read(_HEAD.unpack(head)[0])
    return (json.loads(text) if text else None), files


def _is_served(request: dict[str, Any], asks: socket.socket) -> bool:
    """Whether a script is of the server's own Snakemake and Python, and all that it needs could be imported."""
    process, _, _ = _PEER.unpack(asks.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, _PEER.size))
    if request["prefix"] != sys.prefix or os.getppid() not in _ancestors(process):
        return False
    sys.path[:] = [*dict.fromkeys([*sys.path, *request["path"]])]
    try:
        tops = ast.parse(Path(request["script"]).read_text(encoding="utf-8")).body
        wanted = [node.module for node in tops if isinstance(node, ast.ImportFrom) and node.module]
        for module in map(importlib.import_module, [*wanted, *request["modules"]]):
            for late in getattr(module, "LATE", ()):
                importlib.import_module(late)
    except Exception:  # whatever it is, the script itself tells it where it belongs
        return False
    gc.freeze()  # or a fork's first collection writes to all pages that it shares
    return True


def _ancestors(process: int) -> list[int]:
    found = []
    with contextlib.suppress(OSError):
        for _ in range(_ANCESTORS):
            process = parent_of(process)
            found.append(process)
    return found


def _run(request: dict[str, Any]) -> None:
    """Run a script in this process as in one of its own."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    for number, file in zip(_FILES, request["files"], strict=True):
        os.dup2(file, number)
        os.close(file)
    os.chdir(request["folder"])
    os.environ.clear()
    os.environ.update(request["environment"])
    sys.argv, sys.path[:] = request["words"], request["path"]
    runpy.run_path(request["script"], run_name="__main__")


def main(address: str, listener: str) -> None:
    """The server, and in a fork of it the script."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with socket.socket(fileno=int(listener)) as found:
        request = Server(found).serve()
    if request:
        _run(request)
    else:
        Path(address).unlink(missing_ok=True)
        Path(address).parent.rmdir()


if __name__ == "__main__":
    main(*sys.argv[1:])
