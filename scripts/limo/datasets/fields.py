"""Fields for ParaView and pyvista: the layers as 8-node quadrilaterals, flat and deformed, mirrored to the full device.

One VTU a frame and two series (.pvd) over P_a: ``reference`` on the flat pattern, where all layers lie in one plane (choose
them with a threshold on ``layer``), and ``deformed``. Fields are named by the surface of the layer they belong to: the
inner one faces the ventricle. Where layers are sealed together each has its own points, so nothing is averaged over a seam.
meshio writes the VTU. The PVD is written here: meshio and VTK have no writer of it, pyvista has a reader only.
"""

from __future__ import annotations

import os
import shutil
from dataclasses import dataclass
from pathlib import Path

import meshio
import numpy as np

from limo.cases.case import Case
from limo.cases.wanted import Wanted
from limo.errors import LimoError
from limo.measure.fatigue import cycles_to_failure, largest_amplitude
from limo.measure.frames import CaseFrames, open_case
from limo.measure.strain import DEVICE_SIDES, Streamline, membrane_principal, streamlines
from limo.measure.zones import distances
from limo.mechanics.constitutive import principal
from limo.mechanics.layer import SIDES, inside_out, nodal, surface_state
from limo.mechanics.model import Model
from limo.mesh.elements import QUAD8_MIRROR
from limo.mesh.layers import DeviceMesh
from limo.schema.fatigue import Fatigue

VECTORS = ("displacement", "v1_")  # fields (names or beginnings) that change sign in a mirror


@dataclass(frozen=True)
class Fields:
    """A surface with its fields: ``points`` (p, 3) mm, ``quads`` (m, 8), values at points (p, ...) and at cells (m,)."""

    points: np.ndarray
    quads: np.ndarray
    at_points: dict[str, np.ndarray]
    at_cells: dict[str, np.ndarray]


def mirrored(fields: Fields, symmetry: str) -> Fields:
    """The full device: copies mirrored in x = 0 (quarter) and z = 0 (quarter, front_back); vectors are mirrored too.

    Cells get ``face`` 0 on the front and 1 on the back and ``copy``, 0 in the part that was solved.
    """
    parts = [(fields, 0)]
    if symmetry == "quarter":
        parts.append((_mirror(fields, 0), 1))
    if symmetry != "full":
        parts += [(_mirror(part, 2), copy + len(parts)) for part, copy in parts]
    starts = np.cumsum([0, *(len(part.points) for part, _ in parts)])
    cells = {n: np.concatenate([part.at_cells[n] for part, _ in parts]) for n in fields.at_cells}
    cells["copy"] = np.concatenate([np.full(len(part.quads), copy, np.int8) for part, copy in parts])
    return Fields(
        np.vstack([part.points for part, _ in parts]),
        np.vstack([part.quads + start for (part, _), start in zip(parts, starts, strict=False)]),
        {n: np.concatenate([part.at_points[n] for part, _ in parts]) for n in fields.at_points},
        cells,
    )


def _mirror(fields: Fields, axis: int) -> Fields:
    """The mirror image in x = 0 or z = 0; normals stay along +z in the flat state, as everywhere."""
    sign = np.ones(3)
    sign[axis] = -1.0
    points = {n: v * sign if n.startswith(VECTORS) else v for n, v in fields.at_points.items()}
    quads = fields.quads[:, QUAD8_MIRROR] if axis == 0 else fields.quads
    cells = dict(fields.at_cells)
    if axis == 2:
        cells["face"] = 1 - cells["face"]
    return Fields(fields.points * sign, quads, points, cells)


def frame_fields(
    model: Model,
    displacements: np.ndarray,
    drawn: tuple[str, ...],
    amplitude: np.ndarray | None,
    fatigue: Fatigue,
    source: object,
) -> tuple[Fields, Fields]:
    """Fields of one frame on the flat and on the deformed middle surface of the model's part.

    ``displacements`` (n, 3) in mm; ``amplitude`` (m, 4) for fatigue. Directions v_1 are those of the flat state on the flat
    pattern, and carried along by F on the deformed one.
    """
    mesh = model.mesh
    state = surface_state(model, displacements, source)
    strain = inside_out(mesh, state.strain)
    _, node, quads = nodal(mesh, strain[:, 1, :, 0, 0])
    u = model.expansion.midsurface(displacements[: len(model.expansion.nodes)])[node]
    values: dict[str, np.ndarray] = {"displacement": u}
    carried: dict[str, np.ndarray] = {}
    if "stress" in drawn:
        stress = inside_out(mesh, state.von_mises)
        values["von_mises"] = nodal(mesh, stress.max(axis=1))[0]
        values |= {f"von_mises_{side}": nodal(mesh, stress[:, k])[0] for k, side in enumerate(SIDES)}
    if "strain" in drawn:
        flat_strain, carried = _strain_fields(mesh, strain, inside_out(mesh, state.deformation))
        values |= flat_strain
    if "fatigue" in drawn and amplitude is not None:
        values |= _fatigue_fields(mesh, amplitude, node, fatigue)
    cells = {n: getattr(mesh, n).astype(np.int8) for n in ("layer", "face", "pouch")}
    flat = mesh.nodes[node]
    return Fields(flat, quads, values, cells), Fields(flat + u, quads, values | carried, cells)


def _strain_fields(mesh: DeviceMesh, strain: np.ndarray, gradient: np.ndarray) -> tuple[dict, dict]:
    """Principal strains at points of each side with v_1 of the flat state, and v_1 carried along by F (``gradient``)."""
    values, carried = {}, {}
    for k, side in enumerate(SIDES):
        largest, direction = principal(nodal(mesh, strain[:, k])[0])
        values |= {f"E{i + 1}_{side}": largest[:, i] for i in range(3)}
        values[f"v1_{side}"] = direction[:, 0]
        pushed = np.einsum("pij,pj->pi", nodal(mesh, gradient[:, k])[0], direction[:, 0])
        carried[f"v1_{side}"] = pushed / np.linalg.norm(pushed, axis=1, keepdims=True)
    return values, carried


def _fatigue_fields(mesh: DeviceMesh, amplitude: np.ndarray, node: np.ndarray, fatigue: Fatigue) -> dict[str, np.ndarray]:
    """Strain amplitudes, cycles to failure and distances from seams (mm) at points, whose nodes of the mesh are ``node``."""
    values = {"fatigue_amplitude": nodal(mesh, amplitude)[0]}
    cycles, flags = cycles_to_failure(values["fatigue_amplitude"], fatigue)
    away = distances(mesh, mesh.nodes)
    nearest = np.minimum(away["seam"], away["outer_edge"])[node]
    near = (nearest <= fatigue.seam_distance.value).astype(np.int8)
    return values | {"log10_cycles": np.log10(cycles), "fatigue_flag": flags, "seam_distance": nearest, "near_seam": near}


def write_vtu(fields: Fields, path: Path) -> None:
    """Write a surface as VTU, floating-point fields in single precision."""

    def single(values: np.ndarray) -> np.ndarray:
        return values.astype(np.float32) if values.dtype.kind == "f" else values

    points = {n: single(v) for n, v in fields.at_points.items()}
    cells = {n: [single(v)] for n, v in fields.at_cells.items()}
    data = meshio.Mesh(single(fields.points), [("quad8", fields.quads)], point_data=points, cell_data=cells)
    meshio.write(path, data, file_format="vtu", binary=True)


def write_lines(lines: list[Streamline], deformed: bool, symmetry: str, path: Path) -> None:
    """Write streamlines as VTU lines with ``E1``, mirrored to the full device."""
    points, cells, strain, start = [], [], [], 0
    for line in lines:
        place = line.deformed if deformed else np.column_stack([line.flat, np.zeros(len(line.flat))])
        points.append(place)
        strain.append(line.strain)
        cells.append(start + np.column_stack([np.arange(len(place) - 1), np.arange(1, len(place))]))
        start += len(place)
    if not points:
        points, cells, strain = [np.zeros((1, 3))], [np.zeros((1, 2), int)], [np.zeros(1)]
    where, segments, value = np.vstack(points), np.vstack(cells), np.concatenate(strain)
    signs = {"quarter": [(1, 1), (-1, 1), (1, -1), (-1, -1)], "front_back": [(1, 1), (1, -1)], "full": [(1, 1)]}[symmetry]
    copies = np.vstack([where * [sx, 1, sz] for sx, sz in signs])
    joined = np.vstack([segments + k * len(where) for k in range(len(signs))])
    data = meshio.Mesh(
        copies.astype(np.float32), [("line", joined)], point_data={"E1": np.tile(value, len(signs)).astype(np.float32)}
    )
    meshio.write(path, data, file_format="vtu", binary=True)


def write_pvd(path: Path, files: list[tuple[float, str]]) -> None:
    """A ParaView collection: (P_a in kPa as the time, file name beside it) for every frame."""
    rows = "".join(f'    <DataSet timestep="{pressure:g}" group="" part="0" file="{file}"/>\n' for pressure, file in files)
    head = '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1" byte_order="LittleEndian">\n'
    path.write_text(f"{head}  <Collection>\n{rows}  </Collection>\n</VTKFile>\n", encoding="ascii")


def write_fields(case: Case, wanted: Wanted, fatigue: Fatigue, mesh_file: Path, folder: Path) -> int:
    """Write the fields of a case into ``folder`` and return the number of files.

    A case that cannot be measured leaves ``reason.txt`` there instead. The folder appears as a whole.
    """
    aside = folder.with_name(f".{os.getpid()}.{folder.name}")
    aside.mkdir(parents=True)
    try:
        try:
            model, frames = open_case(case, mesh_file, folder.parent)
            _write_all(model, frames, wanted, fatigue, aside)
        except LimoError as error:
            (aside / "reason.txt").write_text(f"{error}\n", encoding="utf-8")
        shutil.rmtree(folder, ignore_errors=True)
        aside.replace(folder)
    finally:
        shutil.rmtree(aside, ignore_errors=True)
    return len(list(folder.iterdir()))


def _write_all(model: Model, frames: CaseFrames, wanted: Wanted, fatigue: Fatigue, folder: Path) -> None:
    amplitude = _amplitude(model, frames, wanted) if "fatigue" in wanted.drawn else None
    series: dict[str, list[tuple[float, str]]] = {}

    def add(name: str, pressure: float) -> Path:
        file = f"{name}_{len(series.setdefault(name, [])):02d}.vtu"
        series[name].append((pressure, file))
        return folder / file

    for requested in wanted.pressures.get("fields", ()):
        frame = frames.find(requested)
        if frame is None:
            continue
        pressure, u = float(frames.pressure[frame]), frames.displacement[frame].astype(float)
        source = f"{frames.file}, frame at {pressure:g} kPa"
        flat, deformed = frame_fields(model, u, wanted.drawn, amplitude, fatigue, source)
        write_vtu(mirrored(flat, model.mesh.symmetry), add("reference", pressure))
        write_vtu(mirrored(deformed, model.mesh.symmetry), add("deformed", pressure))
        if "strain" not in wanted.drawn:
            continue
        strain = inside_out(model.mesh, surface_state(model, u, source).strain)
        points = model.middle(u)
        for side in DEVICE_SIDES:
            lines = [s for face in np.unique(model.mesh.face) for s in streamlines(model.mesh, strain, points, side, int(face))]
            for geometry in ("reference", "deformed"):
                name = f"streamlines_{side}_{geometry}"
                write_lines(lines, geometry == "deformed", model.mesh.symmetry, add(name, pressure))
    for name, files in series.items():
        write_pvd(folder / f"{name}.pvd", files)


def _amplitude(model: Model, frames: CaseFrames, wanted: Wanted) -> np.ndarray | None:
    """Largest principal membrane strain (m, 4) over the frames that fatigue asks for."""
    strains = []
    for requested in wanted.pressures["fatigue"]:
        if (frame := frames.find(requested)) is not None:
            state = surface_state(model, frames.displacement[frame].astype(float), frames.file)
            strains.append(membrane_principal(inside_out(model.mesh, state.strain)[:, 1]))
    return largest_amplitude(np.array(strains)) if strains else None
