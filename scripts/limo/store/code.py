"""Which code decides a result: the definitions that its entry point reaches, followed through imports by AST.

An entry point is a script of a rule (``mesh_device``), a module (``limo.figures.design``) or a definition of one
(``limo.engines.newton.engine:solve``). A definition is a function, a class
or an assignment at the top of a module. It counts with everything it names, in its own module and in those it imports. Comments,
docstrings, annotations, layout, import lines and the place of a definition do not count.

This is written by hand: packages that follow imports see whole modules, so a change of any of their functions would count.
"""

from __future__ import annotations

import ast
import hashlib
import json
import os
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

SCRIPTS = Path(__file__).parents[2]
#: plumbing: rooms and modules whose decisions, such as builds, stand in the parameters of the rules, or decide no result
PLUMBING = (
    *("limo.errors", "limo.door", "limo.warm", "limo.store", "limo.config", "limo.cases"),
    *("limo.explore.checks", "limo.engines.find", "limo.engines.calculix.build", "limo.engines.newton.build"),
)
#: a file says what it may hold, and what it holds stands in the parameters: only methods of such classes compute something
VALUES = "limo.schema"
_CACHE = "__pycache__/code.json"  # beside the package, by the hash of each source


def code_digest(*entries: str) -> str:
    """Hash (16 hexadecimal digits) of the code that some entry points reach. Raises ``KeyError`` for one that is not there."""
    return _digest(entries, SCRIPTS)


def reached(*entries: str, scripts: Path = SCRIPTS) -> frozenset[tuple[str, str]]:
    """The definitions that some entry points reach, as (module, name); of a script the name is empty."""
    return frozenset(_walk(entries, scripts))


@cache
def _digest(entries: tuple[str, ...], scripts: Path) -> str:
    # a set: the same code in another place, or reached by two ways, is the same code
    code = sorted({_package(scripts)[module].units[name].code for module, name in _walk(entries, scripts)})
    return hashlib.sha256("".join(code).encode()).hexdigest()[:16]


@dataclass(frozen=True)
class _Unit:
    """A definition: hash of what it does, and the dotted names it uses: ``name``, ``name.attribute`` or ``module:name``."""

    code: str
    uses: tuple[str, ...]


@dataclass(frozen=True)
class _Module:
    """Definitions of a module, and what its imports bring: local name -> (module, name). Statements without a name are ``""``."""

    units: dict[str, _Unit]
    imports: dict[str, tuple[str, str]]


def _walk(entries: tuple[str, ...], scripts: Path) -> set[tuple[str, str]]:
    package = _package(scripts)
    collected: set[tuple[str, str]] = set()
    left = [start for entry in entries for start in _starts(package, entry)]
    while left:
        module, name = left.pop()
        if (module, name) in collected:
            continue
        collected.add((module, name))
        if "" in package[module].units:
            left.append((module, ""))
        for use in package[module].units[name].uses:
            left.extend(_resolved(package, module, use))
    return collected


def _starts(package: dict[str, _Module], entry: str) -> list[tuple[str, str]]:
    """The definitions that an entry point stands for."""
    module, _, name = entry.partition(":")
    if name and name not in package[module].units:
        raise KeyError(entry)
    return [(module, one) for one in ([name] if name else package[module].units)]


def _resolved(package: dict[str, _Module], module: str, use: str) -> Iterator[tuple[str, str]]:
    """The definitions behind a name used in a module; nothing for plumbing, other packages and built-in names."""
    where, _, dotted = use.rpartition(":")
    name, _, attribute = dotted.partition(".")
    if not where and name in package[module].units:
        yield module, name
        return
    where, name = (where, name) if where else package[module].imports.get(name, ("", ""))
    if f"{where}.{name}" in package:  # a module as a whole, or what is named of it
        where, name = f"{where}.{name}", attribute.partition(".")[0]
    if where not in package or _within(where, PLUMBING):
        return
    if name in package[where].units:
        yield where, name
    elif name in package[where].imports:
        yield from _resolved(package, where, name)
    else:
        yield from ((where, every) for every in package[where].units)


@cache
def _package(scripts: Path) -> dict[str, _Module]:
    """All scripts of rules by their names and all modules by theirs, read from their sources or from what is known of them."""
    files = {path.stem: path for path in sorted(scripts.glob("*.py"))}
    for path in sorted((scripts / "limo").rglob("*.py")):
        parts = path.relative_to(scripts).with_suffix("").parts
        files[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    cached = scripts / "limo" / _CACHE
    try:
        known = json.loads(cached.read_text())
    except (OSError, ValueError):
        known = {}
    selected = hashlib.sha256(Path(__file__).read_bytes()).hexdigest()
    sources = {name: path.read_bytes() for name, path in files.items()}
    keys = {name: hashlib.sha256(f"{selected} {name} ".encode() + source).hexdigest() for name, source in sources.items()}
    read = {key: known[key] if key in known else _read(sources[name], name) for name, key in keys.items()}
    if read.keys() != known.keys():
        _write(cached, read)
    return {name: _from_json(read[key]) for name, key in keys.items()}


def _write(file: Path, read: dict[str, list]) -> None:
    """Keep what was read; where nothing can be written, sources are read again next time."""
    aside = file.with_name(f"{file.name}.{os.getpid()}")
    try:
        aside.parent.mkdir(exist_ok=True)
        aside.write_text(json.dumps(read))
        aside.replace(file)
    except OSError:
        aside.unlink(missing_ok=True)


def _from_json(data: list) -> _Module:
    units, imports = data
    return _Module({n: _Unit(code, tuple(uses)) for n, (code, uses) in units.items()}, {n: tuple(i) for n, i in imports.items()})


def _read(source: bytes, module: str) -> list:
    """Definitions and imports of a source as plain data."""
    tree = ast.parse(source)
    is_script = not module.startswith("limo")
    imports = _imports(tree.body)
    groups: dict[str, list[ast.stmt]] = {}
    for node in tree.body:
        if isinstance(node, ast.Import | ast.ImportFrom) or _is_text(node) or (is_script and _is_plumbing(node, imports)):
            continue
        for name in [""] if is_script else _names(node):
            groups.setdefault(name, []).append(node)
    is_values = _within(module, (VALUES,))
    units = {}
    for name, nodes in groups.items():
        bare = [_Bare(is_values).visit(ast.parse(ast.unparse(node)).body[0]) for node in nodes]
        code = hashlib.sha256("\n".join(ast.dump(node) for node in bare).encode()).hexdigest()
        uses = {use for before, after in zip(nodes, bare, strict=True) for use in _uses(before, after)}
        units[name] = [code, sorted(u for u in uses if ":" in u or u.partition(".")[0] in groups.keys() | imports.keys())]
    return [units, imports]


def _is_text(node: ast.stmt) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)


def _is_plumbing(node: ast.stmt, imports: dict[str, tuple[str, str]]) -> bool:
    """Whether a statement does no more than call plumbing."""
    called = node.value.func if isinstance(node, ast.Expr) and isinstance(node.value, ast.Call) else None
    return isinstance(called, ast.Name) and _within(imports.get(called.id, ("", ""))[0], PLUMBING)


def _within(module: str, rooms: tuple[str, ...]) -> bool:
    return any(module == room or module.startswith(f"{room}.") for room in rooms)


def _names(node: ast.stmt) -> list[str]:
    """What a statement at the top of a module defines; an empty name for one that only does something."""
    if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
        return [node.name]
    targets = node.targets if isinstance(node, ast.Assign) else [node.target] if isinstance(node, ast.AnnAssign) else []
    names = [n.id for target in targets for n in ast.walk(target) if isinstance(n, ast.Name)]
    if isinstance(node, ast.If) and any(isinstance(n, ast.Name) and n.id == "__name__" for n in ast.walk(node.test)):
        return []  # what a module does when it is run, it does not do when it is imported
    return names or [""]


def _imports(nodes: list[ast.stmt] | Iterator[ast.AST]) -> dict[str, tuple[str, str]]:
    """Local names that imports from this package bring, and what they stand for."""
    collected = {}
    for node in nodes:
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "limo":
            collected |= {alias.asname or alias.name: (node.module, alias.name) for alias in node.names}
    return collected


class _Bare(ast.NodeTransformer):
    """A definition without what decides nothing: docstrings, annotations, imports, and the fields of a file's sections."""

    def __init__(self, is_values: bool):
        self.is_values = is_values

    def visit(self, node: ast.AST) -> ast.AST | None:
        if isinstance(node, ast.Import | ast.ImportFrom):
            return None
        self.generic_visit(node)
        body = getattr(node, "body", None)
        if isinstance(body, list):
            node.body = [n for n in body if not _is_text(n)]
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            node.returns = None
        if isinstance(node, ast.arg):
            node.annotation = None
        if isinstance(node, ast.AnnAssign):
            node.annotation = ast.Constant(None)
        if isinstance(node, ast.ClassDef) and self.is_values:
            node.body = [n for n in node.body if isinstance(n, ast.FunctionDef) and not _checks(n)]
        return node


def _checks(node: ast.FunctionDef) -> bool:
    """Whether a method only checks what a file says."""
    text = " ".join(ast.unparse(d) for d in node.decorator_list)
    return "field_validator" in text or "model_validator" in text


def _uses(before: ast.AST, after: ast.AST) -> Iterator[str]:
    """The names that a bare definition uses; those of imports inside of it as ``module:name``."""
    inner = _imports(ast.walk(before))
    owners = {id(n.value): f".{n.attr}" for n in ast.walk(after) if isinstance(n, ast.Attribute)}
    for node in ast.walk(after):
        if isinstance(node, ast.Name):
            yield (":".join(inner[node.id]) if node.id in inner else node.id) + owners.get(id(node), "")
