"""What is kept of a load path: volumes, energies and events at every increment, and chosen displacement frames."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field

import numpy as np
import xarray as xr

from limo.engines.load_path import LoadPath
from limo.errors import ResultError
from limo.measure.buckling import Event, events, largest_events
from limo.measure.ramp import ramp_of
from limo.mechanics.energy import EnergyBalance, conjugate_volumes, energy_and_extremes_of, ramp_balance
from limo.mechanics.model import Model
from limo.mechanics.volumes import flux_triangles, volumes
from limo.schema.numerics import Numerics
from limo.schema.section import STAGES
from limo.solve.judge import unbelievable

ML = 1.0e-3  # ml in a mm^3


@dataclass
class _Increments:
    """Of the increments that can be used: ``volumes`` (k, 6) in mm^3, ``states`` (k, 4), and why no more of them can be.

    ``is_damaged``: because the path cannot be read there.
    """

    volumes: list[tuple[float, ...]] = field(default_factory=list)
    states: list[tuple[float, ...]] = field(default_factory=list)
    problem: str = ""
    is_damaged: bool = False


@dataclass
class _Frames:
    """Displacements that are kept: of the increments nearest to some pressures, and around buckling events.

    ``pressures`` (f, 2): the one asked for and that of the increment, in kPa. ``cycle``: legs, P_v and P_a (kPa) of the states
    ``cycled`` along the legs of a cycle. ``problem``: why there are no more of them.
    """

    pressures: list[tuple[float, float]] = field(default_factory=list)
    displacements: list[np.ndarray] = field(default_factory=list)
    motions: list[np.ndarray] = field(default_factory=list)
    around: dict[Event, list[np.ndarray]] = field(default_factory=dict)
    cycle: list[tuple[int, float, float]] = field(default_factory=list)
    cycled: list[np.ndarray] = field(default_factory=list)
    problem: str = ""


def harvest(model: Model, path: LoadPath) -> tuple[xr.Dataset, xr.Dataset, str]:
    """Volumes of every increment up to the first that cannot be believed, the displacements of the chosen ones, and a problem.

    The problem is "" where all of the path can be used.
    """
    increments = _increments(model, path)
    history = _history(path, increments.volumes, increments.states)
    if path.leg is not None:
        count = history.sizes["increment"]
        history["ventricular_pressure"] = _of_increments(path.ventricular[:count], "kPa", "ventricular pressure, P_v")
        history["leg"] = _of_increments(path.leg[:count], "1", "point of the cycle that the load goes to, 0 up to the ramp's end")
    if increments.states:
        history["potential_energy"] = _potential_energy(history, model.loading.ventricular_pressure)
    frames = _Frames() if increments.is_damaged else _frames(model, path, history)
    return history, _frames_dataset(model, path, frames), frames.problem or increments.problem


def middles(model: Model, path: LoadPath, history: xr.Dataset) -> list[np.ndarray]:
    """Places (n, 3) in mm of the mesh's nodes on the middle surface, none without rest.

    At rest, at the end of the ramp, and in the last increment where a cycle follows the ramp.
    """
    stages = history.stage.values
    at_rest = np.flatnonzero(stages == STAGES.index("hold"))
    if not len(at_rest):
        return []
    ramp, last = np.flatnonzero(stages != STAGES.index("cycle"))[-1], len(stages) - 1
    try:
        return [model.middle(path.displacements(int(k))) for k in (at_rest[-1], ramp, *([last] if last > ramp else []))]
    except ResultError:  # an increment that cannot be read is named by ``harvest``
        return []


def _increments(model: Model, path: LoadPath) -> _Increments:
    gathered = _Increments()
    try:
        for k in range(len(path.stage)):
            u = path.displacements(k)
            # displacements beyond all bounds would overflow in what is computed of them
            problem, extremes = unbelievable(u, np.nan, model.length), 3 * (np.nan,)
            if not problem and not model.element.is_shell:
                extremes = energy_and_extremes_of(model, u)
                problem = unbelievable(u, extremes[1], model.length)
            if problem:
                gathered.problem = f"{problem} at P_a = {path.pressure[k]:g} kPa of the {STAGES[path.stage[k]]}"
                break
            gathered.volumes.append(_volumes(model, u))
            gathered.states.append((*extremes, np.abs(u).max()))
    except ResultError as error:
        gathered.problem, gathered.is_damaged = str(error), True
    return gathered


def _frames(model: Model, path: LoadPath, history: xr.Dataset) -> _Frames:
    def displacements(k: int) -> np.ndarray:
        return path.displacements(k)[: model.reference_start]

    kept = _Frames()
    try:
        for wanted, k, pressure in _nearest_increments(model.loading.frames, history):
            states = [displacements(k)] if path.is_static else [displacements(j) for j in range(max(k - 2, 0), k + 1)]
            still = np.zeros((2, *states[-1].shape))
            kept.displacements.append(states[-1])
            kept.motions.append(still if path.is_static else _motion(states, list(path.clock[: k + 1])))
            kept.pressures.append((wanted, pressure))
        for event, ends in _event_increments(history).items():
            kept.around[event] = [displacements(k) for k in ends]
        for k, point in _cycle_increments(model.loading.frames, history).items():
            kept.cycle.append(point)
            kept.cycled.append(displacements(k))
    except ResultError as error:
        kept.problem = str(error)
    return kept


def _frames_dataset(model: Model, path: LoadPath, kept: _Frames) -> xr.Dataset:
    per_node = (model.reference_start, 3)
    requested, reached = np.array(kept.pressures, float).reshape(-1, 2).T
    displacement = np.array(kept.displacements, path.precision).reshape(-1, *per_node)
    motion = np.array(kept.motions, np.float32).reshape(-1, 2, *per_node)
    around = np.array(list(kept.around.values()), np.float32).reshape(-1, 2, *per_node)
    at_events = np.array([(e.before, e.after) for e in kept.around], float).reshape(-1, 2)
    cycled = np.array(kept.cycled, path.precision).reshape(-1, *per_node)
    points = np.array(kept.cycle, float).reshape(-1, 3)
    of_motion = "velocity in mm/s and acceleration in mm/s2 on the solver's clock, from the increments before"
    of_events = "displacement in the increments before and after a buckling event"
    at_ends = "actuation pressures before and after a buckling event"
    in_mm, in_kpa = {"units": "mm"}, {"units": "kPa"}
    return xr.Dataset(
        {
            "displacement": (
                ("frame", "node", "axis"),
                displacement,
                in_mm | {"long_name": "displacement from the flat state"},
            ),
            "motion": (("frame", "derivative", "node", "axis"), motion, {"long_name": of_motion}),
            "event_displacement": (("event", "end", "node", "axis"), around, in_mm | {"long_name": of_events}),
            **({} if not kept.cycle else _cycle_variables(points, cycled)),
        },
        coords={
            "event_pressure": (("event", "end"), at_events, in_kpa | {"long_name": at_ends}),
            "derivative": ["velocity", "acceleration"],
            "requested_pressure": ("frame", requested, in_kpa | {"long_name": "pressure asked for"}),
            "actuation_pressure": (
                "frame",
                reached,
                in_kpa | {"long_name": "actuation pressure of the nearest increment, P_a"},
            ),
            "axis": ["x", "y", "z"],
        },
        attrs={"case": model.name, "symmetry": model.mesh.symmetry, "damping": _damping(path, model.numerics)},
    )


def _cycle_variables(points: np.ndarray, displacement: np.ndarray) -> dict[str, tuple]:
    """States along the legs of a cycle: ``points`` (c, 3) are leg, P_v and P_a (kPa), ``displacement`` (c, n, 3) in mm."""
    dims, in_kpa = "cycle_frame", {"units": "kPa"}
    return {
        "cycle_displacement": (
            (dims, "node", "axis"),
            displacement,
            {"units": "mm", "long_name": "displacement from the flat state along a leg of the cycle"},
        ),
        "cycle_leg": (dims, points[:, 0].astype(int), {"long_name": "leg of the cycle, from 1; 0 is the ramp"}),
        "cycle_ventricular_pressure": (dims, points[:, 1], in_kpa | {"long_name": "ventricular pressure, P_v"}),
        "cycle_actuation_pressure": (dims, points[:, 2], in_kpa | {"long_name": "actuation pressure, P_a"}),
    }


def _damping(path: LoadPath, numerics: Numerics) -> float:
    """Damping (1/s) on the clock of the path."""
    return 0.0 if path.is_static else numerics.solver_damping


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
    jumps = largest_events(events(pressure, volume[0] - volume))
    places = [[first + int(np.argmin(np.abs(pressure - p))) for p in (e.before, e.after)] for e in jumps]
    return {event: tuple(ends) for event, ends in zip(jumps, places, strict=True)}


def _cycle_increments(frames: Sequence[float], history: xr.Dataset) -> dict[int, tuple[int, float, float]]:
    """Increments of a cycle whose states are kept, with leg, P_v and P_a (kPa): those next to frames (kPa), and ends of legs."""
    chosen: dict[int, tuple[int, float, float]] = {}
    if "leg" not in history:
        return chosen
    leg, pressure, ventricular = (history[n].values for n in ("leg", "actuation_pressure", "ventricular_pressure"))
    for number in range(1, int(leg.max(initial=0)) + 1):
        own = np.flatnonzero(leg == number)
        if not len(own):
            continue
        low, high = pressure[own].min(), pressure[own].max()
        places = {int(own[np.argmin(np.abs(pressure[own] - f))]) for f in frames if low <= f <= high}
        for k in sorted(places | {int(own[-1])}):
            chosen[k] = number, float(ventricular[k]), float(pressure[k])
    return chosen


def _volumes(model: Model, u: np.ndarray) -> tuple[float, ...]:
    """V_v, V_a on the middle surface, with the paper's triangles, and swept by the loaded faces (mm^3)."""
    mesh, middle = model.mesh, model.middle(u)
    conjugate = (np.nan, np.nan) if model.element.is_shell else conjugate_volumes(model, u)
    return *volumes(mesh, middle), *volumes(mesh, middle, flux_triangles), *conjugate


def _nearest_increments(frames: Sequence[float], history: xr.Dataset) -> list[tuple[float, int, float]]:
    """(wanted pressure, index, its pressure) of the increments nearest to the pressures (kPa) whose frames are kept.

    Only the state at rest and the ramp count; pressures beyond what the case reached are left out.
    """
    pressure, stage = history.actuation_pressure.values, history.stage.values
    at_rest = np.flatnonzero(stage == STAGES.index("hold"))
    first = at_rest[-1] if len(at_rest) else len(stage)
    candidates = np.arange(first, len(stage))[stage[first:] != STAGES.index("cycle")]
    highest = pressure[candidates].max(initial=0.0)
    chosen = []
    for wanted in frames:
        if len(candidates) and wanted <= highest + 1e-6:
            k = int(candidates[np.argmin(np.abs(pressure[candidates] - wanted))])
            chosen.append((wanted, k, float(pressure[k])))
    return chosen


def _history(path: LoadPath, volumes: list[tuple[float, ...]], states: Sequence[tuple[float, ...]] = ()) -> xr.Dataset:
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


def _of_increments(values: np.ndarray, units: str, long_name: str) -> xr.DataArray:
    return xr.DataArray(values, dims="increment", attrs={"units": units, "long_name": long_name})


def _potential_energy(history: xr.Dataset, ventricular_pressure: float) -> xr.DataArray:
    """Pi = U - P_v V_v - P_a V_a (kPa ml = mJ), of full pressure P_v: NaN in the fit, which brings it on."""
    pressure = history.get("ventricular_pressure", ventricular_pressure)
    of_pressures = pressure * history.ventricle_volume_conjugate + history.actuation_pressure * history.actuation_volume_conjugate
    energy = (history.strain_energy - of_pressures).where(history.stage != STAGES.index("fit"))
    return energy.assign_attrs(units="mJ", long_name="potential energy of the full device, Pi = U - P_v V_v - P_a V_a")


def rest(history: xr.Dataset, tolerance: float) -> dict:
    """Whether the device rested: relative change of V_v over the second half of the hold."""
    held = history.isel(increment=history.stage.values == STAGES.index("hold"))
    if held.sizes["increment"] < 2:
        return {"rest_change": None, "rested": False}
    clock, volume = held.solver_time.values, held.ventricle_volume.values
    halfway = np.interp(0.5 * (clock[0] + clock[-1]), clock, volume)
    change = float(abs(volume[-1] - halfway) / max(abs(volume[-1]), 1e-9))
    return {"rest_change": change, "rested": change <= tolerance}


def energy_balance(model: Model, history: xr.Dataset, frames: xr.Dataset) -> dict:
    """The energy balance between the first and the last kept frame."""
    ramp = ramp_of(history)
    if model.element.is_shell or frames.sizes["frame"] < 2:
        return {"dissipated_fraction": None}
    first, last = (float(frames.actuation_pressure[k]) for k in (0, -1))
    part = ramp.isel(increment=(ramp.actuation_pressure >= first - 1e-9) & (ramp.actuation_pressure <= last + 1e-9))
    stored = part.strain_energy.values[[0, -1]]
    conjugate = np.stack([part.ventricle_volume_conjugate, part.actuation_volume_conjugate], axis=1) / ML
    balance: EnergyBalance = ramp_balance(
        part.actuation_pressure.values, model.loading.ventricular_pressure, conjugate, float(stored[1] - stored[0])
    )
    named = {f"{name}_mj": round(value, 4) for name, value in asdict(balance).items()}
    return named | {
        "dissipated_mj": round(balance.dissipated, 4),
        "dissipated_fraction": round(balance.dissipated_fraction, 6),
        "energy_from_kpa": first,
        "energy_to_kpa": last,
    }
