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
from limo.measure.contact import CONTACTS, endo_through_epi, first_contact, front_through_back, outer_through_outer
from limo.measure.cycles import states_of_last_cycle
from limo.measure.fatigue import ENDURANCE, FLAGS, cycles_to_failure, largest_amplitude, strain_cycle
from limo.measure.frames import CaseFrames, open_case
from limo.measure.quantities import LABELS, MEASURES, chosen_measures
from limo.measure.ramp import read_ramp
from limo.measure.strain import (
    DEVICE_SIDES,
    angle_to_warp,
    area_of_side,
    directions,
    fibre_aligned_share,
    inplane_angle,
    membrane_principal,
    side_values,
)
from limo.measure.stress import area_quantile, summarise, top_average
from limo.measure.zones import ZONES, distances, zone_of
from limo.mechanics.constitutive import principal
from limo.mechanics.equilibrium import residual
from limo.mechanics.layer import SIDES, flat_areas, flat_points, inside_out, surface_state
from limo.mechanics.model import Model
from limo.mesh.layers import DeviceMesh
from limo.schema.fatigue import Fatigue
from limo.store.files import write_netcdf
from limo.store.results import CaseFiles
from limo.store.statuses import MEASURED, NOT_MEASURED

log = logging.getLogger(__name__)
_POINTS = ("element", "point")


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
class _Places:
    """Where the points of a case lie on the flat device: zone index, flat distances (mm) by kind of line, areas (mm2).

    All are (n_elements, n_points); ``near_seam`` says where the fatigue estimate is valid.
    """

    zone: np.ndarray
    distance: dict[str, np.ndarray]
    area: np.ndarray
    near_seam: np.ndarray

    @classmethod
    def of_mesh(cls, mesh: DeviceMesh, seam_distance: float) -> _Places:
        """``seam_distance`` in mm."""
        distance = distances(mesh, flat_points(mesh))
        near_seam = np.minimum(distance["seam"], distance["outer_edge"]) <= seam_distance
        return cls(zone_of(mesh, distance, seam_distance), distance, flat_areas(mesh), near_seam)


def _measure(model: Model, frames: CaseFrames, wanted: Wanted, fatigue: Fatigue, folder: Path) -> xr.Dataset:
    asked = sorted({p for pressures in wanted.pressures.values() for p in pressures})
    places = _Places.of_mesh(model.mesh, fatigue.seam_distance.value)
    values = _empty_values(len(asked), wanted.outputs, bool(model.loading.legs))
    if "stress" in wanted.outputs:
        weights = np.bincount(places.zone.ravel(), places.area.ravel(), minlength=len(ZONES))
        values["zone_share"][:] = weights / places.area.sum()
    maps: dict[str, dict[float, np.ndarray]] = {"von_mises": {}, "principal_strain": {}, "strain_angle": {}}
    membrane = [_measure_frame(values, maps, model, frames, wanted, places, k, pressure) for k, pressure in enumerate(asked)]
    dataset = {}
    if "fatigue" in wanted.outputs:
        strained = [strain for strain in membrane if strain is not None]
        if not strained:
            raise ResultError(f"{frames.file}: none of the frames that fatigue asks for")
        dataset |= _fatigue(values, model.mesh, largest_amplitude(np.array(strained)), places.near_seam, fatigue)
        if model.loading.legs:
            dataset |= _cycle_fatigue(values, model, frames, places.near_seam, fatigue)
    _contact(values, model, frames)
    dataset |= _buckling(values, model, frames, folder)
    dataset |= _as_maps(maps, places.distance, places.zone, places.area, flat_points(model.mesh))
    dataset |= _described(values)
    coordinates = {d: v for d, v in LABELS.items() if any(d in MEASURES[name].per for name in values)}
    frame = ("frame", asked, {"units": "kPa", "long_name": "pressure asked for"})
    return xr.Dataset(dataset, coords=coordinates | {"requested_pressure": frame})


def _empty_values(n_frames: int, outputs: tuple[str, ...], is_cycled: bool) -> dict[str, np.ndarray]:
    """An array without results for every quantity of the outputs: NaN, or empty texts."""
    sizes = {"frame": n_frames} | {d: len(v) for d, (_, v, _) in LABELS.items()}
    return {
        name: np.full([sizes[d] for d in measure.per], np.nan if measure.units else "", object)
        for name, measure in chosen_measures(outputs, is_cycled).items()
    }


def _described(values: dict[str, np.ndarray]) -> dict[str, tuple]:
    """Variables of a dataset: dimensions, values of one type, units and long name."""
    described = {}
    for name, array in values.items():
        measure = MEASURES[name]
        attributes = {"long_name": measure.long_name} | ({"units": measure.units} if measure.units else {})
        described[name] = (measure.per, array.astype(float if measure.units else str), attributes)
    return described


def _measure_frame(
    values: dict, maps: dict, model: Model, frames: CaseFrames, wanted: Wanted, places: _Places, k: int, pressure: float
) -> np.ndarray | None:
    """Fill in what is wanted of the ``k``-th pressure (kPa); returns membrane strains where fatigue wants them."""
    index = frames.find(pressure)
    if index is None:
        return None
    mesh = model.mesh
    values["frame_pressure"][k] = frames.pressure[index]
    source = f"{frames.file}, frame at {frames.pressure[index]:g} kPa"
    state = surface_state(model, frames.displacement[index].astype(float), source)
    is_drawn = pressure in wanted.pressures.get("fields", ())
    if pressure in wanted.pressures.get("stress", ()):
        stress = inside_out(mesh, state.von_mises)
        _stress(values, k, model, stress, places.zone)
        _equilibrium(values, k, model, frames, index, source)
        if is_drawn and "stress" in wanted.drawn:
            maps["von_mises"][pressure] = stress
    strain = inside_out(mesh, state.strain)
    if pressure in wanted.pressures.get("strain", ()):
        _strain(values, k, mesh, strain, places.near_seam)
        _yarns(values, k, model, strain, inside_out(mesh, state.second_piola)[:, 1])
        if is_drawn and "strain" in wanted.drawn:
            maps["principal_strain"][pressure], maps["strain_angle"][pressure] = principal(strain)[0], inplane_angle(strain)
    return membrane_principal(strain[:, 1]) if pressure in wanted.pressures.get("fatigue", ()) else None


def _stress(values: dict, k: int, model: Model, stress: np.ndarray, zone: np.ndarray) -> None:
    summary = summarise(model, stress, zone)
    values["von_mises_peak"][k], values["von_mises_peak_middle"][k] = summary.top, summary.top_middle
    values["von_mises_max"][k], values["von_mises_p99"][k] = summary.largest, summary.p99
    values["von_mises_peak_share"][k] = summary.share
    values["von_mises_max_x"][k], values["von_mises_max_y"][k] = summary.x, summary.y
    values["von_mises_max_zone"][k], values["von_mises_max_surface"][k] = summary.zone, summary.surface


def _equilibrium(values: dict, k: int, model: Model, frames: CaseFrames, index: int, source: str) -> None:
    known = frames.motion is not None and np.isfinite(frames.motion[index]).all()
    motion = frames.motion[index].astype(float) if known else None
    stored = frames.displacement[index]
    forces = residual(model, stored.astype(float), frames.pressure[index], motion, frames.damping, source, stored.dtype)
    values["residual"][k], values["residual_floor"][k] = forces.resultant, forces.resultant_floor
    values["residual_full"][k], values["residual_full_floor"][k] = forces.full, forces.floor
    values["viscous_share"][k] = forces.viscous


def _strain(values: dict, k: int, mesh, strain: np.ndarray, near_seam: np.ndarray) -> None:
    for j, side in enumerate(DEVICE_SIDES):
        largest, areas = membrane_principal(side_values(mesh, strain, side)), area_of_side(mesh, side)
        values["strain_peak"][k, j] = top_average(largest, areas)
        values["strain_max"][k, j] = largest.max()
        values["strain_p99"][k, j] = area_quantile(largest, areas, 0.99)
    alignment = directions(mesh, strain, near_seam)
    values["direction_around"][k] = [alignment.around[s] for s in DEVICE_SIDES]
    values["direction_angle"][k] = [alignment.angle[s] for s in DEVICE_SIDES]
    values["direction_between"][k], values["direction_between_at_seams"][k] = alignment.between, alignment.between_at_seams


def _yarns(values: dict, k: int, model: Model, strain: np.ndarray, stress: np.ndarray) -> None:
    if model.fabric.is_isotropic:
        return
    warp = model.of_sheets(lambda sheet: sheet.weave.angle if sheet.weave else np.nan)
    values["direction_to_warp"][k] = [angle_to_warp(model.mesh, strain, warp, side) for side in DEVICE_SIDES]
    values["fibre_aligned_share"][k] = fibre_aligned_share(model.mesh, stress, warp)


def _fatigue(values: dict, mesh, amplitude: np.ndarray, near_seam: np.ndarray, fatigue: Fatigue) -> dict:
    cycles, flags = cycles_to_failure(amplitude, fatigue)
    values["fatigue_amplitude_peak"][()] = top_average(amplitude[near_seam], flat_areas(mesh)[near_seam])
    return {
        "fatigue_amplitude": (
            _POINTS,
            amplitude,
            {"units": "1", "long_name": "largest principal membrane strain of the inflation"},
        ),
        **_life(values, mesh, "fatigue", cycles, flags, near_seam),
        "near_seam": (_POINTS, near_seam.astype(np.int8), {"long_name": "within seam_distance of a seam or the outer edge"}),
    }


def _cycle_fatigue(values: dict, model: Model, frames: CaseFrames, near_seam: np.ndarray, fatigue: Fatigue) -> dict:
    strains, stresses = [], []
    for number, displacement in enumerate(states_of_last_cycle(model, frames)):
        state = surface_state(model, displacement.astype(float), f"{frames.file}, state {number} of the last cycle")
        for kept, tensor in ((strains, state.strain), (stresses, state.second_piola)):
            middle = inside_out(model.mesh, tensor)[:, 1]
            kept.append(np.stack([middle[..., i, j] for i, j in ((0, 0), (1, 1), (0, 1))], axis=-1))
    if not strains:
        return {}
    worst = strain_cycle(np.array(strains), np.array(stresses), fatigue.mean_correction)
    cycles, flags = cycles_to_failure(worst.amplitude, fatigue, fatigue.mean_correction, worst.mean_stress, worst.largest_stress)
    weight = flat_areas(model.mesh)[near_seam]
    values["cycle_amplitude_peak"][()] = top_average(worst.amplitude[near_seam], weight)
    values["cycle_mean_peak"][()] = top_average(worst.mean[near_seam], weight)
    along = "in the direction of most damage, last closed cycle"
    described = {
        "cycle_strain_amplitude": (worst.amplitude, "1", f"amplitude of the membrane strain {along}"),
        "cycle_strain_mean": (worst.mean, "1", f"mean of the membrane strain {along}"),
        "cycle_mean_stress": (worst.mean_stress, "MPa", f"mean of the membrane stress {along}"),
        "cycle_angle": (worst.angle, "degree", "angle of that direction to the circumference, on the flat pattern"),
    }
    fields = {n: (_POINTS, v, {"units": units, "long_name": text}) for n, (v, units, text) in described.items()}
    return fields | _life(values, model.mesh, "cycle_fatigue", cycles, flags, near_seam)


def _life(values: dict, mesh, name: str, cycles: np.ndarray, flags: np.ndarray, near_seam: np.ndarray) -> dict:
    """Cycles to failure and flags of points, and what they come to near seams, under names that begin with ``name``."""
    weight, finite = flat_areas(mesh)[near_seam], np.where(np.isfinite(cycles), cycles, np.inf)[near_seam]
    for key, value in (("min", finite.min()), ("p05", area_quantile(finite, weight, 0.05))):
        values[f"{name}_cycles_{key}"][()] = value if np.isfinite(value) else np.nan
    values[f"{name}_endurance_share"][()] = weight[flags[near_seam] == ENDURANCE].sum() / weight.sum()
    meanings = {"flag_values": np.arange(len(FLAGS), dtype=np.int8), "flag_meanings": " ".join(FLAGS)}
    return {
        f"{name}_cycles": (_POINTS, cycles, {"units": "1", "long_name": "cycles to failure, N_f; valid near seams only"}),
        f"{name}_flag": (_POINTS, flags, {"long_name": "what N_f means"} | meanings),
    }


def _contact(values: dict, model: Model, frames: CaseFrames) -> None:
    order, thickness = np.argsort(frames.pressure), model.fabric.thickness
    touching = []
    for k in order:
        middle = model.middle(frames.displacement[k].astype(float))
        crossed = (
            front_through_back(model.mesh, middle, thickness),
            endo_through_epi(model.mesh, middle, thickness),
            outer_through_outer(model.mesh, middle, thickness),
        )
        touching.append([len(places) > 0 for places in crossed])
    for j, name in enumerate(CONTACTS):
        clear, first = first_contact(frames.pressure[order], np.array(touching)[:, j])
        values[f"{name}_clear"][()], values[name][()] = clear, first


def _buckling(values: dict, model: Model, frames: CaseFrames, folder: Path) -> dict:
    ramp = read_ramp(folder)
    volume = ramp.ventricle_volume.values
    all_events = events(ramp.actuation_pressure.values, volume[:1] - volume)
    differences = {}
    for k, event in enumerate(largest_events(all_events)):
        values["buckling_before"][k], values["buckling_after"][k], values["buckling_jump"][k] = (
            event.before,
            event.after,
            event.jump,
        )
        if (stored := frames.find_event(event)) is not None:
            before, after = model.expansion.midsurface(frames.event_displacement[stored].astype(float))
            differences[k] = displacement_difference(before, after, model.length)
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
