"""Missions that can end so that a skill can't start any more: what is left taken, and by whose end.

Ends of skills that leave a resource as their start has made it are looked at one by one: managers whose resources are the same are the same
to the search, however they came to be so.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from alula.prove.limits import OutOfTimeError
from alula.prove.mission.regions import Region, Regions
from alula.prove.mission.state import Ending, Event, Kind, State
from alula.prove.mission.system import System


@dataclass(frozen=True)
class Left:
    """An end of the mission after which skills of a skillset are ``lost``; ``by``: whose end has left it so, where it is known."""

    place: int
    end: str
    lost: tuple[str, ...]
    by: str
    states: Mapping[str, str]
    events: tuple[Event, ...]


def left_taken(regions: Regions) -> Iterator[Left]:
    """Yield ends of the mission that leave skills unable to start, one for each end of a skill that causes it."""
    found: set[tuple[int, tuple[str, ...], str]] = set()
    for number, region in enumerate(regions.regions):
        for place in range(len(region.closures)):
            for managers, lost in _lost_at(regions, region, place):
                if not any(known[:2] == (place, lost) for known in found):
                    one = _left(regions, region, place, managers, regions.run(number, {place: managers}))
                    found.add((place, lost, one.by))
                    yield one
    lost_places = {place for place, _, _ in found}
    for by, place, run, state in _keeping(regions) if regions.complete else ():
        if place not in lost_places or any(known[0] == place and known[2] == by for known in found):
            continue
        later = Regions(regions.system, regions.deadline)
        try:
            later.explore(state, lambda region, at=place: any(_lost_at(regions, region, at)))  # type: ignore[misc]
        except OutOfTimeError:
            regions.complete = False
            return
        region = later.regions[-1]
        depth = region.closures[place].depth
        several = [
            (depth[managers], _left(regions, region, place, managers, [*run, *later.run(len(later.regions) - 1, {place: managers})]))
            for managers, _ in _lost_at(regions, region, place)
        ]
        for _, one in sorted(several, key=lambda known: (known[0], _assumed(known[1]))):
            if one.by == by and (place, one.lost, by) not in found:
                found.add((place, one.lost, by))
                yield one


def _assumed(one: Left) -> int:
    """Count what a run assumes of numbers that the search does not follow, such as attempts: a flight may need longer for it."""
    return sum(len(event.choices) for event in one.events)


def _left(regions: Regions, region: Region, place: int, managers: int, events: Sequence[Event]) -> Left:
    system = regions.system
    states = system.resource_states(place, managers)
    end = system.ticker.memories[region.memory].end
    return Left(place, end.value if end else "", _lost(regions, place, managers), _by(system, place, events), states, tuple(events))


def _lost_at(regions: Regions, region: Region, place: int) -> Iterator[tuple[int, tuple[str, ...]]]:
    """Yield managers at an end of the mission that have lost skills, the soonest first."""
    if regions.system.ticker.memories[region.memory].end is None:
        return
    closure = region.closures[place]
    for one in sorted(closure.all, key=closure.depth.__getitem__):
        managers = regions.system.managers_of(one)
        if (
            managers.states
            and all(execution.phase == "ended" for execution in managers.executions)
            and (lost := _lost(regions, place, one))
        ):
            yield one, lost


def _lost(regions: Regions, place: int, number: int) -> tuple[str, ...]:
    """Return the skills of the mission that could start after power-up and can't after this, whatever the functional layer does."""
    system = regions.system
    first = system.initial().managers[place]
    return tuple(sorted(system.startable(place, first) - system.startable(place, number)))


# --- whose end it is ----------------------------------------------------------------------------------------------------


def _by(system: System, place: int, events: Sequence[Event]) -> str:
    """Return whose ends in a run have left resources as their starts have made them."""
    skillset = system.skillsets[place]
    taken: dict[str, int] = {}
    left: dict[str, str] = {}
    for event in (one for one in events if one.skillset == skillset.name):
        if event.kind is Kind.DIE:  # those that come again have nothing taken
            taken, left = {}, {}
            continue
        for name, _, _ in event.changes:
            taken.pop(name, None)
            left.pop(name, None)
        if event.kind is Kind.START:
            taken |= {one.resource: event.leaf for one in skillset.skill(event.name).start.assignments}
        for ending in event.ended:
            left |= {name: _said(system, place, ending) for name, leaf in taken.items() if leaf == ending.leaf}
    return ", ".join(sorted(set(left.values())))


def _keeping(regions: Regions) -> Iterator[tuple[str, int, list[Event], State]]:
    """Yield ends of skills that leave a resource as their start has made it: what they are called, and a run to the first of each."""
    system = regions.system
    seen: set[int] = set()
    told: set[str] = set()
    for number, region in enumerate(regions.regions):
        for place, closure in enumerate(region.closures):
            if id(closure) in seen or system.ticker.memories[region.memory].end is not None:
                continue
            seen.add(id(closure))
            for one in sorted(closure.all, key=closure.depth.__getitem__):
                for event, after in system.moves_of(place, one):
                    for ending in event.ended:
                        by = _said(system, place, ending)
                        if by in told or not _keeps(system, place, ending, after):
                            continue
                        told.add(by)
                        goal = regions.soonest(number, (*region.sets[:place], frozenset({one}), *region.sets[place + 1 :]))
                        state = State(region.memory, (*goal[:place], after, *goal[place + 1 :]))
                        yield by, place, [*regions.run(number, dict(enumerate(goal))), event], state


def _keeps(system: System, place: int, ending: Ending, after: int) -> bool:
    managers = system.managers_of(after)
    skillset = system.skillsets[place]
    if managers.states is None or ending.state in {"NOT_READY", "NOT_VALIDATED"}:
        return False
    states = system.resource_states(place, after)
    kept = {one for one in skillset.skill(ending.skill).start.assignments if states[one.resource] == one.target}
    kept = {one for one in kept if one.target != skillset.resource(one.resource).initial}
    running = [system.leaves[one.leaf].model.name for one in managers.executions if one.phase == "running"]
    return bool(kept - {one for name in running for one in skillset.skill(name).start.assignments})


def _said(system: System, place: int, ending: Ending) -> str:
    return f"{system.skillsets[place].name}.{ending.skill} as {ending.result or ending.state}"
