"""Ticks a tree without any robot: its leaves answer and write what a file says, and what they were asked is written down.

The file is `{"leaf name": ["RUNNING", "SUCCESS"], ...}`, or has sections besides (docs/how-to/ticking-trees.md): ``answers`` with that,
``entries`` that are on the blackboard beforehand, ``enums`` of scripts, ``stand_ins`` for nodes with children that only a program has.
"""

from __future__ import annotations

import json
import random
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from alula.common.errors import AlulaError
from alula.common.json_files import read_object
from alula.trees.attributes import is_port, node_name, type_name
from alula.trees.blackboard import Blackboard, Clock
from alula.trees.document import Attribute, Element
from alula.trees.enums import enums_of
from alula.trees.errors import TickError, did_you_mean
from alula.trees.factory import build_tree
from alula.trees.guessing import category_of
from alula.trees.node import Action, Control, Maker, Node, NodeConfig, TickableType, tickable
from alula.trees.node_type import CHILDREN, Category, NodeType, node_type
from alula.trees.ports import Direction, Port
from alula.trees.reading import TreeFiles
from alula.trees.registry import NodeRegistry
from alula.trees.standard import standard_registry
from alula.trees.status import ANSWERS, FAILURE, IDLE, NAMES, RUNNING, SUCCESS, Answer, Status
from alula.trees.structure import is_slip, missing_trees, verify
from alula.trees.tree import Tree
from alula.trees.values import literal

TICK_NS = 100_000_000
"""Mission clock from one tick to the next, as where a robot is: 10 Hz."""
SUBTREE = "SubTree"
MISSING = "in none of the files"
"""The type of the leaf that stands for a tree."""
NO_CHILDREN = CHILDREN[Category.ACTION]
WORDS = {name: answer for name, answer in ANSWERS.items() if answer is not IDLE}
ANY_WORD = "ANY"
"""An answer that chance gives, by the seed."""
OTHERS = "*"
"""The name of all leaves that the answers do not name."""
SECTIONS = ("answers", "entries", "enums", "stand_ins")
PASS_THROUGH, RETRY = "pass-through", "retry"
FORM = '{"leaf name": ["RUNNING", "SUCCESS"], ...}'
STEP = '{"answer": "SUCCESS", "outputs": {"port": 1}}'


class AnswersError(AlulaError):
    """A file of answers is wrong, or does not fit the tree; the message names it and says what to write."""


@dataclass(frozen=True)
class Step:
    """What a leaf does in one tick: ``answer`` None is any that chance gives; ``outputs`` are written to its ports."""

    answer: Answer | None
    outputs: Mapping[str, object] = field(default_factory=dict)


@dataclass(frozen=True)
class Change:
    """A node that has another status after a tick's step than before; ``path`` as BehaviorTree.CPP has it."""

    path: str
    before: str
    after: str

    def as_text(self) -> str:
        """Return it for people."""
        return f"{self.path}: {self.before} -> {self.after}"


@dataclass(frozen=True)
class Tick:
    """One tick.

    Attributes:
        number: from 1.
        root: what the root answered.
        calls: what each leaf was asked: ("start" | "tick" | "halt", its name).
        changes: of statuses, in their order: answers and halts.
        written: the entries of the main blackboard that have another value than before.
    """

    number: int
    root: str
    calls: Sequence[tuple[str, str]]
    changes: Sequence[Change] = ()
    written: Mapping[str, object] = field(default_factory=dict)

    def as_json(self, *, trace: bool = False) -> str:
        """Return the line that tells of it; with ``trace`` also changes, and what was written."""
        told: dict[str, object] = {"tick": self.number, "root": self.root, "calls": self.calls}
        if trace:
            told |= {"changes": [[one.path, one.before, one.after] for one in self.changes], "written": self.written}
        return json.dumps(told, default=str)

    def as_text(self, *, trace: bool = False) -> str:
        """Return a line for people; with ``trace`` also a line for each change, and for each entry that was written."""
        lines = [f"tick {self.number}: {self.root}" + "".join(f", {call} {leaf}" for call, leaf in self.calls)]
        if trace:
            lines += [f"  {one.as_text()}" for one in self.changes]
            lines += [f"  {name} := {json.dumps(value, default=str)}" for name, value in self.written.items()]
        return "\n".join(lines)


@dataclass
class Answers:
    """What leaves answer, by their names: one answer a tick of the leaf, the last one from then on."""

    script: Mapping[str, Sequence[Answer | Step]]
    calls: list[tuple[str, str]] = field(default_factory=list)
    entries: Mapping[str, object] = field(default_factory=dict)
    enums: Mapping[str, float] = field(default_factory=dict)
    stand_ins: Mapping[str, str] = field(default_factory=dict)
    """What ticks nodes with children that only a program has, by their types: a node of BehaviorTree.CPP, pass-through, or retry."""
    seed: int = 0
    _given: dict[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Have chance begin as the seed says."""
        self._chance = random.Random(self.seed)  # noqa: S311 - no secret: a run that can be had again

    def of(self, name: str) -> Sequence[Answer | Step] | None:
        """Return what a leaf answers, None where the file does not name it."""
        return self.script.get(name, self.script.get(OTHERS))

    def next(self, leaf: Node, call: str) -> Step:
        """Return what a leaf does next; raises TickError where the file has nothing for it."""
        script = self.of(leaf.name)
        if script is None:
            cure = f'add "{leaf.name}": ["SUCCESS"], or "{OTHERS}": ["{ANY_WORD}"] for all others'
            raise TickError(f"{leaf.place()}: the answers say nothing of '{leaf.name}'; {cure}")
        number = self._given.get(leaf.name, 0)
        self._given[leaf.name] = number + 1
        self.calls.append((call, leaf.name))
        step = script[min(number, len(script) - 1)]
        step = step if isinstance(step, Step) else Step(step)
        return step if step.answer is not None else replace(step, answer=self._any(leaf))

    def _any(self, leaf: Node) -> Answer:
        is_condition = leaf.config.type.category is Category.CONDITION
        return self._chance.choice((SUCCESS, FAILURE) if is_condition else (RUNNING, SUCCESS, FAILURE))


def read_answers(path: Path, seed: int = 0) -> Answers:
    """Read a file of answers, with or without sections; ``seed`` is of those that chance gives. Raises AnswersError."""
    content = read_object(path, AnswersError, FORM)
    if not any(isinstance(value, dict) for value in content.values()):
        return Answers(_scripts(content, str(path)), seed=seed)
    parts: dict[str, dict[str, object]] = {name: {} for name in SECTIONS}
    for name, value in content.items():
        if name not in SECTIONS:
            raise AnswersError(f"{path}: '{name}' is no section; there are {', '.join(SECTIONS)}")
        if not isinstance(value, dict):
            raise AnswersError(f"{path}: the section '{name}' is no object")
        parts[name] = value
    for name, value in parts["stand_ins"].items():
        if not isinstance(value, str):
            raise AnswersError(f"{path}: stand_ins: '{name}' is {json.dumps(value)}; write {_stands()}")
    stand_ins = {name: str(value) for name, value in parts["stand_ins"].items()}
    enums = enums_of(parts["enums"], f"{path}: enums", AnswersError)
    return Answers(_scripts(parts["answers"], str(path)), entries=parts["entries"], enums=enums, stand_ins=stand_ins, seed=seed)


def _stands() -> str:
    return f'"{PASS_THROUGH}", "{RETRY} 3", or the name of a node of BehaviorTree.CPP, as "Fallback"'


def _scripts(content: Mapping[str, object], where: str) -> dict[str, list[Answer | Step]]:
    return {name: _script(words, f"{where}: '{name}'") for name, words in content.items()}


def _script(words: object, where: str) -> list[Answer | Step]:
    if not isinstance(words, list) or not words:
        raise AnswersError(f'{where}: is no list of answers; write ["RUNNING", "SUCCESS"]')
    return [_step(word, where) for word in words]


def _step(said: object, where: str) -> Step:
    word, outputs = (said.get("answer"), said.get("outputs", {})) if isinstance(said, dict) else (said, {})
    if isinstance(said, dict) and (set(said) - {"answer", "outputs"} or not isinstance(outputs, dict)):
        raise AnswersError(f"{where}: {json.dumps(said)} is no answer; write {STEP}")
    if not isinstance(word, str) or word not in (*WORDS, ANY_WORD):
        raise AnswersError(f"{where}: {json.dumps(word)} is no answer; there are {', '.join(WORDS)}, {ANY_WORD}")
    return Step(WORDS.get(word), outputs)


class ScriptedLeaf(Action):
    """A leaf that answers and writes what a script says."""

    def __init__(self, config: NodeConfig, answers: Answers) -> None:
        super().__init__(config)
        self._answers = answers

    def setup(self) -> None:
        """Refuse outputs that the node has no port for."""
        for step in self._answers.of(self.name) or ():
            for port in step.outputs if isinstance(step, Step) else ():
                known = self.config.type.ports.get(port)
                outputs = [one.name for one in self.config.type.ports.values() if one.direction is not Direction.INPUT]
                if known is None or port not in outputs:
                    cure = did_you_mean(port, outputs) or f"its outputs are {', '.join(outputs) or 'none'}"
                    raise AnswersError(f"the answers have '{self.name}' write the port '{port}', which is no output of it; {cure}")

    def on_start(self) -> Answer:
        """Do the next step."""
        return self._do("start")

    def on_running(self) -> Answer:
        """Do the next step."""
        return self._do("tick")

    def on_halted(self) -> None:
        """Write it down."""
        self._answers.calls.append(("halt", self.name))

    def _do(self, call: str) -> Answer:
        step = self._answers.next(self, call)
        for port, value in step.outputs.items():
            type_ = self.config.type.ports[port].type
            try:
                self.put(port, type_.parse(value) if isinstance(value, str) else type_.read(value))
            except ValueError as error:
                raise TickError(f"{self.place()}: the answers write the port '{port}': {error}") from None
        assert step.answer is not None  # noqa: S101 - `next` has chosen
        return step.answer


class PassThrough(Control):
    """Answers what its only child answers."""

    def update(self) -> Answer:
        """Tick the child."""
        answer = self.children[0].execute()
        if isinstance(answer, Status) and answer is not RUNNING:
            self.reset_children()
        return answer


class UnknownNode(Control):
    """A node with children of which only its place in the file is known: it can be drawn."""

    def update(self) -> Answer:
        """Raise TickError."""
        name = self.config.type.name
        stands = f'say in the answers what stands in: "stand_ins": {{"{name}": ...}} with {_stands()}'
        raise TickError(f"{self.place()}: nothing here ticks a '{name}'; {stands}")


def scripted_tree(
    files: TreeFiles, registry: NodeRegistry, answers: Answers, clock: Clock, enums: Mapping[str, float] | None = None
) -> Tree:
    """Build a tree of any file: what the registry does not know is an action, or with children what stands in for it, or can be drawn.

    A tree that is in none of the files is one leaf of its name (`structure.missing_trees` tells them), unless that name is a slip.
    By the script answer the leaves that it names, and all that only a robot could make. ``enums`` are the numbers of names in scripts.
    On the blackboard are the answers' entries, and the defaults that the model of the main tree has for its inputs.

    Raises:
        AnswersError: it names what is no leaf of the tree, no output of a leaf, or what can't stand in.
        TreeError: something is wrong in a file.
    """
    files = _whole(files)
    board = Blackboard(clock)
    model = files.models.get(files.main)
    for port in () if model is None else model.ports.values():
        if port.direction is Direction.INPUT and port.default is not None and port.name not in answers.entries:
            board.set(port.name, literal(port.default))
    for name, value in answers.entries.items():
        board.set(name, value)
    known = {**(enums or {}), **answers.enums}
    scripted = _scripted(files, registry, answers)
    verify(files, NodeRegistry({**{one.name: one for one in scripted}, **{one.name: one for one in registry}}.values()), of_others=True)
    tree = build_tree(files, scripted, clock, enums=known, blackboard=board)
    leaves = {node.name for node in tree.nodes if not node.children}
    for name in answers.script:
        if name not in leaves and name != OTHERS:
            cure = did_you_mean(name, leaves) or f"its leaves are {', '.join(sorted(leaves))}"
            raise AnswersError(f"the answers name '{name}', which is no leaf of the tree; {cure}")
    return tree


def ticks(tree: Tree, answers: Answers, count: int, clock: StepClock) -> Iterator[Tick]:
    """Tick a tree; raises TreeError when it can't be."""
    changes: list[Change] = []

    def note(node: Node, before: Answer, after: Answer) -> None:
        if after is not IDLE or before is RUNNING:  # what has ended is reset by its parent, which tells nothing
            changes.append(Change(node.config.path, NAMES[before], NAMES[after]))

    unwatch = tree.watch(note)
    known = dict(tree.blackboard.values())
    try:
        for number in range(1, count + 1):
            clock.step()
            answer = tree.tick()
            now = tree.blackboard.values()
            written = {name: value for name, value in now.items() if name not in known or known[name] != value}
            known = dict(now)
            yield Tick(number, NAMES[answer], tuple(answers.calls), tuple(changes), written)
            answers.calls.clear()
            changes.clear()
    finally:
        unwatch()


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


def _scripted(files: TreeFiles, registry: NodeRegistry, answers: Answers) -> NodeRegistry:
    types = {one.name: one for one in registry}
    for name, uses in _uses(files).items():
        if name in files.trees and name not in types:
            continue  # a mistake, told when the tree is made
        known = types.get(name) or _guessed(name, uses)
        if known.children != NO_CHILDREN:
            types[name] = known if known.is_tickable and name not in answers.stand_ins else _standing_in(known, uses, answers)
        elif not known.is_tickable or any(node_name(use) in answers.script for use in uses):
            types[name] = tickable(known, _leaf_maker(known, answers))
    for name in answers.stand_ins:
        if name not in types or types[name].children == NO_CHILDREN:
            having = [
                one.name
                for one in types.values()
                if one.children != NO_CHILDREN and isinstance(one, TickableType) and one.make is UnknownNode
            ]
            cure = did_you_mean(name, having) or f"those that nothing ticks are {', '.join(sorted(having)) or 'none'}"
            raise AnswersError(f"stand_ins: the tree has no node with children of the type '{name}'; {cure}")
    return NodeRegistry(types.values())


def _standing_in(known: NodeType, uses: Collection[Element], answers: Answers) -> NodeType:
    """Return a type with children whose nodes are ticked as the answers say, else not at all."""
    said = answers.stand_ins.get(known.name, "")
    if not said:
        return tickable(known, UnknownNode)
    other = _stand_in(said)
    if other is None:
        raise AnswersError(f"stand_ins: '{said}' can't stand in for {known.name}; write {_stands()}")
    least, most = other.children
    for use in uses:
        count = len(use.children)
        if count < least or (most is not None and count > most):
            wanted = f"{least}" if least == most else f"{least} to {'any number' if most is None else most}"
            raise AnswersError(f"stand_ins: {said} takes {wanted} children, and {known.name} has {count} at {use.place}")
    return replace(tickable(known, other.make), ports={**known.ports, **other.ports})


def _stand_in(said: str) -> TickableType | None:
    """Return the type that a stand-in names, None where it names none with children."""
    if said == PASS_THROUGH:
        return TickableType(PASS_THROUGH, Category.DECORATOR, {}, "", (1, 1), make=PassThrough)
    retry = re.fullmatch(rf"{RETRY} ([1-9]\d*|-1)", said)
    other = standard_registry().get("RetryUntilSuccessful" if retry else said)
    if not isinstance(other, TickableType) or other.children == NO_CHILDREN:
        return None
    ports = {one.name: replace(one, default=retry[1]) if retry and one.name == "num_attempts" else one for one in other.ports.values()}
    return replace(other, ports=ports)


def _leaf_maker(known: NodeType, answers: Answers) -> Maker:
    def leaf(config: NodeConfig) -> Node:
        if isinstance(known, TickableType) and config.name not in answers.script:
            return known.make(config)
        return ScriptedLeaf(config, answers)

    return leaf


def _whole(files: TreeFiles) -> TreeFiles:
    """Return files with a tree of one leaf for each that is in none of them; the leaf has the ports that uses give the tree."""
    added: dict[str, Element] = {}
    for name, uses in missing_trees(files).items():
        if is_slip(name, files.trees):
            continue  # which is told when the tree is built
        place = uses[0].place
        ports = dict.fromkeys(attribute for use in uses for attribute in use.attributes if is_port(attribute))
        attributes = {"name": Attribute("name", name, place), **{port: Attribute(port, f"{{{port}}}", place) for port in ports}}
        leaf = Element(MISSING, place, attributes, empty=True)  # as no file can call a node
        added[name] = Element("BehaviorTree", place, {"ID": Attribute("ID", name, place)}, [leaf])
    return replace(files, trees={**files.trees, **added})


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
