"""Keep the runs of a study that takes hours, so that they are solved once (rule keep_runs)."""

from pathlib import Path

from limo.accuracy.kept_runs import keep_runs
from limo.config.load import load_config
from limo.door import logged

with logged(snakemake.log[0]):  # noqa: F821
    loaded = load_config(snakemake.config["file"])  # noqa: F821
    folder, names = Path(snakemake.output[0]).parent, Path(snakemake.output[1])  # noqa: F821
    kept = keep_runs(loaded, snakemake.wildcards.study, Path("results"), folder, snakemake.params.sources)  # noqa: F821
    names.write_text("".join(f"{name}\n" for name in kept))
