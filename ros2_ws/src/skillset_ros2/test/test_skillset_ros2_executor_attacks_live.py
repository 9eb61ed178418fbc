"""What is destroyed while the executor has it in its hands, and tasks that await one another; rclpy's own is the measure."""

from __future__ import annotations

import threading
import time

import pytest

rclpy = pytest.importorskip("rclpy")

import skillset_ros2_executor_rig as rig  # noqa: E402
from navigation_interfaces.action import Hover  # noqa: E402
from rclpy.action import ActionServer  # noqa: E402
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup, ReentrantCallbackGroup  # noqa: E402
from rclpy.exceptions import InvalidHandle  # noqa: E402
from rclpy.task import Future  # noqa: E402
from rclpy.waitable import NumberOfEntities  # noqa: E402
from skillset_ros2_executor_rig import DEEP, SOON_S, First, Victim, connected, make_node, quiet, turn, turned  # noqa: E402
from std_msgs.msg import String  # noqa: E402
from std_srvs.srv import Trigger  # noqa: E402

from alula_testing.waits import until  # noqa: E402
from skillset_ros2 import ActionClient  # noqa: E402
from skillset_ros2 import executor as executor_module  # noqa: E402
from skillset_ros2.executor import LastingWaitable, SparingExecutor  # noqa: E402

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


# --- what is destroyed ----------------------------------------------------------------------------------------------


def test_what_a_callback_destroys_is_not_dealt_with_in_the_same_turn(victim, node, context, executor):
    bystander: list[str] = []
    first = First(node, victim.destroy)
    node._Node__waitables.remove(first)
    node._Node__waitables.insert(0, first)
    beside = node.create_guard_condition(lambda: bystander.append("rung"))
    turn(executor)
    victim.call()
    until(lambda: victim.ready, "it is ready", SOON_S)
    beside.trigger()
    first.armed = True
    turn(executor)
    assert victim.heard == []
    assert bystander == ["rung"]


def test_what_another_thread_destroys_while_the_executor_sleeps_leaves_it_at_work(victim, node, spun):
    victim.call()
    until(lambda: victim.heard, "it is dealt with", SOON_S)
    victim.destroy()
    again = threading.Event()
    node.create_guard_condition(again.set).trigger()
    assert again.wait(SOON_S)
    assert spun.raised == []


def test_what_comes_and_goes_in_another_thread_disturbs_nothing(node, spun):
    rung: list[int] = []
    guard = node.create_guard_condition(lambda: rung.append(1))
    over = threading.Event()

    def ring():
        while not over.is_set():
            guard.trigger()
            time.sleep(0.0005)

    thread = threading.Thread(target=ring)
    thread.start()
    for number in range(20):
        made = [
            node.create_timer(0.001, lambda: None),
            node.create_subscription(String, "gone", lambda _: None, DEEP),
            node.create_client(Trigger, "gone"),
            node.create_service(Trigger, "gone", lambda _, response: response),
            node.create_guard_condition(lambda: None),
        ]
        server = ActionServer(node, Hover, f"gone{number}", lambda _: Hover.Result())
        client = ActionClient(node, Hover, f"gone{number}")
        made[4].trigger()
        client.destroy()
        server.destroy()
        for entity, kind in zip(made, ["timer", "subscription", "client", "service", "guard_condition"], strict=True):
            getattr(node, f"destroy_{kind}")(entity)
    over.set()
    thread.join()
    count = len(rung)
    guard.trigger()
    until(lambda: len(rung) > count, "the guard rings", SOON_S)
    assert spun.raised == []


class Broken(LastingWaitable):
    """Can't be waited for until it is mended."""

    mended = False

    def add_to_wait_set(self, _wait_set):
        if not self.mended:
            raise InvalidHandle("broken")

    def is_ready(self, _wait_set):
        return False

    def get_num_entities(self):
        return NumberOfEntities()


def test_a_wait_that_fails_for_good_raises_and_one_that_fails_for_a_moment_does_not(node, executor, monkeypatch):
    """Also long after the executor went to sleep: what counts is since when the wait has failed."""
    heard: list[str] = []
    guard = node.create_guard_condition(lambda: heard.append("rung"))
    monkeypatch.setattr(executor_module, "FAILING_S", 0.05)
    broken = Broken(ReentrantCallbackGroup())
    late = threading.Timer(0.2, lambda: (node.add_waitable(broken), guard.trigger()))
    late.start()
    away = threading.Timer(0.21, lambda: setattr(broken, "mended", True))
    away.start()
    turned(executor, lambda: heard == ["rung"], "the guard rings")
    away.join()
    broken.mended = False
    with pytest.raises(InvalidHandle, match="broken"):
        turn(executor)
    node.remove_waitable(broken)


@pytest.mark.parametrize("made", [ActionClient, rclpy.action.ActionClient, lambda *of: ActionServer(*of, lambda _: Hover.Result())])
def test_an_action_that_another_thread_takes_its_time_to_destroy_keeps_nobody_waiting(made, node, executor, monkeypatch):
    """Such a thread may be stopped, for as long as the machine likes, between the two things that it does."""
    heard: list[str] = []
    guard = node.create_guard_condition(lambda: heard.append("rung"))
    monkeypatch.setattr(executor_module, "FAILING_S", -1.0)
    action = made(node, Hover, "hover")
    handle = action._handle if isinstance(action, ActionServer) else action._client_handle
    handle.destroy_when_not_in_use()
    for count in range(1, 4):
        guard.trigger()
        turned(executor, lambda count=count: heard == ["rung"] * count, "the guard rings")
    node.remove_waitable(action)


def test_nothing_of_a_destroyed_node_is_dealt_with(context, node, partner, executor):
    doomed = make_node(context, "doomed")
    heard: list[str] = []
    victims = [Victim(kind, doomed, partner) for kind in ("timer", "subscription", "guard", "service")]
    beside = node.create_guard_condition(lambda: heard.append("rung"))
    first = First(node, doomed.destroy_node)
    executor.add_node(doomed)
    turn(executor)
    for victim in victims:
        victim.call()
    for victim in victims:
        until(lambda victim=victim: victim.ready, "it is ready", SOON_S)
    beside.trigger()
    first.armed = True
    turn(executor, 10)
    assert [victim.heard for victim in victims] == [[]] * len(victims)
    assert heard == ["rung"]


# --- tasks ----------------------------------------------------------------------------------------------------------


def test_a_task_goes_on_with_what_an_older_task_brings_that_goes_on_waiting(node, spun):
    """The newer task is looked at first, when there is nothing for it yet; the older one brings it and does not end."""
    asked, brought, never, told = Future(), Future(), Future(), threading.Event()

    async def bring():
        await asked
        brought.set_result(None)
        await never

    async def wait():
        await brought
        told.set()

    spun.executor.create_task(bring)
    spun.executor.create_task(wait)
    guard = node.create_guard_condition(lambda: asked.set_result(None))
    quiet(spun)
    guard.trigger()
    assert told.wait(SOON_S)
    spun.executor.create_task(lambda: never.set_result(None))


def test_a_callback_that_awaits_brings_what_another_awaits(node, spun):
    asked, brought, never, told = Future(), Future(), Future(), threading.Event()

    async def bring():
        await asked
        brought.set_result(None)
        await never

    async def wait():
        await brought
        told.set()

    for callback in (bring, wait):
        node.create_guard_condition(callback, MutuallyExclusiveCallbackGroup()).trigger()
        quiet(spun)
    node.create_guard_condition(lambda: asked.set_result(None), MutuallyExclusiveCallbackGroup()).trigger()
    assert told.wait(SOON_S)
    spun.executor.create_task(lambda: never.set_result(None))


def test_a_task_awaits_a_task_that_was_made_later(spun):
    ended = threading.Event()

    async def first():
        assert await spun.executor.create_task(lambda: "second") == "second"
        ended.set()

    spun.executor.create_task(first)
    assert ended.wait(SOON_S)


def test_what_a_task_raises_goes_to_the_one_that_awaits_it_and_out_of_spin_once(spun):
    caught: list[str] = []

    def fail():
        raise ValueError("broken")

    async def first():
        try:
            await spun.executor.create_task(fail)
        except ValueError as error:
            caught.append(str(error))

    spun.executor.create_task(first)
    until(lambda: caught == ["broken"], "it is caught", SOON_S)
    quiet(spun)
    assert [str(error) for error in spun.raised] == ["broken"]


def test_a_task_that_another_thread_makes_wakes_the_executor(spun):
    quiet(spun)
    told = threading.Event()
    spun.executor.create_task(told.set)
    assert told.wait(SOON_S)


def test_a_callback_that_is_cancelled_by_another_thread_frees_its_group_and_wakes_the_executor(node, other, spun):
    heard: list[str] = []
    never = Future()

    async def wait(message):
        heard.append(message.data)
        await never

    node.create_subscription(String, "words", wait, DEEP, callback_group=MutuallyExclusiveCallbackGroup())
    words = other.create_publisher(String, "words", DEEP)
    until(lambda: words.get_subscription_count() == 1, "the subscription is known", SOON_S)
    words.publish(String(data="1"))
    until(lambda: heard == ["1"], "the first waits", SOON_S)
    words.publish(String(data="2"))
    quiet(spun)
    assert heard == ["1"]
    (task,) = [task for task, entity, _ in spun.executor._tasks if entity is not None]
    task.cancel()
    until(lambda: heard == ["1", "2"], "the second is heard", SOON_S)
    spun.executor.create_task(lambda: never.set_result(None))


def test_a_callback_that_awaits_goes_on_only_while_its_node_is_served(node, other, executor):
    heard: list[str] = []
    opened = Future()

    async def wait():
        await opened
        heard.append("on")

    executor.add_node(other)
    other.create_guard_condition(wait).trigger()
    turn(executor)
    executor.remove_node(other)
    opened.set_result(None)
    turn(executor)
    assert heard == []
    executor.add_node(other)
    turn(executor)
    assert heard == ["on"]


def test_a_group_that_a_coroutine_holds_is_free_after_it_and_nothing_is_lost(node, spun):
    heard: list[str] = []
    opened, group = Future(), MutuallyExclusiveCallbackGroup()

    async def hold():
        heard.append("held")
        await opened

    guards = [node.create_guard_condition(hold, group), node.create_guard_condition(lambda: heard.append("next"), group)]
    guards[0].trigger()
    quiet(spun)
    guards[1].trigger()
    quiet(spun)
    assert heard == ["held"]
    spun.executor.create_task(lambda: opened.set_result(None))
    until(lambda: heard == ["held", "next"], "the next is served", SOON_S)


def test_executors_are_idle_when_only_the_asker_is_left(spun):
    opened, told = Future(), []

    async def wait():
        await opened

    spun.executor.create_task(wait)
    spun.executor.create_task(lambda: told.append(spun.executor.idle))
    until(lambda: told == [False], "one task waits", SOON_S)
    spun.executor.create_task(lambda: opened.set_result(None))
    quiet(spun)
    spun.executor.create_task(lambda: told.append(spun.executor.idle))
    until(lambda: told == [False, True], "none is left", SOON_S)


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
    spun.executor.create_task(lambda: opened.set_result(None))
    until(lambda: heard[-1] == "end 2", f"both have ended: {heard}", SOON_S)
    assert [word for word in heard if not word.startswith("fast")] == ["begin 1", "end 1", "begin 2", "end 2"]


@pytest.mark.parametrize("kind", [SparingExecutor], ids=["ours"])  # rclpy's loses the wake-up
def test_a_task_goes_on_with_what_an_older_task_brings(spun):
    brought, ended = Future(), threading.Event()

    async def wait():
        await brought
        ended.set()

    def make_both():
        spun.executor.create_task(lambda: brought.set_result(None))
        spun.executor.create_task(wait)  # the newest is run first

    spun.executor.create_task(make_both)
    assert ended.wait(SOON_S)


@pytest.mark.parametrize("kind", [SparingExecutor], ids=["ours"])  # rclpy's loses the wake-up
@pytest.mark.parametrize("awake", ["callback", "thread"])
def test_tasks_bring_one_another_what_they_await_along_any_chain(node, spun, awake):
    """The newest is looked at first: each of five waits for the one that is looked at after it, and then for ever."""
    links, never, told = [Future() for _ in range(5)], Future(), threading.Event()

    async def link(number):
        await links[number]
        if number + 1 < len(links):
            links[number + 1].set_result(None)
        else:
            told.set()
        await never

    for number in range(len(links)):
        spun.executor.create_task(link, number)
    guard = node.create_guard_condition(lambda: links[0].set_result(None))
    quiet(spun)
    if awake == "callback":
        guard.trigger()
    else:
        links[0].set_result(None)
    assert told.wait(SOON_S)


@pytest.mark.parametrize("kind", [SparingExecutor], ids=["ours"])
def test_a_coroutine_that_awaits_nothing_is_looked_at_at_each_turn_and_makes_none(node, spun):
    looks, never = [], Future()

    class Turn:
        def __await__(self):
            yield

    async def look():
        while True:
            looks.append(1)
            await Turn()

    async def wait():
        await never

    spun.executor.create_task(look)
    spun.executor.create_task(wait)
    quiet(spun)
    before = len(looks)
    assert before < 20
    guards = [node.create_guard_condition(lambda: None)]
    guards[0].trigger()
    until(lambda: len(looks) > before, "it is looked at", SOON_S)
