"""The response of a mission to each failure: the coverage of its failures, from all its runs.

A row is a skill that fails in some way, at a moment: the other leaves that run then, their skills asked for. Its response is what the tree
asks for next; its outcomes are all ways in which the mission can end from there, whatever else happens, unless somebody aborts it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

from alula.common.graphs import reachable_from
from alula.prove.mission.regions import Region, Regions, Sets, Ticked
from alula.prove.mission.state import State
from alula.prove.mission.ticking import ABORT, Outcome
from alula.trees.ends import FAILS

GOOD = frozenset({"accomplished", "degraded"})


Way = tuple[Outcome, Sets]
"""A tick, and the managers with which it goes so."""


@dataclass
class Row:
    """A failure at a moment, and its consequences.

    ``node`` is the name of the leaf that failed, ``ways`` are the regions where it is seen, each with how the tick goes that sees it.

    ``loses``: before it the mission could be accomplished, and the tree does not come to a node that says that it gives up.
    ``asks``: the leaves that are asked for at once, in the tick that sees it or in the next that asks for any; an empty set where the
    mission ends without.
    """

    skill: str
    end: str
    node: str
    leaf: int
    moment: tuple[str, ...]
    ways: list[tuple[int, Way]] = field(default_factory=list)
    loses: bool = False
    starts: set[str] = field(default_factory=set)
    asks: set[frozenset[int]] = field(default_factory=set)
    outcomes: set[str] = field(default_factory=set)

    @property
    def region(self) -> int:
        """The first region in which it was seen."""
        return self.ways[0][0]

    @property
    def way(self) -> Way:
        """The way of the first tick that sees it."""
        return self.ways[0][1]

    def as_dict(self) -> dict[str, object]:
        """Return the row as plain values for JSON."""
        return {
            "skill": self.skill,
            "end": self.end,
            "node": self.node,
            "while": list(self.moment),
            "starts": sorted(self.starts),
            "outcomes": sorted(self.outcomes),
        }


class FailureResponses:
    """The rows of all failures that the regions show."""

    def __init__(self, regions: Regions) -> None:
        self._regions = regions
        self._system = regions.system
        self._leads = self._leading()
        self._asking: dict[int, frozenset[frozenset[int]]] = {}
        self._giving_up = {number for number, node in enumerate(self._system.nodes) if not node.children and node.ends == FAILS}
        rows: dict[tuple[str, str, int, tuple[str, ...]], Row] = {}
        for number, region in enumerate(regions.regions):
            for target, ticked in _ticks(region):
                for (leaf, end), way in self._failures(ticked).items():
                    self._add(rows, number, target, ticked, leaf, end, way)
        self.rows = sorted(rows.values(), key=lambda one: (one.skill, one.leaf, one.end, one.moment))

    def _add(
        self,
        rows: dict[tuple[str, str, int, tuple[str, ...]], Row],
        number: int,
        target: int,
        ticked: Ticked,
        leaf: int,
        end: str,
        way: Way,
    ) -> None:
        node = self._system.leaves[leaf]
        skill = f"{node.skillset}.{node.model.name}"
        moment = self._moment(number, leaf)
        row = rows.setdefault((skill, end, leaf, moment), Row(skill, end, node.name, leaf, moment))
        row.ways.append((number, way))
        asks = {frozenset(ticked.outcome.started)} if ticked.outcome.started else self._asked_from(target)
        row.asks |= asks
        row.starts |= {self._name(one) for asked in asks for one in asked}
        row.outcomes |= self._leads[target]
        row.loses |= bool(self._leads[number] & GOOD) and not self._gives_up(target, ticked)

    def _failures(self, ticked: Ticked) -> dict[tuple[int, str], Way]:
        """Return the leaves that fail in a tick, each with how it ended as far as the tree can tell, and a way in which it does."""
        found: dict[tuple[int, str], Way] = {}
        place_of = {id(node): number for number, node in enumerate(self._system.nodes)}
        for outcome, sets in ticked.ways:
            failed = {number for number, status in outcome.touched if status == "FAILURE"}
            for leaf, node in enumerate(self._system.leaves):
                if place_of[id(node)] in failed:
                    place = self._system.place_of(("execution", leaf))
                    known = self._system.managers_of(next(iter(sets[place])))
                    ended = [one for one in known.executions if one.leaf == leaf and one.phase == "ended"]
                    for one in ended:
                        found.setdefault((leaf, one.result or one.state), (outcome, sets))
        return dict(sorted(found.items(), key=lambda one: one[0]))

    def _moment(self, region: int, but: int) -> tuple[str, ...]:
        """Return the other leaves that run and have asked for their skills."""
        memory = self._regions.regions[region].memory
        asked = {leaf for leaf, _ in self._system.ticker.memories[memory].leaves}
        active = set(map(id, self._system.active(State(memory, ()))))
        return tuple(sorted({self._name(leaf) for leaf in asked if leaf != but and id(self._system.leaves[leaf]) in active}))

    def _name(self, leaf: int) -> str:
        node = self._system.leaves[leaf]
        return f"{node.skillset}.{node.model.name}"

    def _asked_from(self, region: int) -> frozenset[frozenset[int]]:
        """Return what the next ticks that ask for anything ask for; an empty set where the mission ends without."""
        if region not in self._asking:
            found: set[frozenset[int]] = set()

            def following(number: int) -> Iterator[int]:
                at = self._regions.regions[number]
                if self._system.ticker.memories[at.memory].end is not None:
                    found.add(frozenset())
                for target, ticked in _ticks(at):
                    if ticked.outcome.started:
                        found.add(frozenset(ticked.outcome.started))
                    else:
                        yield target

            reachable_from([region], following)
            self._asking[region] = frozenset(found)
        return self._asking[region]

    def _gives_up(self, region: int, first: Ticked) -> bool:
        """Return whether a tick, or one of the next before anything is asked for, comes to a node by which the tree gives up."""
        seen: set[int] = {region}
        todo = [(region, first)]
        while todo:
            at, ticked = todo.pop()
            if any(number in self._giving_up for way, _ in ticked.ways for number, _ in way.touched):
                return True
            if not ticked.outcome.started:
                more = [one for one in _ticks(self._regions.regions[at]) if one[0] not in seen]
                seen |= {one for one, _ in more}
                todo += more
        return False

    def _leading(self) -> list[frozenset[str]]:
        """Return for each region how the mission can end from there."""
        regions = self._regions.regions
        found: list[set[str]] = [set() for _ in regions]
        before: list[list[int]] = [[] for _ in regions]
        for number, region in enumerate(regions):
            for target, _ in _ticks(region):
                before[target].append(number)
        ending: dict[str, list[int]] = {}
        for number, region in enumerate(regions):
            if (end := self._system.ticker.memories[region.memory].end) is not None:
                ending.setdefault(end.value, []).append(number)
        for value, several in ending.items():
            for number in reachable_from(several, before.__getitem__):
                found[number].add(value)
        return [frozenset(one) for one in found]


def _ticks(region: Region) -> list[tuple[int, Ticked]]:
    """Return what leads on from a region, without aborts: they answer nothing."""
    return [one for one in region.next if one[1].act != ABORT]
