"""Engines behind one protocol: nobody asks for their names, and what decides a result is one engine's code."""

import ast
import inspect
import re
from pathlib import Path

import pytest

from limo.cases.case import engine_code
from limo.engines.engine import Engine
from limo.engines.find import find_builds, find_engine
from limo.errors import ConfigError
from limo.schema.element import ELEMENTS, element
from limo.schema.numerics import READ_BY, Numerics
from limo.schema.section import ENGINES
from limo.schema.solver import Solver
from limo.store.code import reached

ROOT = Path(__file__).parents[3]
SCRIPTS = ROOT / "scripts"
TASKS = {"solve": "solve_case", "inflate": "solve_airbag", "sample": "measure_scaling"}


@pytest.mark.parametrize("name", ENGINES)
def test_an_engine_is_what_the_protocol_says(name):
    engine = find_engine(name)
    assert isinstance(engine, Engine)
    assert name == engine.NAME
    for task, wanted in inspect.getmembers(Engine, inspect.isfunction):
        if not task.startswith("_"):
            arguments = list(inspect.signature(wanted).parameters)[1:]
            assert list(inspect.signature(getattr(engine, task)).parameters) == arguments, task


def test_shells_are_for_the_engine_that_expands_them():
    assert {n for n in ELEMENTS if not find_engine("newton").takes(element(n))} == {"S3", "S4", "S4R", "S6", "S8", "S8R"}
    assert {n for n in ELEMENTS if not find_engine("calculix").takes(element(n))} == {"SHELL8R"}


def test_every_key_of_numerics_is_read_by_some_engine():
    """A key that none is said to read would be no part of any case: what it changes would be taken for solved."""
    assert {key for keys in READ_BY.values() for key in keys} == Numerics.model_fields.keys() - {"description"}
    assert READ_BY.keys() == {*ENGINES}


def test_an_engine_that_is_not_needed_may_be_lacking():
    absent = Solver(command="/no/ccx")
    assert find_builds(absent, "config.yaml", ["calculix"], needed=[]) == {}
    for needed in (None, ["calculix"]):
        with pytest.raises(ConfigError, match=r"solver\.command"):
            find_builds(absent, "config.yaml", ["calculix"], needed)


# --------------------------------------------------------------------------------------------------------------------
# which code decides a result


def rooms(*entries: str) -> set[str]:
    """The modules of engines that some entry points reach, as ``calculix.run``."""
    return {module.removeprefix("limo.engines.") for module, _ in reached(*entries) if re.match(r"limo\.engines\.\w+\.", module)}


@pytest.mark.parametrize("task", TASKS)
def test_a_script_reaches_no_engine_and_an_entry_point_one(task):
    assert rooms(TASKS[task]) == set()
    of_calculix, of_newton = (rooms(TASKS[task], engine_code(engine, task)) for engine in ("calculix", "newton"))
    assert of_calculix >= {"calculix.run", "calculix.deck", "calculix.sta"}
    assert of_newton >= {"newton.iteration", "newton.assembly", "newton.kernels", "newton.pardiso"}
    assert not any(module.startswith("newton") for module in of_calculix)
    assert not any(module.startswith("calculix") for module in of_newton)
    unseen = {f"{engine}.{part}" for engine in ENGINES for part in ("progress", "build")}
    assert not unseen & (of_calculix | of_newton), "what is watched decides nothing, and builds are a part of what a case is"


# --------------------------------------------------------------------------------------------------------------------
# names


def named(node: ast.AST) -> set[str]:
    """The texts in what is compared, those in a tuple, list or set too."""
    return {part.value for part in ast.walk(node) if isinstance(part, ast.Constant) and isinstance(part.value, str)}


def decisions_by_name(source: str) -> list[int]:
    """Lines of a source that compare something with the name of an engine or an element, or ask how an element's begins."""
    names, lines = {*ENGINES, *ELEMENTS}, []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Compare | ast.MatchValue):
            parts = [node.left, *node.comparators] if isinstance(node, ast.Compare) else [node.value]
            # a call or an index among them is asked for what it gives, not for the names in it
            plain = [part for part in parts if isinstance(part, ast.Constant | ast.Tuple | ast.List | ast.Set)]
            lines += [node.lineno] * bool(names & set().union(*map(named, plain)))
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in ("startswith", "endswith"):
            asked = set().union(*map(named, node.args))
            lines += [node.lineno] * any(getattr(name, node.func.attr)(part) for name in names for part in asked)
    return lines


@pytest.mark.parametrize(
    ("source", "found"),
    [
        ('a.engine == "newton"', True),
        ('"calculix" in used', True),
        ('a.engine in ("newton", "other")', True),
        ('a.element.startswith("S8")', True),
        ('a.element.startswith(("C3D", "X"))', True),
        ('a.element.endswith("R")', True),
        ('match a:\n    case "newton":\n        pass', True),
        ('SHARE = {"newton": 1 / 12}', False),
        ('a.engine == SHARE["newton"]', False),
        ('a.name.startswith("study")', False),
    ],
)
def test_decisions_by_name_are_seen(source, found):
    assert bool(decisions_by_name(source)) == found


def test_nobody_outside_of_the_engines_decides_by_the_name_of_an_engine_or_an_element():
    files = [*SCRIPTS.glob("*.py"), *(f for f in SCRIPTS.glob("limo/**/*.py") if "engines" not in f.parts)]
    assert len(files) > 100
    found = [f"{file.relative_to(ROOT)}:{line}" for file in files for line in decisions_by_name(file.read_text())]
    rules = [ROOT / "Snakefile", *ROOT.glob("workflow/rules/*.smk")]  # no Python that can be parsed
    compared = re.compile(rf"[=!]= *[\"']({'|'.join([*ENGINES, *ELEMENTS])})\b|(starts|ends)with\([\"'](S8|C3D|R\b)")
    found += [f"{file.name}: {match.group()}" for file in rules for match in compared.finditer(file.read_text())]
    assert found == []


# --------------------------------------------------------------------------------------------------------------------
# rooms


BELOW = {"engines": ("config", "cases", "solve", "measure"), "mechanics": ("engines", "config", "cases"), "schema": ("engines",)}


@pytest.mark.parametrize("room", BELOW)
def test_rooms_below_know_nothing_of_those_above(room):
    for file in SCRIPTS.glob(f"limo/{room}/**/*.py"):
        for node in ast.walk(ast.parse(file.read_text())):
            modules = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            modules += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            above = [m for m in modules if m.startswith(tuple(f"limo.{name}" for name in BELOW[room]))]
            assert not above, f"{file.relative_to(SCRIPTS)} imports {above}"
