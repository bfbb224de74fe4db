"""Tell what came of the designs of a round of an exploration (rule tell_designs)."""

from pathlib import Path

from limo.config.load import load_config
from limo.door import logged
from limo.explore.rounds import explored, read_exploration, write_round
from limo.explore.steps import tell_round
from limo.store.results import Results

with logged(snakemake.log[0]) as log:  # noqa: F821
    config_file = Path(snakemake.config["file"])  # noqa: F821
    project, name = load_config(config_file).with_builds(snakemake.params.builds), snakemake.wildcards.exploration  # noqa: F821
    exploration, results = read_exploration(project, config_file, name), Results(Path("results"))
    designs = explored(project, {name: exploration}, results)
    sources = snakemake.params.sources  # noqa: F821
    told = tell_round(designs, name, exploration, int(snakemake.wildcards.round), results, sources)  # noqa: F821
    write_round(Path(snakemake.output[0]), told)  # noqa: F821
    log.info("%s", {design: each["status"] for design, each in told["told"].items()})
