"""Runs of one mission that another does not take, to be flown in both."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import islice
from pathlib import Path

from alula.missions.filed.part import MissionPart
from alula.model.model import Skillset
from alula.prove.mission.play import play
from alula.prove.mission.regions import Regions
from alula.prove.mission.run import MissionRun, run_of
from alula.prove.mission.state import Event, Kind, State
from alula.prove.mission.system import System
from mission_mutations.sameness import Graph, keys_of


def differing(one: Regions, graph: Graph, other: Graph, most: int) -> Iterator[MissionRun]:
    """Yield runs of the first, whose graph this is, up to something that the other does not do there; those of few ticks first.

    The other is followed by what it asks for with the same managers. It may take a run all the same: a flight shows it.
    """
    followed: list[frozenset[int]] = [frozenset({0})]
    for number in range(1, len(one.regions)):
        origin = one.regions[number].origin
        assert origin is not None  # noqa: S101 - only the first has none
        before, ticked = origin
        there = [edge for edge in graph.edges[before] if edge.target == number and edge.way in ticked.ways]
        after = {edge.target for at in followed[before] for edge in other.edges[at] if any(mine.like(edge) for mine in there)}
        followed.append(frozenset(after))
    found = _runs(one, graph, other, followed)
    yield from (run_of(one.system, *run) for run in islice(found, most))


def _runs(one: Regions, graph: Graph, other: Graph, followed: Sequence[frozenset[int]]) -> Iterator[tuple[list[Event], State]]:
    for number, known in enumerate(followed):
        for key, move in graph.moves[number].items():
            if known and not any(key in other.moves[at] for at in known):
                sets, place = one.regions[number].sets, move.place
                goal = one.soonest(number, (*sets[:place], frozenset({move.managers}), *sets[place + 1 :]))
                after = State(one.regions[number].memory, (*goal[:place], move.after, *goal[place + 1 :]))
                yield [*one.run(number, dict(enumerate(goal))), move.event], after
        for edge in graph.edges[number]:
            if known and not any(edge.like(theirs) for at in known for theirs in other.edges[at]):
                yield _until_it_asks(one.system, *one.run_on(number, *edge.way, most=1))


def _until_it_asks(system: System, events: list[Event], state: State) -> tuple[list[Event], State]:
    """Return a run with the steps that the tree then takes by itself, to its next request or its end: a flight compares these."""
    known, todo = {state}, deque([(events, state)])
    while todo:
        run, at = todo.popleft()
        if run[-1].started or system.outcome(at) is not None:
            return run, at
        for event, after in system.steps(at):
            if event.kind in {Kind.TICK, Kind.INTERRUPT} and after not in known:
                known.add(after)
                todo.append(([*run, event], after))
    return events, state


def taken(run: MissionRun, of: System, path: Path, by: System, skillsets: Sequence[Skillset], part: MissionPart) -> bool:
    """Tell whether a mission, flown over its own managers, takes the run of another, step for step, to the same end."""
    here = {key: number for number, key in enumerate(keys_of(by))}
    keys = keys_of(of)
    if any(keys[leaf] not in here for event in run.events for leaf in _leaves(event)):
        return False
    numbers = [here.get(key, -1) for key in keys]
    return not play(path, replace(run, events=tuple(_moved(event, numbers) for event in run.events), skillsets=tuple(skillsets)), part).left


def _leaves(event: Event) -> Iterator[int]:
    yield from event.started
    yield from event.interrupted
    yield from (one.leaf for one in event.ended)
    if event.leaf >= 0:
        yield event.leaf


def _moved(event: Event, numbers: Sequence[int]) -> Event:
    """Return an event with the numbers that its leaves have in the other mission."""
    return event._replace(
        leaf=numbers[event.leaf] if event.leaf >= 0 else event.leaf,
        started=tuple(numbers[leaf] for leaf in event.started),
        interrupted=tuple(numbers[leaf] for leaf in event.interrupted),
        ended=tuple(one._replace(leaf=numbers[one.leaf]) for one in event.ended),
    )
