"""Propose the designs of a round of an exploration (rule propose_designs)."""

from pathlib import Path

from limo.config.load import load_config
from limo.door import logged
from limo.explore.rounds import read_exploration, write_round
from limo.explore.steps import propose_round
from limo.store.results import Results

with logged(snakemake.log[0]) as log:  # noqa: F821
    config_file = Path(snakemake.config["file"])  # noqa: F821
    project, name = load_config(config_file), snakemake.wildcards.exploration  # noqa: F821
    exploration, number = read_exploration(project, config_file, name), int(snakemake.wildcards.round)  # noqa: F821
    proposed = propose_round(project, name, exploration, number, Results(Path("results")))
    write_round(Path(snakemake.output[0]), proposed)  # noqa: F821
    log.info("%d designs, expected to add %s", len(proposed["designs"]), proposed["expected"])
