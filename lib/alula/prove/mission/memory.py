"""The memory of a mission between two ticks as one value: taken out of the engine's own nodes, and put back into them."""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Mapping
from dataclasses import dataclass
from typing import NamedTuple

from alula.missions.director import Director, DirectorMemory, End, Outcome
from alula.missions.filed.skills import SkillNode
from alula.model.model import Skillset
from alula.prove.mission.ahead import Ahead, Looking
from alula.prove.mission.moments import Later, Moment, thawed
from alula.prove.mission.oracle import UndecidedError
from alula.prove.mission.reading import ANOTHER, Read
from alula.prove.mission.robot import Handle, Memory, Robot
from alula.prove.mission.unknown import UNKNOWN, Unknown, UnknownNumber, UnknownText, is_unknown
from alula.trees.node import Node
from alula.trees.status import IDLE, RUNNING, Skipped, Status
from alula.trees.tree import Tree

SEEN = "_seen"
LEFT = "_left"
COUNTS = {LEFT: "the attempts left", "_count": "the rounds", "_retries": "the retries"}
"""Attributes of nodes that count: what is left of a number of attempts, or what there was."""
FEW = 2
PLAIN = frozenset({type(None), bool, int, float, str, Status, Skipped, Unknown})
"""Types whose values are kept as they are."""


class TreeMemory(NamedTuple):
    """All that the next tick hangs on besides the managers. ``held`` are the leaves whose executions it hangs on."""

    phase: str
    end: Outcome | None
    started: bool
    waits: Hashable
    stops: bool
    nodes: tuple[Hashable, ...]
    boards: tuple[Hashable, ...]
    leaves: tuple[tuple[int, bool], ...]
    pending: tuple[int, ...]
    first_failure: str
    ends: frozenset[str]

    @property
    def held(self) -> frozenset[int]:
        """The leaves whose executions the tree still hangs on."""
        return frozenset((*(leaf for leaf, _ in self.leaves), *self.pending))


@dataclass(frozen=True)
class Body:
    """The parts of a mission that have a memory."""

    robot: Robot
    director: Director
    board: Memory
    trees: tuple[Tree, ...]
    skillsets: Mapping[str, Skillset]
    read: Read
    few: int = FEW
    """Up to how many attempts and rounds are counted exactly."""

    def nodes(self) -> list[Node]:
        """Return all nodes, tree by tree."""
        return [node for tree in self.trees for node in tree.nodes]


class Keeper:
    """Takes the memory out of a mission, and puts it back."""

    def __init__(self, body: Body) -> None:
        self._body = body
        self._nodes = [(node, node.remembers, node.remembers_running) for node in body.nodes()]
        self.leaves = [node for node in body.nodes() if isinstance(node, SkillNode)]
        self._boards = [subtree.blackboard for tree in body.trees for subtree in tree.subtrees]
        self._looking = Looking(body.trees, body.read)
        self._known: dict[tuple[str, bool, tuple[Hashable, ...]], tuple[tuple[Hashable, ...], Ahead]] = {}
        self._places: list[tuple[tuple[str, ...], int, int]] = []
        for _, names, while_running in self._nodes:
            start = self._places[-1][2] if self._places else 0
            self._places.append((("status", *names, *while_running), start, start + 1 + len(names) + len(while_running)))
        self._first = tuple(self._values())

    # --- out ---------------------------------------------------------------------------------------------------------

    def take(self) -> TreeMemory:
        """Return the memory: of one that is over how it has ended, else what anything that can still be ticked tells apart."""
        director, board = self._body.director.memory, self._body.board
        started = director.start_s is not None
        if director.end is not None:
            outcome = director.end.outcome
            return TreeMemory(director.phase, outcome, started, None, director.stops, self._first, (), (), (), "", frozenset())
        nodes, ahead = self._looked(director.phase, director.stops, tuple(self._values()))
        first = board.failures[0].skill if board.failures and ahead.first else ""
        return TreeMemory(
            director.phase,
            None,
            started,
            _frozen(director.wait_until_s) if director.phase == "_wait" else None,
            director.stops,
            nodes,
            tuple(self._entries(number, ahead) for number in range(len(self._boards))),
            tuple((number, node.leaf.interrupted) for number, node in enumerate(self.leaves) if _follows(node, ahead)),
            tuple(sorted(one.leaf for one in board.pending.handles if isinstance(one, Handle))),
            first,
            ahead.ends.intersection(one.result for one in board.failures),
        )

    def _looked(self, phase: str, stops: bool, values: tuple[Hashable, ...]) -> tuple[tuple[Hashable, ...], Ahead]:  # noqa: FBT001
        """Return the values of the nodes, those of nodes that are not ticked any more as at first, and what is ahead."""
        key = (phase, stops, values)
        if key not in self._known:
            by_node = [dict(zip(names, values[start:end], strict=True)) for names, start, end in self._places]
            ahead = self._looking.ahead(phase, stops=stops, values=by_node)
            kept = list(values)
            for number, (_, start, end) in enumerate(self._places):
                if number and number not in ahead.nodes and values[start] is not RUNNING:  # the root's status says how it ended
                    kept[start:end] = self._first[start:end]
            self._known[key] = tuple(kept), ahead
        return self._known[key]

    def _values(self) -> Iterator[Hashable]:
        for node, names, while_running in self._nodes:
            yield node.status
            for name in names:
                yield self._seen(node) if name == SEEN else self._kept(node, name)
            for name in while_running:
                yield None if node.status is IDLE else self._kept(node, name)

    def _kept(self, node: Node, name: str) -> Hashable:
        """Return an attribute; counts of attempts and rounds are kept up to a few: from then on there may be more, or not."""
        value = getattr(node, name)
        if name not in COUNTS or not isinstance(value, int | float):
            return _frozen(value)
        if not isinstance(value, UnknownNumber) and value <= self._body.few:
            return _frozen(value)
        least = value.low if isinstance(value, UnknownNumber) else float(value)
        low = max(1.0, min(least, self._body.few - 1.0)) if name == LEFT else self._body.few + 1.0
        return _frozen(UnknownNumber(self._body.robot.oracle, f"{COUNTS[name]} of '{node.name}'", low))

    @staticmethod
    def _seen(node: Node) -> bool:
        entry = node.entry("entry")
        return bool(getattr(node, SEEN) == (0 if entry is None else entry.sequence))

    def _entries(self, number: int, ahead: Ahead) -> Hashable:
        entries = self._boards[number].entries()
        return tuple((name, entries[name].type, _frozen(self._needed(name, entries[name].value, ahead))) for name in sorted(entries))

    def _needed(self, name: str, value: object, ahead: Ahead) -> object:
        """Return what is kept of an entry's value: its kind where it is computed with or text is written over it, else nothing."""
        if ahead.everything or name in ahead.kept:
            return self._body.read.value(name, value)
        if value is None or not (name in ahead.named or (name in ahead.written and isinstance(value, str))):
            return None
        return self._body.read.kind(name, value)

    @property
    def unknown(self) -> bool:
        """Tell whether there is a value on the mission's blackboard that the search does not know."""
        return any(
            entry.value == ANOTHER if type(entry.value) is str else is_unknown(entry.value)
            for board in self._boards
            for entry in board.entries().values()
        )

    # --- back --------------------------------------------------------------------------------------------------------

    def put(self, memory: TreeMemory) -> None:
        """Put a memory back."""
        body = self._body
        body.robot.begin()
        body.director.recall(
            DirectorMemory(
                memory.phase,
                None if memory.end is None else End(memory.end),
                0.0 if memory.started else None,
                self._thawed(memory.waits),  # type: ignore[arg-type]
                memory.stops,
            )
        )
        for number, frozen in enumerate(memory.boards):
            self._boards[number].recall({name: (kind, self._thawed(value)) for name, kind, value in frozen})  # type: ignore[attr-defined]
        self._put_nodes(memory)
        body.board.recall_failures(memory.first_failure, memory.ends)
        handles = {leaf: self._handle(leaf) for leaf in memory.held}
        interrupted = dict(memory.leaves)
        for number, node in enumerate(self.leaves):
            node.leaf.recall(handles.get(number) if number in interrupted else None, interrupted=interrupted.get(number, False))  # type: ignore[arg-type]
        body.board.pending.recall(
            (handles[leaf].skillset, handles[leaf], self.leaves[leaf].leaf.halt_waits)  # type: ignore[misc]
            for leaf in memory.pending
        )

    def _put_nodes(self, memory: TreeMemory) -> None:
        values = iter(memory.nodes)
        for node, names, of_run in self._nodes:
            status = next(values)
            node.status = status  # type: ignore[assignment]
            for name in names:
                value = next(values)
                if name == SEEN:
                    entry = node.entry("entry")
                    setattr(node, SEEN, (0 if entry is None else entry.sequence) if value else -1)
                else:
                    setattr(node, name, self._thawed(value))
            for name in of_run:
                value = next(values)
                if status is not IDLE:
                    setattr(node, name, self._thawed(value))

    def _handle(self, leaf: int) -> Handle:
        node = self.leaves[leaf]
        return Handle(self._body.robot, leaf, self._body.skillsets[node.skillset], node.model.name)

    def _thawed(self, value: Hashable) -> object:
        if type(value) is not tuple:
            return value
        match value:
            case ("list", tuple(items)):
                return [self._thawed(one) for one in items]
            case ("tuple", tuple(items)):
                return tuple(self._thawed(one) for one in items)
            case ("set", frozenset() as items):
                return set(items)
            case ("number", (str(what), float(low), float(high))):
                return UnknownNumber(self._body.robot.oracle, what, low, high)
            case ("text", str(what)):
                return UnknownText(self._body.robot.oracle, what)
            case (_, *_):
                return thawed(self._body.robot.oracle, value)
        return value


def _frozen(value: object) -> Hashable:
    if type(value) in PLAIN:  # nearly all are, and each tick asks of each node
        return value
    match value:
        case UnknownNumber():
            return ("number", value.frozen)
        case Moment() | Later() | UnknownText():
            return value.frozen
        case list():
            return ("list", tuple(_frozen(one) for one in value))
        case tuple():
            return ("tuple", tuple(_frozen(one) for one in value))
        case set():
            return ("set", frozenset(value))
        case dict():
            return UNKNOWN
    raise UndecidedError(f"a node remembers {value!r}, which the search can't keep")


def _follows(node: SkillNode, ahead: Ahead) -> bool:
    """Tell whether an execution of a leaf matters: of one that was left, where a script asks whether it still runs."""
    handle = node.leaf.handle
    if handle is None or node.status is RUNNING:
        return handle is not None
    return (ahead.everything or node.leaf.skill_name in ahead.followed) and not handle.done
