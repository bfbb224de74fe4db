"""The page *where is what*: names in its table exist, and arrows and decisions are found."""

import ast
import re

import pytest

from limo.errors import ResultError
from limo.reports.blocks import by_hand
from limo.reports.rooms import ORDER, PACKAGE, arrows, by_room, first_sentence, rules


def hand_written_rows(root) -> list[str]:
    text = (root / "docs/where_is_what.md").read_text(encoding="utf-8")
    section = text.partition("## To change something")[2].partition("\n## ")[0]
    return [line for line in section.splitlines() if line.startswith("| ")][1:]


def defined_in(path) -> set[str]:
    """Names that a module defines at its top."""
    found = set()
    for node in ast.parse(path.read_text(encoding="utf-8")).body:
        targets = node.targets if isinstance(node, ast.Assign) else [node.target] if isinstance(node, ast.AnnAssign) else []
        names = {n.id for target in targets for n in ast.walk(target) if isinstance(n, ast.Name)}
        found |= names | ({node.name} if hasattr(node, "name") else set())
    return found


def test_files_and_names_of_the_table_exist(root):
    rows = hand_written_rows(root)
    assert len(rows) > 15
    for row in rows:
        named = set(re.findall(r"`([^`]+)`", row.split("|")[2]))
        paths = {name for name in named if re.search(r"[/.]|^schema$|^engines$|^scripts$", name) and "NAME" not in name}
        files = [next((p for p in (root / name, root / PACKAGE / name) if p.exists()), None) for name in paths]
        assert None not in files, row
        known = set().union(*(defined_in(file) for file in files if file.suffix == ".py"))
        keys = {f"{key}:" for file in files if file.suffix == ".yaml" for key in re.findall(r"^(\w+):", file.read_text(), re.M)}
        names = {name for name in named - paths if "NAME" not in name}
        assert names <= known | keys | {"make docs"}, row


@pytest.mark.parametrize("document", ["CONTRIBUTING.md", "config/README.md", "docs/configuration.md"])
def test_files_that_documents_name_exist(root, document):
    text = by_hand((root / document).read_text(encoding="utf-8"))
    named = re.findall(r"`((?:scripts|config|docs|tests|workflow)/[\w./]+)`", text)
    assert named
    assert [name for name in named if "NAME" not in name and not (root / name).exists()] == []


def test_arrows_are_found_wherever_something_is_imported(tmp_path):
    package = tmp_path / "limo"
    for name, text in {
        "a/__init__": '"""A room."""', "b/__init__": "", "c": "", "d/__init__": "", "e/__init__": "",
        "a/one": "from limo.b import x\nfrom limo import c, __version__\nfrom limo.a import two\n",
        "a/two": "def f(name):\n    import limo.d\n\n    import_module(f'limo.e.{name}')\n",
    }.items():  # fmt: skip
        (package / name).parent.mkdir(parents=True, exist_ok=True)
        (package / f"{name}.py").write_text(text)
    assert arrows(package) == {("a", "b"): ["a.one"], ("a", "c"): ["a.one"], ("a", "d"): ["a.two"], ("a", "e"): ["a.two"]}


def test_a_module_without_a_docstring_is_an_error(tmp_path):
    file = tmp_path / "module.py"
    file.write_text('"""Stress by St. Venant (paper): first ``sentence``. Second.\n\nMore."""\n')
    assert first_sentence(file) == "Stress by St. Venant (paper): first `sentence`."
    file.write_text("x = 1\n")
    with pytest.raises(ResultError, match="needs a docstring"):
        first_sentence(file)


def test_modules_stand_with_their_rooms_in_the_order_of_these():
    definitions = frozenset({("limo.solve.case", "a"), ("limo.mesh.flat", "b"), ("limo.mesh", "c"), ("solve_case", "")})
    assert list(by_room(definitions).items()) == [("mesh", ["__init__", "flat"]), ("solve", ["case"])]
    assert set(by_room(definitions)) < set(ORDER)


def test_every_rule_with_a_digest_of_its_code_is_listed(root):
    named = rules(root)
    assert {"mesh_device", "solve_case", "measure_case", "gather_study"} <= set(named)
    assert len(named["solve_case"]) > 1, "with its engines"
    text = "".join(path.read_text() for path in (root / "workflow/rules").glob("*.smk"))
    scripts = set(re.findall(r'code_digest\(\s*"(\w+)"', text)) - {"draw_figure"}
    assert named.keys() == scripts | {"solve_case"}, "figures share one; that of solve_case is made by cases.case"
