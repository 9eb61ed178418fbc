"""Writes the reference of the public API: `python -m api_page [FILE]`, by default docs/reference/api.md of this checkout.

The modules are read as text, so that neither ROS world is needed. A name is looked up where its public module imports it from.
"""

from __future__ import annotations

import ast
import functools
import itertools
import re
import sys
import textwrap
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ALULA_ROOT = Path(__file__).resolve().parents[2]
PAGE = ALULA_ROOT / "docs/reference/api.md"
WIDTH = 118
FOLDERS = {
    "alula": "lib",
    "skillset_ros2": "ros2_ws/src/skillset_ros2",
    "skillset_ros1": "ros1_ws/src/skillset_ros1/src",
}
"""Where the package of each name lies."""
MODULES = ("alula", "alula.trees", "alula.parts", "skillset_ros2", "skillset_ros1")
HEAD = """\
# The public API

For authors of programs, hooks, nodes or parts of a robot in Python. These names stay; what is to go warns for one minor
version first ([CONTRIBUTING](../../CONTRIBUTING.md#the-public-api)). Every other module is private. What generated code
offers is in [client](../how-to/client.md) and in [the skillset interface](names.md).

<!-- Written by `python -m api_page`, from the docstrings. -->
"""
Definition = ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef
SECTIONS = ("Args", "Raises", "Attributes", "Returns", "Yields")


@dataclass(frozen=True)
class Name:
    """A public name, and the statement that defines it; None for a value."""

    name: str
    defined: Definition | None
    bases: tuple[ast.ClassDef, ...] = ()
    """Private classes that a class derives from, the nearest first: their members are its own."""


def main() -> int:
    """Write the page; return the exit code."""
    path = Path(sys.argv[1]) if len(sys.argv) > 1 else PAGE
    path.write_text(page(), encoding="utf-8")
    return 0


def page() -> str:
    """Return the page."""
    return re.sub(r"\n{3,}", "\n\n", HEAD + "\n" + "\n".join(_lines())).rstrip() + "\n"


def _lines() -> Iterator[str]:
    told: dict[str, str] = {}
    for module in MODULES:
        tree = _parsed(module)
        yield f"## {module}"
        yield ""
        yield from _text(ast.get_docstring(tree) or "")
        names = [_name(place, name) for name, place in _offered(tree)]
        values = [one for one in names if one.defined is None]
        for one in sorted((one for one in names if one.defined is not None), key=lambda one: one.name.lower()):
            yield from _entry(one, told)
        if values:
            yield "### Values"
            yield ""
            yield from _wrapped(", ".join(f"`{one.name}`" for one in sorted(values, key=lambda one: one.name)) + ".")


def _path(module: str) -> Path:
    base = ALULA_ROOT / FOLDERS[module.partition(".")[0]] / module.replace(".", "/")
    return base / "__init__.py" if base.is_dir() else base.with_suffix(".py")


@functools.cache
def _parsed(module: str) -> ast.Module:
    return ast.parse(_path(module).read_text(encoding="utf-8"))


def _offered(tree: ast.Module) -> list[tuple[str, str]]:
    """Return the names of ``__all__``, each with the module that defines it."""
    (listed,) = [node.value for node in tree.body if isinstance(node, ast.Assign) and getattr(node.targets[0], "id", "") == "__all__"]
    places = _imported(tree)
    return [(name, places[name]) for name in ast.literal_eval(listed)]


def _name(module: str, name: str) -> Name:
    """Find the definition of a name; a module may import it from another, as `from x import Name`."""
    tree = _parsed(module)
    for node in ast.walk(tree):
        if isinstance(node, Definition) and node.name == name:
            return Name(name, node, tuple(_bases(tree, node)) if isinstance(node, ast.ClassDef) else ())
    return Name(name, None)


def _bases(tree: ast.Module, node: ast.ClassDef) -> Iterator[ast.ClassDef]:
    """Yield the private classes of our packages that a class derives from."""
    for name in (ast.unparse(base).partition("[")[0] for base in node.bases):
        module = _imported(tree).get(name, "")
        if module.partition(".")[0] not in FOLDERS or _is_public(name):
            continue
        place = _parsed(module)
        while (found := next((one for one in place.body if isinstance(one, ast.ClassDef) and one.name == name), None)) is None:
            place = _parsed(_imported(place)[name])
        yield found
        yield from _bases(place, found)


def _imported(tree: ast.Module) -> dict[str, str]:
    """Return the module of each name that a module imports from another."""
    imports = [node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
    return {alias.name: node.module or "" for node in imports for alias in node.names}


def _is_public(name: str) -> bool:
    return any(name == offered for module in MODULES for offered, _ in _offered(_parsed(module)))


def _entry(one: Name, told: dict[str, str]) -> Iterator[str]:
    """Yield what is said of a name; ``told``: the names that list the members of a private base already."""
    node = one.defined
    assert node is not None  # noqa: S101 - values are listed elsewhere
    yield f"### {one.name}"
    yield ""
    if not isinstance(node, ast.ClassDef):
        yield from _signature(node, one.name)
        yield from _text(ast.get_docstring(node) or "")
        return
    yield from _text(ast.get_docstring(node) or "")
    if elsewhere := {told[base.name] for base in one.bases if base.name in told}:
        yield from _wrapped(f"It has what [{min(elsewhere)}](#{min(elsewhere).lower()}) has.")
        yield ""
    classes = (node, *(base for base in one.bases if base.name not in told))
    called = [part for part in reversed(classes) if part is node or not _is_hooks(part)]
    told.update({base.name: one.name for base in one.bases if not _is_hooks(base)})
    named = {member.name: member for part in called for member in part.body if isinstance(member, ast.FunctionDef)}
    members = [member for member in named.values() if _is_shown(member)]
    if any(ast.unparse(base) == "Enum" for base in node.bases):
        yield from _wrapped(f"Values: {', '.join(_enum_members(node))}.")
        yield ""
    rows = {name: row for part in reversed(classes) for name, row in _fields(part)}
    found = list(rows.values())
    yield from found
    for member in members:
        yield from _member(member)
    if members or found:
        yield ""


def _is_hooks(node: ast.ClassDef) -> bool:
    """Return whether a class is a base of hooks: managers call its methods, and a robot sets its attributes."""
    return any(ast.unparse(base) == "SkillHooks" for base in node.bases)


def _enum_members(node: ast.ClassDef) -> list[str]:
    targets = [statement.targets[0] for statement in node.body if isinstance(statement, ast.Assign)]
    return [f"`{target.id}`" for target in targets if isinstance(target, ast.Name)]


def _is_shown(member: ast.FunctionDef) -> bool:
    return not member.name.startswith("_") and ast.get_docstring(member) is not None


def _fields(node: ast.ClassDef) -> Iterator[tuple[str, str]]:
    """Yield each attribute of a class that has a docstring of its own, with its row."""
    for here, below in itertools.pairwise(node.body):
        if not isinstance(here, ast.AnnAssign) or not isinstance(here.target, ast.Name) or here.target.id.startswith("_"):
            continue
        if isinstance(below, ast.Expr) and isinstance(below.value, ast.Constant) and isinstance(below.value.value, str):
            yield here.target.id, _row(f"`{here.target.id}`", below.value.value)


def _member(member: ast.FunctionDef) -> Iterator[str]:
    decorators = {ast.unparse(one).rpartition(".")[2] for one in member.decorator_list}
    asked = bool(decorators & {"property", "cached_property"})
    call = "" if asked else f"({_arguments(member, bound=True)})"
    returns = f" -> {ast.unparse(member.returns)}" if member.returns is not None and ast.unparse(member.returns) != "None" else ""
    yield _row(f"`{member.name}{call}{returns}`", ast.get_docstring(member) or "")


def _row(title: str, doc: str) -> str:
    first = " ".join(doc.strip().partition("\n\n")[0].split())
    return "\n".join(
        textwrap.wrap(f"- {title}: {_marked(first)}", WIDTH, subsequent_indent="  ", break_long_words=False, break_on_hyphens=False)
    )


def _signature(node: Definition, name: str) -> Iterator[str]:
    if isinstance(node, ast.ClassDef):
        return
    returns = f" -> {ast.unparse(node.returns)}" if node.returns is not None else ""
    text = f"{name}({_arguments(node, bound=False)}){returns}"
    yield from textwrap.wrap(text, WIDTH - 4, initial_indent="    ", subsequent_indent="        ", break_long_words=False)
    yield ""


def _arguments(node: ast.FunctionDef | ast.AsyncFunctionDef, *, bound: bool) -> str:
    text = ast.unparse(node.args)
    if bound and not any(ast.unparse(one) == "staticmethod" for one in node.decorator_list):
        text = re.sub(r"^(?:self|cls)(?:, )?", "", text)
    return re.sub(r"^/, ", "", text)


def _text(doc: str) -> Iterator[str]:
    """Yield a docstring as Markdown: paragraphs are filled, a block behind ``::`` is code, the entries of a section are a list."""
    blocks = re.split(r"\n\s*\n", doc.strip())
    code = False
    for block in blocks:
        lines = block.split("\n")
        indented = all(line.startswith("    ") for line in lines)
        if code and indented:
            yield from lines
        elif (match := re.fullmatch(rf"({'|'.join(SECTIONS)}):", lines[0])) is not None:
            yield f"{match[1]}:"
            yield ""
            yield from _items(textwrap.dedent("\n".join(lines[1:])).split("\n"))
        else:
            code = lines[-1].endswith("::")
            yield from _wrapped(re.sub(r"::$", ":", " ".join(line.strip() for line in lines)))
        yield ""


def _items(lines: list[str]) -> Iterator[str]:
    entries: list[str] = []
    for line in lines:
        if line.startswith(" ") and entries:
            entries[-1] += f" {line.strip()}"
        else:
            entries.append(line)
    for entry in entries:
        name, colon, rest = entry.partition(":")
        yield _row(f"`{name}`", rest) if colon else _row(name, "")


def _wrapped(text: str) -> list[str]:
    return textwrap.wrap(_marked(text), WIDTH, break_long_words=False, break_on_hyphens=False)


def _marked(text: str) -> str:
    """Return a text of a docstring as Markdown has it."""
    return text.replace("``", "`")


if __name__ == "__main__":
    sys.exit(main())
