"""Meshes as VTU files."""

from __future__ import annotations

from pathlib import Path

import meshio
import numpy as np

from limo.errors import ResultError
from limo.mesh.layers import DeviceMesh

_MASKS = ("on_valve", "on_outer", "on_seam", "on_axis")


def write_mesh(mesh: DeviceMesh, path: Path) -> None:
    """Keep a mesh as VTU: quadrilaterals of 8 nodes, ``layer``/``face``/``pouch`` as cell data, masks as point data."""
    cells = {"layer": [mesh.layer], "face": [mesh.face], "pouch": [mesh.pouch]}
    cells |= {f"surface_{n}": [np.isin(np.arange(len(mesh.quads)), i).astype(np.int8)] for n, i in mesh.surfaces.items()}
    points = {k: getattr(mesh, k).astype(np.int8) for k in _MASKS}
    data = meshio.Mesh(mesh.nodes, [("quad8", mesh.quads)], point_data=points, cell_data=cells)
    meshio.write(path, data, file_format="vtu", binary=True)


def read_mesh(path: Path, symmetry: str) -> DeviceMesh:
    """Read what ``write_mesh`` wrote. Raises ``ResultError`` for anything else."""
    try:
        data = meshio.read(path)
        if [b.type for b in data.cells] != ["quad8"]:
            raise ResultError(f"{path}: not a device mesh (cells: {', '.join(b.type for b in data.cells)})")
        block, cells = data.cells[0], {k: v[0] for k, v in data.cell_data.items()}
        masks = {k: data.point_data[k].astype(bool) for k in _MASKS}
        return DeviceMesh(
            data.points, block.data.astype(np.int64), cells["layer"], cells["face"], cells["pouch"], symmetry=symmetry, **masks
        )
    except ResultError:
        raise
    except (Exception, SystemExit) as error:  # meshio leaves through sys.exit on some damage
        raise ResultError(f"{path}: not a device mesh ({error})") from error
