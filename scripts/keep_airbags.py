"""Keep the measured rows of all airbags with the documentation (rule keep_airbags)."""

from pathlib import Path

from limo.door import logged
from limo.reports.accuracy_airbag import keep_airbags

with logged(snakemake.log[0]):  # noqa: F821
    keep_airbags([Path(file) for file in snakemake.input], Path(snakemake.output[0]))  # noqa: F821
