"""Write what an exploration found: a dataset, pictures and a page (rule report_exploration)."""

from pathlib import Path

from limo.config.load import load_config
from limo.door import logged
from limo.explore.rounds import read_exploration
from limo.reports.exploration import write_report
from limo.store.results import Results

with logged(snakemake.log[0]) as log:  # noqa: F821
    config_file = Path(snakemake.config["file"])  # noqa: F821
    project, name = load_config(config_file), snakemake.wildcards.exploration  # noqa: F821
    exploration = read_exploration(project, config_file, name)
    log.info("%s", write_report(project, name, exploration, Results(Path("results"))))
