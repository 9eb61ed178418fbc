"""Runs of one mission that another does not take, to be flown in both."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Protocol

from alula.missions.mission_file import MissionFile
from alula.missions.part import MissionPart
from alula.model.model import Skillset
from alula.prove.mission.play import Played, play
from alula.prove.mission.regions import Regions
from alula.prove.mission.run import MissionRun, run_of
from alula.prove.mission.state import Event, Kind, State
from alula.prove.mission.system import System
from mission_mutations.sameness import Edge, Graph, Seen, keys_of


def differing(one: Seen, other: Seen, most: int) -> Iterator[MissionRun]:
    """Yield runs of the first up to something that the other does not do there; those of few ticks first.

    The other is followed by what it asks for with the same managers. It may take a run all the same: a flight shows it. Then come runs up
    to what the other need not do there: it asks something more, and does otherwise by one of the answers, or waits by it.
    """
    followed = _followed(one.regions, one.graph, other.graph)
    several = (
        _runs(one.regions, one.graph, other.graph, followed),
        _runs_by_answers(one, other.graph.edges, followed),
        _runs_by_answers(one, _Waiting(other), followed),
    )
    for runs in several:
        yield from (run_of(one.regions.system, *run) for run in islice(runs, most))


def writing(one: Seen, other: Seen, most: int) -> Iterator[MissionRun]:
    """Yield runs to each way to end, through a tick for which the other asks as well, but ticks other nodes that deal in values."""
    runs = (run for number, edge in _odd(one, other) for run in _to_ends(one.regions, number, edge))
    yield from (run_of(one.regions.system, *run) for run in islice(runs, most))


def _odd(one: Seen, other: Seen) -> Iterator[tuple[int, Edge]]:
    for number, known in enumerate(_followed(one.regions, one.graph, other.graph)):
        for edge in one.graph.edges[number]:
            there = {theirs.shows for at in known for theirs in other.graph.edges[at] if edge.like(theirs)}
            if there and edge.shows not in there:
                yield number, edge


def _to_ends(regions: Regions, number: int, edge: Edge) -> Iterator[tuple[list[Event], State]]:
    """Yield runs through a tick, on to each outcome by as few ticks as any."""
    memories = regions.system.ticker.memories
    events, state = regions.run_on(number, *edge.way, most=1)
    for outcome in sorted({end for region in regions.regions if (end := memories[region.memory].end)}, key=lambda end: end.value):
        on = Regions(regions.system, regions.deadline)
        on.explore(state, lambda region: memories[region.memory].end is outcome)  # noqa: B023 - it is asked now
        last = on.regions[-1]
        if memories[last.memory].end is outcome:
            managers = on.soonest(len(on.regions) - 1, last.sets)
            yield [*events, *on.run(len(on.regions) - 1, dict(enumerate(managers)))], State(last.memory, managers)


def _followed(one: Regions, graph: Graph, other: Graph) -> list[frozenset[int]]:
    """Return for each region of the first where the other can be there; it stays where it is while the first asks for nothing."""
    followed: list[frozenset[int]] = [frozenset({0})]
    for number in range(1, len(one.regions)):
        origin = one.regions[number].origin
        assert origin is not None  # noqa: S101 - only the first has none
        before, ticked = origin
        there = [edge for edge in graph.edges[before] if edge.target == number and edge.way in ticked.ways]
        after: set[int] = set()
        for at in followed[before]:
            alike = {edge.target for edge in other.edges[at] if any(mine.like(edge) for mine in there)}
            after |= alike or ({at} if any(mine.quiet for mine in there) else set())
        followed.append(frozenset(after))
    return followed


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


class _Waiting:
    """The ticks of a mission that leave all as it is."""

    def __init__(self, seen: Seen) -> None:
        self._seen = seen

    def __getitem__(self, number: int) -> Sequence[Edge]:
        return self._seen.waiting(number)


class _Edges(Protocol):
    """Ticks out of each region."""

    def __getitem__(self, number: int, /) -> Sequence[Edge]: ...


def _runs_by_answers(one: Seen, other: _Edges, followed: Sequence[frozenset[int]]) -> Iterator[tuple[list[Event], State]]:
    for number, known in enumerate(followed):
        for edge in one.graph.edges[number]:
            for theirs in (theirs for at in known for theirs in other[at] if edge.unlike(theirs)):
                yield _with_choices_of(one, number, edge, theirs)


def _with_choices_of(one: Seen, number: int, edge: Edge, theirs: Edge) -> tuple[list[Event], State]:
    """Return a run through a tick, with managers with which the other does something else, and with what the other is told then."""
    outcome, sets = edge.way
    some = tuple(frozenset(each for each in own if one.one(place, each) in theirs.sets[place]) for place, own in enumerate(sets))
    events, state = one.regions.run_on(number, outcome, some, most=1)
    told = tuple(each for each in theirs.way[0].choices if each.question not in edge.choices)
    return _until_it_asks(one.regions.system, [*events[:-1], events[-1]._replace(choices=(*events[-1].choices, *told))], state)


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


def flown(run: MissionRun, of: System, path: Path, by: System, skillsets: Sequence[Skillset], part: MissionPart) -> Played | None:
    """Fly a mission over its own managers; None where it does not take the run of another, step for step, to the same end."""
    here = {key: number for number, key in enumerate(keys_of(by))}
    keys = keys_of(of)
    if any(keys[leaf] not in here for event in run.events for leaf in _leaves(event)):
        return None
    numbers = [here.get(key, -1) for key in keys]
    moved = replace(run, events=tuple(_moved(event, numbers) for event in run.events), skillsets=tuple(skillsets))
    played = play(MissionFile.read(path, moved.skillsets, part), moved)
    return None if played.left else played


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
