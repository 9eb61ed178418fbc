"""Whether two missions do the same, shown by a bisimulation of all that they can do.

A mission is compared as the graph of its regions. A region shows what the managers of each skillset can be and can do until the next tick
(starts, refusals, ends with their results, resources), and how the mission has ended. A tick out of it shows with which managers it is
taken, what it asks for, how what nobody knows answers its questions, and which nodes it ticks that write on the blackboard or give inputs.
Two missions whose first regions can't be told apart so do the same, step for step: each run of one is a run of the other.

Numbers and texts that the search does not know have no values here. So the nodes that write or read them must also be the same, in the same
order in the file; otherwise nothing is claimed. Missions that do the same may be told apart all the same: this shows sameness only.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, replace

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

Key = tuple[str, str, int]
"""A skill, the name of the node that asks for it, and which of those of the same names."""


@dataclass(frozen=True)
class Edge:
    """A tick.

    ``label`` is all that it shows, ``target`` the region after it; ``asked``: what it asks for, and how the mission has ended after it;
    ``choices``: what nobody knows, with the answers; ``sets``: the managers of each skillset with which it is taken. ``way`` is the tick.
    """

    label: int
    target: int
    asked: Hashable
    choices: Mapping[Question, Answer]
    sets: tuple[frozenset[int], ...]
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
        label = self._number(("tick", asked, frozenset(chosen.items()), wrote, known))
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
    blocks = _numbered(labels)
    while True:
        if blocks[0] != blocks[shift]:
            return False
        refined = _numbered(
            [(blocks[at], frozenset((edge.label, blocks[edge.target]) for edge in known)) for at, known in enumerate(edges)]
        )
        if len(set(refined)) == len(set(blocks)):
            return True
        blocks = refined


def _numbered(values: Sequence[Hashable]) -> list[int]:
    numbers: dict[Hashable, int] = {}
    return [numbers.setdefault(value, len(numbers)) for value in values]
