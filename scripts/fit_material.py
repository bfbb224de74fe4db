"""Fit the modulus of the fabric to a tensile test, write its table and draw it (rule fit_material)."""

from pathlib import Path

from limo.bench.tensile import fit_tensile, report, specimen_table, tensile_dataset
from limo.config.load import load_config
from limo.door import logged
from limo.figures import style
from limo.figures.tensile_test import draw
from limo.store.files import write_netcdf, write_whole

with logged(snakemake.log[0]) as log:  # noqa: F821
    fit = fit_tensile(load_config(snakemake.config["file"]).config.tensile_test)  # noqa: F821
    for line in filter(None, report(fit).splitlines()):
        log.info("%s", line)
    dataset = tensile_dataset(fit)
    write_netcdf(dataset, Path(snakemake.output.dataset), checked=False)  # noqa: F821
    write_whole(Path(snakemake.output.table), lambda path: specimen_table(fit).to_csv(path, index=False, float_format="%.6g"))  # noqa: F821
    figure = draw(dataset)
    for output in (snakemake.output.png, snakemake.output.pdf):  # noqa: F821
        write_whole(Path(output), lambda path: style.save(figure, path))
    style.close(figure)
