"""Ticks a tree without any robot: its leaves answer what a file says, and what they were asked is written down."""

from __future__ import annotations

import json
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from alula.common.errors import AlulaError
from alula.trees.blackboard import Clock
from alula.trees.document import Element
from alula.trees.errors import TickError, did_you_mean
from alula.trees.factory import make_tree
from alula.trees.guessing import category_of
from alula.trees.node import Action, Control, Node, Wiring
from alula.trees.palette import CHILDREN, Category, Direction, NodeType, Palette, Port, node_type
from alula.trees.reading import TreeFiles, is_port, node_name, type_name
from alula.trees.status import ANSWERS, IDLE, NAMES, Answer
from alula.trees.tree import Tree

TICK_NS = 100_000_000
"""Mission clock from one tick to the next, as where a robot is: 10 Hz."""
SUBTREE = "SubTree"
NO_CHILDREN = CHILDREN[Category.ACTION]
WORDS = {name: answer for name, answer in ANSWERS.items() if answer is not IDLE}


class AnswersError(AlulaError):
    """A file of answers is wrong, or does not fit the tree; the message names it and says what to write."""


@dataclass(frozen=True)
class Tick:
    """One tick: what the root answered, and what each leaf was asked: ("start" | "tick" | "halt", its name)."""

    number: int
    root: str
    calls: Sequence[tuple[str, str]]

    def as_json(self) -> str:
        """Return the line that tells of it."""
        return json.dumps({"tick": self.number, "root": self.root, "calls": self.calls})

    def as_text(self) -> str:
        """Return a line for people."""
        return f"tick {self.number}: {self.root}" + "".join(f", {call} {leaf}" for call, leaf in self.calls)


@dataclass
class Answers:
    """What leaves answer, by their names: one answer a tick of the leaf, the last one from then on."""

    script: Mapping[str, Sequence[Answer]]
    calls: list[tuple[str, str]] = field(default_factory=list)
    _given: dict[str, int] = field(default_factory=dict)

    def next(self, leaf: Node, call: str) -> Answer:
        """Return a leaf's next answer; raises TickError where the file has none for it."""
        script = self.script.get(leaf.name)
        if script is None:
            raise TickError(f'{leaf.place()}: the answers say nothing of \'{leaf.name}\'; add "{leaf.name}": ["SUCCESS"]')
        number = self._given.get(leaf.name, 0)
        self._given[leaf.name] = number + 1
        self.calls.append((call, leaf.name))
        return script[min(number, len(script) - 1)]


def read_answers(path: Path) -> Answers:
    """Read ``{"leaf name": ["RUNNING", "SUCCESS"], ...}``; raises AnswersError."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise AnswersError(f"{path}: {error.strerror or error}") from error
    except (ValueError, RecursionError) as error:
        raise AnswersError(f"{path}: is no JSON: {error}") from error
    if not isinstance(content, dict):
        raise AnswersError(f'{path}: is no object; write {{"leaf name": ["RUNNING", "SUCCESS"], ...}}')
    return Answers({name: _script(words, f"{path}: '{name}'") for name, words in content.items()})


def _script(words: object, where: str) -> list[Answer]:
    if not isinstance(words, list) or not words:
        raise AnswersError(f'{where}: is no list of answers; write ["RUNNING", "SUCCESS"]')
    for word in words:
        if not isinstance(word, str) or word not in WORDS:
            raise AnswersError(f"{where}: {json.dumps(word)} is no answer; there are {', '.join(WORDS)}")
    return [WORDS[word] for word in words]


class ScriptedLeaf(Action):
    """A leaf that answers what a script says."""

    def __init__(self, wiring: Wiring, answers: Answers) -> None:
        super().__init__(wiring)
        self._answers = answers

    def on_start(self) -> Answer:
        """Give the next answer."""
        return self._answers.next(self, "start")

    def on_running(self) -> Answer:
        """Give the next answer."""
        return self._answers.next(self, "tick")

    def on_halted(self) -> None:
        """Write it down."""
        self._answers.calls.append(("halt", self.name))


class UnknownNode(Control):
    """A node with children of which only its place in the file is known: it can be drawn."""

    def update(self) -> Answer:
        """Raise TickError."""
        raise TickError(f"{self.place()}: nothing here ticks a '{self.wiring.type.name}'; only leaves can be scripted")


def scripted_tree(files: TreeFiles, palette: Palette, answers: Answers, clock: Clock, enums: Mapping[str, float] | None = None) -> Tree:
    """Build a tree of any file: what the palette does not know is an action, or with children a node that can only be drawn.

    By the script answer the leaves that it names, and all that only a robot could make. ``enums`` are the numbers of names in scripts.

    Raises:
        AnswersError: it names what is no leaf of the tree.
        TreeError: something is wrong in a file.
    """
    tree = make_tree(files, _scripted(files, palette, answers), clock, enums=enums)
    leaves = {node.name for node in tree.nodes if not node.children}
    for name in answers.script:
        if name not in leaves:
            cure = did_you_mean(name, leaves) or f"its leaves are {', '.join(sorted(leaves))}"
            raise AnswersError(f"the answers name '{name}', which is no leaf of the tree; {cure}")
    return tree


def ticks(tree: Tree, answers: Answers, count: int, clock: StepClock) -> Iterator[Tick]:
    """Tick a tree; raises TreeError when it can't be."""
    for number in range(1, count + 1):
        clock.step()
        answer = tree.tick()
        yield Tick(number, NAMES[answer], tuple(answers.calls))
        answers.calls.clear()


class StepClock:
    """Mission clock that goes on by the period of a tick."""

    def __init__(self) -> None:
        self._now_ns = 0

    def __call__(self) -> int:
        """Return nanoseconds."""
        return self._now_ns

    def step(self) -> None:
        """Go on."""
        self._now_ns += TICK_NS


def _scripted(files: TreeFiles, palette: Palette, answers: Answers) -> Palette:
    types = {one.name: one for one in palette}
    for name, uses in _uses(files).items():
        if name in files.trees and name not in types:
            continue  # a mistake, told when the tree is made
        known = types.get(name) or _guessed(name, uses)
        if known.children != NO_CHILDREN:
            types[name] = known if known.make is not None else replace(known, make=UnknownNode)
        elif known.make is None or any(node_name(use) in answers.script for use in uses):
            types[name] = replace(known, make=_leaf_maker(known.make, answers))
    return Palette(types.values())


def _leaf_maker(make: Callable[[Wiring], Node] | None, answers: Answers) -> Callable[[Wiring], Node]:
    def leaf(wiring: Wiring) -> Node:
        return ScriptedLeaf(wiring, answers) if make is None or wiring.name in answers.script else make(wiring)

    return leaf


def _uses(files: TreeFiles) -> dict[str, list[Element]]:
    """Return the elements of each type of node in the files."""
    uses: dict[str, list[Element]] = {}
    for tree in files.trees.values():
        for element in tree.iterate():
            if element is not tree and element.tag != SUBTREE and type_name(element):
                uses.setdefault(type_name(element), []).append(element)
    return uses


def _guessed(name: str, uses: Collection[Element]) -> NodeType:
    """Return a type by what its uses in files show."""
    ports = dict.fromkeys(attribute for use in uses for attribute in use.attributes if is_port(attribute))
    return node_type(name, category_of(name, uses), [Port(port, direction=Direction.INOUT) for port in ports])
