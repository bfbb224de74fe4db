"""Write the dataset of one study as a table (rule export_study)."""

from pathlib import Path

import xarray as xr

from limo.datasets.export import write_csv
from limo.door import logged
from limo.store.files import write_whole

with logged(snakemake.log[0]):  # noqa: F821
    dataset = xr.load_dataset(snakemake.input[0])  # noqa: F821
    write_whole(Path(snakemake.output[0]), lambda path: write_csv(dataset, path))  # noqa: F821
