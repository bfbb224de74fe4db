"""From a case and a mesh to its result: volumes at every increment, chosen displacement frames, and a status.

A case that fails is data: whatever was accepted before it failed is kept, with the status and the reason.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import xarray as xr

from limo.cases.case import Case, describe
from limo.engines.engine import Engine, EngineSettings
from limo.engines.find import find_engine
from limo.engines.load_path import LoadPath
from limo.errors import LimoError
from limo.measure.ramp import ramp_of
from limo.mechanics.build import build_model
from limo.mechanics.model import Model
from limo.mesh.device import mesh_device
from limo.mesh.file import read_mesh, write_mesh
from limo.mesh.layers import DeviceMesh
from limo.schema.section import STAGES
from limo.schema.solver import Limits, Rung
from limo.solve.beginning import Beginning, beginning
from limo.solve.harvest import energy_balance, harvest, middles, rest
from limo.solve.judge import measure, remarks, verdict
from limo.solve.ladder import CONFIGURED, climb
from limo.store.files import stamp_of, write_json, write_netcdf, write_whole
from limo.store.results import NUMERICS, OWN_MESH
from limo.store.statuses import USABLE

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class SolveSettings(EngineSettings):
    """How a case is solved: besides how its engine is run, the limits that a result must keep and the recovery ladder.

    ``recovery`` is kept in the status: what the ladder was when the case was solved.
    """

    limits: Limits = field(default_factory=Limits)
    rungs: Sequence[Rung] = ()
    recovery: str = ""


@dataclass(frozen=True)
class Attempt:
    """One solve of a case: with which rung and on which mesh, how it ended, what it left, and what it cost."""

    rung: str
    case: Case
    mesh: DeviceMesh
    status: str
    reason: str
    path: LoadPath
    history: xr.Dataset
    frames: xr.Dataset
    summary: dict

    @property
    def standing(self) -> tuple[bool, bool, float]:
        """By which the best of several attempts is chosen: usable, converged, P_a reached (kPa)."""
        return self.status in USABLE, self.status == "converged", self.summary["actuation_pressure_reached"]


def solve_case(case: Case, mesh_file: Path, folder: Path, settings: SolveSettings, fit: Sequence[Path] = ()) -> dict[str, Any]:
    """Solve ``case`` and write ``case.json``, ``status.json``, ``volumes.nc``, ``frames.nc`` into ``folder``; returns the status.

    ``fit``: of the case at whose state at rest it begins the mesh's file, and those of the solved case.
    The engine runs in ``folder/run``: large files of its own are removed, deck, log and .sta stay. While a case fails, the
    rungs of the ladder are climbed one after the other; the best attempt is kept, and all of them are in the status.
    """
    began = beginning(case, fit)
    attempts, best = _climbed(case, read_mesh(mesh_file, case.mesh.symmetry), folder, settings, began)
    summary = _summary(case, attempts, best, settings) | began.summary
    summary["files"] = {name: stamp_of(folder / name) for name in _write(case, best, summary, folder)}
    # of this process, start and imports included
    in_process = sum(attempt.path.cpu_seconds for attempt in attempts if attempt.path.in_process)
    summary["python_cpu_seconds"] = round(time.process_time() - in_process, 2)
    write_json(folder / "status.json", summary)
    for pattern in find_engine(case.engine).LARGE_FILES:
        for large in (folder / "run").glob(pattern):
            large.unlink()
    return summary


def _climbed(
    case: Case, mesh: DeviceMesh, folder: Path, settings: SolveSettings, began: Beginning
) -> tuple[list[Attempt], Attempt]:
    """All attempts at a case in their order, of which only the last keeps its datasets, and the best one."""
    attempts = [_attempt(CONFIGURED, case, mesh, folder, settings, began)]
    best = attempts[0]
    for rung in settings.rungs:
        before = attempts[-1]
        if before.status in USABLE or before.path.interrupted or not _began(before.path):
            break
        if (following := _following(before, rung)) is None:
            continue
        # a path is one of a mesh
        after = before.path if following[1] is before.mesh else None
        attempts.append(_attempt(rung.name, *following, folder, settings, began, after))
        best = max(best, attempts[-1], key=lambda attempt: attempt.standing)
        attempts[:-1] = [replace(a, history=None, frames=None) for a in attempts[:-1]]
    return attempts, best


def _following(before: Attempt, rung: Rung) -> tuple[Case, DeviceMesh] | None:
    """The case and the mesh of another attempt; None where a rung changes nothing or its mesh cannot be made."""
    climbed = climb(before.case, rung, before.path.ended_in)
    if climbed == before.case:
        return None
    log.info("%s: %s; tried again with %s", before.status, before.reason, rung.name)
    if climbed.mesh_content() == before.case.mesh_content():
        return climbed, before.mesh
    try:
        return climbed, mesh_device(climbed.mesh_content())
    except LimoError as error:
        log.warning("%s: %s", rung.name, error)
        return None


def _began(path: LoadPath) -> bool:
    """Whether an engine took a step at all; what it refuses to begin, it refuses with other numerics too."""
    return path.status != "crashed" or sum(path.iterations.values()) > 0


def _attempt(
    rung: str,
    case: Case,
    mesh: DeviceMesh,
    folder: Path,
    settings: SolveSettings,
    began: Beginning,
    after: LoadPath | None = None,
) -> Attempt:
    """Solve a case once in an empty ``folder/run``, and judge it. ``after``: path of the attempt before, to carry on from."""
    run_folder = folder / "run"
    run_folder.mkdir(parents=True, exist_ok=True)
    for stale in run_folder.iterdir():
        stale.unlink()
    if rung != CONFIGURED:
        write_json(run_folder / NUMERICS, case.numerics.model_dump(mode="json"))
    model = build_model(case, mesh)
    log.info("%s, %s: %d elements, %d equations or more", case.case_id, rung, len(mesh.quads), 3 * len(model.nodes))
    with find_engine(case.engine).solve(model, run_folder, settings, after, began.on(model)) as path:
        history, frames, problem = harvest(model, path)
        ends = middles(model, path, history)
    status, reason = path.status, path.reason
    if problem:
        status, reason = ("diverged" if status == "converged" else status), f"{reason} {problem}".strip()
    rested = {"rest_change": 0.0, "rested": True} if path.is_static else rest(history, case.numerics.rest_tolerance)
    balance = energy_balance(model, history, frames)
    checks = measure(model, history, ramp_of(history), frames, balance, rested["rested"], ends)
    status, reason = verdict(status, reason, checks, settings.limits)
    summary = {
        "actuation_pressure_reached": _reached(history),
        "increments": len(path.stage),
        "degrees_of_freedom": 3 * len(model.expansion.nodes),
        **rested,
        **balance,
        "remarks": remarks(checks, settings.limits) if status in USABLE else [],
        "checks": {k: v for k, v in asdict(checks).items() if k not in ("rested", "dissipated_fraction")},
    }
    return Attempt(rung, case, mesh, status, reason, path, history, frames, summary)


def _reached(history: xr.Dataset) -> float:
    """P_a in kPa to which the ramp came; what follows it goes down again."""
    before = history.stage.values != STAGES.index("cycle")
    return float(history.actuation_pressure.values[before][-1]) if before.any() else 0.0


def _is_elsewhere(case: Case, best: Attempt) -> bool:
    """Whether the best attempt stands on another mesh than the case names."""
    return best.case.mesh_content() != case.mesh_content()


def _summary(case: Case, attempts: list[Attempt], best: Attempt, settings: SolveSettings) -> dict[str, Any]:
    """What the status says but of files and of this process."""
    paths = [attempt.path for attempt in attempts]
    status, reason = best.status, best.reason
    if _is_elsewhere(case, best):
        status = "degraded" if status in USABLE else status
        reason = "; ".join(filter(None, [reason, f"solved on another mesh: {best.rung}, {len(best.mesh.quads)} elements"]))
    interrupted = best.status not in USABLE and attempts[-1].path.interrupted
    if interrupted:
        reason = f"{attempts[-1].reason}; solved again when the sweep is started again"
    return {
        "case": case.case_id,
        "engine": case.engine,
        "status": status,
        "reason": reason,
        **best.summary,
        "rejected_attempts": sum(p.rejected for p in paths),
        "iterations": sum(sum(p.iterations.values()) for p in paths),
        "iterations_by_stage": {s: sum(p.iterations[s] for p in paths) for s in STAGES},
        "solver": best.path.build,
        "threads": settings.solver.threads,
        "solver_cpu_seconds": round(sum(p.cpu_seconds for p in paths), 2),
        "solver_wall_seconds": round(sum(p.wall_seconds for p in paths), 2),
        "solver_memory_mib": round(max(p.memory for p in paths), 1),
        "elements": len(best.mesh.quads),
        **best.path.details,
        "limits": settings.limits.model_dump(),
        "attempts": [_record(attempt) for attempt in attempts],
        "recovery": settings.recovery,
        "interrupted": interrupted,
    }


def _record(attempt: Attempt) -> dict[str, Any]:
    """What the status keeps of an attempt."""
    return {
        "rung": attempt.rung,
        "status": attempt.status,
        "reason": attempt.reason,
        "ended_in": attempt.path.ended_in,
        "elements": len(attempt.mesh.quads),
        "actuation_pressure_reached": attempt.summary["actuation_pressure_reached"],
        "iterations": sum(attempt.path.iterations.values()),
        "solver_cpu_seconds": round(attempt.path.cpu_seconds, 2),
        "solver_wall_seconds": round(attempt.path.wall_seconds, 2),
    }


def _write(case: Case, best: Attempt, summary: dict[str, Any], folder: Path) -> list[str]:
    """Write what is kept of the best attempt, and its mesh where the case names another one; returns the files' names."""
    files, description = ["case.json", "frames.nc", "volumes.nc"], describe(case)
    if _is_elsewhere(case, best):
        files.append(OWN_MESH)
        write_whole(folder / OWN_MESH, lambda aside: write_mesh(best.mesh, aside))
        description["solved_on"] = {key: getattr(best.case, key).model_dump(mode="json") for key in ("mesh", "mesh_level")}
    else:
        (folder / OWN_MESH).unlink(missing_ok=True)
    history = best.history.assign_attrs(case=case.case_id, status=summary["status"], reason=summary["reason"])
    write_json(folder / "case.json", description)
    write_netcdf(best.frames, folder / "frames.nc")
    write_netcdf(history, folder / "volumes.nc")
    return files


def follow(engine: Engine, model: Model, run_folder: Path, settings: EngineSettings) -> tuple[str, xr.Dataset]:
    """How a model's path ends, and its volumes at every increment: a solve of which nothing is kept."""
    with engine.solve(model, run_folder, settings) as path:
        return path.status, harvest(model, path)[0]
