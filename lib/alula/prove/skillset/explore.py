"""Explore the reachable situations one by one, breadth first, so that the first path to each is a shortest one."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

from alula.language.counterexamples import StepKind
from alula.prove.limits import Deadline
from alula.prove.skillset.steps import Key, Move, State, TransitionSystem


@dataclass(frozen=True)
class Edge:
    """A step between two situations, by their numbers. ``move`` lacks the details of the step: a counterexample rebuilds them."""

    source: int
    target: int
    kind: StepKind
    subject: tuple[str, ...]
    ended: tuple[str, ...]


@dataclass
class Graph:
    """The reachable situations; number 0 is the initial one. ``faults`` has for each fault the first step that shows it."""

    system: TransitionSystem
    deadline: Deadline
    states: list[State] = field(default_factory=list)
    numbers: dict[State, int] = field(default_factory=dict)
    parents: list[Edge | None] = field(default_factory=list)
    edges: list[list[Edge]] = field(default_factory=list)
    faults: dict[Key, tuple[int, Move]] = field(default_factory=dict)
    started: dict[str, set[int]] = field(default_factory=dict)
    """For each skill the situations in which it can start."""
    complete: bool = False

    def path(self, number: int) -> list[Edge]:
        """Return a shortest way from the initial situation."""
        way: list[Edge] = []
        while (edge := self.parents[number]) is not None:
            way.append(edge)
            number = edge.source
        return way[::-1]

    def backwards(self) -> list[list[int]]:
        """Return for each situation those with a step to it."""
        sources: list[list[int]] = [[] for _ in self.states]
        for number, edges in enumerate(self.edges):
            for edge in edges:
                sources[edge.target].append(number)
        return sources


def explore(system: TransitionSystem, deadline: Deadline, *, most: int) -> Graph:
    """Return the graph, not ``complete`` when there are more than ``most`` situations; raise OutOfTimeError."""
    graph = Graph(system, deadline, started={skill.name: set() for skill in system.skillset.skills})
    todo = deque([_number(graph, system.initial(), None)])
    while todo:
        deadline.check()
        number = todo.popleft()
        for move in system.moves(graph.states[number]):
            for fault in move.faults:
                graph.faults.setdefault(fault, (number, move))
            if move.step is None:
                continue
            if move.kind is StepKind.START:
                graph.started[move.subject[0]].add(number)
            fresh = move.target not in graph.numbers
            target = _number(graph, move.target, (number, move)) if fresh else graph.numbers[move.target]
            # What leaves everything as it was is no step: it can't be told that it was taken.
            if target != number:
                graph.edges[number].append(Edge(number, target, move.kind, move.subject, move.ended))
            if fresh:
                todo.append(target)
        if len(graph.states) > most:
            return graph
    graph.complete = True
    return graph


def _number(graph: Graph, state: State, origin: tuple[int, Move] | None) -> int:
    number = len(graph.states)
    graph.states.append(state)
    graph.numbers[state] = number
    graph.edges.append([])
    graph.parents.append(None if origin is None else Edge(origin[0], number, origin[1].kind, origin[1].subject, origin[1].ended))
    return number
