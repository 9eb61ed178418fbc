"""The executor that collects entities when they change, on real nodes; what rclpy's own does in the same order is its measure."""

from __future__ import annotations

import contextlib
import threading
import time

import pytest

rclpy = pytest.importorskip("rclpy")

from action_msgs.msg import GoalStatus  # noqa: E402
from navigation_interfaces.action import Hover  # noqa: E402
from rclpy.action import ActionClient, ActionServer  # noqa: E402
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup  # noqa: E402
from rclpy.context import Context  # noqa: E402
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor  # noqa: E402
from rclpy.impl.implementation_singleton import rclpy_implementation  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.qos import QoSProfile  # noqa: E402
from rclpy.task import Future  # noqa: E402
from std_msgs.msg import String  # noqa: E402
from std_srvs.srv import Trigger  # noqa: E402

from alula_testing.waits import until  # noqa: E402
from skillset_ros2 import StaticSingleThreadedExecutor  # noqa: E402
from skillset_ros2.base import QUIET, RestingGroup  # noqa: E402

SOON_S = 30.0
NOW_S = 0.0
LONG_S = 20.0
DEEP = QoSProfile(depth=100)


@pytest.fixture
def context(ros2_domain):
    context = Context()
    rclpy.init(context=context)
    yield context
    context.try_shutdown()


@pytest.fixture
def node(context):
    node = Node("served", context=context)
    yield node
    node.destroy_node()


@pytest.fixture
def other(context):
    node = Node("other", context=context)
    yield node
    node.destroy_node()


@pytest.fixture
def executor(context, node):
    executor = StaticSingleThreadedExecutor(context=context)
    executor.add_node(node)
    yield executor
    executor.shutdown(timeout_sec=0)


@pytest.fixture
def spun(executor):
    """Return the executor, spun by a thread of its own, and what callbacks have raised there."""
    raised: list[Exception] = []

    def spin():
        while True:
            try:
                executor.spin()
            except ExternalShutdownException:
                return
            except Exception as error:  # noqa: BLE001 - looked at by the test
                raised.append(error)
                continue
            return

    thread = threading.Thread(target=spin)
    thread.start()
    yield executor, raised
    executor.shutdown(timeout_sec=0)
    thread.join(SOON_S)
    assert not thread.is_alive()


def connected(publisher, subscribers: int = 1) -> None:
    until(lambda: publisher.get_subscription_count() == subscribers, "the subscribers are known", SOON_S)


def all_arrived(context, node, server) -> bool:
    """Tell whether the last two subscriptions, the service "ask" and the action server of a node each have something to take."""
    subscriptions = list(node.subscriptions)[-2:]
    service = next(service for service in node.services if service.srv_name.endswith("ask"))
    inside = server.get_num_entities()
    wait_set = rclpy_implementation.WaitSet(2, 0, inside.num_timers, 0, 1 + inside.num_services, 0, context.handle)
    wait_set.clear_entities()
    for subscription in subscriptions:
        wait_set.add_subscription(subscription.handle)
    wait_set.add_service(service.handle)
    server.add_to_wait_set(wait_set)
    wait_set.wait(0)
    arrived = len(wait_set.get_ready_entities("subscription")) == len(subscriptions)
    return arrived and service.handle.pointer in wait_set.get_ready_entities("service") and server.is_ready(wait_set)


def turned(executor, condition, what: str) -> None:
    """Turn the executor here until a condition holds."""
    end_s = time.monotonic() + SOON_S
    while not condition():
        assert time.monotonic() < end_s, what
        executor.spin_once(timeout_sec=0.05)


def test_every_kind_of_entity_is_served(node, other, spun):
    heard: list[str] = []
    asked = Future()
    node.create_subscription(String, "words", lambda message: heard.append(message.data), DEEP)
    node.create_timer(0.01, lambda: heard.append("timer"))
    node.create_service(Trigger, "ask", lambda _, response: heard.append("service") or response)
    guard = node.create_guard_condition(lambda: heard.append("guard"))
    client = node.create_client(Trigger, "ask")
    assert client.wait_for_service(SOON_S)
    client.call_async(Trigger.Request()).add_done_callback(lambda _: heard.append("client"))
    words = other.create_publisher(String, "words", DEEP)
    connected(words)
    words.publish(String(data="subscription"))
    guard.trigger()
    spun[0].create_task(lambda: asked.set_result("task") or heard.append("task"))
    until(lambda: {"timer", "service", "guard", "client", "subscription", "task"} <= set(heard), f"all are served: {heard}", SOON_S)
    assert spun[1] == []


def test_an_action_with_a_coroutine_that_awaits_comes_to_its_end(node, spun):
    opened = Future()

    async def execute(goal):
        await opened
        goal.succeed()
        return Hover.Result()

    server = ActionServer(node, Hover, "hover", execute)
    client = ActionClient(node, Hover, "hover")
    assert client.wait_for_server(SOON_S)
    statuses: list[int] = []
    client.send_goal_async(Hover.Goal()).add_done_callback(
        lambda sent: sent.result().get_result_async().add_done_callback(lambda ended: statuses.append(ended.result().status))
    )
    until(lambda: server._goal_handles, "the goal is there", SOON_S)
    assert statuses == []
    spun[0].create_task(lambda: opened.set_result(None))
    until(lambda: statuses == [GoalStatus.STATUS_SUCCEEDED], "the goal has succeeded", SOON_S)
    client.destroy()
    server.destroy()


def test_what_awaits_holds_its_callback_group_and_no_other(node, other, spun):
    opened, heard = Future(), []
    held, free = MutuallyExclusiveCallbackGroup(), MutuallyExclusiveCallbackGroup()

    async def wait(message):
        heard.append(f"begin {message.data}")
        await opened
        heard.append(f"end {message.data}")

    node.create_subscription(String, "held", wait, DEEP, callback_group=held)
    node.create_subscription(String, "free", lambda message: heard.append(message.data), DEEP, callback_group=free)
    slow, fast = other.create_publisher(String, "held", DEEP), other.create_publisher(String, "free", DEEP)
    connected(slow)
    connected(fast)
    slow.publish(String(data="1"))
    until(lambda: heard == ["begin 1"], "the first waits", SOON_S)
    slow.publish(String(data="2"))
    for number in range(5):
        fast.publish(String(data=f"fast {number}"))
    until(lambda: heard[-1] == "fast 4", "the other group is served", SOON_S)
    assert "begin 2" not in heard
    spun[0].create_task(lambda: opened.set_result(None))
    until(lambda: heard[-1] == "end 2", f"both have ended: {heard}", SOON_S)
    assert [word for word in heard if not word.startswith("fast")] == ["begin 1", "end 1", "begin 2", "end 2"]


def test_a_task_goes_on_with_what_an_older_task_brings(spun):
    brought, ended = Future(), threading.Event()

    async def wait():
        await brought
        ended.set()

    def make_both():
        spun[0].create_task(lambda: brought.set_result(None))
        spun[0].create_task(wait)  # the newest is run first

    spun[0].create_task(make_both)
    assert ended.wait(SOON_S)


@pytest.mark.parametrize("kind", [SingleThreadedExecutor, StaticSingleThreadedExecutor])
def test_what_is_ready_at_once_is_dealt_with_in_rclpys_order(context, node, other, kind):
    order: list[str] = []
    executor = kind(context=context)
    node.create_service(Trigger, "ask", lambda _, response: order.append("service") or response)
    guard = node.create_guard_condition(lambda: order.append("guard"))
    node.create_subscription(String, "second", lambda message: order.append(message.data), DEEP)
    node.create_subscription(String, "first", lambda message: order.append(message.data), DEEP)
    timer = node.create_timer(0.001, lambda: (order.append("timer"), timer.cancel()))
    server = ActionServer(node, Hover, "hover", lambda _: Hover.Result(), goal_callback=lambda _: order.append("waitable"))
    client, goals = other.create_client(Trigger, "ask"), ActionClient(other, Hover, "hover")
    first, second = other.create_publisher(String, "first", DEEP), other.create_publisher(String, "second", DEEP)
    connected(first)
    connected(second)
    assert client.wait_for_service(SOON_S)
    assert goals.wait_for_server(SOON_S)
    client.call_async(Trigger.Request())
    goals.send_goal_async(Hover.Goal())
    first.publish(String(data="first"))
    second.publish(String(data="second"))
    guard.trigger()
    until(lambda: timer.is_ready() and all_arrived(context, node, server), "all that was sent is there", SOON_S)
    executor.add_node(node)
    turned(executor, lambda: len(order) == 6, f"all six are served: {order}")
    assert order == ["waitable", "timer", "second", "first", "guard", "service"]
    executor.shutdown(timeout_sec=0)
    goals.destroy()
    server.destroy()


def test_entities_are_collected_when_they_change_and_not_at_each_turn(node, other, executor, monkeypatch):
    collected, heard = [], []
    collect = executor._collect
    monkeypatch.setattr(executor, "_collect", lambda: collected.append(1) or collect())
    node.create_subscription(String, "words", lambda message: heard.append(message.data), DEEP)
    words = other.create_publisher(String, "words", DEEP)
    connected(words)
    executor.spin_once(timeout_sec=NOW_S)
    collected.clear()
    for number in range(20):
        words.publish(String(data=str(number)))
        turned(executor, lambda number=number: len(heard) == number + 1, f"message {number} is heard")
    assert collected == []
    node.create_subscription(String, "more", lambda message: heard.append(message.data), DEEP)
    executor.spin_once(timeout_sec=NOW_S)
    assert collected == [1]


def test_a_message_costs_one_wait(node, other, executor, monkeypatch):
    waits, heard = [], []
    wait = executor._wait
    monkeypatch.setattr(executor, "_wait", lambda timeout_ns: waits.append(1) or wait(timeout_ns))
    node.create_subscription(String, "words", heard.append, DEEP)
    words = other.create_publisher(String, "words", DEEP)
    connected(words)
    executor.spin_once(timeout_sec=NOW_S)
    waits.clear()
    for _ in range(20):
        words.publish(String())
        executor.spin_once(timeout_sec=LONG_S)
    assert len(heard) == 20
    assert len(waits) < 30  # rclpy's own: 40; the middleware wakes a wait for nothing now and then


def test_what_comes_and_goes_while_it_spins_from_other_threads_and_callbacks_is_served_and_disturbs_nothing(node, other, spun):
    heard: list[str] = []
    node.create_subscription(String, "words", lambda message: heard.append(message.data), DEEP)
    words, passing = other.create_publisher(String, "words", DEEP), other.create_publisher(String, "passing", DEEP)
    connected(words)

    def come_and_go(rounds: int) -> None:
        for _ in range(rounds):
            met = threading.Event()
            subscription = node.create_subscription(String, "passing", lambda _, met=met: met.set(), DEEP)
            service = node.create_service(Trigger, "passing", lambda _, response: response)
            client, timer = node.create_client(Trigger, "passing"), node.create_timer(0.001, lambda: None)
            connected(passing)
            passing.publish(String())
            assert met.wait(SOON_S)
            node.destroy_timer(timer)
            node.destroy_client(client)
            node.destroy_service(service)
            node.destroy_subscription(subscription)
            until(lambda: passing.get_subscription_count() == 0, "it has gone", SOON_S)

    def within(message) -> None:
        """Make a subscription in a callback, which takes itself away with its first message."""
        made = []
        made.append(
            node.create_subscription(String, "nested", lambda _: (heard.append(message.data), node.destroy_subscription(made[0])), DEEP)
        )

    node.create_subscription(String, "nest", within, DEEP)
    nest, nested = other.create_publisher(String, "nest", DEEP), other.create_publisher(String, "nested", DEEP)
    connected(nest)
    thread = threading.Thread(target=come_and_go, args=(15,))
    thread.start()
    for number in range(15):
        words.publish(String(data=str(number)))
        nest.publish(String(data=f"nested {number}"))
        connected(nested)
        nested.publish(String())
        until(lambda number=number: f"nested {number}" in heard, f"nested {number} is heard", SOON_S)
        until(lambda: nested.get_subscription_count() == 0, "it has gone", SOON_S)
    thread.join(SOON_S)
    assert not thread.is_alive()
    until(lambda: len(heard) == 30, f"all are heard: {heard}", SOON_S)
    assert [word for word in heard if not word.startswith("nested")] == [str(number) for number in range(15)]
    assert spun[1] == []


def test_an_entity_that_rests_is_not_waited_for_until_it_is_awaited(node, other, executor, monkeypatch):
    waits, heard, group = [], [], RestingGroup()
    wait = executor._wait
    monkeypatch.setattr(executor, "_wait", lambda timeout_ns: waits.append(1) or wait(timeout_ns))
    subscription = node.create_subscription(String, "words", heard.append, DEEP, callback_group=group, event_callbacks=QUIET)
    group.resting.add(subscription)
    words = other.create_publisher(String, "words", DEEP)
    connected(words)
    words.publish(String())
    executor.spin_once(timeout_sec=0.5)
    assert heard == []
    assert len(waits) < 20  # were it waited for, each wait would return at once
    group.resting.clear()
    executor.spin_once(timeout_sec=LONG_S)
    assert len(heard) == 1


def test_a_callback_that_raises_is_told_once_and_what_was_ready_beside_it_is_served(node, executor):
    heard: list[str] = []

    def fail():
        raise ValueError("broken")

    guards = [node.create_guard_condition(fail), node.create_guard_condition(lambda: heard.append("after"))]
    executor.spin_once(timeout_sec=NOW_S)
    for guard in guards:
        guard.trigger()
    with pytest.raises(ValueError, match="broken"):
        executor.spin_once(timeout_sec=LONG_S)
    executor.spin_once(timeout_sec=LONG_S)
    executor.spin_once(timeout_sec=NOW_S)
    assert heard == ["after"]


def test_what_was_ready_is_not_lost_where_the_time_out_changes_from_turn_to_turn(node, executor):
    heard: list[int] = []
    guards = [node.create_guard_condition(lambda number=number: heard.append(number)) for number in range(5)]
    executor.spin_once(timeout_sec=NOW_S)
    for guard in guards:
        guard.trigger()
    for turn in range(40):
        executor.spin_once(timeout_sec=0.01 + 0.001 * turn)
    assert sorted(heard) == [0, 1, 2, 3, 4]


def test_a_timer_that_a_callback_of_the_same_turn_has_cancelled_does_not_ring(node, executor):
    rung: list[int] = []
    timers = []

    def ring(number: int) -> None:
        rung.append(number)
        for timer in timers:
            timer.cancel()

    timers += [node.create_timer(0.001, lambda number=number: ring(number)) for number in range(3)]
    until(lambda: all(timer.is_ready() for timer in timers), "all are due", SOON_S)
    for _ in range(5):
        executor.spin_once(timeout_sec=0.01)
    assert rung == [0]


def test_a_turn_lasts_as_long_as_it_may_and_not_longer_than_it_must(node, executor):
    begun_s = time.monotonic()
    executor.spin_once(timeout_sec=0.2)
    assert time.monotonic() - begun_s >= 0.2
    done = Future()
    thread = threading.Timer(0.1, lambda: done.set_result("done"))
    thread.start()
    executor.spin_until_future_complete(done, timeout_sec=SOON_S)
    assert done.result() == "done"
    never = Future()
    executor.spin_until_future_complete(never, timeout_sec=0.2)
    assert not never.done()
    thread.join()


def test_a_node_that_was_taken_away_is_served_no_more_and_one_that_came_is(node, other, context, executor):
    heard: list[str] = []
    guards = [one.create_guard_condition(lambda one=one: heard.append(one.get_name())) for one in (node, other)]
    executor.add_node(other)
    for guard in guards:
        guard.trigger()
    turned(executor, lambda: len(heard) == 2, "both are served")
    heard.clear()
    executor.remove_node(node)
    for guard in guards:
        guard.trigger()
    turned(executor, lambda: "other" in heard, "the one that is left is served")
    executor.spin_once(timeout_sec=NOW_S)
    assert heard == ["other"]


def test_the_end_of_the_context_ends_the_spinning(context, executor):
    ended = threading.Event()

    def spin():
        with contextlib.suppress(ExternalShutdownException):
            while True:
                executor.spin_once()
        ended.set()

    thread = threading.Thread(target=spin)
    thread.start()
    context.try_shutdown()
    assert ended.wait(SOON_S)
    thread.join()
