"""Write the fields of one case for ParaView (rule write_fields)."""

from pathlib import Path

from limo.cases.case import Case
from limo.cases.wanted import Wanted
from limo.datasets.fields import write_fields
from limo.door import logged
from limo.schema.fatigue import Fatigue
from limo.store.files import read_json

with logged(snakemake.log[0]) as log:  # noqa: F821
    case = Case.from_dict(read_json(Path(snakemake.input.case))["case"])  # noqa: F821
    wanted = Wanted.from_dict(snakemake.params.wanted)  # noqa: F821
    fatigue = Fatigue.model_validate(snakemake.params.fatigue)  # noqa: F821
    written = write_fields(case, wanted, fatigue, Path(snakemake.input.mesh), Path(snakemake.output[0]))  # noqa: F821
    log.info("%d files", written)
