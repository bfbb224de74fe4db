"""What studies ask of a case beyond its volumes: stress, strain, fatigue, and what comes with them.

Only outputs that some study names are computed, and only at the pressures it names; several studies may share a case.
A case that cannot be measured keeps a status and a reason, and the other cases do not notice.
"""

from __future__ import annotations

import json
import logging
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from limo.buckling import MOST_EVENTS, displacement_difference, events, largest_events
from limo.case import Case, Wanted, solved_on
from limo.config import Fatigue, Loaded
from limo.constitutive import principal
from limo.contact import endo_through_epi, first_contact, front_through_back
from limo.equilibrium import residual
from limo.errors import LimoError, ResultError
from limo.fatigue import ENDURANCE, FLAGS, cycles_to_failure, largest_amplitude
from limo.files import UNREADABLE, write_netcdf
from limo.layer import SIDES, flat_areas, flat_points, inside_out, layer_state, surface_points
from limo.mesh import read_mesh
from limo.model import Model, build_model
from limo.solution import read_ramp
from limo.strain import DEVICE_SIDES, area_of_side, directions, inplane_angle, membrane_principal, side_values
from limo.stress import area_quantile, summarise, top_average
from limo.zones import ZONES, distances, zone_of

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Measure:
    """What is stored under a name: ``per`` lists its dimensions besides those of a case; ``output`` asks for it.

    An empty ``output`` comes with any of them.
    """

    per: tuple[str, ...]
    units: str
    long_name: str
    output: str = ""


_TOP = "area average of the top 5 %"
MEASURES = {
    "frame_pressure": Measure(("frame",), "kPa", "actuation pressure of the increment nearest to a frame, P_a"),
    "von_mises_peak": Measure(("frame",), "MPa", f"von Mises stress, largest through the thickness, {_TOP}", "stress"),
    "von_mises_peak_middle": Measure(("frame",), "MPa", f"von Mises stress on the middle surface, {_TOP}", "stress"),
    "von_mises_max": Measure(("frame",), "MPa", "largest von Mises stress", "stress"),
    "von_mises_p99": Measure(("frame",), "MPa", "von Mises stress not exceeded on 99 % of the area", "stress"),
    "von_mises_peak_share": Measure(("frame", "zone"), "1", "share of the top 5 % of the area in a zone", "stress"),
    "zone_share": Measure(("zone",), "1", "share of the area of the fabric in a zone", "stress"),
    "von_mises_max_x": Measure(("frame",), "mm", "where the largest von Mises stress is on the flat pattern, x", "stress"),
    "von_mises_max_y": Measure(("frame",), "mm", "where the largest von Mises stress is on the flat pattern, y", "stress"),
    "von_mises_max_zone": Measure(("frame",), "", "zone of the largest von Mises stress", "stress"),
    "von_mises_max_surface": Measure(("frame",), "", "surface of the largest von Mises stress", "stress"),
    "residual": Measure(("frame",), "1", "force resultants out of equilibrium over the applied load", "stress"),
    "residual_floor": Measure(("frame",), "1", "part of the residual that rounding of the frame explains", "stress"),
    "residual_full": Measure(("frame",), "1", "nodal forces out of equilibrium over the applied load", "stress"),
    "residual_full_floor": Measure(("frame",), "1", "part of the full residual that rounding of the frame explains", "stress"),
    "viscous_share": Measure(("frame",), "1", "damping and inertia over the applied load", "stress"),
    "strain_peak": Measure(("frame", "side"), "1", f"largest principal strain in the fabric's plane, E_1, {_TOP}", "strain"),
    "strain_max": Measure(("frame", "side"), "1", "largest principal strain in the fabric's plane, E_1, its maximum", "strain"),
    "strain_p99": Measure(("frame", "side"), "1", "E_1 not exceeded on 99 % of the area", "strain"),
    "direction_around": Measure(
        ("frame", "side"), "1", "share of the pouch area where v_1 is nearer to the circumference than to the axis", "strain"
    ),
    "direction_angle": Measure(("frame", "side"), "degree", "median angle of v_1 to the circumference, on pouches", "strain"),
    "direction_between": Measure(("frame",), "degree", "median angle between v_1 of the two surfaces, on pouches", "strain"),
    "direction_between_at_seams": Measure(("frame",), "degree", "the same, near seams only", "strain"),
    "fatigue_amplitude_peak": Measure(
        (), "1", f"largest principal membrane strain of the inflation near seams, {_TOP}", "fatigue"
    ),
    "fatigue_cycles_min": Measure((), "1", "smallest number of cycles to failure near seams, N_f", "fatigue"),
    "fatigue_cycles_p05": Measure((), "1", "N_f that 5 % of the area near seams do not reach", "fatigue"),
    "fatigue_endurance_share": Measure((), "1", "share of the area near seams below the endurance range", "fatigue"),
    "buckling_before": Measure(("event",), "kPa", "last actuation pressure before a buckling event, P_a,c-"),
    "buckling_after": Measure(("event",), "kPa", "first actuation pressure after a buckling event, P_a,c+"),
    "buckling_jump": Measure(("event",), "ml", "jump of the stroke volume in a buckling event"),
    "buckling_displacement": Measure(("event",), "1", "largest displacement difference across an event, over the length"),
    "contact_front_back_clear": Measure((), "kPa", "highest P_a of a frame before front and back would touch"),
    "contact_front_back": Measure((), "kPa", "lowest P_a of a frame in which front and back would touch"),
    "contact_endo_epi_clear": Measure((), "kPa", "highest P_a of a frame before endocardium and epicardium would cross"),
    "contact_endo_epi": Measure((), "kPa", "lowest P_a of a frame in which endocardium and epicardium cross"),
}
FRAME = "pressure of a frame as the study writes it, in kPa where it is a number"
SIDE = {"long_name": "side of the device's wall, endocardial towards the ventricle"}
_LABELS = {
    "zone": ("zone", list(ZONES), {"long_name": "zone of the fabric"}),
    "side": ("side", list(DEVICE_SIDES), SIDE),
    "event": ("event", list(range(MOST_EVENTS)), {"long_name": "buckling event, from 0 in rising order of P_a"}),
}


# --------------------------------------------------------------------------------------------------------------------
# one case


@dataclass(frozen=True)
class CaseFrames:
    """The stored displacements of a case: ``requested`` and ``pressure`` (f,) in kPa, ``displacement`` (f, n, 3) in mm.

    ``motion`` (f, 2, n, 3): velocity and acceleration in mm/s and mm/s^2 on the solver's clock. ``event_pressure`` (e, 2) in
    kPa and ``event_displacement`` (e, 2, n, 3) in mm: before and after each buckling event. Frames may come without these.
    ``damping`` (1/s) on the solver's clock is that of the attempt that made them.
    """

    file: Path
    requested: np.ndarray
    pressure: np.ndarray
    displacement: np.ndarray
    motion: np.ndarray | None
    event_pressure: np.ndarray
    event_displacement: np.ndarray
    damping: float = 0.0

    def find(self, requested: float) -> int | None:
        """Index of the frame kept for a pressure (kPa); None when the case did not get there."""
        hits = np.flatnonzero(np.isclose(self.requested, requested, atol=1e-6))
        return int(hits[0]) if len(hits) else None


def read_frames(file: Path, n_nodes: int) -> CaseFrames:
    """Frames of a case. Raises ``ResultError`` for a file that is missing, damaged, empty or of another mesh."""
    try:
        with xr.open_dataset(file) as data:
            data = data.load()
        found = CaseFrames(
            file,
            data.requested_pressure.values.astype(float),
            data.actuation_pressure.values.astype(float),
            data.displacement.values,
            data.motion.values if "motion" in data else None,
            data.event_pressure.values if "event_pressure" in data else np.empty((0, 2)),
            data.event_displacement.values if "event_displacement" in data else np.empty((0, 2, n_nodes, 3)),
            float(data.attrs.get("damping", 0.0)),
        )
    except UNREADABLE as error:
        raise ResultError(f"{file}: not the frames of a case ({error})") from None
    if not len(found.pressure):
        raise ResultError(f"{file}: no frames (the case did not reach P_a = 0)")
    if found.displacement.shape[1] != n_nodes:
        raise ResultError(f"{file}: {found.displacement.shape[1]} nodes, the mesh has {n_nodes}")
    return found


def open_case(case: Case, mesh_file: Path, folder: Path) -> tuple[Model, CaseFrames]:
    """Model and frames of a solved case. Raises ``ResultError`` where one cannot be used."""
    case, mesh_file = solved_on(case, mesh_file, folder)
    model = build_model(case, read_mesh(mesh_file, case.mesh.symmetry))
    if model.is_shell:
        raise ResultError(f"{folder / 'frames.nc'}: element {case.mesh.element} keeps no displacements through the thickness")
    return model, read_frames(folder / "frames.nc", len(model.expansion.nodes))


def measure_case(case: Case, wanted: Wanted, fatigue: Fatigue, mesh_file: Path, folder: Path) -> xr.Dataset:
    """Measure a solved case and write ``folder/measures.nc``; returns it.

    A case that cannot be measured gets attributes ``status`` = ``failed`` and ``reason``, and no values.
    """
    try:
        model, frames = open_case(case, mesh_file, folder)
        measured = _measure(model, frames, wanted, fatigue, folder).assign_attrs(status="measured", reason="")
    except LimoError as error:
        log.error("%s", error)
        measured = xr.Dataset(attrs={"status": "failed", "reason": str(error)})
    measured.attrs |= {"case": case.case_id, "wanted": json.dumps(wanted.to_dict(), sort_keys=True)}
    if "fatigue" in wanted.outputs:
        measured.attrs["fatigue"] = fatigue.model_dump_json()
    packed = {n: {"zlib": True} for n, v in measured.variables.items() if v.dtype.kind == "f" and v.size > 1000}
    write_netcdf(measured, folder / "measures.nc", packed, checked=False)
    return measured


def _measure(model: Model, frames: CaseFrames, wanted: Wanted, fatigue: Fatigue, folder: Path) -> xr.Dataset:
    mesh, asked = model.mesh, sorted({p for pressures in wanted.pressures.values() for p in pressures})
    near = fatigue.seam_distance.value
    away = distances(mesh, flat_points(mesh))
    zone = zone_of(mesh, away, near)
    near_seam = np.minimum(away["seam"], away["outer_edge"]) <= near
    outputs = wanted.outputs
    areas = flat_areas(mesh)
    sizes = {"frame": len(asked)} | {d: len(v) for d, (_, v, _) in _LABELS.items()}
    data = {
        n: (m.per, np.full([sizes[d] for d in m.per], np.nan if m.units else "", object))
        for n, m in MEASURES.items()
        if not m.output or m.output in outputs
    }
    values = {n: v for n, (_, v) in data.items()}
    if "stress" in outputs:
        values["zone_share"][:] = np.bincount(zone.ravel(), areas.ravel(), minlength=len(ZONES)) / areas.sum()
    maps: dict[str, dict[float, np.ndarray]] = {"von_mises": {}, "principal_strain": {}, "strain_angle": {}}
    membrane = []
    for k, pressure in enumerate(asked):
        at = frames.find(pressure)
        if at is None:
            continue
        values["frame_pressure"][k] = frames.pressure[at]
        source = f"{frames.file}, frame at {frames.pressure[at]:g} kPa"
        u = frames.displacement[at].astype(float)
        state = layer_state(model, u, surface_points(), source)
        if pressure in wanted.pressures.get("stress", ()):
            stress = inside_out(mesh, state.von_mises)
            _stress(values, k, model, stress, zone)
            _equilibrium(values, k, model, frames, at, source)
            if pressure in wanted.pressures.get("fields", ()) and "stress" in wanted.drawn:
                maps["von_mises"][pressure] = stress
        strain = inside_out(mesh, state.strain)
        if pressure in wanted.pressures.get("strain", ()):
            _strain(values, k, mesh, strain, near_seam)
            if pressure in wanted.pressures.get("fields", ()) and "strain" in wanted.drawn:
                maps["principal_strain"][pressure], maps["strain_angle"][pressure] = _strain_maps(strain)
        if pressure in wanted.pressures.get("fatigue", ()):
            membrane.append(membrane_principal(strain[:, 1]))
    dataset = {}
    if "fatigue" in outputs:
        if not membrane:
            raise ResultError(f"{frames.file}: none of the frames that fatigue asks for")
        dataset |= _fatigue(values, mesh, largest_amplitude(np.array(membrane)), near_seam, fatigue)
    _contact(values, model, frames)
    dataset |= _buckling(values, model, frames, folder)
    dataset |= _as_maps(maps, away, zone, areas, flat_points(mesh))
    for name, (per, array) in data.items():
        measure = MEASURES[name]
        attributes = {"long_name": measure.long_name} | ({"units": measure.units} if measure.units else {})
        dataset[name] = (per, array.astype(float if measure.units else str), attributes)
    coordinates = {d: v for d, v in _LABELS.items() if any(d in per for per, _ in data.values())}
    frame = ("frame", asked, {"units": "kPa", "long_name": "pressure asked for"})
    return xr.Dataset(dataset, coords=coordinates | {"requested_pressure": frame})


def _stress(values: dict, k: int, model: Model, stress: np.ndarray, zone: np.ndarray) -> None:
    found = summarise(model, stress, zone)
    values["von_mises_peak"][k], values["von_mises_peak_middle"][k] = found.top, found.top_middle
    values["von_mises_max"][k], values["von_mises_p99"][k] = found.largest, found.p99
    values["von_mises_peak_share"][k] = found.share
    values["von_mises_max_x"][k], values["von_mises_max_y"][k] = found.x, found.y
    values["von_mises_max_zone"][k], values["von_mises_max_surface"][k] = found.zone, found.surface


def _equilibrium(values: dict, k: int, model: Model, frames: CaseFrames, at: int, source: str) -> None:
    known = frames.motion is not None and np.isfinite(frames.motion[at]).all()
    motion = frames.motion[at].astype(float) if known else None
    stored = frames.displacement[at]
    found = residual(model, stored.astype(float), frames.pressure[at], motion, frames.damping, source, stored.dtype)
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


def _strain_maps(strain: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return principal(strain)[0], inplane_angle(strain)


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
        stored = np.flatnonzero(np.isclose(frames.event_pressure, (event.before, event.after), atol=1e-6).all(axis=1))
        if len(stored):
            before, after = model.expansion.midsurface(frames.event_displacement[stored[0]].astype(float))
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


# --------------------------------------------------------------------------------------------------------------------
# a study


def gather_measures(
    loaded: Loaded,
    name: str,
    cases: dict[tuple, Case],
    coords: dict[str, list],
    case_folder: Path,
    sources: Mapping[tuple, str] | None = None,
) -> xr.Dataset:
    """The measures of a study's cases: ``coords`` are the dimensions of a case and their values.

    ``sources``: by grid point the id of the case that serves it (default: the study's own).
    ``frame`` counts the pressures of the study as it writes them (``P_v + 10``); ``frame_pressure`` is what they came to.
    """
    study = loaded.studies[name]
    labels = [f if isinstance(f, str) else f"{f:g}" for f in (*study.frames, *study.fields_at)]
    entries = dict(zip(labels, (*study.frames, *study.fields_at), strict=True))
    shape, dims = tuple(len(v) for v in coords.values()), tuple(coords)
    sizes = {"frame": len(entries)} | {d: len(v) for d, (_, v, _) in _LABELS.items()}
    chosen = {n: m for n, m in MEASURES.items() if not m.output or m.output in study.measures}
    data = {
        n: np.full(shape + tuple(sizes[d] for d in m.per), np.nan if m.units else "", float if m.units else object)
        for n, m in chosen.items()
    }
    status, reason = np.full(shape, "missing", object), np.full(shape, "", object)
    for key, case in cases.items():
        index = tuple(coords[d].index(k) for d, k in zip(dims, key, strict=True))
        source = sources[key] if sources else case.case_id
        try:
            with xr.open_dataset(case_folder / source / "measures.nc") as measured:
                measured = measured.load()
            status[index], reason[index] = measured.attrs["status"], measured.attrs["reason"]
        except UNREADABLE as error:
            reason[index] = str(error)
            continue
        if status[index] == "measured":
            if source != case.case_id:
                measured = _up_to(measured, case.actuation_pressure_max)
            pressures = [study.pressure_of(entry, case.ventricular_pressure) for entry in entries.values()]
            _take(data, index, measured, chosen, pressures)
    described = {}
    for n, m in chosen.items():
        attributes = {"long_name": m.long_name} | ({"units": m.units} if m.units else {})
        described[n] = ((*dims, *m.per), data[n] if m.units else data[n].astype(str), attributes)
    described["measure_status"] = (dims, status.astype(str), {"long_name": "whether a case could be measured"})
    described["measure_reason"] = (dims, reason.astype(str), {"long_name": "why a case could not be measured"})
    labels_used = {d: v for d, v in _LABELS.items() if any(d in m.per for m in chosen.values())}
    dataset = xr.Dataset(described, coords=coords | labels_used | {"frame": list(entries)})
    dataset.frame.attrs["long_name"] = FRAME
    if "fatigue" in study.measures:
        dataset.attrs["fatigue"] = loaded.config.fatigue.model_dump_json()
    return dataset


def _up_to(measured: xr.Dataset, maximum: float) -> xr.Dataset:
    """The measures of a case without what lies beyond ``maximum`` (kPa): events of buckling, and contact.

    Contact is as fine as the frames, so the last clear one is the last frame at all where contact comes later.
    """
    measured = measured.copy()
    beyond = measured.buckling_after > maximum + 1e-6
    for name in ("buckling_before", "buckling_after", "buckling_jump", "buckling_displacement"):
        measured[name] = measured[name].where(~beyond)
    pressures = measured.frame_pressure.values
    last = max(pressures[pressures <= maximum + 1e-6], default=np.nan)
    for name in ("contact_front_back", "contact_endo_epi"):
        if not measured[name] <= maximum + 1e-6:
            measured[f"{name}_clear"] = np.fmin(measured[f"{name}_clear"], last).assign_attrs(measured[f"{name}_clear"].attrs)
            measured[name] = measured[name].where(False)
    return measured


def _take(data: dict, index: tuple, measured: xr.Dataset, chosen: dict[str, Measure], pressures: list[float | None]) -> None:
    """Put one case's measures in their places, frames by the pressure that was asked for."""
    stored = measured.requested_pressure.values
    rows = [next((j for j, s in enumerate(stored) if p is not None and abs(s - p) < 1e-6), None) for p in pressures]
    for name, measure in chosen.items():
        if name not in measured:
            continue
        values = measured[name].values
        if "frame" not in measure.per:
            data[name][index] = values
            continue
        for k, row in enumerate(rows):
            if row is not None:
                data[name][(*index, k)] = values[row]
