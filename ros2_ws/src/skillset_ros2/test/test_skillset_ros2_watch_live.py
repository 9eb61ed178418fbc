"""A watch that rests while nothing is needed of it: it is woken from any thread, no wake-up is lost, and simulated time never rests."""

from __future__ import annotations

import threading

import pytest

rclpy = pytest.importorskip("rclpy")

from rclpy.node import Node  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402
from rclpy.time import Time  # noqa: E402
from rosgraph_msgs.msg import Clock  # noqa: E402

from alula_testing.ros2 import end_spinning, spin  # noqa: E402
from alula_testing.waits import until  # noqa: E402
from skillset_ros2 import NodeExecutor, Watch  # noqa: E402

SOON_S = 20.0
PERIOD_S = 0.002


class Task:
    """What a watch looks at until it is done; ``left``: how many looks that takes."""

    def __init__(self) -> None:
        self.left = self.looks = 0

    def look(self) -> None:
        self.looks += 1
        self.left = max(0, self.left - 1)

    def needed(self) -> bool:
        return self.left > 0


@pytest.fixture
def made(ros2_domain):
    """Return a function that makes a node which a thread spins."""
    executor = NodeExecutor()
    nodes: list[Node] = []

    def make(**options):
        nodes.append(Node("watching", **options))
        executor.add_node(nodes[-1])
        return nodes[-1]

    thread = threading.Thread(target=spin, args=(executor,), daemon=True)
    thread.start()
    yield make
    end_spinning(executor, thread)
    for node in nodes:
        node.destroy_node()


def rests(watch) -> bool:
    return watch._timer.is_canceled()


def test_a_watch_of_which_nothing_is_needed_rests_until_it_is_woken(made):
    watch, task, other = Watch(made(), PERIOD_S), Task(), Task()
    watch.every(task.look, task.needed)
    watch.every(other.look, other.needed)
    until(lambda: rests(watch), "it rests", SOON_S)
    looks, since_s = task.looks, watch.awake_since_s
    watch.wake()
    until(lambda: task.looks > looks and rests(watch), "it has looked, and rests again", SOON_S)
    assert watch.awake_since_s > since_s
    other.left, since_s = 5, watch.awake_since_s
    watch.wake()
    until(lambda: other.left == 0 and rests(watch), "it has looked as often as one of them needed", SOON_S)
    looks = task.looks
    watch.wake()
    watch.wake()
    until(lambda: task.looks > looks and rests(watch), "it has looked, and rests again", SOON_S)


def test_what_is_always_needed_keeps_a_watch_awake_and_wakes_one_that_rests(made):
    watch, task, always = Watch(made(), PERIOD_S), Task(), Task()
    watch.every(task.look, task.needed)
    until(lambda: rests(watch), "it rests", SOON_S)
    watch.every(always.look)
    until(lambda: always.looks > 10, "it goes on", SOON_S)
    assert not rests(watch)


def test_no_wake_up_is_lost_however_the_end_of_a_look_and_a_need_meet(made):
    watch, task = Watch(made(), PERIOD_S), Task()
    watch.every(task.look, task.needed)
    for number in range(500):
        task.left = 1 + number % 2
        watch.wake()
        # Perhaps just before the look, in it, or between it and the rest.
        until(lambda: task.left == 0, f"need {number} is looked at", SOON_S, every_s=0.0)


def test_with_a_simulated_clock_a_watch_never_rests(made):
    node = made(parameter_overrides=[Parameter("use_sim_time", value=True)])
    watch, task = Watch(node, 1.0), Task()
    watch.every(task.look, task.needed)
    clock = made().create_publisher(Clock, "/clock", 10)
    for second in range(1, 5):
        looks = task.looks

        def looked(second=second, looks=looks):
            clock.publish(Clock(clock=Time(seconds=second, nanoseconds=500_000_000).to_msg()))
            return task.looks > looks

        until(looked, f"it looks in second {second}", SOON_S, every_s=0.02)
