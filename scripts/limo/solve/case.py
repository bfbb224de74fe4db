"""From a case and a mesh to its result: volumes at every increment, chosen displacement frames, and a status.

A case that fails is data: whatever was accepted before it failed is kept, with the status and the reason.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import xarray as xr

from limo.cases.case import Case, describe
from limo.engines import Path as EnginePath
from limo.engines.run import path_of
from limo.errors import LimoError
from limo.measure.ramp import ramp_of
from limo.mechanics.build import build_model
from limo.mechanics.model import Model
from limo.mesh.device import mesh_device
from limo.mesh.file import read_mesh, write_mesh
from limo.mesh.layers import DeviceMesh
from limo.schema.section import STAGES
from limo.schema.solver import Limits, Rung, Solver
from limo.solve.harvest import _energy, _harvest, _rest
from limo.solve.judge import measure, verdict
from limo.solve.ladder import CONFIGURED, climb
from limo.store.files import stamp_of, write_json, write_netcdf, write_whole
from limo.store.results import NUMERICS, OWN_MESH
from limo.store.statuses import USABLE

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Attempt:
    """One solve of a case: with which rung and on which mesh, how it ended, what it left, and what it cost."""

    rung: str
    case: Case
    mesh: DeviceMesh
    status: str
    reason: str
    path: EnginePath
    history: xr.Dataset
    frames: xr.Dataset
    summary: dict

    @property
    def standing(self) -> tuple[bool, bool, float]:
        """By which the best of several attempts is chosen: usable, converged, P_a reached (kPa)."""
        return self.status in USABLE, self.status == "converged", self.summary["actuation_pressure_reached"]


def solve_case(
    case: Case,
    mesh_file: Path,
    folder: Path,
    solver: Solver,
    command: Path | None = None,
    limits: Limits | None = None,
    rungs: Sequence[Rung] = (),
    recovery: str = "",
) -> dict:
    """Solve ``case`` and write ``case.json``, ``status.json``, ``volumes.nc``, ``frames.nc`` into ``folder``; returns the status.

    ``command`` is CalculiX's executable. It runs in ``folder/run``: its own large files are removed, deck, log and .sta stay.
    While a case fails, ``rungs`` are climbed one after the other; the best attempt is kept, and all of them are in the status.
    ``recovery`` is kept there too: what the ladder was when the case was solved.
    """
    limits = limits or Limits()
    mesh = read_mesh(mesh_file, case.mesh.symmetry)
    attempts = [_attempt(CONFIGURED, case, mesh, folder, solver, command, limits)]
    best, tried = attempts[0], case
    for rung in rungs:
        before = attempts[-1]
        if before.status in USABLE or before.path.interrupted or not _began(before.path):
            break
        if (climbed := climb(tried, rung, before.path.ended_in)) == tried:
            continue
        stays = climbed.mesh_content() == tried.mesh_content()
        log.info("%s: %s; tried again with %s", before.status, before.reason, rung.name)
        try:
            mesh = mesh if stays else mesh_device(climbed.mesh_content())
        except LimoError as error:
            log.warning("%s: %s", rung.name, error)
            continue
        tried = climbed
        attempts.append(_attempt(rung.name, tried, mesh, folder, solver, command, limits, before.path if stays else None))
        best = max(best, attempts[-1], key=lambda attempt: attempt.standing)
        attempts[:-1] = [replace(a, history=None, frames=None) for a in attempts[:-1]]
    paths = [attempt.path for attempt in attempts]
    status, reason, elsewhere = best.status, best.reason, best.case.mesh_content() != case.mesh_content()
    if elsewhere:
        status = "degraded" if status in USABLE else status
        reason = "; ".join(filter(None, [reason, f"solved on another mesh: {best.rung}, {len(best.mesh.quads)} elements"]))
    summary = {
        "case": case.case_id,
        "engine": case.engine,
        "status": status,
        "reason": reason,
        **best.summary,
        "rejected_attempts": sum(p.rejected for p in paths),
        "iterations": sum(sum(p.iterations.values()) for p in paths),
        "iterations_by_stage": {s: sum(p.iterations[s] for p in paths) for s in STAGES},
        "solver": best.path.build,
        "threads": solver.threads,
        "solver_cpu_seconds": round(sum(p.cpu_seconds for p in paths), 2),
        "solver_wall_seconds": round(sum(p.wall_seconds for p in paths), 2),
        "solver_memory_mib": round(max(p.memory for p in paths), 1),
        "elements": len(best.mesh.quads),
        **best.path.details,
        "limits": limits.model_dump(),
        "attempts": [_record(attempt) for attempt in attempts],
        "recovery": recovery,
        "interrupted": best.status not in USABLE and attempts[-1].path.interrupted,
    }
    if summary["interrupted"]:
        summary["reason"] = f"{attempts[-1].reason}; solved again when the sweep is started again"
    best.history.attrs |= {"case": case.case_id, "status": summary["status"], "reason": summary["reason"]}
    files, described = ["case.json", "frames.nc", "volumes.nc"], describe(case)
    if elsewhere:
        files.append(OWN_MESH)
        write_whole(folder / OWN_MESH, lambda aside: write_mesh(best.mesh, aside))
        described["solved_on"] = {key: getattr(best.case, key).model_dump(mode="json") for key in ("mesh", "mesh_level")}
    else:
        (folder / OWN_MESH).unlink(missing_ok=True)
    write_json(folder / "case.json", described)
    write_netcdf(best.frames, folder / "frames.nc")
    write_netcdf(best.history, folder / "volumes.nc")
    summary["files"] = {name: stamp_of(folder / name) for name in files}
    # of this process, start and imports included
    in_process = sum(p.cpu_seconds for p in paths if p.in_process)
    summary["python_cpu_seconds"] = round(time.process_time() - in_process, 2)
    write_json(folder / "status.json", summary)
    for pattern in ("*.frd", "*.dat", "*.12d", "*.eig", "spooles.out"):
        for large in (folder / "run").glob(pattern):
            large.unlink()
    return summary


def _attempt(
    rung: str,
    case: Case,
    mesh: DeviceMesh,
    folder: Path,
    solver: Solver,
    command: Path | None,
    limits: Limits,
    before: EnginePath | None = None,
) -> Attempt:
    """Solve a case once in an empty ``folder/run``, and judge it. ``before``: path of the attempt before, to carry on from."""
    run_folder = folder / "run"
    run_folder.mkdir(parents=True, exist_ok=True)
    for stale in run_folder.iterdir():
        stale.unlink()
    if rung != CONFIGURED:
        write_json(run_folder / NUMERICS, case.numerics.model_dump(mode="json"))
    model = build_model(case, mesh)
    log.info("%s, %s: %d elements, %d equations or more", case.case_id, rung, len(mesh.quads), 3 * len(model.nodes))
    with path_of(model, run_folder, solver, command, before) as path:
        history, frames, harvest_error = _harvest(model, path)
    status, reason = path.status, path.reason
    if harvest_error:
        status, reason = ("diverged" if status == "converged" else status), f"{reason} {harvest_error}".strip()
    rest = {"rest_change": 0.0, "rested": True} if path.is_static else _rest(history, case.numerics.rest_tolerance)
    balance = _energy(model, history, frames)
    checks = measure(model, history, ramp_of(history), frames, balance, rest["rested"])
    status, reason = verdict(status, reason, checks, limits)
    reached = float(history.actuation_pressure[-1]) if history.sizes["increment"] else 0.0
    summary = {
        "actuation_pressure_reached": reached,
        "increments": len(path.stage),
        "degrees_of_freedom": 3 * len(model.expansion.nodes),
        **rest,
        **balance,
        "checks": {k: v for k, v in asdict(checks).items() if k not in ("rested", "dissipated_fraction")},
    }
    return Attempt(rung, case, mesh, status, reason, path, history, frames, summary)


def _began(path: EnginePath) -> bool:
    """Whether an engine took a step at all; what it refuses to begin, it refuses with other numerics too."""
    return path.status != "crashed" or sum(path.iterations.values()) > 0


def _record(attempt: Attempt) -> dict:
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


def follow(model: Model, run_folder: Path, solver: Solver, command: Path | None = None) -> tuple[str, xr.Dataset]:
    """How a model's path ends, and its volumes at every increment: a solve of which nothing is kept."""
    with path_of(model, run_folder, solver, command, None) as path:
        return path.status, _harvest(model, path)[0]
