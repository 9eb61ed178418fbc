"""Concretise a path: one that is found backwards through sets is walked forwards by steps of the semantics.

Sets may be wider than what can happen (see ``encoding``); a way that can't be walked is no counterexample.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from typing import Any

from alula.prove.skillset.explore import Edge, Graph
from alula.prove.skillset.sets import Sets
from alula.prove.skillset.steps import Key, Move, State, TransitionSystem

MOST_IN_A_LOOP = 500


class Walker:
    """Walks from the initial situation to sets."""

    def __init__(self, system: TransitionSystem, sets: Sets) -> None:
        self.system = system
        self.sets = sets

    def reaches(self, goal: Any) -> bool:
        """Return whether some run reaches the goal."""
        return bool(self.sets.narrowed(goal) != self.sets.bdd.false and (self.sets.exact or self._rings(goal)))

    def to(self, goal: Any) -> list[Move] | None:
        """Return the steps of a short run to the goal, or None when there is no such set or none was found to walk."""
        rings = self._rings(goal)
        state = self.system.initial()
        moves: list[Move] = []
        for ring in rings[::-1][1:]:
            move = next((m for m in self._real_moves(state) if self.sets.contains(ring, m.target)), None)
            if move is None:
                return None
            moves.append(move)
            state = move.target
        return moves if rings else None

    def fault(self, fault: Key, goal: Any) -> list[Move] | None:
        """Return a run whose last step shows a fault; ``goal`` are the situations before that step."""
        moves = self.to(goal)
        if moves is None:
            return None
        last = next((m for m in self.system.moves(self.end(moves)) if fault in m.faults), None)
        return None if last is None else [*moves, last]

    def end(self, moves: list[Move]) -> State:
        """Return the last state of a run."""
        return moves[-1].target if moves else self.system.initial()

    def _real_moves(self, state: State) -> Iterator[Move]:
        return (move for move in self.system.moves(state) if move.step is not None)

    def _rings(self, goal: Any) -> list[Any]:
        """Return the goal, what is one step before it, and so on up to the initial situation; nothing when it is out of reach."""
        rings = [self.sets.narrowed(goal)]
        seen = rings[0]
        while rings[-1] != self.sets.bdd.false:
            if rings[-1] & self.sets.initial != self.sets.bdd.false:
                return rings
            parts: list[Any] = []
            for part in self.sets.nearer(rings[-1]):
                if part & self.sets.initial != self.sets.bdd.false:
                    return [*rings, part]
                parts.append(part & ~seen)
            rings.append(self.sets.model.any_of(parts))
            seen |= rings[-1]
        return []

    def graph(self, moves: list[Move], inside: Any) -> tuple[Graph, set[int]]:
        """Return the graph of a run and of what follows inside a set, as far as is looked at; and which situations were looked at.

        The last situation of the run is number ``len(moves)``.
        """
        graph = Graph(self.system, self.sets.deadline)
        path = [self.system.initial(), *(move.target for move in moves)]
        for number, state in enumerate(path):
            edge = _edge(number - 1, number, moves[number - 1]) if number else None
            graph.states.append(state)
            graph.parents.append(edge)
            graph.edges.append([])
        graph.numbers[path[-1]] = len(moves)
        looked: set[int] = set()
        todo = deque([len(moves)])
        while todo and len(looked) < MOST_IN_A_LOOP:
            self.sets.deadline.check()
            number = todo.popleft()
            if number in looked or not self.sets.contains(inside, graph.states[number]):
                continue
            looked.add(number)
            for move in self._real_moves(graph.states[number]):
                target = graph.numbers.setdefault(move.target, len(graph.states))
                if target == len(graph.states):
                    graph.states.append(move.target)
                    graph.parents.append(_edge(number, target, move))
                    graph.edges.append([])
                    todo.append(target)
                if target != number:
                    graph.edges[number].append(_edge(number, target, move))
        return graph, looked


def _edge(source: int, target: int, move: Move) -> Edge:
    return Edge(source, target, move.kind, move.subject, move.ended)
