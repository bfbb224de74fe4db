"""An edited formula makes exactly the targets stale that it decides, for every rule and every figure."""

import ast
import re
import shutil
from pathlib import Path

import pytest

from limo.cases.case import engine_code
from limo.schema.figures import AIRBAG_FIGURES, DEVICE_FIGURES, FIGURES
from limo.schema.section import ENGINES
from limo.store import code as code_module

#: rules whose scripts run an engine, and what it does for them: each counts by engine
BY_ENGINE = {"solve_case": "solve", "solve_airbag": "inflate", "measure_scaling": "sample"}
SOLVE = {"solve_case calculix", "solve_case newton"}
AIRBAG = {"solve_airbag calculix", "solve_airbag newton"}
SCALING = {"measure_scaling calculix", "measure_scaling newton"}
#: what is computed of displacements, by these rules
OF_FRAMES = {"measure_case", "gather_shapes", "write_fields", "write_page", "report_exploration"}
ERRORS = {"gather_accuracy", "keep_runs"}
#: a definition -> the rules and figures whose results it decides
DECIDES = {
    # solve: its ladder may mesh anew; explorations: which layouts can be cut
    "geometry.pattern:flat_pattern": {"mesh_device", *SOLVE, *SCALING, "propose_designs", "report_exploration"},
    "mesh.flat:mesh_pattern": {"mesh_device", *SOLVE, *SCALING},
    "mechanics.volumes:volumes": SOLVE,
    "mechanics.energy:ramp_balance": SOLVE,
    "mechanics.build:valve_displacements": {*SOLVE, *SCALING, *OF_FRAMES, *ERRORS, "stress_test", "time_case"},
    "mechanics.kinematics:green_lagrange": {*SOLVE, *AIRBAG, *OF_FRAMES, "measure_scaling newton"},
    "mechanics.constitutive:von_mises": {*SOLVE, *OF_FRAMES},
    "bench.tensile:fit_tensile": {"fit_material"},
    "bench.compare:relative_l2": {"gather_study", "tell_designs", *ERRORS},
    "engines.calculix.deck:write_deck": {"solve_case calculix", "measure_scaling calculix"},
    "engines.calculix.frd:FrdFile": {"solve_case calculix", "solve_airbag calculix"},
    "engines.newton.assembly:Assembly": {"solve_case newton", "solve_airbag newton", "measure_scaling newton", "stress_test"},
    "engines.newton.pardiso:elimination_order": {"solve_case newton", "solve_airbag newton", "measure_scaling newton"},
    "solve.judge:verdict": SOLVE,
    "measure.fatigue:cycles_to_failure": {"measure_case", "write_fields", "write_page", "figure cycles", "figure strain_life"},
    "measure.strain:streamlines": {"gather_shapes", "write_fields", "report_exploration"},
    "measure.contact:crossings": {"measure_case", "gather_shapes", "report_exploration"},
    "measure.efficiency:works": {"gather_study", "tell_designs", *ERRORS},
    "datasets.curves:curves": {"gather_study", "tell_designs", *ERRORS},
    "datasets.export:tidy": {"export_study"},
    "datasets.shapes:gather_shapes": {"gather_shapes", "report_exploration"},
    "accuracy.surfaces:sampled": ERRORS,
    "accuracy.errors:errors_of": {"gather_accuracy"},
    "reliability.stress_test:gather_stress_test": {"stress_test"},
    "reliability.repeatability:cpu_times": {"time_case"},
    "accuracy.scaling:measure_scaling": SCALING,
    "airbag.solve:centre_stress": AIRBAG,
    "airbag.solve:gather": {"gather_airbag"},
    "reports.accuracy_airbag:keep_airbags": {"keep_airbags"},
    "reports.paper_check:check": {"check_paper"},
    "page.packing:pack": {"write_page"},
    "explore.search:improvement": {"propose_designs"},
    "explore.telling:violation": {"propose_designs", "report_exploration"},
    "explore.sensitivity:indices": {"report_exploration"},
    "explore.claims:shares": {"report_exploration"},
    "figures.style:curve": {
        *(f"figure {name}" for name in ("afterload", "buckling", "design", "pressure_volume")),
        "report_exploration",
    },
    **{f"figures.{name}:draw": {f"figure {name}"} for name in (*FIGURES, *AIRBAG_FIGURES, *DEVICE_FIGURES)},
    # decide where and how, not what
    "store.files:write_whole": set(),
    "cases.plan:make_plan": set(),
    "terminal.cli:main": set(),
}


@pytest.fixture(scope="module")
def scripts(tmp_path_factory, root) -> Path:
    """A copy of the sources, with what is known of them."""
    copy = tmp_path_factory.mktemp("scripts")
    for source in (root / "scripts").rglob("*.py"):
        target = copy / source.relative_to(root / "scripts")
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(source, target)
    return copy


def entries(scripts: Path) -> dict[str, tuple[str, ...]]:
    """The entry points of every rule with a script, by engine where it runs one, and of every figure."""
    found = {}
    for name in sorted(file.stem for file in scripts.glob("*.py")):
        if name in BY_ENGINE:
            found |= {f"{name} {engine}": (name, engine_code(engine, BY_ENGINE[name])) for engine in ENGINES}
        elif name == "draw_figure":
            figures = (*FIGURES, *AIRBAG_FIGURES, *DEVICE_FIGURES)
            found |= {f"figure {figure}": (name, f"limo.figures.{figure}") for figure in figures}
        else:
            found[name] = (name,)
    return found


def digests(scripts: Path) -> dict[str, str]:
    code_module._package.cache_clear()
    code_module._digest.cache_clear()
    made = {name: code_module._digest(points, scripts) for name, points in entries(scripts).items()}
    code_module._package.cache_clear()
    code_module._digest.cache_clear()
    return made


@pytest.fixture(scope="module")
def before(scripts) -> dict[str, str]:
    return digests(scripts)


def edited(source: str, name: str) -> str:
    """The source with another first statement in a function, or in the first method of a class."""
    (definition,) = (node for node in ast.parse(source).body if getattr(node, "name", None) == name)
    while not isinstance(definition, ast.FunctionDef):
        definition = next(node for node in definition.body if isinstance(node, ast.FunctionDef))
    first = definition.body[0]
    is_text = isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant)
    lines = source.splitlines(keepends=True)
    lines.insert(first.end_lineno if is_text else first.lineno - 1, " " * first.col_offset + "edited = True\n")
    return "".join(lines)


@pytest.mark.parametrize("definition", DECIDES)
def test_an_edit_makes_stale_what_it_decides_and_nothing_else(scripts, before, definition):
    module, _, name = definition.partition(":")
    file = scripts / f"limo/{module.replace('.', '/')}.py"
    source = file.read_text()
    file.write_text(edited(source, name))
    try:
        after = digests(scripts)
    finally:
        file.write_text(source)
    assert {target for target in before if before[target] != after[target]} == DECIDES[definition]


def test_every_rule_and_figure_is_decided_by_some_row_of_the_table(before):
    assert before.keys() == set().union(*DECIDES.values())


#: rules without a digest: what they keep is kept for good; times follow from the status of a case, which has one
KEPT = ("keep_runs", "time_case")


def test_every_rule_with_a_script_has_its_digest_as_a_parameter(root):
    found = {}
    for file in (root / "workflow/rules").glob("*.smk"):
        for name, body in re.findall(r"^rule (\w+):\n(.*?)(?=^\S|\Z)", file.read_text(), flags=re.MULTILINE | re.DOTALL):
            if script := re.search(r"scripts/(\w+)\.py", body):
                ways = (f'code_digest("{script[1]}"', "code=figure_code", "code=lambda wildcards: solve_code")
                found[name] = any(way in body for way in ways)
    assert len(found) > 15
    assert {name for name, has in found.items() if not has} == set(KEPT)
