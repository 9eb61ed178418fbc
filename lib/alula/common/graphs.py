"""Searches in graphs that are given by what follows each of their nodes."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Collection, Hashable, Iterable, Iterator
from typing import Generic, TypeVar

Vertex = TypeVar("Vertex", bound=Hashable)
Step = TypeVar("Step")


def reachable_from(starts: Iterable[Vertex], following: Callable[[Vertex], Iterable[Vertex]]) -> set[Vertex]:
    """Return the starts and all that is reached from them.

    Args:
        starts: where the search begins.
        following: what follows a vertex, or comes before it: then the result is all from which the starts are reached. It is called once
            for each vertex.
    """
    found = set(starts)
    left = list(found)
    while left:
        for vertex in following(left.pop()):
            if vertex not in found:
                found.add(vertex)
                left.append(vertex)
    return found


class ShortestWays(Generic[Vertex, Step]):
    """Search breadth first, as far as it is iterated over: each vertex comes once, nearest first, the starts before all others.

    ``following`` returns the steps from a vertex, each with the vertex that it leads to; it is called once for each vertex.
    """

    def __init__(self, starts: Iterable[Vertex], following: Callable[[Vertex], Iterable[tuple[Step, Vertex]]]) -> None:
        self._following = following
        self._origins: dict[Vertex, tuple[Vertex, Step] | None] = dict.fromkeys(starts)
        self._todo = deque(self._origins)

    def __iter__(self) -> Iterator[Vertex]:
        yield from tuple(self._origins)
        for vertex, step, after in self.steps():
            if after not in self._origins:
                self.add(vertex, step, after)
                yield after

    def steps(self) -> Iterator[tuple[Vertex, Step, Vertex]]:
        """Search on, and yield each step from each vertex, with where it begins and ends, before its end counts as found by it."""
        while self._todo:
            vertex = self._todo[0]
            for step, after in self._following(vertex):
                yield vertex, step, after
                self.add(vertex, step, after)
            self._todo.popleft()

    def add(self, vertex: Vertex, step: Step, after: Vertex) -> None:
        """Count the end of a step as found, unless it is: the search goes on from there."""
        if after not in self._origins:
            self._origins[after] = (vertex, step)
            self._todo.append(after)

    @property
    def found(self) -> Collection[Vertex]:
        """All that was found, in its order."""
        return self._origins.keys()

    @property
    def open(self) -> Collection[Vertex]:
        """The nodes that were found and whose successors were not all looked at."""
        return self._todo

    def step_to(self, vertex: Vertex) -> Step | None:
        """Return the step by which a vertex was found, None for a start."""
        origin = self._origins[vertex]
        return None if origin is None else origin[1]

    def before(self, vertex: Vertex) -> Vertex | None:
        """Return the vertex from which a vertex was found, None for a start."""
        origin = self._origins[vertex]
        return None if origin is None else origin[0]

    def to(self, vertex: Vertex) -> list[Step]:
        """Return the steps of a shortest way from a start to a vertex that was found."""
        steps: list[Step] = []
        while (origin := self._origins[vertex]) is not None:
            vertex, step = origin
            steps.append(step)
        return steps[::-1]


def components(vertices: Iterable[Vertex], following: Callable[[Vertex], Iterable[Vertex]]) -> Iterator[list[Vertex]]:
    """Yield the strongly connected components of what is reached from vertices (Tarjan 1972, without recursion).

    A component comes after all that it leads to. Of its vertices, the one that was reached first is the first.
    """
    index: dict[Vertex, int] = {}
    low: dict[Vertex, int] = {}
    stack: list[Vertex] = []
    open_: set[Vertex] = set()
    work: list[tuple[Vertex, Iterator[Vertex]]] = []

    def enter(vertex: Vertex) -> None:
        index[vertex] = low[vertex] = len(index)
        stack.append(vertex)
        open_.add(vertex)
        work.append((vertex, iter(following(vertex))))

    for root in vertices:
        if root not in index:
            enter(root)
        while work:
            vertex, rest = work[-1]
            after = next(rest, None)
            if after is None:
                work.pop()
                if work:
                    low[work[-1][0]] = min(low[work[-1][0]], low[vertex])
                if low[vertex] == index[vertex]:
                    yield _popped(stack, open_, vertex)
            elif after not in index:
                enter(after)
            elif after in open_:
                low[vertex] = min(low[vertex], index[after])


def _popped(stack: list[Vertex], open_: set[Vertex], vertex: Vertex) -> list[Vertex]:
    """Take the component of a vertex, which is on top of the stack."""
    component: list[Vertex] = []
    while not component or component[-1] != vertex:
        component.append(stack.pop())
        open_.discard(component[-1])
    return component[::-1]
