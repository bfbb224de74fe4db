"""From the studies in config/ to datasets and figures: mesh -> solve -> gather -> draw."""

import sys

from snakemake.exceptions import WorkflowError

sys.path.insert(0, str(Path(workflow.basedir) / "scripts"))

from limo.case import (
    FIELD_CODE,
    GATHER_CODE,
    MEASURE_CODE,
    MESH_CODE,
    SOLVE_CODE,
    all_cases,
    code_digest,
    study_cases,
    wanted_cases,
)
from limo.config import load_config
from limo.engines.calculix import find_ccx
from limo.errors import LimoError

CONFIG_FILE = config.get("file", "config/config.yaml")
try:
    LOADED = load_config(CONFIG_FILE)
    CCX = find_ccx(LOADED.config.solver, CONFIG_FILE)
except LimoError as error:
    raise WorkflowError(str(error)) from None

CASES = all_cases(LOADED)
WANTED = wanted_cases(LOADED)
MESHES = {case.mesh_id: case for case in CASES.values()}
LONG_CASES = "|".join(re.escape(name) for name, case in CASES.items() if case.n_pouches <= 8) or "none"
STUDIES = {name: study_cases(LOADED, name) for name in LOADED.studies}


include: "workflow/rules/common.smk"


wildcard_constraints:
    case="|".join(map(re.escape, CASES)),
    mesh="|".join(map(re.escape, MESHES)),
    study="|".join(STUDIES),
    figure=r"[a-z_]+",
    kind="png|pdf",


include: "workflow/rules/mesh.smk"
include: "workflow/rules/solve.smk"
include: "workflow/rules/measure.smk"
include: "workflow/rules/aggregate.smk"
include: "workflow/rules/figures.smk"


for name in STUDIES:

    rule:
        name:
            name
        input:
            study_targets(name),
        message:
            f"Study {name}"


rule all:
    default_target: True
    input:
        [study_targets(name) for name in LOADED.config.studies],
