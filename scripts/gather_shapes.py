"""Gather the surfaces that a study's figures draw (rule gather_shapes)."""

from pathlib import Path

from limo.config.load import load_config
from limo.datasets.shapes import gather_shapes, write_shapes
from limo.door import logged

with logged(snakemake.log[0]):  # noqa: F821
    loaded = load_config(snakemake.config["file"])  # noqa: F821
    study, sources = snakemake.wildcards.study, snakemake.params.sources  # noqa: F821
    shapes = gather_shapes(loaded, study, Path("results/cases"), Path("results/meshes"), sources)
    write_shapes(shapes, Path(snakemake.output[0]))  # noqa: F821
