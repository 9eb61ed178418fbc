"""Searches in graphs that are given by what follows each of their nodes."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable
from typing import TypeVar

Vertex = TypeVar("Vertex", bound=Hashable)


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
