"""The search in graphs, beside the slow way: all that a step more adds, until nothing does."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from alula.common.graphs import reachable_from

GRAPHS = st.dictionaries(st.integers(0, 9), st.lists(st.integers(0, 9), max_size=4), max_size=10)


@given(GRAPHS, st.sets(st.integers(0, 9)))
def test_all_that_is_reached_is_found_and_each_vertex_is_looked_at_once(graph: dict[int, list[int]], starts: set[int]) -> None:
    asked: list[int] = []

    def following(vertex: int) -> list[int]:
        asked.append(vertex)
        return graph.get(vertex, [])

    slow = set(starts)
    while more := {after for vertex in slow for after in graph.get(vertex, ())} - slow:
        slow |= more
    assert reachable_from(starts, following) == slow
    assert sorted(asked) == sorted(slow)
