"""Branches that fight for a resource: a request is refused because of what another branch runs, and is asked for again meanwhile."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice

from alula.common.graphs import ShortestWays
from alula.model.expressions import ResourceIs, atoms
from alula.prove.mission.regions import Closure, Regions
from alula.prove.mission.state import Event, Execution, Kind, Managers, State
from alula.prove.mission.system import System

PLACES = 4
"""In so many regions it is looked whether a refused request is asked for again."""
MOST = 2000
"""And so many situations after each refusal."""


@dataclass(frozen=True)
class Fight:
    """A leaf that is refused and asked for again, while another one's skill holds the resource; ``events`` is a run that shows it."""

    asking: int
    holding: int
    resource: str
    events: tuple[Event, ...]
    state: State


def fights(regions: Regions) -> Iterator[Fight]:
    """Yield a fight of each two leaves that fight."""
    system = regions.system
    refused = _Refused(system)
    looked: dict[tuple[int, int], int] = {}
    told: set[tuple[int, int]] = set()
    for number, region in enumerate(regions.regions):
        if system.ticker.memories[region.memory].end is not None:
            continue
        for place, closure in enumerate(region.closures):
            for one, event, after, holding, resource in refused.of(place, closure):
                pair = (event.leaf, holding)
                if pair in told or looked.get(pair, 0) >= PLACES:
                    continue
                looked[pair] = looked.get(pair, 0) + 1
                goal = regions.soonest(number, (*region.sets[:place], frozenset({one}), *region.sets[place + 1 :]))
                again = _again(system, State(region.memory, (*goal[:place], after, *goal[place + 1 :])), *pair)
                if again is not None:
                    told.add(pair)
                    events, last = again
                    yield Fight(*pair, resource, (*regions.run(number, dict(enumerate(goal))), event, *events), last)


class _Refused:
    """Requests that are refused because of what runs, those of each set of managers."""

    def __init__(self, system: System) -> None:
        self._system = system
        self._known: dict[int, list[tuple[int, Event, int, int, str]]] = {}

    def of(self, place: int, closure: Closure) -> list[tuple[int, Event, int, int, str]]:
        """Return managers, the refusal, the managers after it, the leaf that holds what it needs, and the resource; the nearest first."""
        if id(closure) not in self._known:
            self._known[id(closure)] = [
                (one, event, after, *held)
                for one in sorted(closure.all, key=closure.depth.__getitem__)
                for event, after in self._system.moves_of(place, one)
                if (held := _holder(self._system, place, self._system.managers_of(one), event)) is not None
            ]
        return self._known[id(closure)]


def _holder(system: System, place: int, managers: Managers, event: Event) -> tuple[int, str] | None:
    """Return the leaf whose skill runs and holds what a refused request needs, and the resource."""
    if event.kind is not Kind.REFUSE or managers.states is None:
        return None
    skillset = system.skillsets[place]
    needed = next((one for one in skillset.skill(event.name).preconditions if one.name == event.result), None)
    asked = {atom.resource for atom in atoms(needed.condition) if isinstance(atom, ResourceIs)} if needed else set()
    states = dict(zip((one.name for one in skillset.resources), managers.states, strict=True))
    for execution in managers.executions:
        for taken in skillset.skill(system.leaves[execution.leaf].model.name).start.assignments if _runs(execution) else ():
            if execution.leaf != event.leaf and taken.resource in asked and states[taken.resource] == taken.target:
                return execution.leaf, f"{skillset.name}.{taken.resource}"
    return None


def _runs(execution: Execution) -> bool:
    return execution.phase == "running" and not execution.asked


def _again(system: System, first: State, asking: int, holding: int) -> tuple[list[Event], State] | None:
    """Return what leads to the next request of a leaf, while the other one's execution goes on."""

    def going_on(state: State) -> Iterator[tuple[Event, State]]:
        for event, after in system.steps(state):
            if holding not in event.interrupted and all(one.leaf != holding for one in event.ended):
                yield event, after

    ways = ShortestWays([first], going_on)
    for state in islice(ways, MOST):
        event = ways.step_to(state)
        if event is not None and asking in event.started:
            return ways.to(state), state
    return None
