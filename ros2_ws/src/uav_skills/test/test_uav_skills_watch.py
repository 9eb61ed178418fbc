"""The watch of the functional layer: beside the messages, by its timer where they stay away, and on a clock without jumps."""

from __future__ import annotations

from itertools import pairwise
from types import SimpleNamespace

import pytest

pytest.importorskip("rclpy")

from uav_skills.functional import LONGEST_STEP_S, SILENT_S, WATCH_PERIOD_S, Watch


class FakeNode:
    """A clock that is set by hand, and a timer that remembers for when it was set."""

    def __init__(self) -> None:
        self.now_s = 50.0
        self.due_s = self.now_s + WATCH_PERIOD_S
        self.timer_period_ns = round(WATCH_PERIOD_S * 1e9)

    def create_timer(self, _period_s, ring, callback_group):
        self.ring = ring
        return self

    def get_clock(self):
        return SimpleNamespace(now=lambda: SimpleNamespace(nanoseconds=round(self.now_s * 1e9)))

    def reset(self) -> None:
        self.due_s = self.now_s + self.timer_period_ns / 1e9

    def run(self, seconds, watch, *, every_s=None):
        """Let time pass in ticks of 20 ms, with a message now and then; return how often the timer rang."""
        rung = 0
        for tick in range(1, round(seconds / 0.02) + 1):
            self.now_s = round(self.now_s + 0.02, 6)
            if every_s is not None and tick % round(every_s / 0.02) == 0:
                watch.hear(lambda _: None, "a message")
            if self.now_s >= self.due_s - 1e-6:
                self.due_s += self.timer_period_ns / 1e9
                self.ring()
                rung += 1
        return rung


@pytest.fixture
def node():
    return FakeNode()


@pytest.fixture
def watched(node):
    watch, times = Watch(node), []
    watch.add(lambda: times.append(round(watch.now_s, 3)))
    return watch, times


@pytest.mark.parametrize("every_s", [0.04, 0.1, 0.14])
def test_while_messages_come_the_timer_does_not_ring(node, watched, every_s):
    watch, times = watched
    node.run(1.0, watch, every_s=every_s)
    del times[:]
    assert node.run(10 * every_s * 5, watch, every_s=every_s) == 0
    between = {round(later - earlier, 3) for earlier, later in pairwise(times)}
    assert between <= {0.1, 0.12, 0.14}


def test_where_messages_stay_away_the_timer_watches_ten_times_a_second(node, watched):
    watch, times = watched
    assert node.run(1.0, watch) == 10
    node.run(1.0, watch, every_s=0.1)
    heard_s = watch.now_s
    del times[:]
    assert node.run(1.0, watch) == 9
    # The first time at the first tick after SILENT_S, then at once in a period.
    assert times[0] == pytest.approx(heard_s + SILENT_S, abs=0.02)
    assert [round(later - earlier, 2) for earlier, later in pairwise(times)] == [WATCH_PERIOD_S] * 8


def test_a_message_is_told_at_its_time_and_before_what_is_watched(node, watched):
    watch, times = watched
    told = []
    node.now_s += 0.1
    watch.hear(lambda message: told.append((message, round(watch.now_s, 3), list(times))), "news")
    assert told == [("news", 0.1, [])]
    assert times == [0.1]


def test_a_jump_of_the_clock_counts_as_one_step(node, watched):
    watch, _ = watched
    node.now_s += 30.0
    node.ring()
    assert watch.now_s == pytest.approx(LONGEST_STEP_S)
    node.now_s -= 10.0
    node.ring()
    assert watch.now_s == pytest.approx(LONGEST_STEP_S)
