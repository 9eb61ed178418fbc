"""What the manual lists of code: fields of messages and services, topics of a record, types of nodes, rooms of the library, examples."""

from __future__ import annotations

import ast
import inspect
import itertools
import re
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from types import ModuleType

from alula.common.generated import table
from alula.missions.part import NO_PART
from alula.missions.registry import mission_registry
from alula.trees.ports import Port
from alula.trees.standard import standard_registry


def definitions(package: Path) -> Iterator[str]:
    """Yield each message and service of a ROS package: what its first comment says, then its fields."""
    for path in (*sorted(package.glob("msg/*.msg")), *sorted(package.glob("srv/*.srv"))):
        first, _, fields = path.read_text(encoding="utf-8").partition("\n")
        yield from (f"### {path.name}", "", first.removeprefix("# "), "", "```text", fields.strip(), "```", "")


def topics(module: ModuleType) -> Iterator[str]:
    """Yield the lines of a table of a module's constants that are topics, with the docstring below each."""
    body = ast.parse(inspect.getsource(module)).body
    rows = (
        (f"`{here.value.value}`", " ".join(str(below.value.value).split()).replace("``", "`"))
        for here, below in itertools.pairwise(body)
        if isinstance(here, ast.Assign) and isinstance(here.value, ast.Constant)
        if isinstance(here.value.value, str) and here.value.value.startswith("/")
        if isinstance(below, ast.Expr) and isinstance(below.value, ast.Constant)
    )
    yield from table(("topic", "what"), *rows)


def nodes() -> Iterator[str]:
    """Yield the lines of a table of the types of node of missions that BehaviorTree.CPP has not."""
    known = standard_registry().names()
    types = (one for one in mission_registry((), NO_PART) if one.name not in known)
    rows = (
        (f"`{one.name}`", one.doc.replace("``", "`"), "; ".join(_port(name, port) for name, port in one.ports.items())) for one in types
    )
    yield from table(("node", "what it does", "ports"), *rows)


def _port(name: str, port: Port) -> str:
    """Return a port in words: what it is, its unit and its default."""
    more = ", ".join(filter(None, [f"in {port.unit}" if port.unit else "", f"else {port.default}" if port.default else ""]))
    return f"`{name}`: {port.doc}{f' ({more})' if more else ''}"


def rooms(tests: Path, library: Path) -> Iterator[str]:
    """Yield the lines of a table of the library's rooms, as the test of its rooms orders them: what the first sentence of each says."""
    (order,) = (
        ast.literal_eval(one.value)
        for one in ast.parse(tests.read_text(encoding="utf-8")).body
        if isinstance(one, ast.Assign) and ast.unparse(one.targets[0]) == "ROOMS"
    )
    yield from table(("room", "what it is"), *((f"`{name}`", _sentence(library / name / "__init__.py")) for name in order))


def _sentence(module: Path) -> str:
    """Return the first sentence of a module's docstring."""
    text = " ".join((ast.get_docstring(ast.parse(module.read_text(encoding="utf-8"))) or "").split())
    return re.split(r"(?<=\.) ", text)[0].replace("``", "`")


def examples(folder: Path) -> Iterator[str]:
    """Yield the lines of a table of the examples that show one thing: what the first line of each says, without how it is run."""
    rows = (
        (path.name, ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or "") for path in sorted(folder.glob("[er]??_*.py"))
    )
    yield from table(
        ("file", "what it shows"), *((f"[{name}]({name})", text.partition("\n")[0].partition(" Run:")[0]) for name, text in rows)
    )


def settings(module: Path, kinds: Iterable[str]) -> Iterator[str]:
    """Yield the lines of a table of a module's dataclasses of settings: what each does, and its keys with their defaults."""
    tree = ast.parse(module.read_text(encoding="utf-8"))
    constants = {ast.unparse(one.targets[0]): one.value for one in tree.body if isinstance(one, ast.Assign)}
    classes = {one.name: one for one in tree.body if isinstance(one, ast.ClassDef)}
    rows = ((ast.get_docstring(classes[kind]) or "", "; ".join(_keys(classes[kind], constants))) for kind in kinds)
    yield from table(("what it does", "keys, with their defaults"), *((what.replace("``", "`"), keys) for what, keys in rows))


def _keys(definition: ast.ClassDef, constants: Mapping[str, ast.expr]) -> Iterator[str]:
    """Yield the fields of a class of settings; one without a default is needed, one that may be left out is in brackets."""
    for one in definition.body:
        if not isinstance(one, ast.AnnAssign) or not isinstance(one.value, ast.Call):
            continue
        name = ast.unparse(one.target)
        if any(word.arg == "default_factory" for word in one.value.keywords):
            yield f"`{name}` (empty)"
        elif len(one.value.args) > 1:
            default = one.value.args[1]
            yield f"`{name}` ({ast.unparse(constants.get(ast.unparse(default), default))})"
        else:
            yield f"`{name}`"
