"""Cycles of events that have no rate: while the system goes round one, time passes all the same.

A resource that flips at any time, as one of a broken sensor may, could flip without end in no time; then nothing else would ever happen.
No robot does that, so where clocks run on such a cycle, it is left some time. A cycle on which no clock runs is the software's own.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from fractions import Fraction

from alula.odds.process import Choice, Process


def unhurried(process: Process) -> Process:
    """Return the process with the states of each such cycle merged into one, from which the steps out of the cycle remain."""
    at_once = [[to for choice in choices if (to := _instant(choice)) is not None] for choices in process.choices]
    choices = list(process.choices)
    for circle in _circles(at_once):
        if any(choice.mean_s for state in circle for choice in process.choices[state]):
            first, inside = min(circle), frozenset(circle)
            kept = [one for state in circle for one in process.choices[state] if not _stays(one, state, inside)]
            choices = [(Choice({first: Fraction(1)}),) if state in inside else one for state, one in enumerate(choices)]
            choices[first] = tuple(kept)
    return replace(process, choices=tuple(choices))


def _instant(choice: Choice) -> int | None:
    return next(iter(choice.to)) if len(choice.to) == 1 and not choice.mean_s else None


def _stays(choice: Choice, state: int, circle: frozenset[int]) -> bool:
    to = _instant(choice)
    return to in circle and to != state  # one that stays where it is waits for ever: that is no hurry


def _circles(edges: Sequence[Sequence[int]]) -> Iterator[list[int]]:
    """Yield the strongly connected components of several nodes (Kosaraju)."""
    back: list[list[int]] = [[] for _ in edges]
    for at, targets in enumerate(edges):
        for to in targets:
            back[to].append(at)
    left = set(range(len(edges)))
    order = [at for start in range(len(edges)) for at in _left_after(start, edges, left)]
    left = set(order)
    for start in reversed(order):
        found = list(_left_after(start, back, left))
        if len(found) > 1:
            yield found


def _left_after(start: int, edges: Sequence[Sequence[int]], left: set[int]) -> Iterator[int]:
    """Yield what can be reached of what is left, each after all that it leads to, and take it away."""
    if start not in left:
        return
    left.remove(start)
    path = [(start, iter(edges[start]))]
    while path:
        at, targets = path[-1]
        to = next((one for one in targets if one in left), None)
        if to is None:
            path.pop()
            yield at
        else:
            left.remove(to)
            path.append((to, iter(edges[to])))
