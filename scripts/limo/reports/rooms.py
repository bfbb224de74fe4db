"""Where is what: rooms of the package from their docstrings, arrows between them, and which code decides which result."""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import pandas as pd

from limo.cases.case import engine_code
from limo.errors import ResultError
from limo.reports.markdown import markdown_table
from limo.schema.figures import AIRBAG_FIGURES, DEVICE_FIGURES, FIGURES
from limo.schema.section import ENGINES
from limo.store.code import reached

PACKAGE = Path("scripts/limo")
#: rooms, ground first: a room imports only from rooms before it
ORDER = (
    *("errors", "door", "warm", "checkout", "schema", "store", "geometry", "mesh", "mechanics", "engines", "config", "cases"),
    *(
        "measure",
        "bench",
        "solve",
        "cluster",
        "datasets",
        "airbag",
        "accuracy",
        "reliability",
        "beat",
        "explore",
        "figures",
        "drawings",
        "page",
        "reports",
        "terminal",
    ),
)


def parts(root: Path) -> dict[str, Callable[[], str]]:
    """What makes the parts of the page by their names; ``root``: the project's folder."""
    return {
        "overview": partial(overview, root / PACKAGE),
        "rooms": partial(rooms, root / PACKAGE),
        "arrows": partial(arrow_table, root / PACKAGE),
        "results": partial(results, root),
        "changes": partial(changes, root),
        "figures": partial(figures, root),
    }


def overview(package: Path) -> str:
    """Every room with its line."""
    return markdown_table(pd.DataFrame({"room": f"`{room}`", "what it is for": line_of(package, room)} for room in ORDER))


def rooms(package: Path) -> str:
    """The modules of every room that is a folder."""
    texts = []
    for room in (room for room in ORDER if (package / room).is_dir()):
        rows = [
            {"module": f"`{path.relative_to(package / room)}`", "what it does": first_sentence(path)}
            for path in modules(package / room)
        ]
        texts += [f"### `{room}`", markdown_table(pd.DataFrame(rows))]
    return "\n\n".join(texts)


def line_of(package: Path, room: str) -> str:
    """The first sentence of a room, which is a folder or a module."""
    return first_sentence(package / room / "__init__.py" if (package / room).is_dir() else package / f"{room}.py")


def modules(folder: Path) -> list[Path]:
    """The modules of a room, those of packages within it last; a package counts by its ``__init__.py``."""
    files = sorted(folder.rglob("*.py"), key=lambda path: (len(path.parts), path))
    return [path for path in files if path != folder / "__init__.py"]


def first_sentence(file: Path) -> str:
    """The first sentence of a module's docstring as markdown. Raises ``ResultError`` where there is none."""
    text = ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) or ""
    if not text:
        raise ResultError(f"{file}: a module needs a docstring; for example: Where on the device a point lies.")
    paragraph = " ".join(text.partition("\n\n")[0].replace("``", "`").split())
    return re.split(r"(?<!\bSt\.)(?<=\.) (?=[A-Z])", paragraph)[0]


# --------------------------------------------------------------------------------------------------------------------
# arrows


def arrow_table(package: Path) -> str:
    """Which room imports from which others."""
    collected = arrows(package)
    rows = [
        {
            "room": f"`{room}`",
            "imports from": ", ".join(f"`{other}`" for other in ORDER if (room, other) in collected) or "-",
            "is imported by": ", ".join(f"`{other}`" for other in ORDER if (other, room) in collected) or "-",
        }
        for room in ORDER
    ]
    return markdown_table(pd.DataFrame(rows))


def arrows(package: Path) -> dict[tuple[str, str], list[str]]:
    """The imports from one room of a package to another one, with the modules that import."""
    collected: dict[tuple[str, str], list[str]] = {}
    for file in sorted(package.rglob("*.py")):
        module = file.relative_to(package).with_suffix("")
        for name in _imported(ast.parse(file.read_text(encoding="utf-8")), package.name):
            other = name.split(".")[1]
            known = (package / other).is_dir() or (package / f"{other}.py").exists()  # not such as limo.__version__
            if known and other != module.parts[0]:
                collected.setdefault((module.parts[0], other), []).append(".".join(module.parts))
    return collected


def _imported(tree: ast.AST, package: str) -> Iterator[str]:
    """Dotted names of what a module imports from its package, also inside of functions and by ``import_module``."""
    for node in ast.walk(tree):
        names = []
        if isinstance(node, ast.ImportFrom):
            names = [f"{node.module}.{alias.name}" for alias in node.names]
        elif isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.Call) and ast.unparse(node.func).endswith("import_module"):
            names = [part.value for part in ast.walk(node) if isinstance(part, ast.Constant) and isinstance(part.value, str)]
        yield from (name for name in names if name.startswith(f"{package}."))


# --------------------------------------------------------------------------------------------------------------------
# what a change re-runs


#: a rule by engine, and what the engine does for it
TASK = re.compile(r'code_digest\(\s*"(\w+)",\s*engine_code\([^"]*"(\w+)"\)')


def rules(root: Path) -> dict[str, tuple[str, ...]]:
    """The rules whose results depend on code, with the entry points of that code; figures have entries of their own."""
    texts = [file.read_text(encoding="utf-8") for file in sorted((root / "workflow/rules").glob("*.smk"))]
    named = {name for text in texts for name in re.findall(r'code_digest\(\s*"(\w+)"', text)} | {"solve_case"}
    tasks = {"solve_case": "solve"} | dict(TASK.findall("\n".join(texts)))
    named.discard("draw_figure")
    return {
        name: (name, *((engine_code(engine, tasks[name]) for engine in ENGINES) if name in tasks else ()))
        for name in sorted(named)
    }


def results(root: Path) -> str:
    """Every rule with the modules that decide its result."""
    rows = []
    for rule, entries in rules(root).items():
        decided = by_room(reached(*entries, scripts=root / "scripts"))
        rows.append(
            {
                "rule": f"`{rule}`",
                "what it does": re.sub(r" \(rule \w+\)", "", first_sentence(root / f"scripts/{rule}.py")),
                "rooms: modules that decide it": "; ".join(f"`{room}`: {', '.join(names)}" for room, names in decided.items()),
            }
        )
    return markdown_table(pd.DataFrame(rows))


def changes(root: Path) -> str:
    """Every room with the rules that depend on something in it."""
    deciding = {rule: by_room(reached(*entries, scripts=root / "scripts")) for rule, entries in rules(root).items()}
    drawn = {name: by_room(reached(*entries, scripts=root / "scripts")) for name, entries in _figures().items()}
    rows = []
    for room in ORDER:
        collected = [f"`{rule}`" for rule, decided in deciding.items() if room in decided]
        selected = [name for name, decided in drawn.items() if room in decided]
        if selected:
            collected.append("all figures" if len(selected) == len(drawn) else f"{len(selected)} of {len(drawn)} figures")
        rows.append({"a change in": f"`{room}`", "can run again": ", ".join(collected) or "nothing"})
    return markdown_table(pd.DataFrame(rows))


def figures(root: Path) -> str:
    """Every figure with the modules that decide it."""
    rows = []
    for name, entries in _figures().items():
        decided = by_room(reached(*entries, scripts=root / "scripts"))
        others = {room: names for room, names in decided.items() if room != "figures"}
        selected = [module for module in decided["figures"] if module != name]
        rows.append(
            {
                "figure": f"`{name}`",
                "what it shows": first_sentence(root / PACKAGE / f"figures/{name}.py"),
                "beside its own module": "; ".join(
                    f"`{room}`: {', '.join(names)}" for room, names in {"figures": selected, **others}.items() if names
                ),
            }
        )
    return markdown_table(pd.DataFrame(rows))


def _figures() -> dict[str, tuple[str, ...]]:
    return {name: ("draw_figure", f"limo.figures.{name}") for name in (*FIGURES, *AIRBAG_FIGURES, *DEVICE_FIGURES)}


def by_room(definitions: frozenset[tuple[str, str]]) -> dict[str, list[str]]:
    """Modules of some definitions by their room, rooms in ``ORDER``; what stands in a room's ``__init__`` is called so."""
    collected: dict[str, set[str]] = {}
    for module in {module for module, _ in definitions if module.startswith("limo.")}:
        _, room, *inner = module.split(".")
        collected.setdefault(room, set()).add(".".join(inner) or "__init__")
    return {room: sorted(collected[room]) for room in ORDER if room in collected}
