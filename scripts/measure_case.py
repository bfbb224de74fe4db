"""Measure one solved case (rule measure_case). A case that cannot be measured says so and lets the sweep go on."""

from limo.warm import warm

warm()

from pathlib import Path

from limo.cases.case import Case
from limo.cases.wanted import Wanted
from limo.door import logged
from limo.measure.case import measure_case
from limo.schema.fatigue import Fatigue
from limo.store.files import read_json

with logged(snakemake.log[0]) as log:  # noqa: F821
    case = Case.from_dict(read_json(Path(snakemake.input.case))["case"])  # noqa: F821
    wanted = Wanted.from_dict(snakemake.params.wanted)  # noqa: F821
    fatigue = Fatigue.model_validate(snakemake.params.fatigue)  # noqa: F821
    measured = measure_case(case, wanted, fatigue, Path(snakemake.input.mesh), Path(snakemake.output[0]).parent)  # noqa: F821
    log.info("%s %s", measured.attrs["status"], measured.attrs["reason"])
