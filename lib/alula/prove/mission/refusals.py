"""Requests that can be refused without a response of the tree, and what changed between the request and its arrival."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from alula.prove.mission.regions import Closure, Regions
from alula.prove.mission.responses import Row, Way
from alula.prove.mission.state import Event, Kind, State


@dataclass(frozen=True)
class Refusal:
    """A refused request that ends the mission, as NOT_READY or NOT_VALIDATED (``how``).

    ``race``: what changed between the request and its arrival, empty where nothing did.
    """

    events: tuple[Event, ...]
    state: State
    how: str
    by: str
    race: str


def refusal_of(regions: Regions, row: Row) -> Refusal | None:
    """Return a refusal of a row's request to which the mission has no response, None where it fails in other ways only."""
    place = regions.system.place_of(("execution", row.leaf))
    seen = ((at, *way, _refused(regions, at, way, row.leaf)) for at, way in row.ways)
    found = next((one for one in seen if one[-1]), None)
    if found is None:
        return None
    region, outcome, sets, refused = found
    closure = regions.regions[region].closures[place]
    number = min(refused, key=closure.depth.__getitem__)
    refusing = (*sets[:place], frozenset({number}), *sets[place + 1 :])
    before = len(regions.run(region, dict(enumerate(regions.soonest(region, refusing)))))
    events, state = regions.run_on(region, outcome, refusing)
    at = max(at for at, event in enumerate(events[:before]) if event.kind is Kind.REFUSE and event.leaf == row.leaf)
    by = " ".join(filter(None, (events[at].state, events[at].result and f"({events[at].result})")))
    asked = max((one for one, event in enumerate(events[:at]) if row.leaf in event.started), default=0)
    return Refusal(tuple(events), state, events[at].state, by, ", ".join(_changes(events[asked:at], events[at].skillset)))


def failing(regions: Regions, row: Row) -> tuple[int, Way] | None:
    """Return where and how a row fails other than by a refusal, None where it does not."""
    place = regions.system.place_of(("execution", row.leaf))
    for region, way in row.ways:
        outcome, sets = way
        others = sets[place] - _refused(regions, region, way, row.leaf)
        if others:
            return region, (outcome, (*sets[:place], others, *sets[place + 1 :]))
    return None


def _refused(regions: Regions, region: int, way: Way, leaf: int) -> frozenset[int]:
    """Return the managers with which a tick goes so because a request was refused."""
    place = regions.system.place_of(("execution", leaf))
    closure = regions.regions[region].closures[place]
    return frozenset(one for one in way[1][place] if _is_refused(closure, one, leaf))


def _is_refused(closure: Closure, number: int, leaf: int) -> bool:
    return any(event.kind is Kind.REFUSE and event.leaf == leaf for event in closure.way(number)[1])


def _changes(events: list[Event], skillset: str) -> Iterator[str]:
    for event in events:
        if event.skillset == skillset:
            yield from (f"{skillset}.{name} {source} -> {target}" for name, source, target in event.changes)
