"""By which clocks a part of the functional layer waits: calls by the slower one of two, watchers by the mission's."""

from __future__ import annotations

import pytest

pytest.importorskip("rclpy")

from uav_skills.calls import Response
from uav_skills.functional import WATCH_PERIOD_S, FunctionalPart


class Node:
    """A node whose watch calls each period of mission clock, and a monotonic clock beside it."""

    def __init__(self, steady_per_mission_s):
        self.now_s, self.steady_s, self._each_s, self._looks = 50.0, 1000.0, WATCH_PERIOD_S * steady_per_mission_s, []
        self.awake_since_s, self.woken, self.needed = 0.0, 0, lambda: True
        self.part = FunctionalPart(self, self, lambda: self.steady_s)

    def every(self, look, needed):
        self._looks.append(look)
        self.needed = needed

    def wake(self):
        self.woken += 1

    def passes(self, mission_s):
        for _ in range(round(mission_s / WATCH_PERIOD_S)):
            self.now_s, self.steady_s = self.now_s + WATCH_PERIOD_S, self.steady_s + self._each_s
            for look in self._looks:
                look()


class Service:
    def __init__(self, *, ready):
        self.service_name, self._ready, self.sent = "/it", ready, []

    def service_is_ready(self):
        return self._ready

    def call_async(self, request):
        self.sent.append(request)
        return self

    def add_done_callback(self, callback):
        """Never answer."""

    def remove_pending_request(self, future):
        assert future is self


@pytest.mark.parametrize(
    ("steady_per_mission_s", "mission_per_limit_s"), [(0.1, 10.0), (1.0, 1.0), (8.0, 1.0)], ids=["ahead", "even", "creeping"]
)
def test_all_limits_of_a_call_last_as_long_by_both_clocks(steady_per_mission_s, mission_per_limit_s):
    node, responses = Node(steady_per_mission_s), []
    away, mute, stop = Service(ready=False), Service(ready=True), Service(ready=True)
    near_s = WATCH_PERIOD_S * 2

    def lasts(limit_s, is_over):
        assert not is_over()
        node.passes(limit_s * mission_per_limit_s - near_s)
        assert not is_over()
        node.passes(2 * near_s)
        assert is_over()

    node.part._calls.submit(away, "a", responses.append)
    lasts(3.0, lambda: responses)
    assert responses == [Response(accepted=False, answered=False, reason="service /it is not there for 3 s")]
    node.part._calls.submit(mute, "b", responses.append)
    node.part._calls.submit(stop, "c")
    began_s = node.now_s
    lasts(0.3, lambda: stop.sent)
    lasts(20.0 - (node.now_s - began_s) / mission_per_limit_s, lambda: len(responses) > 1)
    assert responses[1].reason == "service /it does not answer for 20 s"


def test_watchers_count_mission_clock():
    node = Node(steady_per_mission_s=0.1)
    told_s = []
    node.part.watch(lambda: told_s.append(node.part.now_s), lambda: True)
    node.passes(2.0)
    assert told_s[-1] == pytest.approx(2.0)


def test_a_clock_that_did_not_come_through_is_neither_silence_nor_patience():
    node, responses = Node(steady_per_mission_s=1.0), []
    node.part._calls.submit(Service(ready=False), "a", responses.append)
    node.now_s, node.steady_s = node.now_s + 60.0, node.steady_s + 60.0
    node.passes(2.0)
    assert responses == []
    assert node.part.now_s < 2.5


def test_what_passes_while_nothing_is_needed_is_neither_silence_nor_patience():
    node, responses = Node(steady_per_mission_s=1.0), []
    node.passes(1.0)
    before_s = node.part.now_s
    node.now_s, node.steady_s = node.now_s + 60.0, node.steady_s + 60.0
    node.awake_since_s = node.now_s
    node.part._submit(Service(ready=False), "a", responses.append)
    node.passes(WATCH_PERIOD_S)
    assert node.part.now_s == pytest.approx(before_s + WATCH_PERIOD_S)


def test_a_part_is_watched_while_a_watcher_needs_it_or_a_call_is_without_a_response():
    node, responses, watched = Node(steady_per_mission_s=1.0), [], []
    node.part.watch(lambda: None, lambda: bool(watched))
    assert not node.needed()
    watched.append("an execution")
    assert node.needed()
    watched.clear()
    node.part._submit(Service(ready=False), "a", responses.append)
    assert node.woken == 1
    assert node.needed()
    node.passes(4.0)
    assert len(responses) == 1
    assert not node.needed()
