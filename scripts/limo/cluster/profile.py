"""The profiles in ``workflow/profiles``, by which Snakemake knows a cluster."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from importlib.machinery import PathFinder
from pathlib import Path

import yaml

from limo.errors import ClusterError, ConfigError

FOLDER = Path(__file__).parents[3] / "workflow" / "profiles"
#: where ``make cluster`` puts Snakemake's plugin for Slurm; only a Snakemake that is to submit looks into it
PLUGINS = Path(__file__).parents[3] / ".local" / "cluster" / "plugins"


@dataclass(frozen=True)
class Profile:
    """A cluster's profile: its folder, Snakemake's executor, jobs at once, and the partition that it names ("": none)."""

    folder: Path
    executor: str
    jobs: int
    partition: str = ""


def names() -> list[str]:
    """Names of the profiles of clusters."""
    return sorted(file.parent.name for file in FOLDER.glob("*/config.yaml"))


def read_profile(name: str) -> Profile:
    """The profile of a name. Raises ``ConfigError`` for one that is not there or says something else."""
    file = FOLDER / name / "config.yaml"
    try:
        data = yaml.safe_load(file.read_text(encoding="utf-8"))
        partition = (data.get("default-resources") or {}).get("slurm_partition", "")
        return Profile(file.parent, str(data["executor"]), int(data.get("jobs", 100)), str(partition))
    except OSError:
        raise ConfigError(FOLDER, "--on", name, f"one of: {', '.join(names())}", "--on slurm") from None
    except (yaml.YAMLError, KeyError, TypeError, ValueError, AttributeError) as error:
        raise ConfigError(file, "executor", "?", f"a profile of Snakemake ({error})", "executor: slurm") from None


def require_plugin(executor: str) -> None:
    """Raise ``ClusterError`` where Snakemake has no plugin for an executor."""
    if PathFinder.find_spec(f"snakemake_executor_plugin_{executor.replace('-', '_')}", [*sys.path, str(PLUGINS)]) is None:
        example = "make cluster" if executor == "slurm" else f"pip install snakemake-executor-plugin-{executor}"
        raise ClusterError(f"Snakemake has no plugin for {executor} here; for example: {example}")
