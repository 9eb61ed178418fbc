"""Jobs on a simulated clock: when they are done, and that a tick of which nothing is due wakes the executor once."""

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
from skillset_ros2.executor import SparingExecutor  # noqa: E402
from skillset_ros2.middleware import RclpyMiddleware  # noqa: E402

SOON_S = 10.0
TICK_S = 0.02
TICKS = 50
SPARE = 10
"""Turns that have other causes."""


class CountingNode(Node):
    """Counts how often an executor gathers its subscriptions for a wait; it looks at them once more for what is ready."""

    looks = 0

    @property
    def subscriptions(self):
        self.looks += 1
        return super().subscriptions


class Simulated:
    """A node on /clock with an executor that spins it, the middleware on it, and what publishes /clock."""

    def __init__(self) -> None:
        self.node = CountingNode("simulated", parameter_overrides=[Parameter("use_sim_time", value=True)])
        self.middleware = RclpyMiddleware(self.node, "navigation")
        self.now_s = 1.0
        self._ticker = Node("clock_of_the_test")
        self._publisher = self._ticker.create_publisher(Clock, "/clock", 10)
        self._executor = SparingExecutor()
        self._executor.add_node(self.node)
        self._thread = threading.Thread(target=spin, args=(self._executor,), daemon=True)
        self._thread.start()

    def tick(self, s: float = TICK_S) -> None:
        """Let time pass, and wait until the node has it; a tick that DDS lost is told again."""
        self.now_s += s
        now_ns = round(self.now_s * 1e9)

        def there() -> bool:
            if self.node.get_clock().now().nanoseconds != now_ns:
                self._publisher.publish(Clock(clock=Time(nanoseconds=now_ns).to_msg()))
            return self.node.get_clock().now().nanoseconds == now_ns

        until(there, "the clock is followed", SOON_S)

    def at(self, s: float, job) -> None:
        """Have a job done at a moment, from another thread than the executor's."""
        self.middleware.at(round(s * 1e9), job)

    def close(self) -> None:
        end_spinning(self._executor, self._thread)
        self.node.destroy_node()
        self._ticker.destroy_node()


@pytest.fixture
def simulated(ros2_domain):
    simulated = Simulated()
    simulated.tick()
    yield simulated
    simulated.close()


def test_jobs_are_done_at_their_moments(simulated):
    begun_s, done = simulated.now_s, []
    for number in (3, 1, 2):
        simulated.at(begun_s + number * TICK_S, lambda number=number: done.append((number, simulated.middleware.now_ns())))
    for number in (1, 2, 3):
        assert len(done) == number - 1
        simulated.tick()
        until(lambda number=number: len(done) == number, "the job is done", SOON_S)
    assert done == [(number, round((begun_s + number * TICK_S) * 1e9)) for number in (1, 2, 3)]


def test_a_job_whose_moment_has_passed_is_done_while_the_clock_stands_still(simulated):
    done = threading.Event()
    simulated.tick(10.0)
    simulated.at(simulated.now_s - 1.0, done.set)
    assert done.wait(SOON_S)


@pytest.mark.parametrize("due_s", [None, 1000.0], ids=["no job", "a job that is not due"])
def test_a_tick_of_which_nothing_is_due_is_one_turn_of_the_executor(simulated, due_s):
    done = threading.Event()
    simulated.tick(10.0)
    simulated.at(simulated.now_s + TICK_S, done.set)
    simulated.tick()
    assert done.wait(SOON_S)
    if due_s is not None:
        simulated.at(simulated.now_s + due_s, done.clear)
    simulated.tick()
    before = simulated.node.looks
    for _ in range(TICKS):
        simulated.tick()
    turns = (simulated.node.looks - before) / 2
    assert TICKS / 2 < turns < TICKS + SPARE
