"""Whether a path that an engine calls converged is right, said from its results alone: no engine is asked.

Engines report success for wrong results: CalculiX ends with exit code 0 and displacements of 1e11 mm, or without a deck.
So every solved case is measured (``measure``), the raw numbers are kept, and ``verdict`` compares them with limits:

- wrong, hence ``diverged``: displacements that are no numbers or beyond all bounds, elements turned inside out, forces far
  out of equilibrium;
- right within limits that a study may not accept, hence ``degraded``: too much damping, energy from nowhere, no rest before the
  ramp, a residual above its limit. Also jumps of a volume that are no buckling event, fabric far beyond its law, and states that
  lock: flat against their own compression, at far higher energy than wrinkled ones.

What the model leaves out is no fault of a solve, but nobody should miss it: ``remarks`` names it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr

from limo.errors import ResultError
from limo.measure.buckling import events
from limo.mechanics.contact import Touching, contact_of
from limo.mechanics.equilibrium import residual
from limo.mechanics.layer import flat_areas
from limo.mechanics.model import Model
from limo.mechanics.tension_field import compression_share, elements_a_wrinkle
from limo.mesh.layers import LAYERS
from limo.schema.solver import Limits

#: largest displacement, over the device length, that a state may show and still be believed
LARGEST_DISPLACEMENT = 3.0
#: thickness over that at rest below which a path that ends has come to the end of its fabric: stretched by E_11 and E_22, a layer
#: of St. Venant-Kirchhoff material thins as C_33 = 1 - 2 nu / (1 - nu) (E_11 + E_22), which is zero at a sum of (1 - nu) / 2 nu
THINNEST = 0.5
#: a residual this many times its limit is no equilibrium at all
NO_EQUILIBRIUM = 10.0
#: frames of a case whose equilibrium is looked at: the first, the last and some between
FRAMES = 5
#: elements a wrinkle from which a mesh follows wrinkles: compression at rest is then what the fabric can carry
FOLLOWED = 5.5
#: compression share from which a mesh is remarked to be coarse for its wrinkles
COARSE = 0.12
#: elements a wrinkle below which it is in any case
FEW = 1.25
#: share of the area on which layers that pass each other by more than the thickness are remarked
PASSED = 0.01
#: V_v over that at rest below which a ventricle is nearly empty
NEARLY_EMPTY = 0.05
#: layers that may pass each other, as people call them
PAIRS = {"front_back": "front and back", "endo_epi": "endocardium and epicardium"}
#: what frees a state that locks
FREED = "fit_via: [1, 3, 10] of engine newton or a finer mesh may free it"


@dataclass(frozen=True)
class Checks:
    """What is measured of a path; None where it is not known (shells keep no displacements through the thickness).

    ``largest_displacement`` over the length, and at integration points ``smallest_volume_ratio`` (det F) and
    ``smallest_thickness`` (over that at rest), of all increments. ``residual`` of the force resultants over the applied load,
    ``residual_floor`` (the part that rounding of stored frames explains) and ``viscous_share`` (damping and inertia over the
    load): the largest of some frames. ``energy_created``: largest fall of the dissipated energy along the ramp over the
    actuation work; ``largest_jump``: largest change of V_v or V_a from one increment to the next outside of buckling events,
    over V_v at rest; ``smallest_ventricle``: smallest V_v of the ramp over that at rest, not positive where front and back,
    between which there is no contact, pass through each other.

    ``compression_share`` at rest and ``elements_a_wrinkle``: ``limo.mechanics.tension_field``; None without P_v.
    ``actuation_at_rest``: V_a in ml; ``actuation_below``: how far it lies below zero beyond the thickness times the area of the
    pouches, over V_v at rest; ``actuation_below_range``: the share of the ramp's P_a up to which it does.
    ``front_back_passed``, ``endo_epi_passed``: share of the area on which these layers have passed each other by more than the
    thickness, the largest of those at rest, at the end of the ramp and of the path; ``in_contact``: those that contact keeps
    apart. ``error``: why frames could not be measured.
    """

    largest_displacement: float | None = None
    smallest_volume_ratio: float | None = None
    smallest_thickness: float | None = None
    residual: float | None = None
    residual_floor: float | None = None
    viscous_share: float | None = None
    dissipated_fraction: float | None = None
    energy_created: float | None = None
    largest_jump: float | None = None
    smallest_ventricle: float | None = None
    compression_share: float | None = None
    elements_a_wrinkle: float | None = None
    actuation_at_rest: float | None = None
    actuation_below: float | None = None
    actuation_below_range: float | None = None
    front_back_passed: float | None = None
    endo_epi_passed: float | None = None
    in_contact: tuple[str, ...] = ()
    rested: bool = True
    error: str = ""


def unbelievable(displacements: np.ndarray, volume_ratio: float, length: float) -> str:
    """Why a state, displacements (n, 3) in mm and its smallest det F (NaN: unknown), cannot be one of the device; else ""."""
    if not np.isfinite(displacements).all() or np.abs(displacements).max() > LARGEST_DISPLACEMENT * length:
        return f"displacements beyond {LARGEST_DISPLACEMENT:g} L"
    return f"elements turned inside out (det F = {volume_ratio:.2g})" if volume_ratio <= 0 else ""


def measure(
    model: Model,
    history: xr.Dataset,
    ramp: xr.Dataset,
    frames: xr.Dataset,
    balance: dict,
    rested: bool,
    ends: list[np.ndarray],
) -> Checks:
    """The raw numbers of a path: all its increments, those of the ramp from the state at rest, and its kept frames.

    ``balance`` holds ``dissipated_fraction`` of the ramp. ``ends``: where the nodes of the mesh (n, 3) are on the middle surface
    at rest, at the end of the ramp and of the path, in mm; empty without rest.
    """
    known = {"rested": rested, "dissipated_fraction": _number(balance.get("dissipated_fraction"))}
    if history.sizes["increment"]:
        known["largest_displacement"] = float(history.largest_displacement.max()) / model.length
        known["smallest_volume_ratio"] = _number(history.smallest_volume_ratio.min())
        known["smallest_thickness"] = _number(history.smallest_thickness.min())
    if ramp.sizes["increment"] > 1:
        known["largest_jump"] = largest_jump(ramp)
        known["smallest_ventricle"] = float(ramp.ventricle_volume.min() / max(abs(float(ramp.ventricle_volume[0])), 1e-9))
        known["energy_created"] = _number(energy_created(ramp, model.loading.ventricular_pressure))
    if ends:
        known |= pouch_volumes(model, ramp) | layers_passed(model, ends)
        if model.loading.ventricular_pressure > 0:
            known |= {"compression_share": compression_share(model, ends[0]), "elements_a_wrinkle": elements_a_wrinkle(model)}
    if not model.element.is_shell and frames.sizes["frame"]:
        known |= _equilibrium(model, frames)
    return Checks(**known)


def pouch_volumes(model: Model, ramp: xr.Dataset) -> dict:
    """How far and how long V_a lies below what the thickness of the fabric explains."""
    pouches = model.mesh.layer == LAYERS.index("endo")
    explained = 1e-3 * model.mesh.copies * model.fabric.thickness * float(flat_areas(model.mesh)[pouches].sum())  # ml
    pressure, volume = ramp.actuation_pressure.values, ramp.actuation_volume.values
    below = np.flatnonzero(volume < -explained)
    way = pressure[-1] - pressure[0]
    return {
        "actuation_at_rest": float(volume[0]),
        "actuation_below": float(max(-explained - volume[0], 0.0) / max(abs(float(ramp.ventricle_volume[0])), 1e-9)),
        "actuation_below_range": float((pressure[below[-1]] - pressure[0]) / way) if below.size and way > 0 else 0.0,
    }


def layers_passed(model: Model, ends: list[np.ndarray]) -> dict:
    """On which share of their area layers have passed each other."""
    mesh, thickness, passed = model.mesh, model.fabric.thickness, {}
    for pair in PAIRS:
        contact = contact_of(mesh, **dict.fromkeys(PAIRS, False) | {pair: True}, penalty=1.0, reach=thickness, span=thickness)
        if contact is None:
            continue
        touching = Touching(contact, mesh.nodes)
        areas = np.vstack([touching.plane_area, touching.pair_area * touching.weights])
        shares = [areas[np.vstack(touching.passed(points, thickness))].sum() / areas.sum() for points in ends]
        passed[f"{pair}_passed"] = float(max(shares))
    wanted = model.numerics.contact
    return passed | {"in_contact": tuple(pair for pair in PAIRS if model.contact is not None and getattr(wanted, pair))}


def largest_jump(ramp: xr.Dataset) -> float:
    """Largest change of V_v or V_a between neighbouring increments that is no buckling event, over V_v at rest."""
    pressure, largest = ramp.actuation_pressure.values, 0.0
    inside = np.zeros(len(pressure) - 1, bool)
    for volume in (ramp.ventricle_volume.values, ramp.actuation_volume.values):
        for event in events(pressure, volume):
            inside |= (pressure[:-1] >= event.before) & (pressure[1:] <= event.after)
    for volume in (ramp.ventricle_volume.values, ramp.actuation_volume.values):
        largest = max(largest, np.abs(np.diff(volume))[~inside].max(initial=0.0))
    return float(largest / max(abs(float(ramp.ventricle_volume[0])), 1e-9))


def energy_created(ramp: xr.Dataset, ventricular_pressure: float) -> float:
    """Largest fall of D = int P_a dV_a + P_v Delta V_v - Delta U along the ramp, over the actuation work of all of it.

    Whatever a path does, snaps included, only dissipates: D falls where the path jumped to a state that it could not reach.
    """
    pressure = ramp.actuation_pressure.values
    ventricle, actuation = ramp.ventricle_volume_conjugate.values, ramp.actuation_volume_conjugate.values
    work = np.append(0.0, np.cumsum(0.5 * (pressure[1:] + pressure[:-1]) * np.diff(actuation)))  # kPa ml = mJ
    dissipated = (
        work + ventricular_pressure * (ventricle - ventricle[0]) - (ramp.strain_energy.values - ramp.strain_energy.values[0])
    )
    fall = (np.maximum.accumulate(dissipated) - dissipated).max()
    return float(fall / work[-1]) if work[-1] > 0 else float("nan")


def _equilibrium(model: Model, frames: xr.Dataset) -> dict:
    """The largest residual, its floor and viscous share of some of the kept frames."""
    chosen = np.unique(np.linspace(0, frames.sizes["frame"] - 1, FRAMES).round().astype(int))
    measured = []
    for k in chosen:
        u, pressure = frames.displacement.values[k], float(frames.actuation_pressure[k])
        motion = frames.motion.values[k].astype(float)
        motion = motion if np.isfinite(motion).all() else None
        try:
            forces = residual(
                model, u.astype(float), pressure, motion, frames.attrs["damping"], f"frame at {pressure:g} kPa", u.dtype
            )
        except ResultError as error:
            return {"error": str(error)}
        measured.append((forces.resultant - forces.resultant_floor, forces.resultant, forces.resultant_floor, forces.viscous))
    _, largest, floor, _ = max(measured)
    viscous = [v for *_, v in measured if np.isfinite(v)]
    return {"residual": largest, "residual_floor": floor, "viscous_share": max(viscous, default=None)}


def _number(value: object) -> float | None:
    return float(value) if value is not None and np.isfinite(value) else None


def gave_way(status: str, smallest_thickness: float | None) -> bool:
    """Whether a path ended because its fabric did: what was reached is right, and the model has no answer far beyond."""
    return status == "diverged" and smallest_thickness is not None and smallest_thickness < THINNEST


def verdict(status: str, reason: str, checks: Checks, limits: Limits) -> tuple[str, str]:
    """Status and reason of a case from what its engine says and what was measured; what the engine calls a failure stays one."""
    if gave_way(status, checks.smallest_thickness):
        thinned = f"the fabric has thinned to {checks.smallest_thickness:.2g} of its thickness, where its law gives way"
        return status, f"{thinned} ({reason})"
    if status != "converged":
        return status, reason
    excess = max((checks.residual or 0.0) - (checks.residual_floor or 0.0), 0.0)
    wrong = [checks.error] if checks.error else []
    if excess > NO_EQUILIBRIUM * limits.residual:
        wrong.append(f"forces out of equilibrium by {excess:.2g} of the load")
    if wrong:
        return "diverged", "; ".join(wrong)
    doubts = [] if checks.rested else ["the device had not come to rest at the end of the hold"]
    if checks.smallest_ventricle is not None and checks.smallest_ventricle <= 0:
        doubts.append("the ventricle's volume is negative: front and back pass through each other")
    if checks.smallest_volume_ratio is not None and checks.smallest_volume_ratio < limits.smallest_volume_ratio:
        crushed = f"fabric keeps {checks.smallest_volume_ratio:.2g} of its volume somewhere"
        doubts.append(f"{crushed} (limit {limits.smallest_volume_ratio:g})")
    above = (
        (excess, limits.residual, "residual {:.2g} of the load"),
        (checks.viscous_share, limits.viscous_share, "damping carries {:.2g} of the load"),
        (checks.dissipated_fraction, limits.dissipated_fraction, "{:.2g} of the actuation work dissipated"),
        (checks.energy_created, limits.energy_created, "{:.2g} of the actuation work came from nowhere"),
        (checks.largest_jump, limits.jump, "a volume jumps by {:.2g} of the ventricle without an event"),
    )
    doubts += [f"{text.format(value)} (limit {limit:g})" for value, limit, text in above if value is not None and value > limit]
    if (unwrinkled := _unwrinkled(checks)) > limits.compression_share:
        share = f"{unwrinkled:.0%} of the fabric's energy is compression that no wrinkle carries"
        doubts.append(f"rests locked: {share} (limit {limits.compression_share:g}); {FREED}")
    if _is_above(checks.actuation_below, limits.actuation_volume):
        doubts.append(f"{_below_zero(checks)} (limit {limits.actuation_volume:g})")
    for pair in checks.in_contact:
        if _is_above(share := getattr(checks, f"{pair}_passed"), PASSED):
            doubts.append(f"{PAIRS[pair]} pass each other in spite of contact, on {share:.0%} of their area")
    return ("degraded", "; ".join(doubts)) if doubts else ("converged", "")


def remarks(checks: Checks, limits: Limits) -> list[str]:
    """What of a usable result is not physical, or coarse, though it is within its limits: ``what: details`` each.

    The words before the colon are the same for all cases.
    """
    found = []
    unwrinkled, elements = _unwrinkled(checks), checks.elements_a_wrinkle
    if COARSE < unwrinkled <= limits.compression_share or (elements is not None and elements < FEW):
        share = f"{unwrinkled:.0%} of the fabric's energy at rest is compression without wrinkles"
        found.append(f"coarse for its wrinkles: {elements or np.nan:.1f} elements a wrinkle, {share}")
    if _is_above(checks.actuation_below, 0.0) and not _is_above(checks.actuation_below, limits.actuation_volume):
        details = f"{checks.actuation_at_rest:.1f} ml at rest, and so up to {checks.actuation_below_range:.0%} of the ramp"
        found.append(f"V_a below zero beyond the fabric's thickness: {details}")
    for pair, names in PAIRS.items():
        if _is_above(passed := getattr(checks, f"{pair}_passed"), PASSED) and pair not in checks.in_contact:
            found.append(f"{names} pass each other: on {passed:.0%} of their area, without contact between them")
    if checks.smallest_ventricle is not None and 0 < checks.smallest_ventricle < NEARLY_EMPTY:
        found.append(f"the ventricle is nearly empty: V_v falls to {checks.smallest_ventricle:.1%} of that at rest")
    return found


def _unwrinkled(checks: Checks) -> float:
    """The compression share, of a mesh that does not follow wrinkles; else 0."""
    return 0.0 if _is_above(checks.elements_a_wrinkle, FOLLOWED) else checks.compression_share or 0.0


def _below_zero(checks: Checks) -> str:
    """How far V_a lies below zero at rest."""
    return (
        f"V_a at rest is {checks.actuation_at_rest:.1f} ml: pouch layers lie on the wrong side of each other by "
        f"{checks.actuation_below:.2g} of V_v beyond what the fabric's thickness explains"
    )


def _is_above(value: float | None, limit: float) -> bool:
    return value is not None and value > limit
