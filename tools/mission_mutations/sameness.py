"""Whether two missions do the same, shown by a bisimulation of all that they can do.

A mission is compared as the graph of its regions. A region shows what the managers of each skillset can be and can do until the next tick
(starts, refusals, ends with their results, resources), and how the mission has ended. A tick out of it shows with which managers it is
taken, what it asks for, how what nobody knows answers its questions, and which nodes it ticks that write on the blackboard or give inputs.
Two missions whose first regions can't be told apart so do the same, step for step: each run of one is a run of the other.

Numbers and texts that the search does not know have no values here. So the nodes that write or read them must also be the same, in the same
order in the file; otherwise nothing is claimed. Missions that do the same may be told apart all the same: this shows sameness only.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

from alula.missions.filed.skills import SkillNode
from alula.prove.mission.oracle import Answer, Question
from alula.prove.mission.reading import scripts_of
from alula.prove.mission.regions import Closure, Regions, Sets
from alula.prove.mission.state import Event
from alula.prove.mission.system import System
from alula.prove.mission.ticking import Outcome
from alula.trees.node import Node, pointer
from alula.trees.palette import Direction
from alula.trees.script import parse
from alula.trees.script.syntax import Assignment, Literal, Name, walk

FEW = 20_000
"""Up to so many situations are compared one by one."""
Products = tuple[frozenset[int], ...]
Key = tuple[str, str, int]
"""A skill, the name of the node that asks for it, and which of those of the same names."""


@dataclass(frozen=True)
class Edge:
    """A tick.

    ``label`` is all that it shows but ``sets``, the managers of each skillset with which it is taken; ``target``: the region after it;
    ``asked``: what it asks for, and how the mission has ended after it; ``choices``: what nobody knows, with the answers. ``way`` is
    the tick itself.
    """

    label: int
    target: int
    asked: Hashable
    choices: Mapping[Question, Answer]
    sets: Products
    way: tuple[Outcome, Sets]

    def like(self, other: Edge) -> bool:
        """Tell whether both ask for the same, with some managers that are the same, and the same answers of what nobody knows."""
        agree = all(other.choices.get(question, answer) == answer for question, answer in self.choices.items())
        return agree and self.asked == other.asked and all(a & b for a, b in zip(self.sets, other.sets, strict=True))


@dataclass(frozen=True)
class Move:
    """Something that happens in the managers of the skillset at ``place``, from these to others, by their numbers."""

    place: int
    managers: int
    event: Event
    after: int


@dataclass(frozen=True)
class Graph:
    """The regions with what each shows, and the ticks out of each.

    ``moves`` are what can happen in the managers of each region; ``values``: the nodes that deal in values, in the file's order.
    """

    labels: tuple[Hashable, ...]
    edges: tuple[tuple[Edge, ...], ...]
    moves: tuple[Mapping[int, Move], ...]
    values: tuple[Hashable, ...]


def keys_of(system: System) -> list[Key]:
    """Return the names of the leaves, which another file may have at other numbers."""
    found: list[Key] = []
    for leaf in system.leaves:
        names = (f"{leaf.skillset}.{leaf.model.name}", leaf.name)
        found.append((*names, sum(key[:2] == names for key in found)))
    return found


class Shown:
    """Makes graphs that can be compared: what is the same has the same number in all of them."""

    def __init__(self) -> None:
        self._numbers: dict[Hashable, int] = {}

    def graph(self, regions: Regions) -> Graph:
        """Return the graph of a mission whose regions are all known."""
        return _Making(self, regions).graph()

    def number(self, value: Hashable) -> int:
        """Return the number of a value."""
        return self._numbers.setdefault(value, len(self._numbers))


class _Making:
    def __init__(self, shown: Shown, regions: Regions) -> None:
        self._number = shown.number
        self._regions = regions
        self._system = regions.system
        self._keys = keys_of(regions.system)
        self._ports = {
            str(pointer(node.wiring.ports.get(port.name, ""), port.name)).removeprefix("@")
            for node in self._system.nodes
            for port in node.wiring.type.ports.values()
            if port.direction is not Direction.INPUT
        }
        self._values = {number: value for number, node in enumerate(self._system.nodes) if (value := self._deals(node)) is not None}
        self._managers: dict[tuple[int, int], int] = {}
        self._moves: dict[tuple[int, int], int] = {}
        self._closures: dict[int, int] = {}
        self._happens: dict[int, Mapping[int, Move]] = {}

    def graph(self) -> Graph:
        labels, edges, moves = [], [], []
        for region in self._regions.regions:
            memory = self._system.ticker.memories[region.memory]
            closures = tuple(self._closure(place, one) for place, one in enumerate(region.closures))
            labels.append(self._number(("region", memory.started, memory.end, closures)))
            over = memory.end is not None
            moves.append(
                {key: one for place, known in enumerate(region.closures) for key, one in self._known(place, known, over=over).items()}
            )
            edges.append(tuple(self._edge(target, ticked.act, way) for target, ticked in region.next for way in ticked.ways))
        return Graph(tuple(labels), tuple(edges), tuple(moves), tuple(self._values.values()))

    def _edge(self, target: int, act: str, way: tuple[Outcome, Sets]) -> Edge:
        (memory, started, interrupted, choices, touched), sets = way
        requests = tuple(tuple(self._keys[leaf] for leaf in leaves) for leaves in (started, interrupted))
        asked = (act, *requests, self._system.ticker.memories[memory].end)
        chosen = {one.question: one.answer for one in choices}
        wrote = frozenset((self._values[number], status) for number, status in touched if number in self._values)
        known = tuple(frozenset(self._one(place, number) for number in numbers) for place, numbers in enumerate(sets))
        label = self._number(("tick", asked, frozenset(chosen.items()), wrote))
        return Edge(label, target, asked, chosen, known, way)

    def _deals(self, node: Node) -> Hashable | None:
        """Return a node that writes on the blackboard, or gives inputs to what it asks for, as its file has it."""
        element, wiring = node.wiring.element, node.wiring
        writes = any(port.direction is not Direction.INPUT for port in wiring.type.ports.values() if port.name in wiring.ports)
        if not (writes or isinstance(node, SkillNode) or any(map(self._computes, scripts_of(element)))):
            return None
        return (wiring.type.name, node.name, *((name, element.get(name)) for name in element.attributes if name != "_description"))

    def _computes(self, text: str) -> bool:
        """Tell whether a script writes values that the search does not keep as they are."""
        parts = [part for statement in parse(text).statements for part in walk(statement)]
        return any(not self._kept(part) for part in parts if isinstance(part, Assignment))

    def _kept(self, part: Assignment) -> bool:
        """Tell whether an entry gets a value of the file, and never any other."""
        name = part.target.name.removeprefix("@") if isinstance(part.target, Name) else ""
        reads = self._system.reads
        others = {target for _, target in reads.flows} | {source for source, _ in reads.flows} | reads.counted
        return isinstance(part.value, Literal) and name in reads.names and name not in others and name not in self._ports

    def _closure(self, place: int, closure: Closure) -> int:
        if id(closure) not in self._closures:
            self._closures[id(closure)] = self._number(("closure", frozenset(self._can(place, one) for one in closure.all)))
        return self._closures[id(closure)]

    def _can(self, place: int, number: int) -> int:
        """Return managers with all that can happen in them."""
        if (place, number) not in self._moves:
            moves = frozenset((self._event(event), self._one(place, after)) for event, after in self._system.moves_of(place, number))
            self._moves[place, number] = self._number(("moves", self._one(place, number), moves))
        return self._moves[place, number]

    def _known(self, place: int, closure: Closure, *, over: bool) -> Mapping[int, Move]:
        """Return by what it shows each thing that can happen in managers of a set, as soon as it can."""
        if id(closure) not in self._happens:
            found: dict[int, Move] = {}
            for number in sorted(closure.all, key=closure.depth.__getitem__):
                for event, after in self._system.moves_of(place, number):
                    if not (over and event.leaf < 0):
                        found.setdefault(
                            self._number(("event", self._one(place, number), self._event(event))), Move(place, number, event, after)
                        )
            self._happens[id(closure)] = found
        return self._happens[id(closure)]

    def _one(self, place: int, number: int) -> int:
        if (place, number) not in self._managers:
            states, executions = self._system.managers_of(number)
            value = (place, states, tuple((self._keys[one.leaf], *one[1:]) for one in executions))
            self._managers[place, number] = self._number(value)
        return self._managers[place, number]

    def _event(self, event: Event) -> Hashable:
        ended = tuple((self._keys[one.leaf], *one[1:]) for one in event.ended)
        leaf = self._keys[event.leaf] if event.leaf >= 0 else ""
        return (event.kind, event.name, event.result, event.state, event.source, event.changes, leaf, ended)


def same(one: Graph, other: Graph) -> bool:
    """Tell whether it is shown that two missions do the same."""
    if one.values != other.values:
        return False
    labels = [*one.labels, *other.labels]
    shift = len(one.labels)
    edges = [*one.edges, *(tuple(replace(edge, target=edge.target + shift) for edge in known) for known in other.edges)]
    blocks, unions = _numbered(labels), _Unions()
    while True:
        if blocks[0] != blocks[shift]:
            return False
        refined = _numbered([(blocks[at], unions.shown(known, blocks)) for at, known in enumerate(edges)])
        if len(set(refined)) == len(set(blocks)):
            return True
        blocks = refined


class _Unions:
    """What the ticks out of a region show: those that show the same are one, taken with all managers of any of them."""

    def __init__(self) -> None:
        self._known: dict[frozenset[Products], Hashable] = {}

    def shown(self, edges: Sequence[Edge], blocks: Sequence[int]) -> Hashable:
        """Return it, with the blocks that the ticks lead to."""
        found: dict[tuple[int, int], set[Products]] = {}
        for edge in edges:
            found.setdefault((edge.label, blocks[edge.target]), set()).add(edge.sets)
        return frozenset((key, self._union(frozenset(sets))) for key, sets in found.items())

    def _union(self, sets: frozenset[Products]) -> Hashable:
        """Return a union of products, the same however it was divided, where it is not too large to be looked at one by one."""
        if sets not in self._known:
            merged = _merged(sets)
            few = len(merged) > 1 and sum(math.prod(map(len, one)) for one in merged) <= FEW
            self._known[sets] = frozenset(one for known in merged for one in product(*known)) if few else merged
        return self._known[sets]


def _merged(sets: frozenset[Products]) -> frozenset[Products]:
    """Return the products with those that differ in one skillset only made one."""
    found: list[Products] = []
    for each in sorted(sets, key=lambda known: [sorted(part) for part in known]):
        one = each
        while (other := next((known for known in found if sum(a != b for a, b in zip(known, one, strict=True)) <= 1), None)) is not None:
            found.remove(other)
            one = tuple(a | b for a, b in zip(other, one, strict=True))
        found.append(one)
    return frozenset(found)


def _numbered(values: Sequence[Hashable]) -> list[int]:
    numbers: dict[Hashable, int] = {}
    return [numbers.setdefault(value, len(numbers)) for value in values]
