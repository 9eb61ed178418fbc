"""Searches in graphs, beside the slow way: all that a step more adds, until nothing does."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from alula.common.graphs import ShortestWays, components, reachable_from

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


@given(GRAPHS, st.sets(st.integers(0, 9)))
def test_each_vertex_is_found_by_a_shortest_way_and_the_nearest_first(graph: dict[int, list[int]], starts: set[int]) -> None:
    ways = ShortestWays(starts, lambda one: [((one, after), after) for after in graph.get(one, ())])
    found = list(ways)
    assert len(found) == len(set(found))
    assert set(found) == reachable_from(starts, lambda one: graph.get(one, ()))
    ring, distance = set(starts), 0
    left = set(found)
    while ring:
        assert set(found[: len(ring)]) == ring
        for vertex in ring:
            steps = ways.to(vertex)
            assert len(steps) == distance
            assert [after for _, after in steps[:-1]] == [before for before, _ in steps[1:]]
            assert (steps[0][0] if steps else vertex) in starts
            assert ways.step_to(vertex) == (steps[-1] if steps else None)
        left, found, distance = left - ring, found[len(ring) :], distance + 1
        ring = {after for vertex in ring for after in graph.get(vertex, ())} & left


@given(GRAPHS, st.sets(st.integers(0, 9)), st.integers(0, 40))
def test_each_step_comes_once_and_before_its_end_is_found_by_it(graph: dict[int, list[int]], starts: set[int], most: int) -> None:
    ways = ShortestWays(starts, lambda one: [((one, after), after) for after in graph.get(one, ())])
    taken: list[tuple[int, int]] = []
    for vertex, step, after in ways.steps():
        assert step == (vertex, after)
        assert set(ways.found) == starts | {one for _, one in taken}
        taken.append(step)
        if len(taken) == most:
            break
    whole = [(vertex, after) for vertex in ways.found if vertex not in ways.open for after in graph.get(vertex, ())]
    assert taken[: len(whole)] == whole
    if len(taken) != most:
        assert (set(ways.found), list(ways.open)) == (reachable_from(starts, lambda one: graph.get(one, ())), [])


@given(GRAPHS, st.sets(st.integers(0, 9), min_size=1), st.integers(0, 9))
def test_a_search_goes_on_from_what_is_added(graph: dict[int, list[int]], starts: set[int], added: int) -> None:
    ways = ShortestWays(starts, lambda one: [((one, after), after) for after in graph.get(one, ())])
    found = list(ways)
    ways.add(found[0], (found[0], added), added)
    again = {vertex for vertex, _, _ in ways.steps()}
    assert again.isdisjoint(found)
    assert set(ways.found) == reachable_from([*starts, added], lambda one: graph.get(one, ()))


@given(GRAPHS, st.lists(st.integers(0, 9)))
def test_what_reaches_each_other_is_a_component_and_comes_after_what_it_leads_to(graph: dict[int, list[int]], starts: list[int]) -> None:
    reached = {vertex: reachable_from([vertex], lambda one: graph.get(one, ())) for vertex in range(10)}
    several = list(components(starts, lambda one: graph.get(one, ())))
    assert {one for component in several for one in component} == reachable_from(starts, lambda one: graph.get(one, ()))
    for place, component in enumerate(several):
        for vertex in component:
            assert {other for other in reached[vertex] if vertex in reached[other]} == set(component)
            assert reached[vertex] <= {one for earlier in several[: place + 1] for one in earlier}
