"""Which nodes of a mission's trees can still be ticked, and so what of its memory anything can still tell apart.

A Sequence that has passed a child ticks it no more, unless something above begins the Sequence again; what only such nodes ask for is
forgotten. Each set holds from a memory on: what can be ticked after a tick could be ticked before it.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from alula.prove.mission.reading import OUTCOME, Read
from alula.trees.access import Key, takes_script_from_entry
from alula.trees.node import Node
from alula.trees.reach import Reach
from alula.trees.status import RUNNING, SKIPPED
from alula.trees.ticking import Order, Ticking
from alula.trees.tree import Tree

RUNS = RUNNING.value


@dataclass(frozen=True)
class Ahead:
    """What can still matter: ``nodes`` by their numbers; ``kept`` are entries that are asked for, ``named`` those that are computed with.

    ``everything``: a node may ask for any entry. ``written``: entries that scripts write.

    ``ends``, ``first``: what is asked of failures; ``followed`` are skills whose executions are asked for, interrupted ones, too.
    """

    nodes: frozenset[int]
    everything: bool
    kept: frozenset[Key]
    named: frozenset[Key]
    written: frozenset[Key]
    ends: frozenset[str]
    first: bool
    followed: frozenset[str]


class Looking:
    """Computes what is ahead of a mission from the state of its trees."""

    def __init__(self, trees: Sequence[Tree], read: Read) -> None:
        self.read = read
        self._nodes = [node for tree in trees for node in tree.nodes]
        self.ticking = [node.config.ticking for node in self._nodes]
        self.all = frozenset(range(len(self._nodes)))
        self._number = {id(node): number for number, node in enumerate(self._nodes)}
        self._roots = [tree.root for tree in trees]
        self._below = {number: frozenset(self._all(node)) for number, node in enumerate(self._nodes)}
        self._asks = [read.asks(node.config) for node in self._nodes]
        self._outcome = frozenset((root.blackboard, name) for root in self._roots for name in OUTCOME)
        self._reach = Reach()
        self._opaque = {number for number, node in enumerate(self._nodes) if not self._plain(node)}
        self._skips = {number for number, node in enumerate(self._nodes) if any(map(self._may_skip, self._below[number]))}

    def _plain(self, node: Node) -> bool:
        """Return whether all that a node asks for stands in the file."""
        of = node.config
        return of.type.name not in self.read.free and not takes_script_from_entry(of.element, of.type)

    def _may_skip(self, number: int) -> bool:
        return SKIPPED in self._reach.ends(self._nodes[number].config) or number in self._opaque

    def may_be_skipped(self, number: int) -> bool:
        """Return whether a node, or one below it, may be skipped, or depends on an unknown value."""
        return number in self._skips

    def ahead(self, phase: str, *, stops: bool, values: Sequence[Mapping[str, Hashable]]) -> Ahead:
        """Return what is ahead in a director's phase; ``values`` are the statuses and attributes of the nodes.

        ``stops``: the second tree brings the robot to rest. Until then it may have to.
        """
        if phase == "_settle":
            return self._asked(frozenset(), everything=False)
        found: set[int] = set()
        for root in self._roots[1:] if stops else self._roots:
            found |= self._from(root, values)
        return self._asked(frozenset(found), everything=phase == "_wait")  # what is needed to begin may ask for anything

    def _from(self, node: Node, values: Sequence[Mapping[str, Hashable]]) -> frozenset[int]:
        """Return what can be ticked below a node, and it."""
        number = self._number[id(node)]
        mine, ticking = values[number], self.ticking[number]
        if mine["status"] != RUNS or not ticking.tells_passed or number in self._skips:
            return self._below[number]  # what is skipped may begin again
        found = {number}
        for place, child in enumerate(node.children):
            below = self._number[id(child)]
            if not self._passed(ticking, mine, place):
                found |= self._from(child, values)
            elif values[below]["status"] == RUNS:  # it was skipped, and is halted some time
                found |= self._below[below]
        return frozenset(found)

    @staticmethod
    def _passed(ticking: Ticking, mine: Mapping[str, Hashable], place: int) -> bool:
        told = mine.get(ticking.place)
        if ticking.order is Order.IN_TURN:
            return isinstance(told, int) and place < told
        return isinstance(told, tuple) and place in told[1]

    def _asked(self, nodes: frozenset[int], *, everything: bool) -> Ahead:
        asks = [self._asks[number] for number in sorted(nodes)]
        kept = self._outcome.union(*(one.names for one in asks))
        return Ahead(
            nodes,
            everything or bool(nodes & self._opaque),
            self.read.sources(kept),
            self.read.sources(kept.union(*(one.named for one in asks))),
            self.read.sources(one for asked in asks for one in asked.written),
            frozenset(end for one in asks for end in one.ends),
            any(one.first for one in asks),
            frozenset(skill for one in asks for skill in one.skills),
        )

    def _all(self, node: Node) -> Iterator[int]:
        yield self._number[id(node)]
        for child in node.children:
            yield from self._all(child)
