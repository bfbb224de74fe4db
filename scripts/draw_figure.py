"""Draw one figure of a study from its dataset (rule draw_figure)."""

from importlib import import_module
from pathlib import Path

import xarray as xr

from limo.door import logged
from limo.figures import style
from limo.figures.measured import read_measured
from limo.files import write_whole

with logged(snakemake.log[0]):  # noqa: F821
    module = import_module(f"limo.figures.{snakemake.wildcards.figure}")  # noqa: F821
    measured = read_measured(Path(snakemake.input.measured)) if snakemake.input.measured else None  # noqa: F821
    with xr.open_dataset(snakemake.input.dataset) as dataset:  # noqa: F821
        figure = module.draw(dataset.load(), measured)
    write_whole(Path(snakemake.output[0]), lambda path: style.save(figure, path))  # noqa: F821
