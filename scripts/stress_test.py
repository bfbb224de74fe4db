"""Gather the cases of the stress test (rule stress_test)."""

from pathlib import Path

from limo.door import logged
from limo.reliability.stress_test import gather_stress_test, write_rows

with logged(snakemake.log[0]) as log:  # noqa: F821
    rows = gather_stress_test(snakemake.params.cases, Path("results"))  # noqa: F821
    write_rows(rows, Path(snakemake.output[0]))  # noqa: F821
    log.info("%d cases", len(rows))
