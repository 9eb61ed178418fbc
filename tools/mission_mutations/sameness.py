"""Whether two missions do the same, shown by a bisimulation of all that they can do.

Both are searched side by side, as one: pairs of memories of their trees, with what the managers can be there. Between two ticks both must
have the same managers, which can do the same: starts, refusals, ends with their results, resources. A tick must ask for the same in both,
with the same managers, for the same answers of what nobody knows (one of both may ask less), tick the same of those nodes that write on
the blackboard or give inputs, and end the mission alike. A tick hangs on nothing else; so each run of one is a run of the other, step for
step.

Numbers and texts that the search does not know have no values here. So the nodes that write or read them must also be the same, in the same
order in the file, and what both need to start must be the same, in any order: it is told together. Otherwise nothing is claimed. Missions
that do the same may be told apart all the same: this shows sameness only.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Hashable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from alula.missions.mission_file import READY
from alula.missions.nodes import Needs
from alula.missions.skills import SkillNode
from alula.prove.mission.accepted import DESCRIPTION
from alula.prove.mission.oracle import Answer, Question
from alula.prove.mission.regions import Closure, Region, Regions, Sets
from alula.prove.mission.state import Event
from alula.prove.mission.system import System
from alula.prove.mission.ticking import TICK, Outcome
from alula.trees.access import scripts_of, written_entries
from alula.trees.attributes import type_name
from alula.trees.document import Attribute, Element
from alula.trees.node import Node
from alula.trees.ports import Direction
from alula.trees.reading import read_files
from alula.trees.script import statements_of
from alula.trees.script.syntax import Assignment, Literal, Name, walk

Products = tuple[frozenset[int], ...]
Key = tuple[str, str, int]
"""A skill, the name of the node that asks for it, and which of those of the same names."""


@dataclass(frozen=True)
class Edge:
    """A tick.

    ``target``: the region after it; ``asked``: what it asks for, and how the mission has ended after it; ``choices``: what nobody knows,
    with the answers; ``sets``: the managers of each skillset with which it is taken; ``shows``: the number of all else that it shows;
    ``quiet``: it asks for nothing, and the mission neither begins nor ends. ``way`` is the tick itself.
    """

    target: int
    shows: int
    asked: Hashable
    choices: Mapping[Question, Answer]
    sets: Products
    quiet: bool
    way: tuple[Outcome, Sets]

    def like(self, other: Edge) -> bool:
        """Return whether both ask for the same, with some managers that are the same, and the same answers of what nobody knows."""
        return self.asked == other.asked and self._meets(other)

    def unlike(self, other: Edge) -> bool:
        """Return whether the same managers and answers can lead to both, and they ask for something else, or end otherwise."""
        return self.asked != other.asked and self._meets(other)

    def _meets(self, other: Edge) -> bool:
        agree = all(other.choices.get(question, answer) == answer for question, answer in self.choices.items())
        return agree and all(a & b for a, b in zip(self.sets, other.sets, strict=True))


@dataclass(frozen=True)
class Move:
    """Something that happens in the managers of the skillset at ``place``, from these to others, by their numbers."""

    place: int
    managers: int
    event: Event
    after: int


@dataclass(frozen=True)
class Graph:
    """The regions: the ticks out of each, and what can happen in the managers of each."""

    edges: tuple[tuple[Edge, ...], ...]
    moves: tuple[Mapping[int, Move], ...]


def keys_of(system: System) -> list[Key]:
    """Return the names of the leaves, which another file may have at other numbers."""
    found: list[Key] = []
    for leaf in system.leaves:
        names = (f"{leaf.skillset}.{leaf.model.name}", leaf.name)
        found.append((*names, sum(key[:2] == names for key in found)))
    return found


class Shown:
    """Tells of missions what can be compared: what is the same has the same number in all of them."""

    def __init__(self) -> None:
        self._numbers: dict[Hashable, int] = {}

    def of(self, regions: Regions, path: Path) -> Seen:
        """Return what a mission's file shows, whose regions are all known."""
        return Seen(self, regions, path)

    def number(self, value: Hashable) -> int:
        """Return the number of a value."""
        return self._numbers.setdefault(value, len(self._numbers))


class Seen:
    """What can be seen of a mission.

    ``values`` are the nodes that deal in values, in the file's order; ``needs``: what the mission needs to start, in any order.
    """

    def __init__(self, shown: Shown, regions: Regions, path: Path) -> None:
        self.regions = regions
        self._number = shown.number
        self._system = regions.system
        self._keys = keys_of(regions.system)
        self._ports = {node.blackboard.where(key) for node in self._system.nodes for key in written_entries(node).values()}
        self._values = {number: value for number, node in enumerate(self._system.nodes) if (value := self._deals(node)) is not None}
        self.values = tuple(self._values.values())
        ready = read_files(path).trees.get(READY)
        needs = [_attributes(one) for one in ready.iterate()] if ready is not None else []
        self.needs = sorted(one for one in needs if one[0] == Needs.__name__)
        self._managers: dict[tuple[int, int], int] = {}
        self._moves: dict[tuple[int, int], int] = {}
        self._closures: dict[int, int] = {}
        self._happens: dict[int, Mapping[int, Move]] = {}
        self._waiting: dict[int, tuple[Edge, ...]] = {}

    @cached_property
    def graph(self) -> Graph:
        """All regions."""
        edges, moves = [], []
        for region in self.regions.regions:
            over = self._system.ticker.memories[region.memory].end is not None
            moves.append(
                {key: one for place, known in enumerate(region.closures) for key, one in self._known(place, known, over=over).items()}
            )
            edges.append(tuple(self._edge(region, target, ticked.act, way) for target, ticked in region.next for way in ticked.ways))
        return Graph(tuple(edges), tuple(moves))

    def waiting(self, number: int) -> tuple[Edge, ...]:
        """Return the ticks in a region that leave all as it is, for all that the managers can be: they are no edges of the graph."""
        if number not in self._waiting:
            region = self.regions.regions[number]
            over = self._system.ticker.memories[region.memory].end is not None
            ways = [] if over else list(self.regions.split(region.memory, TICK, region.sets))
            still = [way for way in ways if way[0].memory == region.memory and not (way[0].started or way[0].interrupted)]
            self._waiting[number] = tuple(self._edge(region, number, TICK, way) for way in still)
        return self._waiting[number]

    def _edge(self, region: Region, target: int, act: str, way: tuple[Outcome, Sets]) -> Edge:
        outcome, sets = way
        chosen = {one.question: one.answer for one in outcome.choices}
        asked = self._asked(outcome)
        quiet = asked == ((), (), self._system.ticker.memories[region.memory].started, None)
        return Edge(target, self.tick(outcome), (act, *asked), chosen, self.common(sets), quiet, way)

    def _asked(self, outcome: Outcome) -> tuple[Hashable, ...]:
        requests = tuple(tuple(self._keys[leaf] for leaf in leaves) for leaves in (outcome.started, outcome.interrupted))
        memory = self._system.ticker.memories[outcome.memory]
        return (*requests, memory.started, memory.end)

    def tick(self, outcome: Outcome) -> int:
        """Return the number of all that a tick shows but the managers with which it is taken, and what nobody knows."""
        wrote = frozenset((self._values[number], status) for number, status in outcome.touched if number in self._values)
        return self._number(("tick", self._asked(outcome), wrote))

    def common(self, sets: Sets) -> Products:
        """Return managers by the numbers that they have in all missions."""
        return tuple(frozenset(self.one(place, number) for number in numbers) for place, numbers in enumerate(sets))

    def _deals(self, node: Node) -> Hashable | None:
        """Return a node that writes on the blackboard, or gives inputs to what it asks for, as its file has it."""
        element, config = node.config.element, node.config
        writes = any(port.direction is not Direction.INPUT for port in config.type.ports.values() if port.name in config.ports)
        if not (writes or isinstance(node, SkillNode) or any(self._computes(node, one) for one in scripts_of(element, config.type))):
            return None
        return (node.name, *_attributes(element))

    def _computes(self, node: Node, script: Attribute) -> bool:
        """Return whether a script writes values that the search does not keep as they are."""
        parts = [part for statement in statements_of(script.value) for part in walk(statement)]
        return any(not self._kept(node, part) for part in parts if isinstance(part, Assignment))

    def _kept(self, node: Node, part: Assignment) -> bool:
        """Return whether an entry gets a value of the file, and never any other."""
        key = node.blackboard.where(part.target.name) if isinstance(part.target, Name) else None
        reads = self._system.reads
        others = reads.counted.union(reads.flows, *reads.flows.values())
        return isinstance(part.value, Literal) and key in reads.names and key not in others and key not in self._ports

    def closure(self, place: int, closure: Closure) -> int:
        """Return the number of all that managers can be, with all that can happen in them."""
        if id(closure) not in self._closures:
            self._closures[id(closure)] = self._number(("closure", frozenset(self._can(place, one) for one in closure.all)))
        return self._closures[id(closure)]

    def _can(self, place: int, number: int) -> int:
        """Return managers with all that can happen in them."""
        if (place, number) not in self._moves:
            moves = frozenset((self._event(event), self.one(place, after)) for event, after in self._system.moves_of(place, number))
            self._moves[place, number] = self._number(("moves", self.one(place, number), moves))
        return self._moves[place, number]

    def _known(self, place: int, closure: Closure, *, over: bool) -> Mapping[int, Move]:
        """Return by what it shows each thing that can happen in managers of a set, as soon as it can."""
        if id(closure) not in self._happens:
            found: dict[int, Move] = {}
            for number in sorted(closure.all, key=closure.depth.__getitem__):
                for event, after in self._system.moves_of(place, number):
                    if not (over and event.leaf < 0):
                        found.setdefault(
                            self._number(("event", self.one(place, number), self._event(event))), Move(place, number, event, after)
                        )
            self._happens[id(closure)] = found
        return self._happens[id(closure)]

    def one(self, place: int, number: int) -> int:
        """Return the number that managers have in all missions."""
        if (place, number) not in self._managers:
            states, executions = self._system.managers_of(number)
            value = (place, states, tuple((self._keys[one.leaf], *one[1:]) for one in executions))
            self._managers[place, number] = self._number(value)
        return self._managers[place, number]

    def _event(self, event: Event) -> Hashable:
        ended = tuple((self._keys[one.leaf], *one[1:]) for one in event.ended)
        leaf = self._keys[event.leaf] if event.leaf >= 0 else ""
        return (event.kind, event.name, event.result, event.state, event.source, event.changes, leaf, ended)


def same(one: Seen, other: Seen) -> bool:
    """Return whether it is shown that two missions do the same."""
    if (one.values, one.needs) != (other.values, other.needs):
        return False
    return _Both(one, other).same()


@dataclass(frozen=True)
class _Pair:
    """Memories of both trees, and for each skillset the managers, by the numbers of each mission."""

    memories: tuple[int, int]
    sets: tuple[Sets, Sets]


class _Both:
    """Two missions, searched as one."""

    def __init__(self, one: Seen, other: Seen) -> None:
        self._both = (one, other)
        self._known: dict[tuple[int, int], list[Sets]] = {}

    def same(self) -> bool:
        first = [one.regions.system.initial() for one in self._both]
        roots = [tuple(frozenset({number}) for number in state.managers) for state in first]
        todo = deque([_Pair((first[0].memory, first[1].memory), (roots[0], roots[1]))])
        while todo:
            pair = self._grown(todo.popleft())
            if pair is None:
                return False
            known = self._known.setdefault(pair.memories, [])
            if any(all(a <= b for a, b in zip(pair.sets[0], sets, strict=True)) for sets in known):
                continue
            known.append(pair.sets[0])
            after = self._after(pair)
            if after is None:
                return False
            todo += after
        return True

    def _grown(self, pair: _Pair) -> _Pair | None:
        """Return all that can come of the managers before the next tick; None where both can't do the same until then."""
        found = []
        for seen, memory, roots in zip(self._both, pair.memories, pair.sets, strict=True):
            closures = tuple(seen.regions.closure(place, numbers, memory) for place, numbers in enumerate(roots))
            found.append((tuple(seen.closure(*known) for known in enumerate(closures)), tuple(known.all for known in closures)))
        return _Pair(pair.memories, (found[0][1], found[1][1])) if found[0][0] == found[1][0] else None

    def _after(self, pair: _Pair) -> list[_Pair] | None:
        """Return what the next tick leads to; None where it is not the same."""
        if self._both[0].regions.system.ticker.memories[pair.memories[0]].end is not None:
            return []
        mine, theirs = (
            [(outcome, _chosen(outcome), seen.tick(outcome), seen.common(left)) for outcome, left in seen.regions.split(memory, TICK, sets)]
            for seen, memory, sets in zip(self._both, pair.memories, pair.sets, strict=True)
        )
        pairs = []
        for a, answers, shown, those in mine:
            for b, others, shows, these in theirs:
                if _agree(answers, others) and all(managers := tuple(x & y for x, y in zip(those, these, strict=True))):
                    if shown != shows:
                        return None
                    pairs.append(self._ticked(pair, (a, b), managers))
        return pairs

    def _ticked(self, pair: _Pair, outcomes: tuple[Outcome, Outcome], managers: Products) -> _Pair:
        found = []
        for seen, outcome, sets in zip(self._both, outcomes, pair.sets, strict=True):
            some = [[number for number in numbers if seen.one(place, number) in managers[place]] for place, numbers in enumerate(sets)]
            found.append(tuple(frozenset(seen.regions.after(place, one, outcome) for one in ones) for place, ones in enumerate(some)))
        return _Pair((outcomes[0].memory, outcomes[1].memory), (found[0], found[1]))


def _chosen(outcome: Outcome) -> Mapping[Question, tuple[Answer, ...]]:
    """Return the answers of what nobody knows: of a question that was asked several times all of them, in order."""
    chosen: dict[Question, tuple[Answer, ...]] = {}
    for one in outcome.choices:
        chosen[one.question] = (*chosen.get(one.question, ()), one.answer)
    return chosen


def _agree(one: Mapping[Question, tuple[Answer, ...]], other: Mapping[Question, tuple[Answer, ...]]) -> bool:
    """Return whether two ticks can have been given the same answers, though one has asked more than the other."""
    return all(a == b for question in one.keys() & other.keys() for a, b in zip(one[question], other[question], strict=False))


def _attributes(element: Element) -> tuple[str | tuple[str, str], ...]:
    """Return a node as its file has it, but for what is said about it."""
    return (type_name(element), *((name, element.get(name)) for name in element.attributes if name != DESCRIPTION))
