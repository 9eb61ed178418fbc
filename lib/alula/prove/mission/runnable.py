"""Whether the search can run the class of a node with children, and which attributes one tick of it leaves for the next.

It can where the code hangs on nothing but the node's ports, the mission's clock, its children and its own attributes, and changes nothing
else: then a tick that is done again does the same again. What is not surely so, by its source, is refused.
"""

from __future__ import annotations

import ast
import builtins
import inspect
import math
import textwrap
from collections.abc import Iterator
from types import FunctionType, ModuleType

from alula.trees.node import Control, Decorator, Node
from alula.trees.status import Skipped, Status

OURS = ("alula.trees.node.", "alula.trees.nodes.", "alula.missions.", "py_trees.")
"""Modules of classes that are known to be so."""
FACE = "alula.trees"
"""What says that it defines the classes of `alula.trees.node`, which are public there."""
OF_THE_NODE = frozenset(
    {
        "child",
        "children",
        "status",
        "name",
        "now_ns",
        "get",
        "put",
        "given",
        "number",
        "real",
        "place",
        "update",
        "execute",
        "halt",
        "halt_node",
    }
    | {"become", "give_way", "reset_child", "reset_children"}
)
"""What code may use of its own node."""
OF_OTHERS = frozenset(
    {"status", "name", "execute", "halt_node"}  # of children
    | {"append", "add", "clear", "copy", "count", "difference", "discard", "extend", "index", "insert", "intersection", "isdisjoint"}
    | {"issubset", "issuperset", "pop", "remove", "reverse", "sort", "union", "update"}
    | {"endswith", "join", "lower", "lstrip", "partition", "rstrip", "split", "startswith", "strip", "upper"}
)
"""What it may use of anything else."""
BUILTINS = frozenset(
    {"abs", "all", "any", "bool", "divmod", "enumerate", "filter", "float", "int", "isinstance", "iter", "len", "list", "map", "max", "min"}
    | {"next", "range", "reversed", "round", "set", "sorted", "str", "sum", "super", "tuple", "zip"}
)
_BUILTINS = tuple(getattr(builtins, name) for name in sorted(BUILTINS))
STATEMENTS = (
    *(ast.FunctionDef, ast.Return, ast.Assign, ast.AugAssign, ast.AnnAssign, ast.If, ast.While, ast.For, ast.Break, ast.Continue),
    *(ast.Pass, ast.Expr, ast.Raise, ast.Assert),
)
EXPRESSIONS = (
    *(ast.BoolOp, ast.BinOp, ast.UnaryOp, ast.IfExp, ast.Compare, ast.Call, ast.Attribute, ast.Name, ast.Constant, ast.NamedExpr),
    *(ast.List, ast.Tuple, ast.Set, ast.Subscript, ast.Slice, ast.Starred, ast.ListComp, ast.SetComp, ast.GeneratorExp),
    *(ast.JoinedStr, ast.FormattedValue),
)
PARTS = (ast.arguments, ast.arg, ast.keyword, ast.comprehension, ast.expr_context, ast.operator, ast.boolop, ast.unaryop, ast.cmpop)
SYNTAX = (*STATEMENTS, *EXPRESSIONS, *PARTS)
DECLARED = frozenset(name for name, kind in Node.__annotations__.items() if kind.startswith("ClassVar")) | {"may_end", "never_ticked"}
"""The description of a class's nodes."""
WORDS = "feedback_message"
"""The attribute with a text about a node, which decides nothing."""
CONSTANT = (type(None), bool, int, float, str, Status, Skipped)


class _RefusedError(Exception):
    """Code can't be run; the message has the reason."""


def why_not(real: type[Node]) -> str:
    """Return why the search can't run a class, empty where it can."""
    if not issubclass(real, Control):
        return "its class is neither a Control nor a Decorator"
    try:
        sets = frozenset(_assigned(real))
        for one in _of_others(real):
            for name, value in vars(one).items():
                _member(real, sets, name, value)
        late = sets - _assigned(real, "__init__") - _assigned(real, "setup")
    except _RefusedError as error:
        return str(error)
    missing = [name for name in sorted(late) if not hasattr(real, name)]
    return f"`self.{missing[0]}` is not there from the begin: set it in `setup`" if missing else ""


def remembered(real: type[Node]) -> tuple[str, ...]:
    """Return the attributes that one tick of a class leaves for the next: those that it declares, and all that its code sets."""
    return tuple(dict.fromkeys((*real.remembers, *real.remembers_running, *sorted(_assigned(real)))))


def names_in(real: type[Node]) -> frozenset[str]:
    """Return the names that the code of a class uses."""
    codes = [value.__code__ for one in _of_others(real) for value in vars(one).values() if isinstance(value, FunctionType)]
    found: set[str] = set()
    while codes:
        code = codes.pop()
        found.update(code.co_names)
        codes += [one for one in code.co_consts if isinstance(one, type(code))]
    return frozenset(found)


def _of_others(real: type[Node]) -> Iterator[type]:
    """Yield the classes that a robot's author has written."""
    ours = (one for one in real.__mro__ if one is object or one.__module__ == FACE or f"{one.__module__}.".startswith(OURS))
    known = frozenset(ours)
    yield from (one for one in real.__mro__ if one not in known)


def _assigned(real: type[Node], method: str = "") -> set[str]:
    """Return the attributes of a node that its code sets, in one method or anywhere."""
    found: set[str] = set()
    for one in _of_others(real):
        for name, value in vars(one).items():
            function = value.fget if isinstance(value, property) else value
            if isinstance(function, FunctionType) and method in {"", name}:
                source = _source(function)
                found |= {
                    node.attr
                    for node in ast.walk(source)
                    if isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store) and _is_self(node.value, source)
                }
    return found - {WORDS}


def _source(function: FunctionType) -> ast.FunctionDef:
    try:
        found = ast.parse(textwrap.dedent(inspect.getsource(function))).body[0]
    except (OSError, SyntaxError, IndexError):
        raise _RefusedError(f"the source of `{function.__name__}` is not there") from None
    if not isinstance(found, ast.FunctionDef) or found.name != function.__name__:
        raise _RefusedError(f"`{function.__name__}` is no plain function")
    return found


def _is_self(node: ast.expr, source: ast.FunctionDef) -> bool:
    return isinstance(node, ast.Name) and bool(source.args.args) and node.id == source.args.args[0].arg


def _member(real: type[Node], sets: frozenset[str], name: str, value: object) -> None:
    """Look at what stands in the body of a class."""
    if isinstance(value, property):
        if value.fset is not None or not isinstance(value.fget, FunctionType):
            raise _RefusedError(f"`{name}` is no property that is only read")
        _Code(real, sets, value.fget, method=True).look()
    elif isinstance(value, staticmethod) and isinstance(value.__func__, FunctionType):
        _Code(real, sets, value.__func__, method=False).look()
    elif isinstance(value, FunctionType):
        if name.startswith("__") and name != "__init__":
            raise _RefusedError(f"it has a `{name}`")
        _Code(real, sets, value, method=True).look()
    elif name not in DECLARED and not (name.startswith("__") or name == "_abc_impl") and not _is_constant(value):
        raise _RefusedError(f"`{name}` of the class may change, or hang on anything")


def _is_constant(value: object) -> bool:
    return isinstance(value, CONSTANT) or (isinstance(value, tuple | frozenset) and all(map(_is_constant, value)))


class _Code:
    """One function, and those that it calls."""

    def __init__(
        self, real: type[Node], sets: frozenset[str], function: FunctionType, *, method: bool, above: tuple[FunctionType, ...] = ()
    ) -> None:
        self._real = real
        self._sets = sets
        self._function = function
        self._method = method
        self._above = (*above, function)
        self._source = _source(function)
        named = (node for node in ast.walk(self._source) if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store | ast.Del))
        self._local = {node.id for node in named} | {node.arg for node in ast.walk(self._source) if isinstance(node, ast.arg)}

    def look(self) -> None:
        """Check the code; raises _RefusedError."""
        defaults = (*(self._function.__defaults__ or ()), *(self._function.__kwdefaults__ or {}).values())
        if not all(map(_is_constant, defaults)):
            self._refuse(self._source, "has a default that may change")
        for node in self._nodes(self._source):
            if node is not self._source and (not isinstance(node, SYNTAX) or isinstance(node, ast.FunctionDef)):
                self._refuse(node, f"has a {type(node).__name__}")
            elif isinstance(node, ast.Attribute):
                self._attribute(node)
            elif isinstance(node, ast.Name) and node.id not in self._local:
                self._name(node)

    def _nodes(self, node: ast.AST) -> Iterator[ast.AST]:
        """Yield what is done there, without what is said of types, and without decorators."""
        yield node
        for name, value in ast.iter_fields(node):
            if name not in {"annotation", "returns", "decorator_list", "type_comment"}:
                for one in value if isinstance(value, list) else [value]:
                    if isinstance(one, ast.AST):
                        yield from self._nodes(one)

    def _attribute(self, node: ast.Attribute) -> None:
        own = self._method and _is_self(node.value, self._source)
        of_super = isinstance(node.value, ast.Call) and isinstance(node.value.func, ast.Name) and node.value.func.id == "super"
        if not isinstance(node.ctx, ast.Load):
            if not own or (node.attr != WORDS and (hasattr(Decorator, node.attr) or node.attr in _OF_EACH)):
                self._refuse(node, f"sets `{ast.unparse(node)}`")
        elif own or of_super:
            mine = hasattr(self._real, node.attr) and not hasattr(Decorator, node.attr)
            if not (node.attr in OF_THE_NODE or mine or node.attr in self._sets or (of_super and node.attr == "__init__")):
                self._refuse(node, f"uses `{ast.unparse(node)}`")
        elif isinstance(node.value, ast.Name) and node.value.id not in self._local:
            value = self._value(node.value)
            ours = isinstance(value, ModuleType) and value.__name__ == FACE and self._is_fixed(getattr(value, node.attr, NotImplemented))
            if not (value is math or value is Status or value is Skipped or ours):
                self._refuse(node, f"uses `{ast.unparse(node)}`")
        elif node.attr not in OF_OTHERS:
            self._refuse(node, f"uses `{ast.unparse(node)}`")

    def _name(self, node: ast.Name) -> None:
        value = self._value(node)
        if isinstance(value, FunctionType) and not f"{value.__module__}.".startswith("alula."):
            if value not in self._above:
                _Code(self._real, self._sets, value, method=False, above=self._above).look()
        elif not (value is math or self._is_fixed(value) or (isinstance(value, ModuleType) and value.__name__ == FACE)):
            self._refuse(node, f"uses `{node.id}`")

    def _is_fixed(self, value: object) -> bool:
        return _is_constant(value) or self._is_harmless(value)

    @staticmethod
    def _is_harmless(value: object) -> bool:
        """Return whether it is a function or a class of Python's or of ours that keeps nothing."""
        if isinstance(value, type) and f"{value.__module__}.".startswith(("builtins.", "alula.", "py_trees.")):
            return value in _BUILTINS or issubclass(value, Exception | Node | Status | Skipped)
        return any(value is one for one in _BUILTINS)

    def _value(self, node: ast.Name) -> object:
        function = self._function
        closed = dict(zip(function.__code__.co_freevars, function.__closure__ or (), strict=True))
        if node.id in closed:
            try:
                return closed[node.id].cell_contents
            except ValueError:
                self._refuse(node, f"uses `{node.id}`")
        if node.id in function.__globals__:
            return function.__globals__[node.id]
        return getattr(builtins, node.id, NotImplemented)

    def _refuse(self, node: ast.AST, what: str) -> None:
        line = self._function.__code__.co_firstlineno + getattr(node, "lineno", 1) - 1
        raise _RefusedError(f"line {line} of its source {what}")


_OF_EACH = frozenset({"config", "before", "after", "uid", "status", "children", "parent", "name", "id", "logger", "_shared", "_constants"})
"""Attributes that each node has of its own."""
