"""From the studies in config/ to datasets and figures: mesh -> solve -> gather -> draw; and measured errors (accuracy)."""

import gc
import shlex
import sys

from snakemake.exceptions import WorkflowError
from snakemake.logging import logger

# what Snakemake and planning make stays: looking it through for garbage every 700 objects took an eighth of a no-op
gc.set_threshold(100_000, 50, 100)
sys.path.insert(0, str(Path(workflow.basedir) / "scripts"))

# nothing here may bring libraries that planning does not need: a test counts them
from limo.accuracy.kept_names import kept_file, lacking
from limo.accuracy.roles import error_studies, is_kept, is_timed
from limo.cases.case import engine_code, solve_code
from limo.cases.cost import plan_costs, ranks
from limo.cases.plan import make_plan
from limo.checkout import check_archive, check_folder, check_results
from limo.cluster.handed import handed
from limo.cluster.requests import Requests
from limo.config.builds import engines_of, with_found_builds
from limo.config.load import load_config
from limo.config.targets import asked_studies
from limo.errors import ConfigError, LimoError
from limo.figures.renderer import renderer_lacks
from limo.page import TEMPLATES, sources
from limo.schema.figures import AIRBAG_FIGURES, DEVICE_FIGURES, SHAPES, items_of
from limo.schema.section import ENGINES
from limo.store.code import code_digest
from limo.store.digest import digest
from limo.store.progress import enter_sweep
from limo.store.results import Results

CONFIG_FILE = config.get("file", "config/config.yaml")
KEPT_FOLDER = Path("docs/gallery/data")
# Snakemake puts this path into command lines as it is, whatever blanks it has; what is quoted already does not exist
if Path(sys.executable).exists():
    sys.executable = shlex.quote(sys.executable)
RESULTS = Results(Path("results"))
EXPLORATIONS = sorted(file.stem for file in Path(CONFIG_FILE).parent.glob("explorations/*.yaml"))
# The studies of the paper; their cases are shared, and each is solved once.
PAPER = [
    "kinematics",
    "pressure_volume",
    "buckling",
    "afterload",
    "stress",
    "fatigue",
    "strain_paths",
    "valve_support",
    "compliance",
    "deformation",
    "symmetry",
]
# a process of one job asks for nothing: what started it has decided
WORDS = sys.argv[1:] if workflow.is_main_process else []
ASKED = asked_studies(WORDS, CONFIG_FILE, RESULTS, {"paper": PAPER}) if workflow.is_main_process else []
try:
    check_folder(workflow.basedir)
    check_results(Path.cwd())
    check_archive(WORDS)
    for key, value in config.items():
        if key not in ("file", "solving"):  # the second is set below, for scripts
            expected = f"the key file alone: {key} is a line of that file"
            raise ConfigError("snakemake --config", key, value, expected, f"--config file={CONFIG_FILE}")
    # errors are gathered from all studies that have a role, and nobody knows that of a broken one
    PROJECT = load_config(CONFIG_FILE, ASKED, strict="accuracy" in WORDS)
    NEEDED = engines_of(PROJECT, ASKED)
    PROJECT, CCX = with_found_builds(PROJECT, CONFIG_FILE, needed=NEEDED)
    asked = [*ASKED, *(PROJECT.config.studies if "all" in ASKED else [])]
    if compared := [name for name in asked if name in PROJECT.studies and PROJECT.studies[name].measured]:
        from limo.bench.check import check_curves

        check_curves(PROJECT, compared)
except LimoError as error:
    raise WorkflowError(str(error)) from None

SWEEP = enter_sweep(RESULTS.root, Path(".snakemake/locks")) if workflow.is_main_process else None
# jobs on a cluster are handed the plan of the process that submitted them
HANDED = None if workflow.is_main_process else handed()
PLAN = HANDED.plan if HANDED else make_plan(PROJECT)
RENDERER_LACKS = renderer_lacks()
if workflow.is_main_process:
    for warning in PROJECT.warnings:
        logger.warning(warning)
    if RENDERER_LACKS:
        logger.warning(f"Figures of surfaces are left out: {RENDERER_LACKS}")
# what decides no result, such as paths and limits of time: scripts find it here, where no change re-runs them
config["file"] = CONFIG_FILE
config["solving"] = {
    **{part: getattr(PROJECT.config, part).model_dump(mode="json") for part in ("solver", "limits", "recovery")},
    "command": str(CCX or ""),
}


include: "workflow/rules/common.smk"
include: "workflow/rules/cluster.smk"


# short patterns: Snakemake puts them into every path it compares, and a thousand names would take it seconds
wildcard_constraints:
    case=r"[\w.]+",
    mesh=r"\w+",
    study="|".join(PROJECT.studies) or "none",
    airbag="|".join(PROJECT.airbags) or "none",
    exploration="|".join(EXPLORATIONS) or "none",
    round=r"\d+",
    run=r"\w+",
    figure=r"[a-z_]+",


# a mistake in an exploration that is asked for is told before anything else
for name in WORDS:
    if name in EXPLORATIONS:
        exploration(name)


# seconds each, so not worth a job on a cluster; its profile puts the rules of a case into one
localrules:
    mesh_device,
    export_study,
    gather_airbag,
    draw_airbag,
    keep_airbags,
    keep_runs,
    draw_accuracy,
    fit_material,
    check_paper,
    propose_designs,
    tell_designs,
    report_exploration,


# A job of a cluster is a Snakemake already: what is local to it runs there, all else in one more Snakemake for each rule.
if not workflow.is_main_process:

    localrules:
        solve_case,
        measure_case,
        write_fields,
        gather_study,
        gather_shapes,
        draw_figure,


onstart:
    begin()


include: "workflow/rules/mesh.smk"
include: "workflow/rules/solve.smk"
include: "workflow/rules/measure.smk"
include: "workflow/rules/aggregate.smk"
include: "workflow/rules/figures.smk"
include: "workflow/rules/paper.smk"
include: "workflow/rules/stress_test.smk"
include: "workflow/rules/page.smk"
include: "workflow/rules/accuracy.smk"
include: "workflow/rules/explore.smk"


for name in PROJECT.studies:

    rule:
        name:
            name
        input:
            partial(study_targets, name),
        message:
            f"Study {name}"


rule all:
    default_target: True
    input:
        partial(targets_of, PROJECT.config.studies),
