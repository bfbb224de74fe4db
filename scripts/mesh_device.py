"""Mesh one device (rule mesh_device)."""

from limo.warm import warm

warm()

from pathlib import Path

from limo.door import logged
from limo.mesh.device import mesh_device
from limo.mesh.file import write_mesh
from limo.mesh.layers import degrees_of_freedom_of
from limo.store.files import write_whole

with logged(snakemake.log[0]) as log:  # noqa: F821
    mesh = mesh_device(snakemake.params.content)  # noqa: F821
    log.info("%d quadrilaterals, %d degrees of freedom", len(mesh.quads), degrees_of_freedom_of(mesh))
    write_whole(Path(snakemake.output[0]), lambda path: write_mesh(mesh, path))  # noqa: F821
