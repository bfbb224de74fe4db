"""The plan of a sweep, handed to the jobs of a cluster: they need not read all results to know what their own case is.

Jobs get its path by an environment variable, which Slurm passes on. Where it does not arrive they make the plan themselves.
"""

from __future__ import annotations

import os
import pickle
import platform
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from limo.cases.plan import Plan
from limo.errors import ClusterError
from limo.store.digest import digest
from limo.store.files import write_whole

VARIABLE = "LIMO_PLAN"
#: what to do where a build does not run on a node
OTHER_NODES = (
    "ask for nodes like the login node (constraint), or use a build that runs on all, "
    "for example solver: {build: stock} in config/config.yaml"
)
FOLDER = Path(".snakemake/limo")


@dataclass(frozen=True)
class Handed:
    """A plan with the builds of engines that it was made for."""

    plan: Plan
    builds: Mapping[str, str]

    def check_build(self, engine: str, found: str) -> None:
        """Raise ``ClusterError`` if this machine would solve by another build of an engine than results are named by."""
        if (planned := self.builds.get(engine, found)) != found:
            raise ClusterError(
                f"{platform.node()}: engine {engine} is the build {found} here, the sweep was planned with {planned}, which does "
                f"not run on this node; {OTHER_NODES}"
            )


def hand(plan: Plan, builds: Mapping[str, str], folder: Path = FOLDER) -> Path:
    """Write a plan for the jobs that this process is going to submit; those of earlier sweeps are removed."""
    data = pickle.dumps(Handed(plan, dict(builds)))
    file = folder.resolve() / f"plan_{digest([len(data), sorted(plan.to_solve), os.getpid()])}.pickle"
    for old in folder.glob("plan_*.pickle"):
        old.unlink(missing_ok=True)
    write_whole(file, lambda aside: aside.write_bytes(data))
    os.environ[VARIABLE] = str(file)
    return file


def handed(file: Path | None = None) -> Handed | None:
    """The plan of a file, or that was handed to this process; None where none was, or by another version of the project."""
    try:
        found = pickle.loads((file or Path(os.environ[VARIABLE])).read_bytes())
    except (KeyError, OSError, pickle.UnpicklingError, AttributeError, ImportError, EOFError, TypeError):
        return None
    return found if isinstance(found, Handed) else None


def was_handed(folder: Path) -> bool:
    """Whether a sweep of a folder was ever submitted to a cluster."""
    return any((folder / FOLDER).glob("plan_*.pickle"))
