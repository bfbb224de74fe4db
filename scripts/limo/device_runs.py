"""The runs from which errors of the device are taken: where they come from, what of their shapes counts, and which are kept.

A device has these studies: ``accuracy_<device>`` varies one setting at a time, ``reference_<device>`` is an ensemble on the
finest mesh, ``referee_<device>`` what CalculiX itself finds on a fine one, ``scatter_<device>`` an ensemble on the default mesh;
``shells_<device>`` adds elements of which only volumes are known. Runs of ``KEPT_PARTS`` take hours: they are solved once, and
kept.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
import xarray as xr
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
from vtkmodules.vtkCommonCore import VTK_ID_TYPE, vtkDoubleArray, vtkPoints
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData
from vtkmodules.vtkFiltersCore import vtkImplicitPolyDataDistance

from limo.case import Case, solved_on, study_cases
from limo.config import Loaded
from limo.dataset import gather_study
from limo.elements import gauss, quad8_shape
from limo.errors import LimoError, ResultError
from limo.figures.surface import grid, mirrors
from limo.files import UNREADABLE, read_json, write_netcdf
from limo.measures import open_case
from limo.mesh import degrees_of_freedom_of, read_mesh
from limo.overhead import processor

PARTS = ("accuracy", "reference", "referee", "scatter", "shells")
KEPT_PARTS = ("reference", "referee")
#: parts of which short runs are timed several times
TIMED_PARTS = ("accuracy", "shells")
#: points on the full device whose distance to another is taken, and steps of the stored coordinates in mm
CLOUD, STEP = 6000, 0.01
#: where the device is cut, y / L
SECTION = 0.5
#: linear quadrilaterals along a side of an element that is cut, and of one to which distances are taken
_CUT, _MEASURED = 2, 4


@dataclass(frozen=True)
class Surface:
    """What is kept of a run's shapes: w / L (f,) at pressures (f,) in kPa, and the deformed middle surface of its last frame.

    ``points`` (n, 3) in mm and ``quads`` (m, 8) are those of the part that was solved, of which ``symmetry`` makes the full
    device. ``sections``: for each frame the segments (k, 2, 2), x and z in mm of both ends, in which the plane y / L =
    ``SECTION`` cuts that part.
    """

    pressure: np.ndarray
    height: np.ndarray
    points: np.ndarray
    quads: np.ndarray
    symmetry: str
    sections: tuple[np.ndarray, ...] = ()

    @cached_property
    def cloud(self) -> np.ndarray:
        """Points (``CLOUD``, 3) in mm, equally dense all over the full device."""
        signs = mirrors(self.symmetry)
        part = sampled(self.points, self.quads, CLOUD // len(signs))
        return np.vstack([part * sign for sign in signs])

    @cached_property
    def _measure(self) -> vtkImplicitPolyDataDistance:
        values, _, cells = grid(_MEASURED)
        points = np.einsum("gn,mnk->mgk", values, self.points[self.quads])
        corners = np.arange(points.size // 3).reshape(points.shape[:2])[:, cells][:, :, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3)
        faces, place = vtkCellArray(), vtkPoints()
        faces.SetData(3, numpy_to_vtk(corners.ravel(), deep=True, array_type=VTK_ID_TYPE))
        place.SetData(numpy_to_vtk(points.reshape(-1, 3), deep=True))
        surface = vtkPolyData()
        surface.SetPoints(place)
        surface.SetPolys(faces)
        measure = vtkImplicitPolyDataDistance()
        measure.SetInput(surface)
        return measure

    def distances(self, points: np.ndarray) -> np.ndarray:
        """Distances (p,) in mm of points (p, 3) from the full device, whose elements are divided into flat triangles."""
        images = points * np.array(mirrors(self.symmetry))[:, None]
        low, high = self.points.min(axis=0), self.points.max(axis=0)
        beyond = np.linalg.norm(np.maximum(0.0, np.maximum(low - images, images - high)), axis=-1)
        found = np.full(len(points), np.inf)
        for turn in np.argsort(beyond, axis=0, kind="stable"):  # the image nearest to the part first: searches from afar are slow
            image = turn, np.arange(len(points))
            near = beyond[image] < found
            signed = vtkDoubleArray()
            self._measure.FunctionValue(numpy_to_vtk(images[image][near]), signed)
            found[near] = np.minimum(found[near], np.abs(vtk_to_numpy(signed)))
        return found


def surface_of(case: Case, mesh_file: Path, folder: Path) -> Surface:
    """Heights and sections at all frames, the surface at the last. Raises ``LimoError`` where there are none."""
    model, frames = open_case(case, mesh_file, folder)
    if not len(frames.pressure):
        raise ResultError(f"{frames.file}: no frames")
    mesh, length = model.mesh, case.device.pattern.length
    middle = [model.expansion.midsurface(u.astype(float)) for u in frames.displacement]
    height = np.array([np.abs(u[:, 2]).max() for u in middle]) / length
    sections = tuple(section(mesh.nodes + u, mesh.quads, SECTION * length) for u in middle)
    last = np.round((mesh.nodes + middle[int(np.argmax(frames.pressure))]) / STEP) * STEP
    return Surface(frames.pressure, height, last, mesh.quads, mesh.symmetry, sections)


def sampled(points: np.ndarray, quads: np.ndarray, count: int) -> np.ndarray:
    """Points (count, 3) spread over quadrilaterals in proportion to their area, the same for the same surface.

    ``points`` (n, 3) in mm, ``quads`` (m, 8). Along the order of the elements the points lie at equal steps
    of area; within an element at points of a low-discrepancy sequence.
    """
    place = points[quads]
    local, weights = gauss(2, 2)
    _, slopes = quad8_shape(local)
    tangents = np.einsum("gnd,mnk->mgdk", slopes, place)
    areas = np.linalg.norm(np.cross(tangents[:, :, 0], tangents[:, :, 1]), axis=-1) @ weights
    steps = (np.arange(count) + 0.5) / count * areas.sum()
    element = np.searchsorted(np.cumsum(areas), steps).clip(max=len(quads) - 1)
    # additive recurrence with the plastic number: even in two dimensions for every count
    inside = np.mod(0.5 + np.arange(1, count + 1)[:, None] * np.array([0.7548776662466927, 0.5698402909980532]), 1.0)
    values, _ = quad8_shape(2.0 * inside - 1.0)
    return np.einsum("pn,pnk->pk", values, place[element])


def section(points: np.ndarray, quads: np.ndarray, y: float) -> np.ndarray:
    """Segments (k, 2, 2), x and z in mm of both ends, in which the plane at ``y`` (mm) cuts quadrilaterals.

    ``points`` (n, 3) in mm, ``quads`` (m, 8). Elements are divided and cut as flat triangles.
    """
    values, _, cells = grid(_CUT)
    place = np.einsum("gn,mnk->mgk", values, points[quads])
    triangles = place[:, cells][:, :, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3, 3)
    above = triangles[:, :, 1] > y
    crossed = above.any(axis=1) & ~above.all(axis=1)
    triangles, above = triangles[crossed], above[crossed]
    single = np.argmax(above == (above.sum(axis=1) == 1)[:, None], axis=1)  # the corner that has its side to itself
    rows = np.arange(len(triangles))[:, None]
    tip, others = triangles[rows, single[:, None]], triangles[rows, (single[:, None] + [1, 2]) % 3]
    share = (y - tip[..., 1]) / (others[..., 1] - tip[..., 1])
    return (tip + share[..., None] * (others - tip))[..., [0, 2]]


# --------------------------------------------------------------------------------------------------------------------
# the runs of a device


@dataclass(frozen=True)
class Run:
    """One run: study's part, variant, branch, its values in the study's dataset, and its surface where there is one.

    ``equations``: displacements of the part that was solved, and of the full device; ``times``: CPU seconds of the solver, each
    time the case was solved.
    """

    part: str
    variant: str
    description: str
    branch: int
    case: Case
    values: xr.Dataset
    surface: Surface | None
    equations: tuple[float, float] = (np.nan, np.nan)
    times: tuple[float, ...] = ()

    @property
    def converged(self) -> bool:
        return str(self.values.case_status.values) == "converged"


def devices(loaded: Loaded) -> list[str]:
    """Names of the devices for which there is a reference, as in ``reference_<device>``."""
    return [name.partition("_")[2] for name in loaded.studies if name.startswith("reference_")]


def error_studies(loaded: Loaded) -> list[str]:
    """Studies of all devices from which errors are gathered."""
    names = (f"{part}_{device}" for device in devices(loaded) for part in PARTS)
    return [name for name in names if name in loaded.studies]


def runs_of(loaded: Loaded, device: str, results: Path, kept: Path, sources: Mapping[str, Sequence[str]]) -> list[Run]:
    """The runs of a device: those of ``KEPT_PARTS`` that are kept in the folder ``kept``, the others as they were gathered.

    Cases that are not solved are left out. ``sources``: by study the ids of the cases that serve it, in the order of its grid.
    """
    runs = []
    for part in PARTS:
        name = f"{part}_{device}"
        if name not in sources:
            continue
        if part in KEPT_PARTS:
            runs += read_runs(loaded, name, kept_file(kept, name))
        elif any((results / "cases" / source / "status.json").exists() for source in sources[name]):
            dataset = gather_study(loaded, name, results / "cases", sources[name])
            runs += _runs_in(loaded, name, dataset, results, sources[name])
    return runs


def _runs_in(loaded: Loaded, name: str, dataset: xr.Dataset, results: Path, sources: Sequence[str]) -> list[Run]:
    """The runs of a study's dataset that were solved."""
    runs = []
    for (key, case), source in zip(study_cases(loaded, name).items(), sources, strict=True):
        variant, branch = key[-2:]
        at = {d: v for d, v in (("variant", variant), ("branch", branch)) if d in dataset.dims}
        values = dataset.sel(at).squeeze(drop=True)
        if str(values.case_status.values) != "missing":
            timed = results / "times" / f"{source}.json"
            times = read_json(timed)["cpu_seconds"] if timed.exists() else [float(values.solver_time)]
            runs.append(Run(*_named(loaded, name, variant), branch, case, values, *_shape(results, source), tuple(times)))
    return runs


def _named(loaded: Loaded, name: str, variant: str) -> tuple[str, str, str]:
    """What a study is for, a variant of it, and that in words."""
    return name.partition("_")[0], variant, loaded.studies[name].variants[variant].description if variant else ""


def _shape(results: Path, case_id: str) -> tuple[Surface | None, tuple[float, float]]:
    """Surface and numbers of displacements of a solved case; none for shells, which keep no displacements."""
    folder = results / "cases" / case_id
    stored = Case.from_dict(read_json(folder / "case.json")["case"])
    file = results / "meshes" / f"{stored.mesh_id}.vtu"
    solved, own = solved_on(stored, file, folder)
    mesh = read_mesh(own, solved.mesh.symmetry)
    part = degrees_of_freedom_of(mesh)
    try:
        return surface_of(stored, file, folder), (part, part * mesh.copies)
    except LimoError:
        return None, (part, part * mesh.copies)


# --------------------------------------------------------------------------------------------------------------------
# runs that are kept

#: what is kept of a run's values in its study's dataset; texts, and numbers as they are
_TEXTS = ("case_id", "case_status", "case_reason", "solver_build", "machine")
_NUMBERS = (
    "ventricle_volume",
    "actuation_volume_change",
    "stroke_volume",
    "pressure_90ml",
    "efficiency_90ml",
    "von_mises_peak",
    "fatigue_cycles_min",
    "dissipated_fraction",
    "solver_time",
    "iterations",
    "solver_memory",
)
#: what a kept file holds besides: units, meaning
_SHAPES = {
    "solved_degrees_of_freedom": ("1", "displacements of the written-out bricks of the part that was solved"),
    "degrees_of_freedom": ("1", "displacements of the written-out bricks, full device"),
    "picture_pressure": ("kPa", "actuation pressure of a picture, P_a"),
    "picture_height": ("1", "largest w / L in a picture"),
    "points": ("mm", "nodes of the middle surface of the part that was solved, at P_a,max"),
    "quads": ("1", "points of an element, corners first; -1 behind the last element"),
    "mesh": ("1", "which of the meshes a run has"),
    "sections": ("mm", f"x and z of cuts through the part that was solved at y/L = {SECTION:g}"),
}


def kept_file(folder: Path, study: str) -> Path:
    """Where the runs of a study are kept."""
    return folder / f"{study}_runs.nc"


def kept_name(case: Case) -> str:
    """The name under which a run is kept: that of its case, whichever build of the engine solved it."""
    return replace(case, build="").case_id


def lacking(loaded: Loaded, name: str, folder: Path) -> list[bool]:
    """Of each case of a study, in the order of its grid, whether its run is not kept in ``folder``.

    Another mesh or other numerics are another case; another build of the engine is not.
    """
    there = set(_names_in(kept_file(folder, name)))
    return [kept_name(case) not in there for case in study_cases(loaded, name).values()]


def _names_in(file: Path) -> list[str]:
    if not file.exists():
        return []
    with _opened(file) as dataset:
        return [*map(str, dataset.kept_name.values)]


def keep_runs(loaded: Loaded, name: str, results: Path, folder: Path, sources: Sequence[str]) -> list[str]:
    """Add the runs of a study that are solved to those that are kept of it; runs that it no longer has are dropped.

    A run that is kept is not replaced: whoever wants it anew deletes the file. ``sources`` as in ``runs_of``. Returns the names
    of those that are kept now. Raises ``ResultError`` where nothing is solved.
    """
    file = kept_file(folder, name)
    runs = {kept_name(run.case): run for run in read_runs(loaded, name, file)}
    if any(lacking(loaded, name, folder)):
        machine = xr.DataArray(processor(), attrs={"long_name": "processor of the machine that solved the case"})
        dataset = gather_study(loaded, name, results / "cases", sources).assign(machine=machine)
        runs = {kept_name(run.case): run for run in _runs_in(loaded, name, dataset, results, sources)} | runs
    if not runs:
        raise ResultError(f"{results}: no case of {name} is solved; snakemake --cores 2 results/kept/{name}.txt does that")
    names = [key for key in map(kept_name, study_cases(loaded, name).values()) if key in runs]
    if names != _names_in(file):
        write_runs([runs[key] for key in names], file)
    return names


def write_runs(runs: Sequence[Run], file: Path) -> None:
    """Write runs: curves and values of their study, coordinates of shapes in steps of ``STEP``."""
    texts = {n: ("run", np.array([str(r.values[n].values) for r in runs])) for n in _TEXTS}
    parts = [r.values[[n for n in _NUMBERS if n in r.values]].reset_coords(drop=True) for r in runs]
    surfaces = [run.surface for run in runs]
    shapes = {
        "solved_degrees_of_freedom": ("run", [run.equations[0] for run in runs]),
        "degrees_of_freedom": ("run", [run.equations[1] for run in runs]),
        "picture_pressure": (("run", "picture"), padded([np.empty(0) if s is None else s.pressure for s in surfaces])),
        "picture_height": (("run", "picture"), padded([np.empty(0) if s is None else s.height for s in surfaces])),
        "points": (("run", "point", "axis"), _filled([np.empty((0, 3)) if s is None else s.points for s in surfaces], np.nan)),
    }
    quads, mesh = np.unique(
        _filled([np.empty((0, 8), int) if s is None else s.quads for s in surfaces], -1), axis=0, return_inverse=True
    )
    shapes |= {"quads": (("mesh_number", "quad", "corner"), quads), "mesh": ("run", mesh)}
    pictures = shapes["picture_pressure"][1].shape[1]
    cuts = stacked([() if s is None else s.sections for s in surfaces], pictures)
    shapes["sections"] = (("run", "picture", "segment", "end", "plane"), cuts)
    names = {"kept_name": ("run", [kept_name(run.case) for run in runs])}
    dataset = xr.concat(parts, "run").assign(names | texts | shapes)
    for name, (units, long_name) in _SHAPES.items():
        dataset[name].attrs = {"units": units, "long_name": long_name}
    for name in _TEXTS:
        dataset[name].attrs = runs[0].values[name].attrs
    dataset["kept_name"].attrs = {"long_name": "name of the case, whichever build solved it"}
    title = f"{runs[0].part}: runs that are kept because they take hours"
    write_netcdf(dataset.assign_attrs(title=title), file, packed(dataset), checked=False)


def read_runs(loaded: Loaded, name: str, file: Path) -> list[Run]:
    """The kept runs of a study that it still has, in the order of its grid; none without a file. Raises ``ResultError``."""
    if not file.exists():
        return []
    with _opened(file) as opened:
        dataset = opened.load()
    try:
        rows = {str(key): row for row, key in enumerate(dataset.kept_name.values)}
        return [
            _kept_run(_named(loaded, name, key[-2]), key[-1], case, dataset.isel(run=rows[kept_name(case)]))
            for key, case in study_cases(loaded, name).items()
            if kept_name(case) in rows
        ]
    except UNREADABLE as error:
        raise ResultError(f"{file}: not the runs of a study ({error}); without the file they are solved anew") from None


def _kept_run(named: tuple[str, str, str], branch: int, case: Case, row: xr.Dataset) -> Run:
    known = np.isfinite(row.picture_pressure.values)
    cuts = [cut[np.isfinite(cut).all(axis=(1, 2))] for cut in row.sections.values[known]]
    points, quads = row.points.values, row.quads.values[int(row.mesh)]
    surface = Surface(
        row.picture_pressure.values[known],
        row.picture_height.values[known],
        points[np.isfinite(points).all(axis=1)].astype(float),
        quads[quads[:, 0] >= 0],
        case.mesh.symmetry,
        tuple(cuts),
    )
    equations = float(row.solved_degrees_of_freedom), float(row.degrees_of_freedom)
    return Run(
        *named,
        branch,
        case,
        row.drop_vars(["kept_name", *_SHAPES]),
        surface if known.any() else None,
        equations,
        (float(row.solver_time),),
    )


def _opened(file: Path) -> xr.Dataset:
    try:
        return xr.open_dataset(file)
    except UNREADABLE as error:
        raise ResultError(f"{file}: not the runs of a study ({error}); without the file they are solved anew") from None


def packed(dataset: xr.Dataset) -> dict[str, dict]:
    """How variables are stored: compressed, in single precision, coordinates of shapes in steps of ``STEP``."""
    stored = {}
    for name, variable in dataset.variables.items():
        if name in ("points", "sections"):
            stored[name] = {"dtype": "int16", "scale_factor": STEP, "_FillValue": -32768, "zlib": True, "complevel": 9}
        elif name == "quads":
            stored[name] = {"dtype": "int32", "zlib": True, "complevel": 9}
        elif variable.dtype.kind == "f":
            squeezed = {"zlib": True, "complevel": 9} if variable.size > 1000 else {}
            stored[name] = {"dtype": "float32", "_FillValue": np.float32(np.nan)} | squeezed
    return stored


def padded(arrays: Sequence[np.ndarray]) -> np.ndarray:
    """Arrays (n,) of different lengths as rows, NaN behind their ends."""
    table = np.full((len(arrays), max([len(a) for a in arrays], default=0)), np.nan)
    for row, array in zip(table, arrays, strict=True):
        row[: len(array)] = array
    return table


def _filled(arrays: Sequence[np.ndarray], fill: float) -> np.ndarray:
    """Arrays (n, k) of different lengths as one (a, n, k), ``fill`` behind their ends."""
    longest = max(map(len, arrays))
    return np.array([np.pad(a, ((0, longest - len(a)), (0, 0)), constant_values=fill) for a in arrays])


def stacked(sections: Sequence[tuple[np.ndarray, ...]], frames: int) -> np.ndarray:
    """Segments (s, frames, k, 2, 2) of runs, NaN behind the last of each frame."""
    longest = max([len(part) for parts in sections for part in parts], default=0)
    table = np.full((len(sections), frames, longest, 2, 2), np.nan)
    for row, parts in zip(table, sections, strict=True):
        for place, part in zip(row, parts, strict=False):
            place[: len(part)] = part
    return table
