"""The memory of a mission between two ticks as one value: taken out of the engine's own nodes, and put back into them."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import dataclass
from itertools import compress
from operator import ne
from typing import NamedTuple

from alula.missions.director import Director, DirectorMemory, MissionResult, Outcome
from alula.missions.skills import SkillNode
from alula.model.model import Skillset
from alula.prove.mission.ahead import RUNS, Ahead, Looking
from alula.prove.mission.live import Live, Liveness, leaf_place
from alula.prove.mission.moments import Later, Moment, Thawing, numbered
from alula.prove.mission.oracle import UndecidedError
from alula.prove.mission.own import MOST, Run
from alula.prove.mission.reading import ANOTHER, Read
from alula.prove.mission.robot import Handle, Robot, SummaryContext
from alula.prove.mission.touched import Touched, TouchedEntries
from alula.prove.mission.unknown import Unknown, UnknownItems, UnknownNumber, UnknownText, is_unknown
from alula.trees.access import Key
from alula.trees.blackboard import Entry
from alula.trees.node import Count, Node
from alula.trees.status import IDLE, RUNNING, Skipped, Status
from alula.trees.tree import Tree
from alula.trees.values import ANY, STRING, PortType

FEW = 2
STATUS_OF = {one.value: one for one in Status}
TAKE_TEXT = (STRING, ANY)
"""Types of entries that any text can be written into."""
Frozen = tuple[str, PortType, Hashable]
"""An entry of a memory: its name, type and value."""
PLAIN = frozenset({type(None), bool, int, float, str, Status, Skipped})
"""Types whose values are kept as they are."""


class _Value(NamedTuple):
    """Which value of a memory is which: a node's status, at ``start``, or an attribute, which counts only while it runs or at any time.

    ``watched`` is the port whose entry's writings it has the number of.
    """

    node: Node
    name: str
    start: int
    while_running: bool
    watched: str = ""


class _Remembered(NamedTuple):
    """What a node remembers: at any time ``names``, while it runs ``all_names``; ``not_as_is`` are kept by another value than theirs."""

    node: Node
    names: tuple[str, ...]
    all_names: tuple[str, ...]
    counts: Mapping[str, Count]
    not_as_is: frozenset[str]

    @classmethod
    def of(cls, node: Node) -> _Remembered:
        """Read the description of its class."""
        counts = {one.attribute: one for one in node.counts}
        return cls(node, node.remembers, (*node.remembers, *node.remembers_running), counts, frozenset({*counts, *node.watches}))


class TreeMemory(NamedTuple):
    """All that the next tick depends on besides the managers. ``held`` are the leaves whose executions it depends on."""

    phase: str
    end: Outcome | None
    started: bool
    waits: Hashable
    stops: bool
    nodes: tuple[Hashable, ...]
    boards: tuple[tuple[Frozen, ...], ...]
    leaves: tuple[tuple[int, bool], ...]
    first_failure: str
    ends: frozenset[str]

    @property
    def held(self) -> frozenset[int]:
        """The leaves whose executions the tree still depends on."""
        return frozenset(leaf for leaf, _ in self.leaves)


class Looked(NamedTuple):
    """What can still matter of a mission: the values of its nodes, what is ahead, and what is live.

    ``entries``: what is kept of entries that are as before.
    """

    nodes: tuple[Hashable, ...]
    ahead: Ahead
    live: Live | None
    entries: dict[Hashable, Frozen]


@dataclass(frozen=True)
class Body:
    """The parts of a mission that have a memory."""

    robot: Robot
    director: Director
    board: SummaryContext
    trees: tuple[Tree, ...]
    skillsets: Mapping[str, Skillset]
    read: Read
    few: int = FEW
    """Up to how many attempts and rounds are counted exactly."""

    def nodes(self) -> list[Node]:
        """Return all nodes, tree by tree."""
        return [node for tree in self.trees for node in tree.nodes]


class Keeper:
    """Takes the memory out of a mission's nodes, and puts it back."""

    def __init__(self, body: Body) -> None:
        self._body = body
        self._nodes = [_Remembered.of(node) for node in body.nodes()]
        self.leaves = [node for node in body.nodes() if isinstance(node, SkillNode)]
        self._boards = list(dict.fromkeys(subtree.blackboard for tree in body.trees for subtree in tree.subtrees))
        self._looking = Looking(body.trees, body.read)
        self._living = Liveness(body.trees, self._looking)
        self._known: dict[tuple[str, bool, tuple[Hashable, ...]], Looked] = {}
        self.looked: Looked | None = None
        """What can still matter of the memory that was taken last; None where the mission is over."""
        self.touched = Touched(lambda: len(body.robot.oracle.asked))
        """What the tick from the memory that was put back last has looked at."""
        self._places: list[tuple[tuple[str, ...], int, int]] = []
        self._values_of: list[_Value] = []
        for node, names, all_names, _, _ in self._nodes:
            start = len(self._values_of)
            self._values_of.append(_Value(node, "status", start, while_running=False))
            self._values_of += [_Value(node, name, start, name not in names, node.watches.get(name, "")) for name in all_names]
            self._places.append((("status", *all_names), start, len(self._values_of)))
        self._always = [at for at, one in enumerate(self._values_of) if one.watched or one.while_running]
        self._thawing = Thawing(body.robot.oracle)
        self._first = self._left = self._values()[0]

    # --- out ---------------------------------------------------------------------------------------------------------

    def take(self) -> TreeMemory:
        """Return the memory: the end of a mission that is over, else all values that a node that can still be ticked distinguishes."""
        director, board = self._body.director.memory, self._body.board
        started = director.start_s is not None
        self._left, moments = self._values()
        self.touched.end()
        if director.end is not None:
            self.looked = None
            outcome = director.end.outcome
            return TreeMemory(director.phase, outcome, started, None, director.stops, self._first, (), (), "", frozenset())
        self.looked = self._looked(director.phase, director.stops, self._left)
        nodes, ahead, live, _ = self.looked
        first = board.failures[0].skill if board.failures and ahead.first else ""
        return TreeMemory(
            director.phase,
            None,
            started,
            _frozen(director.wait_until_s) if director.phase == "_wait" else None,
            director.stops,
            numbered(nodes, moments) if len(moments) > 1 else nodes,
            tuple(self._entries(number, ahead, live) for number in range(len(self._boards))),
            tuple((number, node.leaf.interrupted) for number, node in enumerate(self.leaves) if self._follows(number, node, ahead, live)),
            first,
            ahead.ends.intersection(one.result for one in board.failures),
        )

    def leave(self) -> None:
        """Record the nodes' values as those of a memory that was put back, where no tick followed."""
        self._left = self._values()[0]
        self.touched.end()

    def kept(self, number: int, entry: Frozen, looked: Looked) -> Frozen:
        """Return what the memory keeps of an entry that a tick has not changed, with what is ahead after the tick."""
        key = (number, *exact(entry))
        if key not in looked.entries:
            name, kind, value = entry
            thawed = Entry(kind)
            thawed.value = self._thawed(value)
            looked.entries[key] = self._entry(number, name, thawed, looked.ahead, looked.live)
        return looked.entries[key]

    def _looked(
        self,
        phase: str,
        stops: bool,  # noqa: FBT001
        values: tuple[Hashable, ...],
    ) -> Looked:
        """Return the values of the nodes, those of nodes that are not ticked any more as at first, what is ahead, and what is live."""
        key = (phase, stops, values)
        if key not in self._known:
            by_node = [dict(zip(names, values[start:end], strict=True)) for names, start, end in self._places]
            ahead = self._looking.ahead(phase, stops=stops, values=by_node)
            kept = list(values)
            for number, (_, start, end) in enumerate(self._places):
                if number and number not in ahead.nodes and values[start] != RUNS:  # the root's status says how it ended
                    kept[start:end] = self._first[start:end]
            live = None if ahead.everything else self._living.live(phase, stops=stops, values=dict(enumerate(by_node)))
            self._known[key] = Looked(tuple(kept), ahead, live, {})
        return self._known[key]

    def _values(self) -> tuple[tuple[Hashable, ...], dict[int, tuple[str, Moment | Later]]]:
        """Return the values of the nodes, and by their places what was a moment, with its name."""
        values: list[Hashable] = []
        moments: dict[int, tuple[str, Moment | Later]] = {}
        for node, names, all_names, counts, not_as_is in self._nodes:
            status = node.status
            values.append(status._value_)  # the hash of an Enum takes long, and each memory has hundreds
            for name in names if status is IDLE else all_names:
                value = getattr(node, name)
                exact = type(value) is int and isinstance(node, Run)
                if type(value) in PLAIN and name not in not_as_is and not exact:  # nearly all
                    values.append(value)
                    continue
                if isinstance(value, Moment | Later):
                    moments[len(values)] = name, value
                values.append(self._seen(node, name) if name in node.watches else self._kept(node, name, counts.get(name)))
            if status is IDLE and names is not all_names:
                values += [None] * (len(all_names) - len(names))
        return tuple(values), moments

    def _kept(self, node: Node, name: str, count: Count | None) -> Hashable:
        """Return an attribute; counts of attempts and rounds are kept up to a few: from then on there may be more, or not."""
        value = getattr(node, name)
        if isinstance(node, Run):
            return _exactly(node, name, value)
        if count is None or not isinstance(value, int | float):
            return _frozen(value)
        if not isinstance(value, UnknownNumber) and value <= self._body.few:
            return _frozen(value)
        least = value.low if isinstance(value, UnknownNumber) else float(value)
        low = max(1.0, min(least, self._body.few - 1.0)) if count.down else self._body.few + 1.0
        return _frozen(UnknownNumber(self._body.robot.oracle, f"{count.what} of '{node.name}'", low))

    @staticmethod
    def _seen(node: Node, name: str) -> bool:
        entry = node.entry(node.watches[name])
        return bool(getattr(node, name) == (0 if entry is None else entry.sequence))

    def _entries(self, number: int, ahead: Ahead, live: Live | None) -> tuple[Frozen, ...]:
        entries = self._boards[number].entries()
        return tuple(self._entry(number, name, entries[name], ahead, live) for name in sorted(entries))

    def _entry(self, number: int, name: str, entry: Entry, ahead: Ahead, live: Live | None) -> Frozen:
        return name, entry.type, _frozen(self._needed((self._boards[number], name), entry, ahead, live))

    def _follows(self, number: int, node: SkillNode, ahead: Ahead, live: Live | None) -> bool:
        """Return whether an execution of a leaf matters: of one that was left, where a script asks whether it still runs."""
        handle = node.leaf.handle
        if handle is None or node.status is RUNNING:
            return handle is not None
        asked = ahead.everything or (node.leaf.skill_name in ahead.followed and (live is None or leaf_place(number) in live.texts))
        return asked and not handle.done

    def _needed(self, name: Key, entry: Entry, ahead: Ahead, live: Live | None) -> object:
        """Return what is kept of an entry's value: its kind where it is computed with or text is written over it, else nothing."""
        value = entry.value
        if live is not None and name not in live.texts:
            over = name in ahead.written and isinstance(value, str) and entry.type not in TAKE_TEXT
            return self._body.read.kind(name, value) if over else None
        if ahead.everything or name in ahead.kept:
            kept = self._body.read.value(name, value)
            return kept if live is None or type(kept) is not str else live.text(name, kept)
        if value is None or not (name in ahead.named or (name in ahead.written and isinstance(value, str))):
            return None
        return self._body.read.kind(name, value)

    @property
    def unknown(self) -> bool:
        """Return whether the mission's blackboard has a value that the search does not know."""
        return any(
            entry.value == ANOTHER if type(entry.value) is str else is_unknown(entry.value)
            for board in self._boards
            for entry in board.entries().values()
        )

    def inside(self) -> Hashable:
        """Return, in the middle of a tick, all that the rest of it depends on; reduce counted values to what is kept between two ticks."""
        for node, _, _, counts, _ in self._nodes:
            for name, count in counts.items():
                setattr(node, name, self._thawed(self._kept(node, name, count)))
        for board in self._boards:
            for name, entry in board.entries().items():
                if (board, name) in self._body.read.counted:
                    entry.value = self._body.read.value((board, name), entry.value)
        robot, told = self._body.robot, self._body.board
        first = told.failures[0].skill if told.failures else ""
        return (
            self._values()[0],
            tuple((name, one.type, _frozen(one.value)) for known in self._boards for name, one in sorted(known.entries().items())),
            tuple((getattr(one.leaf.handle, "fixed", ""), one.leaf.interrupted) for one in self.leaves),
            (first, frozenset(one.result for one in told.failures), told.reason),
            (tuple(robot.started), frozenset(robot.interrupted)),
        )

    # --- back --------------------------------------------------------------------------------------------------------

    def put(self, memory: TreeMemory) -> None:
        """Put a memory back."""
        body = self._body
        body.robot.begin()
        self._thawing = Thawing(body.robot.oracle)
        body.director.recall(
            DirectorMemory(
                memory.phase,
                None if memory.end is None else MissionResult(memory.end),
                0.0 if memory.started else None,
                self._thawed(memory.waits),  # type: ignore[arg-type]
                memory.stops,
            )
        )
        for number, frozen in enumerate(memory.boards):
            entries = {name: (kind, self._thawed(value)) for name, kind, value in frozen}
            self._boards[number].recall(entries, TouchedEntries(number, self.touched))
        self.touched.begin()
        self._put_nodes(memory)
        body.board.recall_failures(memory.first_failure, memory.ends)
        handles = {leaf: self._handle(leaf) for leaf in memory.held}
        interrupted = dict(memory.leaves)
        for number, node in enumerate(self.leaves):
            node.leaf.recall(handles.get(number) if number in interrupted else None, interrupted=interrupted.get(number, False))  # type: ignore[arg-type]

    def _put_nodes(self, memory: TreeMemory) -> None:
        """Put back what is not as the last tick has left it; values that ticks change inside are always put back."""
        values, left = memory.nodes, self._left
        changed = compress(range(len(values)), map(ne, values, left))
        inside = (at for at, kind in enumerate(map(type, values)) if kind is tuple)
        for at in {*changed, *inside, *self._always}:
            node, name, start, while_running, watched = self._values_of[at]
            value = values[at]
            if at == start:
                node.status = STATUS_OF[value]  # type: ignore[index]
            elif watched:
                entry = node.entry(watched)
                setattr(node, name, (0 if entry is None else entry.sequence) if value else -1)
            elif not while_running or values[start] != IDLE.value:
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
            case ("dict", tuple(items)):
                return {name: self._thawed(one) for name, one in items}
            case ("set", frozenset() as items):
                return set(items)
            case ("number", (str(what), float(low), float(high), bool(whole), frozenset() as others)):
                return UnknownNumber(self._body.robot.oracle, what, low, high, whole=whole, others=others)
            case ("text", str(what), frozenset() as others):
                return UnknownText(self._body.robot.oracle, what, others)
            case ("items", str(what), PortType() as item):
                return UnknownItems(self._body.robot.oracle, what, item)
            case ("any", str(what), bool(fits)):
                return Unknown(self._body.robot.oracle, what, fits=fits)
            case (_, *_):
                return self._thawing.moment(value)
        return value


def exact(entry: Frozen) -> tuple[Hashable, ...]:
    """Return the key by which entries are compared: numbers and truth values that are equal are not the same."""
    name, kind, value = entry
    return name, kind, value, repr(value) if isinstance(value, tuple) else type(value)


def _exactly(node: Node, name: str, value: object) -> Hashable:
    """Return what the class of a robot's own node remembers, as it is; raises UndecidedError where that can't be kept, or may grow."""
    if isinstance(value, dict) or is_unknown(value) or (isinstance(value, int) and abs(value) > MOST):
        what = f"grows beyond {MOST}" if isinstance(value, int) else f"is {value!r}, which the search can't keep"
        raise UndecidedError(f"{node.place()}: its `{name}` {what}")
    if isinstance(value, list | tuple | set):
        several = tuple(_exactly(node, name, one) for one in value)
        return (type(value).__name__, frozenset(several) if isinstance(value, set) else several)
    return _frozen(value)


def _frozen(value: object) -> Hashable:
    if type(value) in PLAIN:  # nearly all are, and each tick asks of each node
        return value
    match value:
        case UnknownNumber():
            return ("number", value.frozen)
        case Moment() | Later() | UnknownText() | UnknownItems() | Unknown():
            return value.frozen
        case list():
            return ("list", tuple(_frozen(one) for one in value))
        case tuple():
            return ("tuple", tuple(_frozen(one) for one in value))
        case set():
            return ("set", frozenset(value))
        case dict():
            return ("dict", tuple((name, _frozen(one)) for name, one in value.items()))
    raise UndecidedError(f"a node remembers {value!r}, which the search can't keep")
