"""When the battery is said to fail, without a graph: a node whose clock and topics are the test's."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
from skillset_ros2 import Watch

from rover_robot.hooks.power import HOME_S, RESERVE, Battery, Supply


class FakeNode:
    """Calls timers and subscriptions when the test says so."""

    def __init__(self):
        self.now_s, self.timers, self.subscribers = 0.0, [], []

    def get_clock(self):
        return SimpleNamespace(now=lambda: SimpleNamespace(nanoseconds=round(self.now_s * 1e9)))

    def create_timer(self, _period_s, callback):
        self.timers.append(callback)

    def create_subscription(self, _kind, _topic, callback, _depth):
        self.subscribers.append(callback)

    def tell(self, now_s, level):
        self.now_s = now_s
        for call in self.subscribers:
            call(SimpleNamespace(percentage=level))
        for call in self.timers:
            call()


def level_at_its_end(falls_s, monkeypatch):
    """Let a full battery fall by so much a second; return how full it is when `supply` says that it fails; None: it never does."""
    node, ends = FakeNode(), []
    supply = Supply(Battery(node, Watch(node)))
    monkeypatch.setattr(supply, "terminated_FAILING", lambda _execution, message: ends.append(message))
    supply.on_dispatch(SimpleNamespace())
    level = 1.0
    for second in range(1000):
        level = 1.0 - falls_s * second
        node.tell(float(second), level)
        if ends or level <= 0.0:
            break
    return level if ends else None


@pytest.mark.parametrize("falls_s", [0.005, 0.008])
def test_it_turns_back_when_the_way_home_would_leave_too_little_and_not_before(falls_s, monkeypatch):
    level = level_at_its_end(falls_s, monkeypatch)
    assert RESERVE + HOME_S * falls_s - 1.01 * falls_s < level <= RESERVE + HOME_S * falls_s


def test_a_battery_that_falls_as_ever_is_the_models(monkeypatch):
    assert level_at_its_end(0.0004 * 5, monkeypatch) is None
