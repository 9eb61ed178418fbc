"""Waits that return at once with nothing: when they count as a busy loop, and that ending one loses no message."""

from __future__ import annotations

import contextlib
from types import SimpleNamespace

import pytest

rclpy = pytest.importorskip("rclpy")

from rclpy.executors import SingleThreadedExecutor  # noqa: E402
from rclpy.node import Node  # noqa: E402
from std_msgs.msg import String  # noqa: E402
from std_srvs.srv import Trigger  # noqa: E402

from alula_testing.waits import until  # noqa: E402
from skillset_ros2 import empty_wakes  # noqa: E402
from skillset_ros2.empty_wakes import AT_ONCE_S, ROW, watch_empty_wakes  # noqa: E402
from skillset_ros2.executor import KINDS  # noqa: E402
from skillset_ros2.middleware import RclpyMiddleware  # noqa: E402

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


@pytest.fixture
def turn(node, monkeypatch):
    """Return a function that makes the executor's wait, as far as the watch sees it, by a clock of its own."""
    now_s = [100.0]
    monkeypatch.setattr(empty_wakes, "time", SimpleNamespace(monotonic=lambda: now_s[0]))
    wakes = watch_empty_wakes(node)

    def wait(*, lasts_s: float = 0.0, **ready: int) -> bool:
        wakes.add_to_wait_set(None)
        now_s[0] += lasts_s
        busy = wakes.is_ready(WaitSet(**ready))
        if busy:
            wakes.take_data()
        return busy

    return wait


def test_a_node_has_one_watch(node):
    assert watch_empty_wakes(node) is watch_empty_wakes(node)


def test_a_row_of_empty_wakes_is_a_busy_loop(turn):
    assert [turn() for _ in range(2 * ROW)] == ([False] * (ROW - 1) + [True]) * 2


@pytest.mark.parametrize("kind", KINDS)
def test_a_wake_with_something_ready_ends_the_row(turn, kind):
    for _ in range(3):
        assert not any(turn() for _ in range(ROW - 1))
        assert not turn(**{kind: 1})


def test_a_wait_that_has_lasted_ends_the_row(turn):
    assert not any(turn(lasts_s=2.0 * AT_ONCE_S) for _ in range(2 * ROW))


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
        """Take from all readers, without a turn of the executor: what is heard was taken here."""
        with contextlib.suppress(StopIteration):
            wakes.execute(None).send(None)
        return sorted(heard) == ["asked", "one"]

    until(end_a_loop, "both are dealt with", SOON_S)
    executor.shutdown()
    other.destroy_node()


def test_the_nodes_of_skillsets_and_their_clients_are_watched(node):
    RclpyMiddleware(node, "navigation")
    assert [type(one).__name__ for one in node.waitables].count("EmptyWakes") == 1
