"""Mesh one device (rule mesh_device)."""

from pathlib import Path

from limo.door import logged
from limo.files import write_whole
from limo.mesh import degrees_of_freedom_of, mesh_device, write_mesh

with logged(snakemake.log[0]) as log:  # noqa: F821
    mesh = mesh_device(snakemake.params.content)  # noqa: F821
    log.info("%d quadrilaterals, %d degrees of freedom", len(mesh.quads), degrees_of_freedom_of(mesh))
    write_whole(Path(snakemake.output[0]), lambda path: write_mesh(mesh, path))  # noqa: F821
