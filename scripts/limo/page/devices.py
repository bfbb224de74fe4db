"""What the page shows in three dimensions: the surfaces of cases at stored P_a, and what colours them.

Everything comes from files that are there: displacements of each case (``frames.nc``), and stress, strain and fatigue where
a study had them measured (``measures.nc``), at the pressures it asked for. Only the part that was solved is kept.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from limo.cases.case import Case
from limo.datasets.shapes import mesh_values
from limo.errors import LimoError, ResultError
from limo.figures.cycles import cycles_of
from limo.figures.pictures import rounded_up
from limo.measure.frames import CaseFrames, open_case
from limo.measure.strain import inplane_angle, membrane_principal
from limo.mechanics.layer import SIDES, inside_out, nodal, surface_state
from limo.mechanics.model import Model
from limo.mesh.layers import LAYERS, DeviceMesh
from limo.mesh.surface import Surface, borders, divided, grid
from limo.page.packing import pack, pack_steps
from limo.schema.fatigue import Fatigue
from limo.store.files import read_json
from limo.store.results import CaseFiles, Results
from limo.store.statuses import MEASURED

MOST_PRESSURES = 20  # of a case
_FEWER = (MOST_PRESSURES, 15, 12, 10, 8, 6, 5, 4, 3, 2)  # what is tried until a page is small enough
_STEPS = {"displacement": 8000}  # between zero and the largest value
_OTHER_STEPS = 1000  # of other quantities
_FINEST = {600: 3, 1500: 2}  # elements of a part up to which they are divided so often along a side, beyond it not at all
_SHOWN_UP_TO = 0.99  # share of the values that a scale covers
_SAME = 1e-3  # kPa, pressures closer than this are one
LEFT_OUT = "left out of the 3D view to keep the page small"


@dataclass(frozen=True)
class Quantity:
    """What colours a surface: name, meaning, units, and whether its logarithm is stored."""

    name: str
    long_name: str
    units: str
    log: bool = False


_E1 = "largest principal strain in the fabric's plane, E_1"
_V1 = "angle of its direction v_1 to the circumference"
QUANTITIES = {
    "displacement": Quantity("displacement", "displacement from the flat state", "mm"),
    "von_mises": Quantity("von Mises stress", "von Mises stress, largest through the thickness", "MPa"),
    "strain_outer": Quantity("strain E_1, outer side", f"{_E1}, outer side", "1"),
    "strain_inner": Quantity("strain E_1, inner side", f"{_E1}, inner side", "1"),
    "angle_outer": Quantity("direction v_1, outer side", f"{_V1}, outer side", "degree"),
    "angle_inner": Quantity("direction v_1, inner side", f"{_V1}, inner side", "degree"),
    "cycles": Quantity("cycles to failure", "expected cycles to failure near seams, N_f: an index, no lifetime", "1", log=True),
}


@dataclass(frozen=True)
class _Stop:
    """A stored state: P_a (kPa), displacements (n, 3) in mm, the pressure asked for (none across an event), and a remark."""

    pressure: float
    displacement: np.ndarray
    requested: float | None
    remark: str = ""


class Devices:
    """Cases and their meshes as they are put into a page, plain data with packed numbers.

    Of a thousand cases no more are opened and held than a page of ``most`` characters can take at fewest pressures.
    """

    def __init__(self, results: Path, most: float = float("inf")):
        self.results, self.most, self._least = results, most, 0
        self.meshes: dict[str, dict[str, Any]] = {}
        self.cases: dict[str, dict[str, Any]] = {}
        self.reasons: dict[str, str] = {}

    def add(self, case_id: str) -> None:
        """Take a case in; one whose files cannot be used leaves a reason instead."""
        if case_id in self.cases or case_id in self.reasons:
            return
        if self._least > self.most:
            self.reasons[case_id] = LEFT_OUT
            return
        results = Results(self.results)
        files = results.case(case_id)
        try:
            case = Case.from_dict(read_json(files.described)["case"])
            model, frames = open_case(case, results.mesh(case.mesh_id), files.folder)
            self.cases[case_id] = _case(model, frames) | {"mesh": case.mesh_id}
            self.meshes.setdefault(case.mesh_id, _mesh(model.mesh, case))
            self._least += _size(thinned(self.cases[case_id], _FEWER[-1]))
        except (LimoError, AttributeError, KeyError, TypeError, ValueError) as error:
            self.reasons[case_id] = str(error)

    def fit(self, most: int) -> str:
        """Make all of it at most ``most`` characters long: fewer pressures a case, then fewer cases; says what is left out."""
        meshes = sum(map(_size, self.meshes.values()))
        closed = sum(reason == LEFT_OUT for reason in self.reasons.values())
        count = len(self.cases) + closed
        if not closed and meshes + sum(map(_size, self.cases.values())) <= most:
            return ""
        for pressures in _FEWER:
            kept = {name: thinned(case, pressures) for name, case in self.cases.items()}
            sizes = {name: _size(case) for name, case in kept.items()}
            if (size := meshes + sum(sizes.values())) <= most:
                break
        while kept and size > most:
            name, _ = kept.popitem()
            size -= sizes[name]
            self.reasons[name] = LEFT_OUT
        notes = [f"each case is shown at {pressures} of its stored pressures at most"]
        if dropped := count - len(kept):
            notes.append(f"{dropped} of {count} cases are left out")
        self.cases = kept
        return "; ".join(notes)

    def plain(self) -> dict[str, Any]:
        """Meshes and cases with what is needed to read them."""
        used = {case["mesh"] for case in self.cases.values()}
        meshes = {name: mesh for name, mesh in self.meshes.items() if name in used}
        shapes = {d: pack(grid(d)[0]) for d in {mesh["divisions"] for mesh in meshes.values()}}
        quantities = {name: asdict(quantity) for name, quantity in QUANTITIES.items()}
        return {"quantities": quantities, "layers": list(LAYERS), "shapes": shapes, "meshes": meshes, "cases": self.cases}


def _size(entry: dict[str, Any]) -> int:
    """Characters that a mesh or a case takes in the page."""
    return len(json.dumps(entry))


def spread(count: int, most: int) -> list[int]:
    """At most ``most`` (two or more) of ``count`` places, the first and the last among them, evenly spread."""
    return sorted(set(np.linspace(0, count - 1, min(count, most)).round().astype(int).tolist()))


def thinned(case: dict[str, Any], most: int) -> dict[str, Any]:
    """A packed case at fewer pressures."""
    return case | {"stops": [case["stops"][k] for k in spread(len(case["stops"]), most)]}


def _mesh(mesh: DeviceMesh, case: Case) -> dict[str, Any]:
    """A mesh divided into small quadrilaterals, and how values at its points are carried to theirs.

    ``joined`` marks points of a quarter that its mirror image in x = 0 continues without a seam: no border runs there.
    """
    values = mesh_values(mesh)
    quads = values["quads"]
    divisions = next((d for most, d in _FINEST.items() if len(quads) <= most), 1)
    surface = Surface(values["flat"], values["flat"], *(values[n] for n in ("quads", "layer", "face", "pouch")))
    first, point = divided(surface, divisions)
    shape, _, cells = grid(divisions)
    small = point[:, cells].reshape(-1, 4)
    per_face = case.n_pouches // 2
    continued = (mesh.pouch < 0) | (2 * (mesh.pouch % per_face) + 1 == per_face)
    flat_x = np.einsum("gn,mn->mg", shape, values["flat"][quads, 0]).ravel()[first]
    joined = (case.mesh.symmetry == "quarter") & (np.abs(flat_x) < 1e-6) & continued[first // len(shape)]
    lines = borders(small)
    lines = lines[~joined[lines].all(axis=1)]
    arrays = {"flat": values["flat"], "quads": quads, "layer": mesh.layer, "face": mesh.face}
    arrays |= {"first": first, "small": small, "joined": joined, "borders": lines, "away": values["seam_distance"]}
    return {"divisions": divisions} | {n: pack(a) for n, a in arrays.items()}


def _case(model: Model, frames: CaseFrames) -> dict[str, Any]:
    """A case at up to ``MOST_PRESSURES`` of its stored states."""
    mesh, measured = model.mesh, _measured(CaseFiles(frames.file.parent).measures)
    wanted = json.loads(measured.attrs.get("wanted", "{}")).get("pressures", {})
    every = _stops(frames)
    stops = [every[k] for k in spread(len(every), MOST_PRESSURES)]
    _, node, _ = nodal(mesh, np.zeros((len(mesh.quads), 4)))
    by_stop = [_values(model, stop, node, wanted, frames.file) for stop in stops]
    constant, near, shown = {}, 0.0, [*by_stop]
    if "fatigue" in wanted:
        fatigue = Fatigue.model_validate_json(measured.attrs["fatigue"])
        cycles, near = _cycles(mesh, measured, fatigue), fatigue.seam_distance.value
        constant = {"cycles": cycles}
        shown.append({"cycles": np.where(mesh_values(mesh)["seam_distance"] <= near, cycles, np.nan)})
    steps, limits = _scales(shown)
    return {
        "symmetry": mesh.symmetry,
        "reach": {
            "flat": _reach([mesh.nodes]),
            "deformed": _reach([mesh.nodes[node] + values["displacement"] for values in by_stop]),
        },
        "stored": len(every),
        "near": near,
        "steps": steps,
        "limits": limits,
        "constant": {n: pack_steps(v, steps[n]) for n, v in constant.items() if n in steps},
        "stops": [
            {"pressure": stop.pressure, "remark": stop.remark, "values": {n: pack_steps(v, steps[n]) for n, v in values.items()}}
            for stop, values in zip(stops, by_stop, strict=True)
        ],
    }


def _scales(shown: list[dict[str, np.ndarray]]) -> tuple[dict[str, float], dict[str, list[float]]]:
    """By quantity the step in which its numbers are packed and the ends of its scale, of what has any values."""
    steps, limits = {}, {}
    for name, quantity in QUANTITIES.items():
        values = np.concatenate([np.empty(0), *(_magnitude(v[name]).ravel() for v in shown if name in v)])
        known = values[np.isfinite(values)]
        if known.size:
            steps[name] = float(np.float32(max(np.abs(known).max(), 1e-9) / _STEPS.get(name, _OTHER_STEPS)))
            limits[name] = _limits(name, quantity, known)
    return steps, limits


def _reach(places: list[np.ndarray]) -> list[float]:
    """Largest distances (mm) from the axis of the full device in x and z, smallest and largest y."""
    x, y, z = np.vstack(places).T
    return [round(float(value), 2) for value in (np.abs(x).max(), np.abs(z).max(), y.min(), y.max())]


def _stops(frames: CaseFrames) -> list[_Stop]:
    """All stored states by P_a: frames, and both ends of buckling events that are no frames."""
    stops = [_Stop(float(p), u, float(r)) for p, u, r in zip(frames.pressure, frames.displacement, frames.requested, strict=True)]
    for ends, both in zip(frames.event_pressure, frames.event_displacement, strict=True):
        for pressure, u, remark in zip(ends, both, ("before", "after"), strict=True):
            if all(abs(pressure - stop.pressure) > _SAME for stop in stops):
                stops.append(_Stop(float(pressure), u, None, f"{remark} a buckling event"))
    once = {round(stop.pressure / _SAME): stop for stop in reversed(stops)}
    return sorted(once.values(), key=lambda stop: stop.pressure)


def _measured(file: Path) -> xr.Dataset:
    """What is known of a case's fatigue, with what was asked for; empty where nothing was measured."""
    try:
        with xr.open_dataset(file) as measured:
            if measured.attrs.get("status") == MEASURED:
                return measured[[n for n in ("fatigue_amplitude",) if n in measured]].load()
    except (OSError, ValueError):
        pass
    return xr.Dataset()


def _values(model: Model, stop: _Stop, node: np.ndarray, wanted: dict[str, list[float]], source: Path) -> dict[str, np.ndarray]:
    """Displacements at the points of the page's mesh, which are nodes (p,), and what was asked for at this pressure."""
    mesh, u = model.mesh, stop.displacement.astype(float)
    values = {"displacement": model.expansion.midsurface(u)[node]}
    asked = [o for o in ("stress", "strain") if stop.requested is not None and _holds(wanted.get(o, ()), stop.requested)]
    if not asked:
        return values
    state = surface_state(model, u, source)
    if "stress" in asked:
        values["von_mises"] = nodal(mesh, inside_out(mesh, state.von_mises).max(axis=1))[0]
    if "strain" in asked:
        strain = inside_out(mesh, state.strain)
        for side in ("outer", "inner"):
            tensor = nodal(mesh, strain[:, SIDES.index(side)])[0]
            values |= {f"strain_{side}": membrane_principal(tensor), f"angle_{side}": np.abs(inplane_angle(tensor))}
    return values


def _holds(pressures: Iterable[float], pressure: float) -> bool:
    return any(abs(p - pressure) < _SAME for p in pressures)


def _cycles(mesh: DeviceMesh, measured: xr.Dataset, fatigue: Fatigue) -> np.ndarray:
    """Logarithm of the cycles to failure at points, near seams and away from them; in the endurance range its limit."""
    amplitude = measured.fatigue_amplitude.values
    if len(amplitude) != len(mesh.quads):
        raise ResultError(f"measures.nc: {len(amplitude)} elements, the mesh has {len(mesh.quads)}")
    at_points = nodal(mesh, amplitude)[0]
    return np.log10(cycles_of(at_points, np.zeros(len(at_points)), fatigue))


def _magnitude(values: np.ndarray) -> np.ndarray:
    """Lengths of vectors (p, 3); other values (p,) as they are."""
    return np.linalg.norm(values, axis=1) if values.ndim > 1 else values


def _limits(name: str, quantity: Quantity, known: np.ndarray) -> list[float]:
    """Ends of a scale."""
    if quantity.log:
        return [float(np.floor(known.min())), float(known.max())]
    if name.startswith("angle"):
        return [0.0, 90.0]
    return [0.0, rounded_up(float(np.quantile(known, _SHOWN_UP_TO if name != "displacement" else 1.0)))]
