"""Gather the runs of one airbag into a dataset (rule gather_airbag)."""

from pathlib import Path

import xarray as xr

from limo.airbag.solve import gather
from limo.config.load import load_config
from limo.door import logged
from limo.store.files import write_netcdf

with logged(snakemake.log[0]):  # noqa: F821
    name = snakemake.wildcards.airbag  # noqa: F821
    airbag = load_config(snakemake.config["file"]).airbags[name]  # noqa: F821
    dataset = gather(airbag, name, [xr.load_dataset(file) for file in snakemake.input])  # noqa: F821
    write_netcdf(dataset, Path(snakemake.output[0]), checked=False)  # noqa: F821
