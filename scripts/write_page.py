"""Gather what is there into one page (rule page)."""

from pathlib import Path

from limo.config.load import load_config
from limo.door import logged
from limo.page.write import write_page

with logged(snakemake.log[0]) as log:  # noqa: F821
    loaded = load_config(snakemake.config["file"])  # noqa: F821
    log.info("%s", write_page(Path(snakemake.output[0]).parent, loaded.studies))  # noqa: F821
