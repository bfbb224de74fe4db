"""Test the statements of the paper on the gathered studies (rule check_paper)."""

from pathlib import Path

from limo.door import logged
from limo.reports.paper_check import write_check

with logged(snakemake.log[0]) as log:  # noqa: F821
    table, page = (Path(o) for o in snakemake.output)  # noqa: F821
    log.info("%s", write_check(Path(snakemake.input[0]).parents[1], table, page))  # noqa: F821
