"""Gather the cases of one study into a dataset (rule gather_study)."""

from pathlib import Path

from limo.config.load import load_config
from limo.datasets.study import gather_study
from limo.door import logged
from limo.store.files import write_netcdf

with logged(snakemake.log[0]):  # noqa: F821
    loaded = load_config(snakemake.config["file"])  # noqa: F821
    study, sources = snakemake.wildcards.study, snakemake.params.sources  # noqa: F821
    dataset = gather_study(loaded, study, Path("results/cases"), sources)
    write_netcdf(dataset, Path(snakemake.output[0]), checked=False)  # noqa: F821
