"""Ticks of a simulated clock that nothing is due at do not wake the executor; what is due at one comes after what was sent before it."""

from __future__ import annotations

import threading

import pytest

rclpy = pytest.importorskip("rclpy")

from rclpy.node import Node  # noqa: E402
from rclpy.parameter import Parameter  # noqa: E402
from rclpy.time import Time  # noqa: E402
from rosgraph_msgs.msg import Clock  # noqa: E402
from std_msgs.msg import Float64, String  # noqa: E402

from alula.runtime.middleware import Topic  # noqa: E402
from alula_testing.ros2 import end_spinning, spin  # noqa: E402
from alula_testing.waits import until  # noqa: E402
from skillset_ros2.executor import SparingExecutor  # noqa: E402
from skillset_ros2.middleware import RclpyMiddleware  # noqa: E402
from skillset_ros2.names import latched  # noqa: E402
from skillset_ros2.simulated_time import SimulatedTime  # noqa: E402

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
    """A node that takes /clock beside its executor, what spins it, and what publishes to it."""

    def __init__(self) -> None:
        self.node = CountingNode("simulated", parameter_overrides=[Parameter("use_sim_time", value=True)])
        self.time = SimulatedTime(self.node)
        self.middleware = RclpyMiddleware(self.node, "navigation")
        self.now_s = 1.0
        self.ticker = Node("clock_of_the_test")
        self._publisher = self.ticker.create_publisher(Clock, "/clock", 10)
        self._executor = SparingExecutor()
        self._executor.add_node(self.node)
        self._thread = threading.Thread(target=spin, args=(self._executor,), daemon=True)
        self._thread.start()

    def tell(self, s: float = TICK_S) -> None:
        """Let time pass."""
        self.now_s += s
        self._publisher.publish(Clock(clock=Time(nanoseconds=round(self.now_s * 1e9)).to_msg()))

    def tick(self, s: float = TICK_S) -> None:
        """Let time pass, and wait until the node has it; a tick that DDS lost is told again."""
        self.now_s += s

        def there() -> bool:
            if self.has_it:
                return True
            self.tell(0.0)
            return self.has_it

        until(there, "the clock is followed", SOON_S)

    @property
    def has_it(self) -> bool:
        return self.node.get_clock().now().nanoseconds == round(self.now_s * 1e9)

    def close(self) -> None:
        self.time.close()
        end_spinning(self._executor, self._thread)
        self.node.destroy_node()
        self.ticker.destroy_node()


@pytest.fixture
def simulated(ros2_domain):
    simulated = Simulated()
    simulated.tick()
    yield simulated
    simulated.close()


@pytest.mark.parametrize("due_s", [None, 1000.0], ids=["no job", "a job that is not due"])
def test_a_tick_of_which_nothing_is_due_does_not_wake_the_executor(simulated, due_s):
    if due_s is not None:
        simulated.middleware.at(round((simulated.now_s + due_s) * 1e9), lambda: None)
    simulated.tick()
    before = simulated.node.looks
    for _ in range(TICKS):
        simulated.tick()
    assert (simulated.node.looks - before) / 2 < SPARE


def test_jobs_are_done_at_the_first_tick_that_they_are_due_at(simulated):
    begun_s, done = simulated.now_s, []
    for number in (3, 1, 2):
        moment_ns = round((begun_s + (number - 0.5) * TICK_S) * 1e9)
        simulated.middleware.at(moment_ns, lambda number=number: done.append((number, simulated.middleware.now_ns())))
    for number in (1, 2, 3):
        assert len(done) == number - 1
        simulated.tick()
        until(lambda number=number: len(done) == number, "the job is done", SOON_S)
    assert done == [(number, round((begun_s + number * TICK_S) * 1e9)) for number in (1, 2, 3)]


def test_a_timer_of_rclpy_rings_at_each_of_its_periods(simulated):
    rung = []
    simulated.node.create_timer(5 * TICK_S, lambda: rung.append(simulated.middleware.now_ns()))
    begun_ns = round(simulated.now_s * 1e9)
    for number in range(1, 21):
        simulated.tick()
        until(lambda number=number: len(rung) == number // 5, "the timer has rung", SOON_S)
    assert rung == [begun_ns + round(number * 5 * TICK_S * 1e9) for number in range(1, 5)]


def test_what_comes_too_soon_after_a_value_is_left_out_and_does_not_wake_the_executor(simulated):
    """A second is fifty ticks: of news at each of them, every fiftieth is heard."""
    heard = []
    topic = Topic("news", type_name="std_msgs/Float64", every_s=1.0)
    simulated.middleware.subscribe(topic, lambda sample: heard.append((sample.value.data, simulated.middleware.now_ns())))
    publisher = simulated.ticker.create_publisher(Float64, "navigation/news", latched(1))
    until(lambda: publisher.get_subscription_count() == 1, "the news are followed", SOON_S)
    sent = {}
    before = simulated.node.looks
    for number in range(3 * TICKS):
        simulated.tick()
        sent[float(number)] = simulated.middleware.now_ns()
        publisher.publish(Float64(data=float(number)))
        publisher.wait_for_all_acked()
        if number % TICKS == 0:
            until(lambda number=number: len(heard) == number // TICKS + 1, "the news are heard", SOON_S)
    assert heard == [(number, sent[number]) for number in (0.0, float(TICKS), 2.0 * TICKS)]
    assert (simulated.node.looks - before) / 2 < 3 * 3 + SPARE  # a value, a tick, and what is due at it: that the next one is awaited


def test_what_was_sent_before_a_tick_comes_before_what_is_due_at_it(simulated):
    """Time passes while the executor is busy: a job that waits for a message until then must not find it missing."""
    told, busy, go_on = [], threading.Event(), threading.Event()
    publisher = simulated.ticker.create_publisher(String, "news", 10)
    simulated.node.create_subscription(String, "news", lambda message: told.append(message.data), 10)
    until(lambda: publisher.get_subscription_count() == 1, "the news are followed", SOON_S)
    received: list[object] = []
    taken = simulated.time._take
    simulated.time._take = lambda tick: (taken(tick), received.append(tick))
    for number in range(5):

        def hold() -> None:
            busy.set()
            go_on.wait(SOON_S)

        busy.clear()
        go_on.clear()
        received.clear()
        told.clear()
        simulated.middleware.at(round((simulated.now_s + TICK_S) * 1e9), lambda: told.append("due"))
        simulated.middleware.submit(hold)
        assert busy.wait(SOON_S)
        publisher.publish(String(data=f"news {number}"))
        publisher.wait_for_all_acked()
        simulated.now_s += TICK_S
        until(lambda: simulated.tell(0.0) or received, "the tick has come while the executor is busy", SOON_S)
        go_on.set()
        until(lambda: len(told) == 2, "both are done", SOON_S)
        assert told == [f"news {number}", "due"]


def test_a_node_with_the_wall_clock_is_left_as_it_is(ros2_domain):
    node = Node("on_the_wall")
    waitables = len(list(node.waitables))
    time = SimulatedTime(node)
    assert len(list(node.waitables)) == waitables
    time.close()
    node.destroy_node()


def test_the_thread_ends_with_the_context_of_a_node_that_was_given_up(ros2_domain):
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=ros2_domain)
    SimulatedTime(Node("given_up", context=context, parameter_overrides=[Parameter("use_sim_time", value=True)]))
    assert "given_up_clock" in {thread.name for thread in threading.enumerate()}
    context.try_shutdown()
    assert "given_up_clock" not in {thread.name for thread in threading.enumerate()}
