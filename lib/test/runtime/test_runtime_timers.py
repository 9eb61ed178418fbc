"""The queue of timers: jobs come in the order of their moments, and what was cancelled leaves nothing behind."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from alula.runtime.timers import FEW, TimerQueue


@given(st.lists(st.tuples(st.integers(0, 20), st.booleans()), max_size=200))
def test_jobs_come_in_order_without_those_that_were_cancelled(asked: list[tuple[int, bool]]) -> None:
    queue = TimerQueue()
    for number, (when_ns, cancelled) in enumerate(asked):
        timer = queue.put(when_ns, lambda number=number: number)
        if cancelled:
            timer.cancel()
    wanted = [(when_ns, number) for number, (when_ns, cancelled) in enumerate(asked) if not cancelled]
    found = []
    while (due := queue.pop_due(20)) is not None:
        found.append((due[0], due[1]()))
    assert found == sorted(wanted)


@given(st.integers(0, 30))
def test_timers_that_are_cancelled_again_and_again_do_not_pile_up(waiting: int) -> None:
    queue = TimerQueue()
    for when_ns in range(waiting):
        queue.put(1_000_000 + when_ns, list)
    for when_ns in range(2000):
        queue.put(when_ns, list).cancel()
    assert len(queue._timers) <= FEW + 2 * (FEW + waiting)
    assert queue.due_ns == (1_000_000 if waiting else None)
