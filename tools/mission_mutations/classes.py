"""Ways to alter the class of a node of a robot's own, each at each place where it can be done: a class with one alteration in it.

Nothing that a loop needs to end is altered: neither what it asks, nor what is assigned in it.
"""

from __future__ import annotations

import ast
import copy
import inspect
import linecache
import sys
import textwrap
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from alula.missions.part import MissionPart
from alula.prove.mission.runnable import why_not
from alula.trees.node import Node
from alula.trees.status import Status

CLASS_ALTERED = "a class altered"
OTHER_ANSWER = {"SUCCESS": "FAILURE", "FAILURE": "SUCCESS", "RUNNING": "FAILURE"}
LOOPS = (ast.While, ast.For)

Change = Callable[[ast.AST], None]
"""Changes a node of the source."""


@dataclass(frozen=True)
class Altered:
    """A class as a robot has it, and the source of the other one."""

    module: str
    name: str
    source: str

    def within(self, part: MissionPart) -> MissionPart:
        """Return a robot's part with the altered class in the place of its own."""
        nodes = tuple(self._made() if (one.__module__, one.__name__) == (self.module, self.name) else one for one in part.nodes)
        return MissionPart(nodes, part.context, part.check_inputs)

    def _made(self) -> type[Node]:
        file = f"<{self.module}.{self.name} altered, {hash(self.source)}>"
        # The search reads the source of what it runs.
        linecache.cache[file] = (len(self.source), None, self.source.splitlines(keepends=True), file)
        names = {**{one.value: one for one in Status}, **vars(sys.modules[self.module])}
        exec(compile(self.source, file, "exec", dont_inherit=True), names)  # noqa: S102 - the robot's own class
        made: type[Node] = names[self.name]
        return made


def altered(node: type[Node]) -> Iterator[tuple[str, Altered]]:
    """Yield each altered class: what was done to it, and the class. One that the search does not run is not altered: it may do anything."""
    if why_not(node):
        return
    whole = ast.parse(textwrap.dedent(inspect.getsource(node)))
    for number, one in enumerate(ast.walk(whole)):
        for what, change in _places(one, in_loop=number in _in_loops(whole)):
            copied = copy.deepcopy(whole)
            change(list(ast.walk(copied))[number])
            source = ast.unparse(ast.fix_missing_locations(copied)) + "\n"
            yield f"line {getattr(one, 'lineno', 1)}: {what}", Altered(node.__module__, node.__name__, source)


def _in_loops(whole: ast.AST) -> frozenset[int]:
    """Return the numbers of what stands in loops."""
    numbers = {id(one): number for number, one in enumerate(ast.walk(whole))}
    return frozenset(numbers[id(one)] for loop in ast.walk(whole) if isinstance(loop, LOOPS) for one in ast.walk(loop))


def _places(one: ast.AST, *, in_loop: bool) -> Iterator[tuple[str, Change]]:
    if isinstance(one, ast.If | ast.IfExp):
        yield f"`{ast.unparse(one.test)}` is negated", _negate
    if isinstance(one, ast.Return) and one.value is not None:
        for name in (each for each in ast.walk(one.value) if isinstance(each, ast.Name) and each.id in OTHER_ANSWER):
            yield f"`{ast.unparse(one)}` answers {OTHER_ANSWER[name.id]} for {name.id}", _answer_otherwise(name.id)
        if ast.unparse(one.value).endswith(".execute()"):
            yield f"FAILURE instead of `{ast.unparse(one)}`", _fail
    for place, block in ast.iter_fields(one):
        if isinstance(block, list) and len(block) > 1 and isinstance(one, ast.FunctionDef | ast.If | ast.While | ast.For):
            for at, each in enumerate(block):
                if _may_go(each, in_loop=in_loop or isinstance(one, LOOPS)):
                    yield f"without `{ast.unparse(each)}`", _without(place, at)


def _may_go(one: object, *, in_loop: bool) -> bool:
    """Return whether a class goes without a statement: a call, or, where no loop needs it, an assignment to what the node has already."""
    if isinstance(one, ast.Expr):
        return isinstance(one.value, ast.Call) and not ast.unparse(one).startswith("super().__init__(")
    return isinstance(one, ast.Assign | ast.AugAssign) and not in_loop and ast.unparse(one).startswith("self.")


def _negate(one: ast.AST) -> None:
    assert isinstance(one, ast.If | ast.IfExp)  # noqa: S101 - as `_places` has it
    one.test = ast.UnaryOp(ast.Not(), one.test)


def _answer_otherwise(name: str) -> Change:
    def change(one: ast.AST) -> None:
        for each in ast.walk(one):
            if isinstance(each, ast.Name) and each.id == name:
                each.id = OTHER_ANSWER[name]

    return change


def _fail(one: ast.AST) -> None:
    assert isinstance(one, ast.Return)  # noqa: S101 - as `_places` has it
    one.value = ast.Name("FAILURE", ast.Load())


def _without(name: str, at: int) -> Change:
    def change(one: ast.AST) -> None:
        del getattr(one, name)[at]

    return change
