"""The executor on real nodes: what is ready, what is made, what raises, and the end; rclpy's own is the measure."""

from __future__ import annotations

import threading
import time
from pathlib import Path

import pytest

rclpy = pytest.importorskip("rclpy")

import skillset_ros2_executor_rig as rig  # noqa: E402
from action_msgs.msg import GoalStatus  # noqa: E402
from navigation_interfaces.action import Hover  # noqa: E402
from rclpy.action import ActionServer  # noqa: E402
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup, ReentrantCallbackGroup  # noqa: E402
from rclpy.task import Future  # noqa: E402
from skillset_ros2_executor_rig import DEEP, SOON_S, Counting, First, all_arrived, connected, quiet, turn, turned  # noqa: E402
from std_msgs.msg import String  # noqa: E402
from std_srvs.srv import Trigger  # noqa: E402

from alula_testing.waits import until  # noqa: E402
from skillset_ros2 import ActionClient  # noqa: E402
from skillset_ros2.base import QUIET, RestingGroup  # noqa: E402
from skillset_ros2.executor import RCLPY, NodeExecutor, RclpyExecutor, SparingExecutor, executor_for  # noqa: E402

context, executor, kind, node, other, partner, spun, victim = (
    rig.context,
    rig.executor,
    rig.kind,
    rig.node,
    rig.other,
    rig.partner,
    rig.spun,
    rig.victim,
)


# --- what is ready -------------------------------------------------------------------------------------------------


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
    spun.executor.create_task(lambda: asked.set_result("task") or heard.append("task"))
    until(lambda: {"timer", "service", "guard", "client", "subscription", "task"} <= set(heard), f"all are served: {heard}", SOON_S)
    assert spun.raised == []


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
    spun.executor.create_task(lambda: opened.set_result(None))
    until(lambda: statuses == [GoalStatus.STATUS_SUCCEEDED], "the goal has succeeded", SOON_S)
    client.destroy()
    server.destroy()


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


@pytest.mark.parametrize("kind", [SparingExecutor], ids=["ours"])  # rclpy's takes two
def test_a_message_costs_one_wait(node, other, executor):
    heard, counting = [], Counting(node)
    node.create_subscription(String, "words", heard.append, DEEP)
    words = other.create_publisher(String, "words", DEEP)
    connected(words)
    turn(executor)
    counting.waits = 0
    for _ in range(20):
        words.publish(String())
        executor.spin_once(timeout_sec=SOON_S)
    assert len(heard) == 20
    assert counting.waits < 30  # rclpy's own: 40; the middleware wakes a wait for nothing now and then


def test_an_entity_that_rests_is_not_waited_for_until_it_is_awaited(node, other, executor):
    heard, group, counting = [], RestingGroup(), Counting(node)
    subscription = node.create_subscription(String, "words", heard.append, DEEP, callback_group=group, event_callbacks=QUIET)
    group.resting.add(subscription)
    words = other.create_publisher(String, "words", DEEP)
    connected(words)
    words.publish(String())
    executor.spin_once(timeout_sec=0.5)
    assert heard == []
    assert counting.waits < 20  # were it waited for, each wait would return at once
    group.resting.clear()
    executor.spin_once(timeout_sec=SOON_S)
    assert len(heard) == 1


def test_what_was_ready_is_not_lost_where_the_time_out_changes_from_turn_to_turn(node, executor):
    heard: list[int] = []
    guards = [node.create_guard_condition(lambda number=number: heard.append(number)) for number in range(5)]
    executor.spin_once(timeout_sec=0)
    for guard in guards:
        guard.trigger()
    for number in range(40):
        executor.spin_once(timeout_sec=0.01 + 0.001 * number)
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


# --- what is made ---------------------------------------------------------------------------------------------------


def test_what_a_callback_makes_is_served(kind, context, node, partner, spun):
    heard: list[str] = []
    words = partner.create_publisher(String, "made", DEEP)
    asks = partner.create_client(Trigger, "made")

    def make():
        node.create_subscription(String, "made", lambda _: heard.append("subscription"), DEEP)
        node.create_service(Trigger, "made", lambda _, response: heard.append("service") or response)
        node.create_timer(0.01, lambda: heard.append("timer"))
        node.create_guard_condition(lambda: heard.append("guard")).trigger()

    node.create_guard_condition(make).trigger()
    until(lambda: words.get_subscription_count() == 1, "the subscription is known", SOON_S)
    words.publish(String())
    assert asks.wait_for_service(SOON_S)
    asks.call_async(Trigger.Request())
    until(lambda: {"subscription", "service", "timer", "guard"} <= set(heard), f"all are served: {heard}", SOON_S)
    assert spun.raised == []


def test_what_another_thread_makes_while_the_executor_sleeps_is_served(node, spun, victim):
    quiet(spun)
    victim.call()
    until(lambda: victim.heard, "it is served", SOON_S)
    rung = threading.Event()
    quiet(spun)
    node.create_timer(0.01, rung.set)
    assert rung.wait(SOON_S)


def test_a_node_that_comes_or_goes_in_a_callback_is_served_from_then_on_or_not(context, node, other, executor):
    heard: list[str] = []
    own, guest = (one.create_guard_condition(lambda one=one: heard.append(one.get_name())) for one in (node, other))
    come = node.create_guard_condition(lambda: executor.add_node(other))
    come.trigger()
    turn(executor)
    guest.trigger()
    turn(executor)
    assert heard == ["other"]
    go = other.create_guard_condition(lambda: executor.remove_node(other))
    turn(executor)
    go.trigger()
    turn(executor)
    guest.trigger()
    own.trigger()
    turn(executor)
    assert heard == ["other", "served"]


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
    assert spun.raised == []


# --- exceptions -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("late", [False, True], ids=["at once", "after an await"])
def test_a_callback_that_raises_is_told_once_and_frees_its_group(node, spun, late):
    heard: list[str] = []
    opened, group = Future(), MutuallyExclusiveCallbackGroup()

    async def fail():
        if late:
            await opened
        raise ValueError("broken")

    node.create_guard_condition(fail, group).trigger()
    quiet(spun)
    spun.executor.create_task(lambda: opened.set_result(None))
    until(lambda: spun.raised, "it is told", SOON_S)
    node.create_guard_condition(lambda: heard.append("next"), group).trigger()
    until(lambda: heard == ["next"], "the next is served", SOON_S)
    assert [str(error) for error in spun.raised] == ["broken"]


@pytest.mark.parametrize("kind", [SparingExecutor], ids=["ours"])  # with rclpy's, the group is held for ever
def test_what_can_not_be_taken_is_told_and_frees_its_group(node, executor):
    class Broken(First):
        def take_data(self):
            self.armed = False
            raise ValueError("broken")

    heard: list[str] = []
    broken = Broken(node, lambda: None)
    broken.callback_group = MutuallyExclusiveCallbackGroup()
    broken.callback_group.add_entity(broken)
    guard = node.create_guard_condition(lambda: heard.append("next"), broken.callback_group)
    broken.armed = True
    guard.trigger()
    with pytest.raises(ValueError, match="broken"):
        turn(executor)
    turn(executor)
    assert heard == ["next"]


def test_a_callback_that_raises_is_told_once_and_what_was_ready_beside_it_is_served(node, executor):
    heard: list[str] = []

    def fail():
        raise ValueError("broken")

    guards = [node.create_guard_condition(fail), node.create_guard_condition(lambda: heard.append("after"))]
    executor.spin_once(timeout_sec=0)
    for guard in guards:
        guard.trigger()
    with pytest.raises(ValueError, match="broken"):
        executor.spin_once(timeout_sec=SOON_S)
    executor.spin_once(timeout_sec=SOON_S)
    executor.spin_once(timeout_sec=0)
    assert heard == ["after"]


# --- turns, nested ones, and the end --------------------------------------------------------------------------------


def test_a_callback_spins_for_an_answer_of_the_same_executor(node, partner, executor):
    partner.create_service(Trigger, "answer", lambda _, response: response)
    client = node.create_client(Trigger, "answer", callback_group=ReentrantCallbackGroup())
    assert client.wait_for_service(SOON_S)
    answered: list[bool] = []

    def ask():
        future = client.call_async(Trigger.Request())
        executor.spin_until_future_complete(future, timeout_sec=SOON_S)
        answered.append(future.done())

    node.create_guard_condition(ask).trigger()
    turn(executor)
    assert answered == [True]


def test_a_turn_without_time_does_what_is_there_and_returns(node, executor):
    heard: list[str] = []
    for _ in range(3):
        executor.spin_once(timeout_sec=0)
    node.create_guard_condition(lambda: heard.append("rung")).trigger()
    for _ in range(3):
        executor.spin_once(timeout_sec=0)
    assert heard == ["rung"]


def test_a_wake_up_of_another_thread_disturbs_nothing(node, spun):
    heard: list[str] = []
    for _ in range(100):
        spun.executor.wake()
    guard = node.create_guard_condition(lambda: heard.append("rung"))
    quiet(spun)
    guard.trigger()
    until(lambda: heard == ["rung"], "it is served", SOON_S)
    assert spun.raised == []


@pytest.mark.parametrize("where", ["callback", "task", "thread"])
def test_a_shutdown_ends_the_spinning(node, spun, where):
    guard = node.create_guard_condition(lambda: spun.executor.shutdown(timeout_sec=0))
    quiet(spun)
    if where == "callback":
        guard.trigger()
    elif where == "task":
        spun.executor.create_task(spun.executor.shutdown, 0)
    else:
        spun.executor.shutdown(timeout_sec=0)
    spun.thread.join(SOON_S)
    assert not spun.thread.is_alive()
    assert spun.raised == []


def test_a_shutdown_leaves_what_awaits_where_it_is(node, spun):
    heard: list[str] = []

    async def wait():
        await Future()
        heard.append("on")

    node.create_guard_condition(wait).trigger()
    quiet(spun)
    spun.executor.shutdown(timeout_sec=0)
    spun.thread.join(SOON_S)
    assert not spun.thread.is_alive()
    assert (heard, spun.raised) == ([], [])


def test_the_end_of_the_context_ends_the_spinning(context, spun):
    quiet(spun)
    context.try_shutdown()
    spun.thread.join(SOON_S)
    assert not spun.thread.is_alive()


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


# --- which executor -------------------------------------------------------------------------------------------------


def test_with_another_rclpy_than_the_pinned_one_its_own_loop_and_handlers_are_taken():
    assert NodeExecutor is executor_for(RCLPY) is SparingExecutor
    assert executor_for("7.1.7") is executor_for("") is RclpyExecutor
    changed = {name for name, value in vars(RclpyExecutor).items() if callable(value) or isinstance(value, property)}
    assert changed == {"can_execute", "idle", "wait_for_ready_callbacks"}


def test_the_pinned_rclpy_is_the_one_that_the_executor_knows():
    pins = (Path(__file__).resolve().parents[4] / "setup/jazzy.txt").read_text(encoding="utf-8").split()
    assert f"ros-rclpy=={RCLPY}" in pins
