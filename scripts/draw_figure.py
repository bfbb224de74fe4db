"""Draw one figure of a study from its dataset and its shapes, in every format (rule draw_figure)."""

from importlib import import_module
from pathlib import Path

import xarray as xr

from limo.config.load import load_config
from limo.door import logged
from limo.figures import style
from limo.store.files import write_whole

with logged(snakemake.log[0]):  # noqa: F821
    module = import_module(f"limo.figures.{snakemake.wildcards.figure}")  # noqa: F821
    measured = None
    if snakemake.input.measured:  # noqa: F821
        # by name: what reads them decides figures of studies with measured curves alone (measured_content in common.smk)
        read = import_module("limo.bench.compare").study_curves
        measured = read(load_config(snakemake.config["file"]), snakemake.wildcards.study).table  # noqa: F821
    files = [snakemake.input.dataset, *([snakemake.input.shapes] if snakemake.input.shapes else [])]  # noqa: F821
    datasets = [xr.load_dataset(file) for file in files]
    shown, note = style.shown_cases(datasets[0])
    figure = module.draw(shown, measured, *datasets[1:])
    style.note_above(figure, note)
    for output in snakemake.output:  # noqa: F821
        write_whole(Path(output), lambda path: style.save(figure, path))
    style.close(figure)
