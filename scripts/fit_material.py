"""Fit the modulus of the fabric to a tensile test and draw it (rule fit_material)."""

from pathlib import Path

from limo.config.load import load_config
from limo.door import logged
from limo.figures import style
from limo.figures.tensile_test import draw
from limo.mechanics.tensile_test import tensile_test
from limo.store.files import write_netcdf, write_whole

with logged(snakemake.log[0]):  # noqa: F821
    dataset = tensile_test(load_config(snakemake.config["file"]).config.tensile_test)  # noqa: F821
    write_netcdf(dataset, Path(snakemake.output.dataset), checked=False)  # noqa: F821
    figure = draw(dataset)
    for output in snakemake.output[1:]:  # noqa: F821
        write_whole(Path(output), lambda path: style.save(figure, path))
    style.close(figure)
