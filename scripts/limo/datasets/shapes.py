"""The shapes of a study: one small file with the surfaces, maps and lines that its figures draw, without any solver's output.

Everything is kept on the part that was solved; ``limo.mesh.surface`` mirrors it to the full device. Points are those of the
middle surface, once for each layer and face that they belong to, so that nothing is averaged over a seam. Cases whose meshes
are smaller than the largest of the study are padded: with -1 in indices, with NaN elsewhere.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr

from limo.cases.case import Case, solved_on
from limo.cases.grid import GridPoint, study_grid
from limo.config.project import Project
from limo.datasets.gather import GridArrays, Member, attributes, frame_labels, members
from limo.datasets.variables import CASE_DIMS, describe_axes, on_axes
from limo.errors import LimoError, ResultError
from limo.measure.buckling import events
from limo.measure.contact import front_through_back
from limo.measure.frames import CaseFrames, open_case
from limo.measure.quantities import FRAME, SIDE
from limo.measure.ramp import read_ramp
from limo.measure.strain import DEVICE_SIDES, streamlines
from limo.measure.stress import von_mises_map
from limo.measure.zones import distances
from limo.mechanics.layer import inside_out, nodal, surface_state
from limo.mechanics.model import Model
from limo.mesh.layers import DeviceMesh
from limo.schema.figures import items_of, shown_places
from limo.schema.pressures import reaches
from limo.schema.study import Study
from limo.store.files import UNREADABLE, read_json, write_netcdf
from limo.store.results import CaseFiles
from limo.store.statuses import NOT_MEASURED, SolveStatus

MESH = {"long_name": "name of a mesh, of its file in results/meshes"}
_LEVELS = 4000  # steps of a packed variable on either side of zero: more would be noise, which no compression takes
_LEVELS_OF_MESH = 32000  # the same of what there is once a mesh


@dataclass(frozen=True)
class Shape:
    """What is stored under a name: dimensions besides those of a case (``mesh`` first: of a mesh instead), units, meaning."""

    dims: tuple[str, ...]
    units: str
    long_name: str
    of_mesh: bool = False


VARIABLES = {
    "flat": Shape(("point", "plane"), "mm", "place on the flat pattern: x, and y from the valve edge to the apex", True),
    "quads": Shape(("quad", "corner"), "", "points of a quadrilateral: corners, then mid-sides; -1 beyond the last", True),
    "layer": Shape(("quad",), "", "wall 0, endocardium 1, epicardium 2", True),
    "face": Shape(("quad",), "", "front 0, back 1", True),
    "pouch": Shape(("quad",), "", "pouch from 0, front before back, -1 on the wall", True),
    "seam_distance": Shape(("point",), "mm", "flat distance to the nearest seam or the outer edge", True),
    "frame_requested": Shape(("frame",), "kPa", "actuation pressure asked for"),
    "frame_pressure": Shape(("frame",), "kPa", "actuation pressure of the increment nearest to it, P_a"),
    "frame_contact": Shape(("frame",), "", "whether front and back would touch: 1 or 0, -1 without a frame"),
    "displacement": Shape(("frame", "point", "axis"), "mm", "displacement of the middle surface from the flat state"),
    "von_mises": Shape(("frame", "point"), "MPa", "von Mises stress, largest through the thickness"),
    "fatigue_amplitude": Shape(("point",), "1", "largest principal membrane strain of the inflation"),
    "line_place": Shape(("side", "vertex", "axis"), "mm", "deformed lines along v_1, the largest principal strain's direction"),
    "line_number": Shape(("side", "vertex"), "", "which line a vertex belongs to, -1 beyond the last"),
    "line_face": Shape(("side", "vertex"), "", "face that a vertex lies on: front 0, back 1, -1 beyond the last"),
    "line_strain": Shape(("side", "vertex"), "1", "E_1 in the fabric's plane along the lines"),
    "event_pressure": Shape(("end",), "kPa", "actuation pressures before and after the largest buckling event"),
    "event_jump": Shape((), "ml", "its jump of the stroke volume"),
    "event_displacement": Shape(("end", "point", "axis"), "mm", "displacements before and after it"),
}
_BY_ITEM = {
    "von_mises": ("von_mises",),
    "fatigue": ("fatigue_amplitude",),
    "lines": ("line_place", "line_number", "line_face", "line_strain"),
    "event": ("event_pressure", "event_jump", "event_displacement"),
}
_SIZES = {"axis": 3, "plane": 2, "corner": 8, "side": len(DEVICE_SIDES), "end": 2}  # of dimensions that no case decides
_INTEGERS = ("quads", "layer", "face", "pouch", "frame_contact", "line_number", "line_face")


def frame_entries(study: Study) -> dict[str, float | str]:
    """The pressures whose shapes are kept, as the study writes them, by their labels."""
    return frame_labels([*(study.frames if "frames" in items_of(study.figures) else ()), *study.fields_at])


def gather_shapes(
    project: Project, name: str, case_folder: Path, mesh_folder: Path, sources: Sequence[str] | None = None
) -> xr.Dataset:
    """The shapes of a study from the frames of its cases below ``case_folder`` and the meshes in ``mesh_folder``.

    Of the branches of a case the lowest is shown, as in the curves (``states.lowest``).
    ``sources``: ids of the cases that serve the study, in the order of its grid (default: its own cases). A case without
    usable frames has none here, and ``shape_reason`` says why; the others do not notice. Of more cases than figures show
    (``shown_places``) there are no shapes of the others.
    """
    grid = study_grid(project, name)
    ids = dict(zip(grid.cases, sources or [case.case_id for case in grid.cases.values()], strict=False))
    places = shown_places({name: len(values) for name, values in grid.axes.items()})
    axes = {name: [values[k] for k in places[name]] for name, values in grid.axes.items()} | {"branch": [0]}
    inside = {p: c for p, c in grid.cases.items() if all(v in axes[n] for n, v in p._replace(branch=0)._asdict().items())}
    shown = _lowest(inside, ids, case_folder)
    arrays = GridArrays(axes)
    arrays.add("mesh_number", -1, "which mesh a case is on, -1 without shapes")
    arrays.add("symmetry", "", "full, front_back (mirror in z = 0) or quarter (and in x = 0)")
    arrays.add("device_length", np.nan, "length of the device, L", "mm")
    arrays.add("shape_reason", "", "why a case has no shapes")
    gathered = _Shapes(grid.study, mesh_folder)
    chosen = {place: case for place, (case, _) in shown.items()}
    for member in members(chosen, arrays.axes, case_folder, [name for _, name in shown.values()]):
        gathered.add(member, arrays)
    coords = {"frame": ("frame", list(gathered.entries), {"long_name": FRAME})}
    coords |= {"mesh_id": ("mesh", list(gathered.meshes), MESH), "axis": ["x", "y", "z"], "plane": ["x", "y"]}
    if "lines" in gathered.items:
        coords["side"] = ("side", list(DEVICE_SIDES), SIDE)
    dataset = arrays.dataset(coords).assign(gathered.variables(arrays.shape))
    named = {"title": f"{name}: surfaces that its figures draw", "study": name, "items": " ".join(gathered.items)}
    dataset = dataset.assign_attrs(named | {"config": json.dumps(project.content(name), sort_keys=True)})
    return on_axes(describe_axes(dataset), grid.study)


def _lowest(cases: Mapping[GridPoint, Case], ids: Mapping[GridPoint, str], folder: Path) -> dict[GridPoint, tuple[Case, str]]:
    """Of the solutions of each case the one of least energy at rest with its id, in the place of the first."""
    solutions: dict[GridPoint, list[GridPoint]] = {}
    for point in cases:
        solutions.setdefault(point._replace(branch=0), []).append(point)
    shown = {}
    for place, points in solutions.items():
        point = min(points, key=lambda point: _energy_at_rest(CaseFiles(folder / ids[point]))) if len(points) > 1 else place
        shown[place] = cases[point], ids[point]
    return shown


def _energy_at_rest(files: CaseFiles) -> float:
    """Pi in mJ at rest of a solved case; infinite where it cannot be used or does not say."""
    try:
        usable = SolveStatus.from_json(read_json(files.status), files.status).is_usable
        ramp = read_ramp(files.folder)
    except (ResultError, *UNREADABLE):
        return np.inf
    return float(ramp.potential_energy[0]) if usable and ramp.sizes["increment"] and "potential_energy" in ramp else np.inf


class _Shapes:
    """The shapes of cases that are gathered one by one: ``meshes`` by id, values of each case by its place."""

    def __init__(self, study: Study, mesh_folder: Path):
        self.study, self.mesh_folder = study, mesh_folder
        self.items, self.entries = items_of(study.figures), frame_entries(study)
        self.meshes: dict[str, dict[str, np.ndarray]] = {}
        self.values: dict[tuple[int, ...], dict[str, np.ndarray]] = {}

    def add(self, member: Member, arrays: GridArrays) -> None:
        """Take in a case; one that cannot be used leaves a reason."""
        index, case = member.index, member.case
        arrays["symmetry"][index], arrays["device_length"][index] = case.mesh.symmetry, case.device.pattern.length
        try:
            stored = Case.from_dict(read_json(member.files.described)["case"])
            where = self.mesh_folder / f"{stored.mesh_id}.vtu", member.files.folder
            model, frames = open_case(stored, *where)
            mesh_id, arrays["symmetry"][index] = solved_on(stored, *where)[0].mesh_id, model.mesh.symmetry
            if mesh_id not in self.meshes:
                self.meshes[mesh_id] = mesh_values(model.mesh)
            pressures = [self.study.pressure_of(entry, case.ventricular_pressure) for entry in self.entries.values()]
            self.values[index] = _case_values(model, frames, pressures, self.items, case.actuation_pressure_max)
            arrays["mesh_number"][index] = list(self.meshes).index(mesh_id)
        except (LimoError, KeyError, TypeError, ValueError) as error:
            arrays["shape_reason"][index] = str(error)

    def variables(self, shape: tuple[int, ...]) -> dict[str, tuple]:
        """What is stored of meshes, and of cases over a grid of a ``shape``."""
        count, frames = len(self.meshes), len(self.entries)
        numbers = [(k,) for k in range(count)]
        variables = {}
        for name, variable in VARIABLES.items():
            if variable.of_mesh:
                dims, array = ("mesh",), _stack(name, numbers, [*self.meshes.values()], (count,), variable.dims)
            elif name in _case_names(self.items):
                dims, array = CASE_DIMS, _stack(name, [*self.values], [*self.values.values()], shape, variable.dims, frames)
            else:
                continue
            variables[name] = ((*dims, *variable.dims), array, attributes(variable.long_name, variable.units))
        return variables


def write_shapes(dataset: xr.Dataset, path: Path) -> None:
    """Write shapes packed: numbers as steps of 1/4000 of their largest, which is 0.01 mm in displacements; finer the mesh."""
    encoding = {}
    for name, values in dataset.variables.items():
        if values.dtype.kind == "f" and values.size > 1000:
            largest = np.nanmax(np.abs(values.values)) if np.isfinite(values.values).any() else 0.0
            levels = _LEVELS_OF_MESH if "mesh" in values.dims else _LEVELS
            scale = float(np.float32(max(largest, 1e-12) / levels))
            encoding[name] = {"dtype": "int16", "scale_factor": scale, "_FillValue": -32768}
        if values.size > 1000 and values.dtype.kind in "fiu":
            encoding[name] = encoding.get(name, {}) | {"zlib": True, "shuffle": True, "complevel": 9}
    write_netcdf(dataset, path, encoding, checked=False)


def _case_names(items: tuple[str, ...]) -> list[str]:
    optional = {n: item for item, names in _BY_ITEM.items() for n in names}
    return [n for n, v in VARIABLES.items() if not v.of_mesh and (n not in optional or optional[n] in items)]


def _stack(
    name: str,
    places: list[tuple],
    values: list[dict[str, np.ndarray]],
    shape: tuple[int, ...],
    dims: tuple[str, ...],
    frames: int = 0,
) -> np.ndarray:
    """One array of all cases or meshes (or sides), each padded to the largest along ``dims``; there may be none."""
    arrays = [np.asarray(v[name]) for v in values]
    rank = len(dims)
    sizes = _SIZES | {"frame": frames}
    largest = tuple(max([sizes.get(dims[k], 0), *(a.shape[k] for a in arrays)]) for k in range(rank))
    whole = name in _INTEGERS
    stacked = np.full(shape + largest, -1 if whole else np.nan, np.int16 if whole else np.float32)
    if whole and any(a.size and a.max() > np.iinfo(np.int16).max for a in arrays):
        stacked = stacked.astype(np.int32)
    for place, array in zip(places, arrays, strict=True):
        stacked[(*place, *(slice(n) for n in array.shape))] = array
    return stacked


def mesh_values(mesh: DeviceMesh) -> dict[str, np.ndarray]:
    """A mesh as it is drawn: points by layer and face, quadrilaterals on them."""
    _, node, quads = nodal(mesh, np.zeros((len(mesh.quads), 4)))
    away = distances(mesh, mesh.nodes)
    values = {"flat": mesh.nodes[node, :2], "quads": quads, "layer": mesh.layer, "face": mesh.face, "pouch": mesh.pouch}
    return values | {"seam_distance": np.minimum(away["seam"], away["outer_edge"])[node]}


def _case_values(
    model: Model, frames: CaseFrames, pressures: list[float | None], items: tuple[str, ...], maximum: float
) -> dict[str, np.ndarray]:
    """Everything that is stored of one case; ``pressures`` (kPa) of its frames, None for one beyond its range."""
    mesh, files = model.mesh, CaseFiles(frames.file.parent)
    _, node, _ = nodal(mesh, np.zeros((len(mesh.quads), 4)))
    values, last = _frame_values(model, frames, pressures, node, "von_mises" in items)
    if last is None:
        raise ResultError(f"{frames.file}: none of the frames that the figures draw")
    if "fatigue" in items:
        values["fatigue_amplitude"] = nodal(mesh, _amplitude(files.measures, len(mesh.quads)))[0]
    if "lines" in items:
        values |= _lines(model, last, frames.file)
    if "event" in items:
        values |= _event(model, frames, node, maximum)
    return values


def _frame_values(
    model: Model, frames: CaseFrames, pressures: list[float | None], node: np.ndarray, stressed: bool
) -> tuple[dict[str, np.ndarray], np.ndarray | None]:
    """What is stored of the frames at some pressures (kPa), and displacements (n, 3) in mm of the one at the highest of them.

    ``node``: node of the mesh of each stored point; ``stressed``: with von Mises stresses.
    """
    mesh, thickness, count = model.mesh, model.fabric.thickness, len(pressures)
    values = {
        "frame_requested": np.array([np.nan if p is None else p for p in pressures]),
        "frame_pressure": np.full(count, np.nan),
        "frame_contact": np.full(count, -1),
        "displacement": np.full((count, len(node), 3), np.nan),
        "von_mises": np.full((count, len(node)), np.nan),
    }
    last = None
    for k, pressure in enumerate(pressures):
        frame = None if pressure is None else frames.find(pressure)
        if frame is None:
            continue
        u = frames.displacement[frame].astype(float)
        middle = model.expansion.midsurface(u)
        values["frame_pressure"][k] = frames.pressure[frame]
        values["frame_contact"][k] = len(front_through_back(mesh, mesh.nodes + middle, thickness)) > 0
        values["displacement"][k] = middle[node]
        if stressed:
            values["von_mises"][k] = nodal(mesh, von_mises_map(model, u, frames.file).max(axis=1))[0]
        last = u if last is None or reaches(pressure, np.nanmax(values["frame_pressure"][: k + 1])) else last
    return values, last


def _amplitude(file: Path, count: int) -> np.ndarray:
    """Strain amplitudes (m, 4) of a measured case."""
    try:
        with xr.open_dataset(file) as measured:
            if measured.attrs.get("status") == NOT_MEASURED:
                raise ResultError(measured.attrs.get("reason", f"{file}: not measured"))
            amplitude = measured.fatigue_amplitude.values
    except (OSError, AttributeError) as error:
        raise ResultError(f"{file}: no fatigue amplitudes ({error})") from None
    if len(amplitude) != count:
        raise ResultError(f"{file}: {len(amplitude)} elements, the mesh has {count}")
    return amplitude


def _lines(model: Model, u: np.ndarray, source: Path) -> dict[str, np.ndarray]:
    """Streamlines of v_1 on both sides of the part that was solved."""
    mesh = model.mesh
    strain = inside_out(mesh, surface_state(model, u, source).strain)
    points = model.middle(u)
    sides = []
    for side in DEVICE_SIDES:
        lines = [(line, face) for face in np.unique(mesh.face) for line in streamlines(mesh, strain, points, side, int(face))]
        sizes = [len(line.flat) for line, _ in lines]
        sides.append(
            {
                "line_place": np.vstack([np.empty((0, 3)), *(line.deformed for line, _ in lines)]),
                "line_number": np.repeat(np.arange(len(lines)), sizes),
                "line_face": np.repeat([face for _, face in lines], sizes),
                "line_strain": np.concatenate([np.empty(0), *(line.strain for line, _ in lines)]),
            }
        )
    return {n: _stack(n, [(0,), (1,)], sides, (2,), VARIABLES[n].dims[1:]) for n in _BY_ITEM["lines"]}


def _event(model: Model, frames: CaseFrames, node: np.ndarray, maximum: float) -> dict[str, np.ndarray]:
    """The largest buckling event up to ``maximum`` (kPa) whose displacements were kept; NaN where there is none."""
    values = {
        "event_pressure": np.full(2, np.nan),
        "event_jump": np.array(np.nan),
        "event_displacement": np.full((2, len(node), 3), np.nan),
    }
    ramp = read_ramp(frames.file.parent)
    volume = ramp.ventricle_volume.values
    jumps = events(ramp.actuation_pressure.values, volume[:1] - volume)
    for event in sorted((e for e in jumps if reaches(maximum, e.after)), key=lambda e: -abs(e.jump)):
        if (stored := frames.find_event(event)) is not None:
            both = model.expansion.midsurface(frames.event_displacement[stored].astype(float))
            values["event_pressure"], values["event_jump"] = np.array([event.before, event.after]), np.array(event.jump)
            values["event_displacement"] = both[:, node]
            break
    return values
