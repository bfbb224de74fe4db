"""Which code decides a result: found through imports, blind to what decides nothing."""

import shutil

import pytest

from limo.store import code as code_module

SCRIPT = "from limo.area import area\n\nwith open('x'):\n    area(2)\n"
AREA = '''"""A module."""

from limo.half import HALF, unused


def area(x: float) -> float:
    """Half of it."""
    return x * HALF  # a comment


def other(x):
    return unused(x)
'''
HALF = "HALF = 1 / 2\n\n\ndef unused(x):\n    return x\n"


@pytest.fixture
def digest_of(tmp_path):
    """``digest_of(area, half, script)``: digest of a rule with these sources."""

    def make(area: str = AREA, half: str = HALF, script: str = SCRIPT, **others: str) -> str:
        shutil.rmtree(tmp_path / "limo", ignore_errors=True)
        (tmp_path / "limo").mkdir()
        (tmp_path / "rule.py").write_text(script)
        for name, text in {"area": area, "half": half, "__init__": "", **others}.items():
            (tmp_path / f"limo/{name}.py").write_text(text)
        code_module._package.cache_clear()
        code_module._digest.cache_clear()
        found = code_module._digest(("rule",), tmp_path)
        code_module._package.cache_clear()
        return found

    return make


SAME = {
    "comment": {"area": AREA.replace("a comment", "another")},
    "docstring": {"area": AREA.replace("Half of it", "The half of it")},
    "no docstrings": {"area": AREA.replace('    """Half of it."""\n', "").replace('"""A module."""\n', "")},
    "layout": {"area": AREA.replace("return x * HALF", "return (\n        x *\n        HALF\n    )")},
    "annotation": {"area": AREA.replace("x: float", "x: int")},
    "import lines": {"area": AREA.replace("import HALF, unused", "import unused, HALF")},
    "a function that nothing reaches": {"area": AREA.replace("unused(x)", "unused(x) + 1")},
    "the same of the other module": {"half": HALF.replace("return x", "return 2 * x")},
    "a definition in another module": {
        "half": HALF.replace("HALF = 1 / 2\n", ""),
        "area": AREA.replace("HALF, ", "").replace("\n\n\ndef area", "\nfrom limo.moved import HALF\n\n\ndef area"),
        "moved": "HALF = 1 / 2\n",
    },
    "a name passed on": {"area": AREA.replace("limo.half", "limo.passed"), "passed": "from limo.half import HALF, unused\n"},
}
OTHER = {
    "number": {"half": HALF.replace("1 / 2", "1 / 3")},
    "operator": {"area": AREA.replace("x * HALF", "x / HALF")},
    "default": {"area": AREA.replace("x: float", "x: float = 1")},
    "decorator": {"area": AREA.replace("def area", "@cache\ndef area")},
    "script": {"script": SCRIPT.replace("area(2)", "area(3)")},
    "statement without a name": {"half": HALF + "\n\nprint(HALF)\n"},
    "an import inside of a function": {
        "area": AREA.replace("return x * HALF", "from limo.half import unused as f\n\n    return f(x) * HALF"),
    },
}


@pytest.mark.parametrize("name", [*SAME, *OTHER])
def test_a_digest_sees_what_code_does_and_nothing_else(digest_of, name):
    assert (digest_of() == digest_of(**{**SAME, **OTHER}[name])) == (name in SAME)


def test_a_module_used_through_an_attribute_counts_by_that_attribute(digest_of):
    area = AREA.replace("from limo.half import HALF, unused", "from limo import half").replace("HALF", "half.HALF")
    area = area.replace("unused(x)", "half.unused(x)")
    assert digest_of(area) == digest_of(area, HALF.replace("return x", "return 2 * x"))
    assert digest_of(area) != digest_of(area, HALF.replace("1 / 2", "1 / 3"))


def test_a_module_handed_on_as_a_whole_counts_whole(digest_of):
    area = AREA.replace("from limo.half import HALF, unused", "from limo import half").replace("x * HALF", "use(half)")
    assert digest_of(area) != digest_of(area, HALF.replace("return x", "return 2 * x"))


def test_what_was_read_is_kept_and_read_again_when_a_source_changes(digest_of, tmp_path):
    before = digest_of()
    cache = tmp_path / "limo/__pycache__/code.json"
    kept = cache.read_text()
    assert code_module._digest(("rule",), tmp_path) == before
    assert cache.read_text() == kept
    cache.write_text("{broken")
    code_module._package.cache_clear()
    code_module._digest.cache_clear()
    assert code_module._digest(("rule",), tmp_path) == before


def test_an_unknown_entry_point_is_an_error():
    with pytest.raises(KeyError):
        code_module.code_digest("no_such_rule")


INSIDE = {
    "a definition": ("from limo.half import unused as f", "f(x)"),
    "a module": ("from limo import half as h", "h.unused(x)"),
}


@pytest.mark.parametrize("name", INSIDE)
def test_what_is_imported_inside_of_a_function_is_followed(digest_of, name):
    line, call = INSIDE[name]
    area = AREA.replace("return x * HALF", f"{line}\n\n    return {call} * HALF")
    assert digest_of(area) != digest_of(area, HALF.replace("return x", "return 2 * x"))
    assert digest_of(area) == digest_of(area, f"{HALF}\n\ndef more(x):\n    return x\n")


def test_a_definition_is_an_entry_point_too(digest_of, tmp_path):
    digest_of()
    assert code_module.reached("limo.area:area", scripts=tmp_path) == {("limo.area", "area"), ("limo.half", "HALF")}
    with pytest.raises(KeyError, match=r"limo\.area:nothing"):
        code_module.reached("limo.area:nothing", scripts=tmp_path)
