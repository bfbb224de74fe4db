"""From the studies in config/ to datasets and figures: mesh -> solve -> gather -> draw; and measured errors (accuracy)."""

import sys

from snakemake.exceptions import WorkflowError
from snakemake.logging import logger

sys.path.insert(0, str(Path(workflow.basedir) / "scripts"))

from limo.airbag import RUN_CODE, run_content, runs_of
from limo.bench import CURVE_CODE, TENSILE_CODE
from limo.case import (
    EXPORT_CODE,
    FIELD_CODE,
    GATHER_CODE,
    MEASURE_CODE,
    MESH_CODE,
    SHAPE_CODE,
    STRESS_TEST_CODE,
    code_digest,
    digest,
    solve_code,
)
from limo.config import ENGINES, load_config
from limo.cost import plan_costs, ranks
from limo.device_runs import KEPT_PARTS, TIMED_PARTS, error_studies, kept_file, lacking
from limo.engines.find import find_builds, find_engines
from limo.errors import ConfigError, LimoError
from limo.figures import AIRBAG_FIGURES, DEVICE_FIGURES, SHAPES, items_of, renderer_lacks
from limo.page import CODE as PAGE_CODE
from limo.page import TEMPLATES, sources
from limo.plan import CROSS_CHECK, make_plan
from limo.progress import enter_sweep
from limo.sampling import stress_cases

CONFIG_FILE = config.get("file", "config/config.yaml")
KEPT_FOLDER = Path("docs/gallery/data")
try:
    for key, value in config.items():
        if key not in ("file", "solving"):  # the second is set below, for scripts
            expected = f"the key file alone: {key} is a line of that file"
            raise ConfigError("snakemake --config", key, value, expected, f"--config file={CONFIG_FILE}")
    LOADED = load_config(CONFIG_FILE)
    CCX = find_engines(LOADED, CONFIG_FILE)
    if workflow.is_main_process and any(study.measured for study in LOADED.studies.values()):
        from limo.bench.check import check_curves

        check_curves(LOADED, LOADED.studies)
except LimoError as error:
    raise WorkflowError(str(error)) from None

SWEEP = enter_sweep(Path("results"), Path(".snakemake/locks")) if workflow.is_main_process else None
STRESS_TEST = {key: case.case_id for key, case in stress_cases(LOADED).items()}
STUDIES = make_plan(LOADED)
PLAN = STUDIES.with_cases(stress_cases(LOADED).values())
COSTS = plan_costs(PLAN)
MESH_IDS = {name: case.mesh_id for name, case in PLAN.cases.items()}
RENDERER_LACKS = renderer_lacks()
if RENDERER_LACKS and workflow.is_main_process:
    logger.warning(f"Figures of surfaces are left out: {RENDERER_LACKS}")
MESHES = {MESH_IDS[name]: case for name, case in PLAN.cases.items()}
# what decides no result, such as paths and limits of time: scripts find it here, where no change re-runs them
config["file"] = CONFIG_FILE
config["solving"] = {
    **{part: getattr(LOADED.config, part).model_dump(mode="json") for part in ("solver", "limits", "recovery")},
    "command": str(CCX or ""),
}


include: "workflow/rules/common.smk"


# short patterns: Snakemake puts them into every path it compares, and a thousand names would take it seconds
wildcard_constraints:
    case=r"[\w.]+",
    mesh=r"\w+",
    study="|".join(LOADED.studies),
    airbag="|".join(LOADED.airbags) or "none",
    run=r"\w+",
    figure=r"[a-z_]+",


include: "workflow/rules/mesh.smk"
include: "workflow/rules/solve.smk"
include: "workflow/rules/measure.smk"
include: "workflow/rules/aggregate.smk"
include: "workflow/rules/figures.smk"
include: "workflow/rules/paper.smk"
include: "workflow/rules/stress_test.smk"
include: "workflow/rules/page.smk"
include: "workflow/rules/accuracy.smk"


for name in LOADED.studies:

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
