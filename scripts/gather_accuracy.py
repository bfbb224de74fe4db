"""Gather the errors and costs of the settings of all devices (rule gather_accuracy)."""

import shutil
from pathlib import Path

from limo.accuracy.table import gather_errors, write_errors
from limo.config.load import load_config
from limo.door import logged

with logged(snakemake.log[0]):  # noqa: F821
    loaded = load_config(snakemake.config["file"])  # noqa: F821
    file, kept = map(Path, snakemake.output)  # noqa: F821
    write_errors(gather_errors(loaded, Path("results"), kept.parent, snakemake.params.sources), file)  # noqa: F821
    shutil.copyfile(file, kept)
