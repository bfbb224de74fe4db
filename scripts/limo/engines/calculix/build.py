"""Which CalculiX is used: found, identified, and tried out."""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
import subprocess
from pathlib import Path

from limo.errors import ConfigError, SolverNotFoundError
from limo.schema.solver import Solver

LOCAL = Path(__file__).parents[4] / ".local" / "bin" / "ccx"


TUNED = Path(__file__).parents[4] / ".local" / "ccx-tuned" / "bin" / "ccx"


def find_ccx(solver: Solver, config_file: str = "config/config.yaml") -> Path:
    """The executable: ``solver.command``; else, by ``solver.build``, the tuned build, ``ccx`` on PATH, or the one in ``.local``.

    Raises ``ConfigError`` for a command that is not an executable, ``SolverNotFoundError`` when there is none at all.
    """
    if solver.command:
        path = shutil.which(solver.command)
        if not path:
            raise ConfigError(
                config_file, "solver.command", solver.command, "the path of a CalculiX executable", "command: /usr/bin/ccx"
            )
        return Path(path).absolute()
    if solver.build != "stock" and tuned_build_runs():
        return TUNED.absolute()
    if solver.build == "tuned":
        raise SolverNotFoundError(
            "There is no tuned CalculiX in .local/ccx-tuned for this machine: `make ccx-tuned` builds it and says what is "
            "missing; or use the stock one with solver: {build: stock} in config/config.yaml"
        )
    path = shutil.which("ccx") or (str(LOCAL) if os.access(LOCAL, os.X_OK) else None)
    if not path:
        raise SolverNotFoundError(
            "CalculiX was not found: no ccx on PATH and none in .local/bin. "
            "`make setup` installs it; or name it in config/config.yaml, for example solver: {command: /usr/bin/ccx}"
        )
    return Path(path).absolute()


def tuned_build_runs() -> bool:
    """Whether the tuned build is there, was made for this processor, and starts (its libraries are in .venv)."""
    built_for = _tuned_facts(TUNED).get("processor")
    return built_for is not None and built_for == _processor() and "Version" in _version_text(TUNED)


def _processor() -> str:
    """The processor's name and a hash of its features, as ``scripts/ccx/build.sh`` writes them down."""
    lines = dict(re.findall(r"^(model name|flags)\s*: (.*)$", Path("/proc/cpuinfo").read_text(), re.MULTILINE))
    features = hashlib.sha256(lines.get("flags", "").encode()).hexdigest()[:8]
    return f"{lines.get('model name', '')}, features {features}"


def _tuned_facts(command: Path) -> dict[str, str]:
    """What ``scripts/ccx/build.sh`` wrote down about a build; empty for any other executable."""
    facts = command.parent.parent / "build.json"
    return json.loads(facts.read_text()) if command == TUNED and facts.exists() and os.access(command, os.X_OK) else {}


def _version_text(command: Path) -> str:
    answer = subprocess.run([command, "-v"], capture_output=True, text=True, timeout=60, check=False)
    return answer.stdout + answer.stderr


def solver_build(command: Path) -> dict[str, str]:
    """Which build a result comes from: path, version and hash of the executable, and what a tuned one is made of."""
    version = re.search(r"Version\s+(\S+)", _version_text(command))
    facts = _tuned_facts(command)
    return {
        "command": str(command),
        "version": version.group(1) if version else "unknown",
        "sha256": hashlib.sha256(command.resolve().read_bytes()).hexdigest()[:16],
        "build": "tuned" if facts else "stock",
        **facts,
    }


def build_id(command: Path) -> str:
    """The build in short, as part of what determines a result: version and hash, wherever the executable lies."""
    build = solver_build(command)
    return f"{build['version']}-{build['sha256'][:8]}"
