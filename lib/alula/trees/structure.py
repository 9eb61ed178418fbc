"""What can be wrong in files of trees before anything is built of them: types of nodes, their children, their ports, cycles."""

from __future__ import annotations

import difflib
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from alula.trees.attributes import is_port, type_name
from alula.trees.document import DEEPEST, Attribute, Element
from alula.trees.errors import Problem, Report, did_you_mean, refuse
from alula.trees.guessing import guessed_types
from alula.trees.node import pointer
from alula.trees.node_type import CATEGORIES, NodeType
from alula.trees.ports import Direction
from alula.trees.reading import TreeFiles
from alula.trees.registry import NodeRegistry
from alula.trees.status import ANSWERS
from alula.trees.values import PortType

MOST_NODES = 65_535
"""A node's uid has 16 bits in Groot2's protocol."""


ALIKE = 0.9
"""From here on a name that nobody knows is a slip of the pen, not a node of one's own."""
SHOWN = 5
"""Names of nodes that one message shows."""
_WRITTEN = {"double": "write a number, such as 0.5", "bool": "write true or false", "BT::NodeStatus": f"write {', '.join(ANSWERS)}"}
"""How a value is written, by its type's name."""


def verify(
    files: TreeFiles, registry: NodeRegistry, report: Report = refuse, *, of_others: bool = False, others: Collection[Path] = ()
) -> None:
    """Report what is wrong with any tree of the files; of trees ``of_others``, what nobody has declared is one warning.

    Trees that they take of these ``others`` are not looked at: each of those files is verified by itself.
    """
    trees = files.trees_but(others)
    _verify_uses(files, trees, report)
    declared: set[str] = set()
    if of_others:
        declared = {one.name for one in registry if one.assumed or files.models.get(one.name) is one}
        registry = NodeRegistry([*registry, *_undeclared(files, trees, registry, report)])
    for name, tree in trees.items():
        if registry.get(name) is not None:
            report(Problem(tree.place_of("ID"), f"the tree '{name}' has the name of a node", "call it otherwise"))
    differing = _Differing()
    for tree in trees.values():
        for top in tree.children:
            for element in top.iterate():
                differs = element.tag != "SubTree" and type_name(element) in declared
                _verify_node(element, files, registry, differing.of(type_name(element)) if differs else report)
    differing.tell(report)
    _Sizes(files, report).verify()


class _Differing:
    """How nodes are used otherwise than files of others declare them: one warning, as their program goes by its classes."""

    def __init__(self) -> None:
        self._found: dict[str, list[Problem]] = {}

    def of(self, name: str) -> Report:
        """Return what takes the problems of the uses of a type."""
        return lambda problem: self._found.setdefault(name, []).append(problem)

    def tell(self, report: Report) -> None:
        """Report them, at the first."""
        if not self._found:
            return
        first = next(iter(self._found.values()))[0]
        cure = first.cure or "correct the use, or the declaration: the program goes by its class"
        if len(self._found) == 1:
            (name,), times = self._found, sum(map(len, self._found.values()))
            which = f"'{name}' is used otherwise than it is declared" + (f" ({times} times)" if times > 1 else "")
        else:
            which = f"{len(self._found)} nodes are used otherwise than they are declared: {_first(list(self._found))}"
        report(replace(first, message=f"{which}; here {first.message}", cure=cure, warning=True))


def _verify_node(element: Element, files: TreeFiles, registry: NodeRegistry, report: Report) -> None:
    name = type_name(element)
    if not name:
        report(Problem(element.place, f"<{element.tag}> has no ID", "it names the type of the node"))
    elif element.tag == "SubTree":
        _verify_subtree(element, files, report)
    else:
        known = registry.get(name)
        if known is None:
            cure = did_you_mean(name, [*registry.names()]) or "see `alula palette`"
            if name in files.trees:
                cure = f'it is a tree: write <SubTree ID="{name}"/>'
            place = element.place_of("ID") if element.tag in CATEGORIES else element.place
            report(Problem(place, f"unknown node '{name}'", cure, code="ALU601"))
        else:
            _verify_children(element, known, report)
            for attribute in element.attributes.values():
                _verify_attribute(attribute, known, element, report)
            _verify_given(element, known, report)
            _verify_reactive(element, report)


def missing_trees(files: TreeFiles, users: Iterable[str] | None = None) -> dict[str, list[Element]]:
    """Return the trees that are used and that there are not, each with its uses; ``users``: by these trees only."""
    missing: dict[str, list[Element]] = {}
    for name in files.trees if users is None else users:
        for element in files.uses(name):
            if type_name(element) and type_name(element) not in files.trees:
                missing.setdefault(type_name(element), []).append(element)
    return missing


def is_slip(name: str, known: Iterable[str]) -> bool:
    """Return whether an unknown name is a known one misspelt."""
    return bool(difflib.get_close_matches(name, known, n=1, cutoff=ALIKE))


def _verify_uses(files: TreeFiles, trees: Mapping[str, Element], report: Report) -> None:
    """Report, file by file, the trees that there are not."""
    users: dict[str, list[str]] = {}
    for name, tree in trees.items():
        users.setdefault(tree.place.path, []).append(name)
    for names in users.values():
        _report_missing(missing_trees(files, names), files, report)


def _report_missing(missing: Mapping[str, Sequence[Element]], files: TreeFiles, report: Report) -> None:
    """Report each tree whose name is a slip, and all others together, where the first of them is used first."""
    slips = [name for name in missing if is_slip(name, files.trees)]
    others = [name for name in missing if name not in slips]
    for name in slips if others[1:] else missing:
        uses = missing[name]
        more = f", which is used {len(uses)} times" if uses[1:] else ""
        cure = did_you_mean(name, files.trees) or "include the file that has it, or give that file or its folder, too"
        report(Problem(uses[0].place_of("ID"), f"there is no tree '{name}'{more}", cure, code="ALU617"))
    if others[1:]:
        message = f"{len(others)} trees are in none of the files: {_first(others)}"
        cure = "include the files that have them, or give those files or their folder, too"
        report(Problem(missing[others[0]][0].place_of("ID"), message, cure, code="ALU617"))


def _first(names: Sequence[str]) -> str:
    """Return the first of many names."""
    return ", ".join(names[:SHOWN]) + (", ..." if names[SHOWN:] else "")


def _undeclared(files: TreeFiles, trees: Mapping[str, Element], registry: NodeRegistry, report: Report) -> list[NodeType]:
    """Report the nodes of the files that nobody has declared, and return what their uses show; names that are slips are left out."""
    own = {document.path for document in files.documents}
    guessed = guessed_types(trees.values(), registry)
    first: dict[str, Element] = {}
    for tree in trees.values():
        for element in tree.iterate():
            first.setdefault(type_name(element), element)
    declared = [one.name for one in registry if not one.assumed]
    guessed = [one for one in guessed if one.name not in files.trees and not is_slip(one.name, declared)]
    told = sorted((one for one in guessed if first[one.name].place.path in own), key=lambda one: first[one.name].place.line)
    if told:
        names = _first([one.name for one in told])
        message = f"{len(told)} nodes are not declared: {names}" if told[1:] else f"the node '{names}' is not declared"
        cure = "`alula palette --guess FOLDER` makes a first list of them, for `--palette`"
        report(Problem(first[told[0].name].place, message, cure, "ALU601", warning=True))
    return guessed


def _verify_subtree(element: Element, files: TreeFiles, report: Report) -> None:
    name = type_name(element)
    if element.children:
        report(Problem(element.children[0].place, f"<SubTree> '{name}' has children", "they belong into the tree itself"))
    model = files.models.get(name)
    if model is not None and not _is_true(element.get("_autoremap")):
        for port in model.ports.values():
            if port.default is None and port.name not in element.attributes:
                report(
                    Problem(element.place, f"the subtree '{name}' needs the port '{port.name}'", f'add {port.name}="..."', code="ALU604")
                )


def _is_true(text: str) -> bool:
    return text.lower() in {"1", "true"}


def _verify_children(element: Element, known: NodeType, report: Report) -> None:
    count, (least, most) = len(element.children), known.children
    if count < least or (most is not None and count > most):
        expected = "none" if most == 0 else str(least) if most == least else f"{least} or more" if most is None else f"{least} to {most}"
        if most == 1 and count > 1:
            expected += ": put them into a Sequence"
        place = element.place if count < least or most is None else element.children[most].place
        report(Problem(place, f"'{known.name}' has {count or 'no'} {'child' if count == 1 else 'children'}", f"it takes {expected}"))


def _verify_attribute(attribute: Attribute, known: NodeType, element: Element, report: Report) -> None:
    if attribute.name == "ID" and element.tag not in CATEGORIES:
        report(Problem(attribute.place, f"<{element.tag}> takes no ID", 'the tag is its type; call it by name="..."'))
    if not is_port(attribute.name):
        return
    port = known.ports.get(attribute.name)
    if port is None:
        report(
            Problem(
                attribute.place, f"'{known.name}' has no port '{attribute.name}'", did_you_mean(attribute.name, known.ports), code="ALU603"
            )
        )
        return
    key = pointer(attribute.value, port.name)
    if key is None and port.direction is Direction.OUTPUT and attribute.value:  # an empty one: nothing is written
        report(Problem(attribute.place, f"the port '{port.name}' is written", f'it names an entry: {port.name}="{{...}}"', code="ALU605"))
    elif key is None:
        try:
            port.type.parse(attribute.value)
        except ValueError as error:
            place = attribute.value_place or attribute.place
            report(Problem(place, f"the port '{port.name}': {error}", _written_as(port.type), code="ALU605"))


def _written_as(type_: PortType) -> str:
    """Return how a value of a type of ports is written in a file; empty for a type of a robot's own."""
    if type_.limits is not None:
        return f"write a whole number from {type_.limits[0]} to {type_.limits[1]}"
    return _WRITTEN.get(type_.name, "")


def _verify_given(element: Element, known: NodeType, report: Report) -> None:
    for port in known.ports.values():
        if port.required and port.name not in element.attributes:
            report(Problem(element.place, f"'{known.name}' needs the port '{port.name}'", f'add {port.name}="..."', code="ALU604"))


def _verify_reactive(element: Element, report: Report) -> None:
    if type_name(element) == "ReactiveSequence":
        slow = [child for child in element.children if type_name(child) == "AsyncSequence"]
        for child in slow[1:]:
            report(
                Problem(child.place, "a second AsyncSequence in a ReactiveSequence", "only one child may take several ticks", code="ALU611")
            )


class _Sizes:
    """Goes down from each tree into those that it contains, with a stack: a file may have thousands, one in the other."""

    def __init__(self, files: TreeFiles, report: Report) -> None:
        self._files = files
        self._report = report
        self._sizes: dict[str, tuple[int, int]] = {}
        self._inner = {name: [one for one, _ in _levels(tree) if one.tag == "SubTree"] for name, tree in files.trees.items()}

    def verify(self) -> None:
        """Report trees that contain themselves, and those that grow beyond the limits."""
        for start in self._files.trees:
            stack = [start]
            while stack:
                name = stack[-1]
                if name in self._sizes or not self._inner[name]:
                    stack.pop()
                    if name not in self._sizes:
                        self._sizes[name] = self._size(name)
                    continue
                element = self._inner[name].pop()
                inner = type_name(element)
                if inner in stack:
                    way = " in ".join(f"'{one}'" for one in [inner, *reversed(stack[stack.index(inner) :])])
                    self._report(Problem(element.place, f"a tree contains itself: {way}", "write a loop with Repeat", code="ALU007"))
                elif inner in self._files.trees:
                    stack.append(inner)

    def _size(self, name: str) -> tuple[int, int]:
        """Return how many nodes and how many levels a tree has with those that it contains; beyond a limit: as if it had none."""
        tree, nodes, depth = self._files.trees[name], 0, 0
        for element, level in _levels(tree):
            count, levels = self._sizes.get(type_name(element), (0, 0)) if element.tag == "SubTree" else (0, 0)
            nodes, depth = nodes + 1 + count, max(depth, level + levels)
        if nodes > MOST_NODES:
            message = f"the tree '{name}' has with its subtrees {nodes} nodes, more than {MOST_NODES}"
        elif depth > DEEPEST:
            message = f"the tree '{name}' is with its subtrees {depth} levels deep, more than {DEEPEST}"
        else:
            return nodes, depth
        self._report(Problem(tree.place, message, "use a tree less often, or in fewer of the others", code="ALU009"))
        return 0, 0


def _levels(tree: Element) -> Iterator[tuple[Element, int]]:
    """Yield the nodes of a tree, each with its level from 1."""
    left = [(child, 1) for child in tree.children]
    while left:
        element, level = left.pop()
        yield element, level
        left += [(child, level + 1) for child in element.children]
