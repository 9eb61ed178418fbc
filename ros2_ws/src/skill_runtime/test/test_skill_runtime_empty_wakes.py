"""Waits that return at once with nothing: when they count as a busy loop, and that ending one loses no message."""

from __future__ import annotations

import time

import pytest

rclpy = pytest.importorskip("rclpy")

from rclpy.executors import SingleThreadedExecutor  # noqa: E402
from rclpy.node import Node  # noqa: E402
from std_msgs.msg import String  # noqa: E402
from std_srvs.srv import Trigger  # noqa: E402

from alula_testing.waits import until  # noqa: E402
from skill_runtime.ros2.empty_wakes import AT_ONCE_S, KINDS, ROW, watch_empty_wakes  # noqa: E402

SOON_S = 10.0


class WaitSet:
    """What a wait has brought."""

    def __init__(self, **ready: int) -> None:
        self._ready = ready

    def get_ready_entities(self, kind: str) -> list[int]:
        return list(range(self._ready.get(kind, 0)))


@pytest.fixture
def node(ros2_domain):
    node = Node("empty_wakes")
    yield node
    node.destroy_node()


def turn(wakes, wait_set, *, after_s: float = 0.0) -> bool:
    wakes.add_to_wait_set(wait_set)
    time.sleep(after_s)
    ready = wakes.is_ready(wait_set)
    if ready:
        wakes.take_data()
    return ready


def test_a_row_of_empty_wakes_is_a_busy_loop(node):
    wakes = watch_empty_wakes(node)
    assert watch_empty_wakes(node) is wakes
    assert [turn(wakes, WaitSet()) for _ in range(2 * ROW)] == ([False] * (ROW - 1) + [True]) * 2


@pytest.mark.parametrize("kind", KINDS)
def test_a_wake_with_something_ready_ends_the_row(node, kind):
    wakes = watch_empty_wakes(node)
    for _ in range(3):
        assert not any(turn(wakes, WaitSet()) for _ in range(ROW - 1))
        assert not turn(wakes, WaitSet(**{kind: 1}))


def test_a_wait_that_has_lasted_ends_the_row(node):
    wakes = watch_empty_wakes(node)
    assert not any(turn(wakes, WaitSet(), after_s=2.0 * AT_ONCE_S) for _ in range(2 * ROW))


def test_what_is_taken_on_the_way_is_dealt_with(node):
    wakes, heard = watch_empty_wakes(node), []
    node.create_subscription(String, "words", lambda message: heard.append(message.data), 10)
    node.create_service(Trigger, "ask", lambda _, response: heard.append("asked") or response)
    other = Node("empty_wakes_other")
    words, client = other.create_publisher(String, "words", 10), other.create_client(Trigger, "ask")
    until(lambda: words.get_subscription_count() and client.service_is_ready(), "they know each other", SOON_S)
    words.publish(String(data="one"))
    client.call_async(Trigger.Request())
    executor = SingleThreadedExecutor()
    executor.add_node(node)

    def end_a_loop() -> bool:
        executor.create_task(wakes.execute, None)
        executor.spin_once(timeout_sec=0)
        return sorted(heard) == ["asked", "one"]

    until(end_a_loop, "both are dealt with", SOON_S)
    assert wakes.ended
    executor.shutdown()
    other.destroy_node()
