"""What studies ask of a case beyond its volumes: stress, strain, fatigue, and what comes with them.

Only outputs that some study names are computed, and only at the pressures it names; several studies may share a case.
A case that cannot be measured keeps a status and a reason, and the other cases do not notice.
"""

from __future__ import annotations

import json
import logging
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from limo.cases.case import Case
from limo.cases.wanted import Wanted
from limo.errors import LimoError, ResultError
from limo.measure.buckling import MOST_EVENTS, displacement_difference, events, largest_events
from limo.measure.contact import endo_through_epi, first_contact, front_through_back
from limo.measure.fatigue import ENDURANCE, FLAGS, cycles_to_failure, largest_amplitude
from limo.measure.frames import CaseFrames, open_case
from limo.measure.quantities import LABELS, MEASURES
from limo.measure.ramp import read_ramp
from limo.measure.strain import DEVICE_SIDES, area_of_side, directions, inplane_angle, membrane_principal, side_values
from limo.measure.stress import area_quantile, summarise, top_average
from limo.measure.zones import ZONES, distances, zone_of
from limo.mechanics.constitutive import principal
from limo.mechanics.equilibrium import residual
from limo.mechanics.layer import SIDES, flat_areas, flat_points, inside_out, layer_state, surface_points
from limo.mechanics.model import Model
from limo.schema.fatigue import Fatigue
from limo.store.files import write_netcdf
from limo.store.results import CaseFiles
from limo.store.statuses import MEASURED, NOT_MEASURED

log = logging.getLogger(__name__)


def measure_case(case: Case, wanted: Wanted, fatigue: Fatigue, mesh_file: Path, folder: Path) -> xr.Dataset:
    """Measure a solved case and write ``folder/measures.nc``; returns it.

    A case that cannot be measured gets attributes ``status`` = ``failed`` and ``reason``, and no values.
    """
    try:
        model, frames = open_case(case, mesh_file, folder)
        measured = _measure(model, frames, wanted, fatigue, folder).assign_attrs(status=MEASURED, reason="")
    except LimoError as error:
        log.error("%s", error)
        measured = xr.Dataset(attrs={"status": NOT_MEASURED, "reason": str(error)})
    measured.attrs |= {"case": case.case_id, "wanted": json.dumps(wanted.to_dict(), sort_keys=True)}
    if "fatigue" in wanted.outputs:
        measured.attrs["fatigue"] = fatigue.model_dump_json()
    packed = {n: {"zlib": True} for n, v in measured.variables.items() if v.dtype.kind == "f" and v.size > 1000}
    write_netcdf(measured, CaseFiles(folder).measures, packed, checked=False)
    return measured


@dataclass(frozen=True)
class _Task:
    """A case that is measured: model, frames, what is wanted of it, and of its flat points (m, p) where they lie.

    ``away`` are distances in mm, ``areas`` in mm2; ``zone`` counts ``ZONES``.
    """

    model: Model
    frames: CaseFrames
    wanted: Wanted
    away: dict[str, np.ndarray]
    zone: np.ndarray
    near_seam: np.ndarray
    areas: np.ndarray

    @classmethod
    def prepare(cls, model: Model, frames: CaseFrames, wanted: Wanted, seam_distance: float) -> _Task:
        """What is measured of a case; ``seam_distance`` (mm) is how far the surroundings of seams reach."""
        mesh = model.mesh
        away = distances(mesh, flat_points(mesh))
        near_seam = np.minimum(away["seam"], away["outer_edge"]) <= seam_distance
        return cls(model, frames, wanted, away, zone_of(mesh, away, seam_distance), near_seam, flat_areas(mesh))

    @property
    def pressures(self) -> list[float]:
        """All pressures (kPa) that something is asked for at, in order."""
        return sorted({p for pressures in self.wanted.pressures.values() for p in pressures})

    def is_asked(self, output: str, pressure: float) -> bool:
        """Whether an output is asked for at a pressure (kPa)."""
        return pressure in self.wanted.pressures.get(output, ())

    def is_mapped(self, output: str, pressure: float) -> bool:
        """Whether a map of an output is kept at a pressure (kPa)."""
        return self.is_asked("fields", pressure) and output in self.wanted.drawn


class _Values:
    """What is measured of one case: ``values`` by the names in ``MEASURES``, maps by name and pressure, membrane strains."""

    def __init__(self, wanted: Wanted, frames: int):
        sizes = {"frame": frames} | {d: len(v) for d, (_, v, _) in LABELS.items()}
        self.measures = {n: m for n, m in MEASURES.items() if not m.output or m.output in wanted.outputs}
        self.values = {n: np.full([sizes[d] for d in m.per], np.nan if m.units else "", object) for n, m in self.measures.items()}
        self.maps: dict[str, dict[float, np.ndarray]] = {"von_mises": {}, "principal_strain": {}, "strain_angle": {}}
        self.membrane: list[np.ndarray] = []

    def variables(self) -> dict[str, tuple]:
        """The values as variables of a dataset."""
        found = {}
        for name, measure in self.measures.items():
            attributes = {"long_name": measure.long_name} | ({"units": measure.units} if measure.units else {})
            found[name] = (measure.per, self.values[name].astype(float if measure.units else str), attributes)
        return found

    def labels(self) -> dict[str, tuple]:
        """The coordinates of the dimensions that they have."""
        return {d: v for d, v in LABELS.items() if any(d in m.per for m in self.measures.values())}


def _measure(model: Model, frames: CaseFrames, wanted: Wanted, fatigue: Fatigue, folder: Path) -> xr.Dataset:
    task = _Task.prepare(model, frames, wanted, fatigue.seam_distance.value)
    found = _Values(wanted, len(task.pressures))
    if "stress" in wanted.outputs:
        share = np.bincount(task.zone.ravel(), task.areas.ravel(), minlength=len(ZONES))
        found.values["zone_share"][:] = share / task.areas.sum()
    for k, pressure in enumerate(task.pressures):
        if (frame := frames.find(pressure)) is not None:
            _measure_frame(task, found, k, pressure, frame)
    variables = {}
    if "fatigue" in wanted.outputs:
        if not found.membrane:
            raise ResultError(f"{frames.file}: none of the frames that fatigue asks for")
        amplitude = largest_amplitude(np.array(found.membrane))
        variables |= _fatigue(found.values, model.mesh, amplitude, task.near_seam, fatigue)
    _contact(found.values, model, frames)
    variables |= _buckling(found.values, model, frames, folder)
    variables |= _as_maps(found.maps, task.away, task.zone, task.areas, flat_points(model.mesh))
    requested = ("frame", task.pressures, {"units": "kPa", "long_name": "pressure asked for"})
    return xr.Dataset(variables | found.variables(), coords=found.labels() | {"requested_pressure": requested})


def _measure_frame(task: _Task, found: _Values, k: int, pressure: float, frame: int) -> None:
    """Measure a frame: what is asked for at its pressure (kPa), the ``k``-th of all."""
    model, frames = task.model, task.frames
    found.values["frame_pressure"][k] = frames.pressure[frame]
    source = f"{frames.file}, frame at {frames.pressure[frame]:g} kPa"
    state = layer_state(model, frames.displacement[frame].astype(float), surface_points(), source)
    if task.is_asked("stress", pressure):
        stress = inside_out(model.mesh, state.von_mises)
        _stress(found.values, k, model, stress, task.zone)
        _equilibrium(found.values, k, model, frames, frame, source)
        if task.is_mapped("stress", pressure):
            found.maps["von_mises"][pressure] = stress
    strain = inside_out(model.mesh, state.strain)
    if task.is_asked("strain", pressure):
        _strain(found.values, k, model.mesh, strain, task.near_seam)
        if task.is_mapped("strain", pressure):
            found.maps["principal_strain"][pressure] = principal(strain)[0]
            found.maps["strain_angle"][pressure] = inplane_angle(strain)
    if task.is_asked("fatigue", pressure):
        found.membrane.append(membrane_principal(strain[:, 1]))


def _stress(values: dict, k: int, model: Model, stress: np.ndarray, zone: np.ndarray) -> None:
    found = summarise(model, stress, zone)
    values["von_mises_peak"][k], values["von_mises_peak_middle"][k] = found.top, found.top_middle
    values["von_mises_max"][k], values["von_mises_p99"][k] = found.largest, found.p99
    values["von_mises_peak_share"][k] = found.share
    values["von_mises_max_x"][k], values["von_mises_max_y"][k] = found.x, found.y
    values["von_mises_max_zone"][k], values["von_mises_max_surface"][k] = found.zone, found.surface


def _equilibrium(values: dict, k: int, model: Model, frames: CaseFrames, frame: int, source: str) -> None:
    known = frames.motion is not None and np.isfinite(frames.motion[frame]).all()
    motion = frames.motion[frame].astype(float) if known else None
    stored = frames.displacement[frame]
    found = residual(model, stored.astype(float), frames.pressure[frame], motion, frames.damping, source, stored.dtype)
    values["residual"][k], values["residual_floor"][k] = found.resultant, found.resultant_floor
    values["residual_full"][k], values["residual_full_floor"][k] = found.full, found.floor
    values["viscous_share"][k] = found.viscous


def _strain(values: dict, k: int, mesh, strain: np.ndarray, near_seam: np.ndarray) -> None:
    for j, side in enumerate(DEVICE_SIDES):
        largest, areas = membrane_principal(side_values(mesh, strain, side)), area_of_side(mesh, side)
        values["strain_peak"][k, j] = top_average(largest, areas)
        values["strain_max"][k, j] = largest.max()
        values["strain_p99"][k, j] = area_quantile(largest, areas, 0.99)
    found = directions(mesh, strain, near_seam)
    values["direction_around"][k] = [found.around[s] for s in DEVICE_SIDES]
    values["direction_angle"][k] = [found.angle[s] for s in DEVICE_SIDES]
    values["direction_between"][k], values["direction_between_at_seams"][k] = found.between, found.between_at_seams


def _fatigue(values: dict, mesh, amplitude: np.ndarray, near_seam: np.ndarray, fatigue: Fatigue) -> dict:
    areas = flat_areas(mesh)
    cycles, flags = cycles_to_failure(amplitude, fatigue)
    weight, finite = areas[near_seam], np.where(np.isfinite(cycles), cycles, np.inf)[near_seam]
    values["fatigue_amplitude_peak"][()] = top_average(amplitude[near_seam], weight)
    values["fatigue_cycles_min"][()] = finite.min() if np.isfinite(finite.min()) else np.nan
    weakest = area_quantile(finite, weight, 0.05)
    values["fatigue_cycles_p05"][()] = weakest if np.isfinite(weakest) else np.nan
    values["fatigue_endurance_share"][()] = weight[flags[near_seam] == ENDURANCE].sum() / weight.sum()
    meanings = {"flag_values": np.arange(len(FLAGS), dtype=np.int8), "flag_meanings": " ".join(FLAGS)}
    dims = ("element", "point")
    return {
        "fatigue_amplitude": (dims, amplitude, {"units": "1", "long_name": "largest principal membrane strain of the inflation"}),
        "fatigue_cycles": (dims, cycles, {"units": "1", "long_name": "cycles to failure, N_f; valid near seams only"}),
        "fatigue_flag": (dims, flags, {"long_name": "what N_f means"} | meanings),
        "near_seam": (dims, near_seam.astype(np.int8), {"long_name": "within seam_distance of a seam or the outer edge"}),
    }


def _contact(values: dict, model: Model, frames: CaseFrames) -> None:
    order, thickness = np.argsort(frames.pressure), model.case.device.material.thickness
    touching = []
    for k in order:
        middle = model.mesh.nodes + model.expansion.midsurface(frames.displacement[k].astype(float))
        crossed = front_through_back(model.mesh, middle, thickness), endo_through_epi(model.mesh, middle)
        touching.append([len(places) > 0 for places in crossed])
    for j, name in enumerate(("contact_front_back", "contact_endo_epi")):
        clear, first = first_contact(frames.pressure[order], np.array(touching)[:, j])
        values[f"{name}_clear"][()], values[name][()] = clear, first


def _buckling(values: dict, model: Model, frames: CaseFrames, folder: Path) -> dict:
    ramp = read_ramp(folder)
    volume = ramp.ventricle_volume.values
    found = events(ramp.actuation_pressure.values, volume[:1] - volume)
    differences = {}
    for k, event in enumerate(largest_events(found)):
        values["buckling_before"][k], values["buckling_after"][k], values["buckling_jump"][k] = (
            event.before,
            event.after,
            event.jump,
        )
        if (stored := frames.find_event(event)) is not None:
            before, after = model.expansion.midsurface(frames.event_displacement[stored].astype(float))
            differences[k] = displacement_difference(before, after, model.case.device.pattern.length)
            values["buckling_displacement"][k] = differences[k].max()
    if not differences:
        return {}
    field = np.full((MOST_EVENTS, len(model.mesh.nodes)), np.nan, np.float32)
    for k, difference in differences.items():
        field[k] = difference
    long_name = "displacement difference across an event, over the device length"
    return {"buckling_difference": (("event", "node"), field, {"units": "1", "long_name": long_name})}


def _as_maps(maps: dict, away: dict, zone: np.ndarray, areas: np.ndarray, points: np.ndarray) -> dict:
    """Maps at the pressures of the fields, with what is needed to draw and to integrate them."""
    described = {
        "von_mises": (("surface", "point"), "MPa", "von Mises stress"),
        "principal_strain": (("surface", "point", "principal"), "1", "principal strains, E_1 >= E_2 >= E_3"),
        "strain_angle": (("surface", "point"), "degree", "angle of v_1 in the fabric's plane to the circumference"),
    }
    stored: dict[str, Any] = {}
    for name, (dims, units, long_name) in described.items():
        if maps[name]:
            stacked = np.stack([maps[name][p] for p in sorted(maps[name])]).astype(np.float32)
            stored[name] = (("map", "element", *dims), stacked, {"units": units, "long_name": long_name})
            pressures = {"units": "kPa", "long_name": "pressure asked for, of the maps"}
            stored["map_pressure"] = ("map", np.array(sorted(maps[name])), pressures)
    if stored:
        stored["surface"] = ("surface", list(SIDES), {"long_name": "surface of the layer, inner faces the ventricle"})
        stored["area"] = (("element", "point"), areas, {"units": "mm2", "long_name": "flat area a point stands for"})
        stored["position"] = (
            ("element", "point", "axis"),
            points[..., :2],
            {"units": "mm", "long_name": "flat position, x and y"},
        )
        meanings = {"flag_values": np.arange(len(ZONES), dtype=np.int8), "flag_meanings": " ".join(ZONES)}
        stored["zone_index"] = (("element", "point"), zone.astype(np.int8), {"long_name": "zone"} | meanings)
        stored["seam_distance"] = (("element", "point"), away["seam"], {"units": "mm", "long_name": "flat distance to a seam"})
    return stored
