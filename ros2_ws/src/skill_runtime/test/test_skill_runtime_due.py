"""The timer of what is due: it wakes the executor for what has changed, and for nothing else."""

from __future__ import annotations

import pytest

pytest.importorskip("rclpy")

from skill_runtime.ros2.due import DueTimer

NOW_NS = 1000


class Timer:
    def __init__(self) -> None:
        self.runs = False
        self.timer_period_ns = 0

    def reset(self) -> None:
        self.runs = True

    def cancel(self) -> None:
        self.runs = False


class Node:
    """Node, clock and guard condition in one: each wish of the timer is written down, none is fulfilled by itself."""

    def __init__(self) -> None:
        self.timer = Timer()
        self.wakes = 0
        self.nanoseconds = NOW_NS

    def get_clock(self):
        return self

    def now(self):
        return self

    def create_timer(self, period_s, ring, autostart):
        self.ring = ring
        return self.timer

    def create_guard_condition(self, wake):
        self.wake = wake
        return self

    def trigger(self) -> None:
        self.wakes += 1


class Engine:
    """Something that is due; ``meanwhile`` happens right after it was asked when."""

    def __init__(self) -> None:
        self.due = None
        self.ticks = 0
        self.meanwhile = None

    @property
    def due_ns(self):
        due, happens, self.meanwhile = self.due, self.meanwhile, None
        if happens is not None:
            happens()
        return due

    def tick(self) -> None:
        self.ticks += 1
        self.due = None


@pytest.fixture
def due():
    node, engine = Node(), Engine()
    return DueTimer(node, engine), node, engine


def test_nothing_due_wakes_nobody(due):
    timer, node, _ = due
    timer.look()
    assert node.wakes == 0


def test_the_timer_is_set_once_for_what_is_due_and_rings_once(due):
    timer, node, engine = due
    engine.due = NOW_NS + 70
    timer.look()
    node.wake()
    timer.look()
    assert (node.wakes, node.timer.runs, node.timer.timer_period_ns) == (1, True, 70)
    node.ring()
    timer.look()
    assert (node.wakes, node.timer.runs, engine.ticks) == (1, False, 1)


def test_what_is_not_due_any_more_stops_the_timer(due):
    timer, node, engine = due
    engine.due = NOW_NS + 70
    timer.look()
    node.wake()
    engine.due = None
    timer.look()
    assert node.wakes == 2
    node.wake()
    assert not node.timer.runs


@pytest.mark.parametrize("before", [None, NOW_NS + 70])
def test_a_change_while_it_is_being_set_is_not_lost(due, before):
    """Back to what it was set for before: only the setting itself tells that this is a change."""
    timer, node, engine = due
    engine.due = before
    timer.look()
    node.wake()
    wakes = node.wakes
    engine.due = NOW_NS + 90

    def change() -> None:
        engine.due = before
        timer.look()

    engine.meanwhile = change
    node.wake()
    assert node.wakes == wakes + 1
    node.wake()
    assert node.timer.runs == (before is not None)
    assert before is None or node.timer.timer_period_ns == 70
