"""From a case and a mesh to its result: volumes at every increment, chosen displacement frames, and a status.

A case that fails is data: whatever was accepted before it failed is kept, with the status and the reason.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
import xarray as xr

from limo.buckling import Event, events, largest_events
from limo.case import OWN_MESH, Case, describe
from limo.config import STAGES, Limits, Rung, Solver
from limo.energy import EnergyBalance, conjugate_volumes, energy_and_extremes_of, ramp_balance
from limo.engines import Path as EnginePath
from limo.engines import calculix
from limo.errors import LimoError, ResultError
from limo.files import UNREADABLE, stamp_of, write_json, write_netcdf, write_whole
from limo.judge import USABLE, measure, unbelievable, verdict
from limo.mesh import DeviceMesh, mesh_device, read_mesh, write_mesh
from limo.model import Model, build_model
from limo.progress import NUMERICS
from limo.recovery import CONFIGURED, climb
from limo.volumes import flux_triangles, volumes

log = logging.getLogger(__name__)
ML = 1.0e-3  # ml in a mm^3


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


@contextmanager
def path_of(
    model: Model, run_folder: Path, solver: Solver, command: Path | None, before: EnginePath | None
) -> Iterator[EnginePath]:
    """The path of a model by the engine of its case. CalculiX cannot carry on from ``before`` (see ``limo.deck``)."""
    if model.case.engine == "newton":
        from limo.engines import newton  # brings MKL, which the other engine does not need

        yield newton.solve(model, solver, after=before)
    else:
        with calculix.solve(model, run_folder, solver, command) as path:
            yield path


def _harvest(model: Model, path: EnginePath) -> tuple[xr.Dataset, xr.Dataset, str]:
    """Volumes of every increment up to the first that cannot be believed, and the displacements of the chosen ones."""
    case = model.case
    rows: list[tuple[float, ...]] = []
    states: list[tuple[float, ...]] = []
    frames: list[np.ndarray] = []
    motions: list[np.ndarray] = []
    kept: list[tuple[float, float]] = []
    around: dict[Event, list[np.ndarray]] = {}
    error = ""

    def displacements(k: int) -> np.ndarray:
        return path.displacements(k)[: model.reference_start]

    try:
        for k in range(len(path.stage)):
            u = path.displacements(k)
            if problem := unbelievable(u, np.nan, case.device.pattern.length):
                error = f"{problem} at P_a = {path.pressure[k]:g} kPa of the {STAGES[path.stage[k]]}"
                break
            energy, smallest, thinnest = 3 * (np.nan,) if model.is_shell else energy_and_extremes_of(model, u)
            if problem := unbelievable(u, smallest, case.device.pattern.length):
                error = f"{problem} at P_a = {path.pressure[k]:g} kPa of the {STAGES[path.stage[k]]}"
                break
            rows.append(_volumes(model, u))
            states.append((energy, smallest, thinnest, np.abs(u).max()))
        history = _history(path, rows, states)
        for wanted, k, pressure in _nearest_increments(case, history):
            frames.append(displacements(k))
            if path.is_static:
                motions.append(np.zeros((2, *frames[-1].shape)))
            else:
                motions.append(_motion([displacements(j) for j in range(max(k - 2, 0), k + 1)], list(path.clock[: k + 1])))
            kept.append((wanted, pressure))
        for event, ends in _event_increments(history).items():
            around[event] = [displacements(k) for k in ends]
    except ResultError as problem:
        error = str(problem)
        history = _history(path, rows[: len(states)], states)
    per_node = (model.reference_start, 3)
    dataset = xr.Dataset(
        {
            "displacement": (
                ("frame", "node", "axis"),
                np.array(frames, path.precision).reshape(-1, *per_node),
                {"units": "mm", "long_name": "displacement from the flat state"},
            ),
            "motion": (
                ("frame", "derivative", "node", "axis"),
                np.array(motions, np.float32).reshape(-1, 2, *per_node),
                {"long_name": "velocity in mm/s and acceleration in mm/s2 on the solver's clock, from the increments before"},
            ),
            "event_displacement": (
                ("event", "end", "node", "axis"),
                np.array(list(around.values()), np.float32).reshape(-1, 2, *per_node),
                {"units": "mm", "long_name": "displacement in the increments before and after a buckling event"},
            ),
        },
        coords={
            "event_pressure": (
                ("event", "end"),
                np.array([(e.before, e.after) for e in around], float).reshape(-1, 2),
                {"units": "kPa", "long_name": "actuation pressures before and after a buckling event"},
            ),
            "derivative": ["velocity", "acceleration"],
            "requested_pressure": ("frame", [k[0] for k in kept], {"units": "kPa", "long_name": "pressure asked for"}),
            "actuation_pressure": (
                "frame",
                [k[1] for k in kept],
                {"units": "kPa", "long_name": "actuation pressure of the nearest increment, P_a"},
            ),
            "axis": ["x", "y", "z"],
        },
        attrs={
            "case": case.case_id,
            "symmetry": case.mesh.symmetry,
            "damping": 0.0 if path.is_static else case.numerics.solver_damping,
        },
    )
    return history, dataset, error


def _motion(displacements: list[np.ndarray], solver_times: list[float]) -> np.ndarray:
    """Velocity and acceleration (2, n, 3) from backward differences over up to three increments, the last one now.

    Displacements (n, 3) in mm, times in s; NaN where there are too few increments.
    """
    motion = np.full((2, *displacements[-1].shape), np.nan)
    steps = np.diff(solver_times[-len(displacements) :])
    velocities = [(b - a) / step for a, b, step in zip(displacements[:-1], displacements[1:], steps, strict=True)]
    if velocities:
        motion[0] = velocities[-1]
    if len(velocities) > 1:
        motion[1] = 2.0 * (velocities[1] - velocities[0]) / (steps[0] + steps[1])
    return motion


def _event_increments(history: xr.Dataset) -> dict[Event, tuple[int, int]]:
    """The buckling events of a case and the increments before and after each; the largest in rising order."""
    ramp = ramp_of(history)
    if not ramp.sizes["increment"]:
        return {}
    first = history.sizes["increment"] - ramp.sizes["increment"]
    pressure, volume = ramp.actuation_pressure.values, ramp.ventricle_volume.values
    found = largest_events(events(pressure, volume[0] - volume))
    places = [[first + int(np.argmin(np.abs(pressure - p))) for p in (e.before, e.after)] for e in found]
    return {event: tuple(ends) for event, ends in zip(found, places, strict=True)}


def _volumes(model: Model, u: np.ndarray) -> tuple[float, ...]:
    """V_v, V_a on the middle surface, with the paper's triangles, and swept by the loaded faces (mm^3)."""
    mesh = model.mesh
    if model.is_shell:
        middle, conjugate = mesh.nodes + u, (np.nan, np.nan)
    else:
        middle, conjugate = mesh.nodes + model.expansion.midsurface(u), conjugate_volumes(model, u)
    return *volumes(mesh, middle), *volumes(mesh, middle, flux_triangles), *conjugate


def _nearest_increments(case: Case, history: xr.Dataset) -> list[tuple[float, int, float]]:
    """(wanted pressure, index, its pressure) of the increments nearest to the pressures whose frames a case keeps.

    Only the state at rest and the ramp count; pressures beyond what the case reached are left out.
    """
    pressure, stage = history.actuation_pressure.values, history.stage.values
    at_rest = np.flatnonzero(stage == STAGES.index("hold"))
    first = at_rest[-1] if len(at_rest) else len(stage)
    candidates = np.arange(first, len(stage))
    chosen = []
    for wanted in case.frames:
        if len(candidates) and wanted <= pressure[-1] + 1e-6:
            k = int(candidates[np.argmin(np.abs(pressure[candidates] - wanted))])
            chosen.append((wanted, k, float(pressure[k])))
    return chosen


def _history(path: EnginePath, volumes: list[tuple[float, ...]], states: Sequence[tuple[float, ...]] = ()) -> xr.Dataset:
    """The first k increments of a path: volumes (k, 6) in mm^3; ``states`` (k, 4): strain energy in mJ, ratios, mm."""
    count = len(volumes)
    volumes_ml = np.array(volumes, float).reshape(-1, 6) * ML
    names = {
        "ventricle_volume": "ventricle volume, V_v",
        "actuation_volume": "total pouch volume, V_a",
        "ventricle_volume_triangles": "V_v with the paper's one-point triangles",
        "actuation_volume_triangles": "V_a with the paper's one-point triangles",
        "ventricle_volume_conjugate": "volume swept by the faces that P_v loads",
        "actuation_volume_conjugate": "volume swept by the faces that P_a loads",
    }
    stage, pressure, clock = (a[:count] for a in (path.stage, path.pressure, path.clock))
    data = {n: ("increment", volumes_ml[:, k], {"units": "ml", "long_name": text}) for k, (n, text) in enumerate(names.items())}
    of_states = {
        "strain_energy": ("mJ", "strain energy of the full device, U"),
        "smallest_volume_ratio": ("1", "smallest det F of the integration points"),
        "smallest_thickness": ("1", "smallest thickness of the fabric at the integration points over that at rest"),
        "largest_displacement": ("mm", "largest component of a displacement"),
    }
    if len(states):
        for k, (name, (units, text)) in enumerate(of_states.items()):
            data[name] = ("increment", np.array(states, float)[:, k], {"units": units, "long_name": text})
    return xr.Dataset(
        data,
        coords={
            "actuation_pressure": ("increment", pressure, {"units": "kPa", "long_name": "actuation pressure, P_a"}),
            "stage": (
                "increment",
                np.asarray(stage, np.int8),
                {"long_name": "stage", "flag_values": np.arange(len(STAGES), dtype=np.int8), "flag_meanings": " ".join(STAGES)},
            ),
            "solver_time": ("increment", clock, {"units": "s", "long_name": "time on the solver's clock"}),
        },
    )


def ramp_of(history: xr.Dataset) -> xr.Dataset:
    """The ramp of a case from its state at rest: the last increment of the hold, and all of the ramp after it."""
    at_rest = np.flatnonzero(history.stage.values == STAGES.index("hold"))
    ramp = np.flatnonzero(history.stage.values == STAGES.index("ramp"))
    if not len(at_rest):
        return history.isel(increment=slice(0, 0))
    return history.isel(increment=np.concatenate([at_rest[-1:], ramp]))


def read_ramp(folder: Path) -> xr.Dataset:
    """The ramp in a case's ``volumes.nc``. Raises ``ResultError`` for a file that is missing, damaged or of something else."""
    file = folder / "volumes.nc"
    try:
        with xr.open_dataset(file) as history:
            return ramp_of(history.load())
    except UNREADABLE as error:
        raise ResultError(f"{file}: not the volumes of a case ({error})") from None


def _rest(history: xr.Dataset, tolerance: float) -> dict:
    """Whether the device rested: relative change of V_v over the second half of the hold."""
    held = history.isel(increment=history.stage.values == STAGES.index("hold"))
    if held.sizes["increment"] < 2:
        return {"rest_change": None, "rested": False}
    clock, volume = held.solver_time.values, held.ventricle_volume.values
    halfway = np.interp(0.5 * (clock[0] + clock[-1]), clock, volume)
    change = float(abs(volume[-1] - halfway) / max(abs(volume[-1]), 1e-9))
    return {"rest_change": change, "rested": change <= tolerance}


def _energy(model: Model, history: xr.Dataset, frames: xr.Dataset) -> dict:
    """The energy balance between the first and the last kept frame."""
    ramp, case = ramp_of(history), model.case
    if model.is_shell or frames.sizes["frame"] < 2:
        return {"dissipated_fraction": None}
    first, last = (float(frames.actuation_pressure[k]) for k in (0, -1))
    part = ramp.isel(increment=(ramp.actuation_pressure >= first - 1e-9) & (ramp.actuation_pressure <= last + 1e-9))
    stored = part.strain_energy.values[[0, -1]]
    conjugate = np.stack([part.ventricle_volume_conjugate, part.actuation_volume_conjugate], axis=1) / ML
    balance: EnergyBalance = ramp_balance(
        part.actuation_pressure.values, case.ventricular_pressure, conjugate, float(stored[1] - stored[0])
    )
    named = {f"{name}_mj": round(value, 4) for name, value in asdict(balance).items()}
    return named | {
        "dissipated_mj": round(balance.dissipated, 4),
        "dissipated_fraction": round(balance.dissipated_fraction, 6),
        "energy_from_kpa": first,
        "energy_to_kpa": last,
    }
