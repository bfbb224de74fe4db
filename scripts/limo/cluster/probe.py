"""One short job before all others: whether a node sees this folder, and whether the engines' builds run there.

The job looks for a file of this folder, then lets each engine iterate on a small device. What it finds is written into the
folder, and asked again only where partition, builds or folder are others.
"""

from __future__ import annotations

import platform
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from limo.cases.case import Case
from limo.cluster import slurm
from limo.cluster.handed import FOLDER, OTHER_NODES, Handed, handed
from limo.cluster.resources import SNAKEMAKE_MIB
from limo.engines.engine import EngineSettings
from limo.engines.find import find_builds, find_engine
from limo.errors import ClusterError, LimoError, ResultError
from limo.schema.numerics import MeshLevel
from limo.schema.solver import Solver
from limo.store.digest import digest
from limo.store.files import read_json, write_json

MINUTES, MEMORY = 10, SNAKEMAKE_MIB + 700
#: displacements of the device on which an engine is tried
SMALL = MeshLevel(degrees_of_freedom=3000, grading=1.0)
#: s between two questions, and s that a shared folder may take to show a file
_EVERY, _LATE = 1.0, 20.0


def probe_node(options: Mapping[str, str], solver: Solver, plan_file: Path, builds: Mapping[str, str], patience: float) -> str:
    """Submit the job with some options of sbatch, wait for it, and return the node that answered; "" where it is known.

    Raises ``ClusterError`` where no node answers within ``patience`` s, it does not see the folder, or a build does not run.
    """
    folder = FOLDER.resolve()
    key = digest({"options": dict(options), "builds": dict(builds), "python": sys.executable, "folder": str(folder)})
    answer = folder / f"node_{key}.json"
    if _answered(answer) and not read_json(answer).get("lacks"):
        return ""
    answer.unlink(missing_ok=True)
    request = {"solver": solver.model_dump(mode="json"), "answer": str(answer)}
    write_json(folder / f"ask_{key}.json", request)
    command = shlex.join([sys.executable, "-m", "limo.cluster.probe", str(folder / f"ask_{key}.json"), str(plan_file)])
    command = f"PYTHONPATH={shlex.quote(str(Path(__file__).parents[2]))} {command}"
    number = _submit(options, command)
    try:
        _wait(answer, number, patience)
    except BaseException:
        subprocess.run(["scancel", number], capture_output=True, check=False)
        raise
    found = read_json(answer)
    if found["lacks"]:
        raise ClusterError(f"node {found['node']} ({found['processor']}): {found['lacks']}")
    return str(found["node"])


def _answered(answer: Path) -> bool:
    try:
        return "node" in read_json(answer)
    except ResultError:
        return False


def _submit(options: Mapping[str, str], command: str) -> str:
    """Number of the job. Raises ``ClusterError`` where Slurm refuses it."""
    # not in this folder, nor a log in it: it may not be there
    words = ["sbatch", "--parsable", "--export=ALL", "--job-name=limo_probe", "--chdir=/", "--output=/dev/null"]
    words += [f"--time={MINUTES}", f"--mem={MEMORY}", "--ntasks=1", *(f"--{k}={v}" for k, v in options.items())]
    done = subprocess.run([*words, f"--wrap={command}"], capture_output=True, text=True, timeout=slurm.TIMEOUT, check=False)
    if done.returncode:
        said = (done.stderr.strip().splitlines() or [""])[-1]
        raise ClusterError(f"sbatch: Slurm refuses a job of {MINUTES} min and {MEMORY} MiB: {said}")
    return done.stdout.strip().split(";")[0]


def _wait(answer: Path, number: str, patience: float) -> None:
    until, ended = time.monotonic() + patience, None
    while not _answered(answer):
        if ended is None and not slurm.is_alive(number):
            ended = time.monotonic()
        if ended is not None and time.monotonic() > ended + _LATE:
            raise ClusterError(
                f"{answer.parents[2]}: a job ran on a node and left no answer here: this folder, or the Python in "
                f"{Path(sys.executable).parent}, is not shared with the nodes; move the project to a shared file system"
            )
        if time.monotonic() > until:
            raise ClusterError(f"Slurm started no job within {patience / 60:g} min; squeue --me says what the job waits for")
        time.sleep(_EVERY)


# --------------------------------------------------------------------------------------------------------------------
# on the node


def answer_request(request: Path, plan_file: Path) -> None:
    """What the job does: try the engines of a plan, and write what this node lacks."""
    asked = read_json(request)
    found = {"node": platform.node(), "processor": platform.processor() or platform.machine(), "lacks": ""}
    try:
        _try_engines(handed(plan_file), Solver.model_validate(asked["solver"]))
    except LimoError as error:
        found["lacks"] = str(error)
    except Exception as error:  # whatever it is, it would be so in a thousand jobs
        found["lacks"] = f"{type(error).__name__}: {error}"
    write_json(Path(asked["answer"]), found)


def _try_engines(given: Handed | None, solver: Solver) -> None:
    if given is None:
        raise ClusterError("the plan of the sweep cannot be read here; set the project up again on the login node: make setup")
    cases = {given.plan.cases[case_id].engine: given.plan.cases[case_id] for case_id in given.plan.to_solve}
    for engine, case in cases.items():
        build = find_builds(solver, "config/config.yaml", [engine])[engine]
        given.check_build(engine, build.id)
        _try(engine, case, EngineSettings(solver, build.command))


def _try(engine: str, case: Case, settings: EngineSettings) -> None:
    """Let an engine iterate on a small mesh of a case's device, in a process of its own: a wrong build dies of a signal."""
    from concurrent.futures import ProcessPoolExecutor
    from concurrent.futures.process import BrokenProcessPool
    from multiprocessing import get_context

    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        try:
            iterations, reason = pool.submit(_iterate, engine, case, settings).result()
        except BrokenProcessPool:
            raise ClusterError(f"engine {engine} was ended by a signal, its build does not run here; {OTHER_NODES}") from None
    if not iterations:
        raise ClusterError(f"engine {engine} does not iterate here ({reason}); {OTHER_NODES}")


def _iterate(engine: str, case: Case, settings: EngineSettings) -> tuple[int, str]:
    from limo.mechanics.build import build_model
    from limo.mesh.device import mesh_device

    small = replace(case, mesh_level=SMALL)
    folder = Path(tempfile.mkdtemp(prefix="limo_probe_"))
    try:
        sample = find_engine(engine).sample(build_model(small, mesh_device(small.mesh_content())), folder, settings)
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    return sample.iterations, sample.reason


if __name__ == "__main__":
    answer_request(Path(sys.argv[1]), Path(sys.argv[2]))
