"""Executors on real nodes: ours and rclpy's, which is the measure, and entities of each kind with what happens to them."""

from __future__ import annotations

import contextlib
import threading
import time
from types import SimpleNamespace

import pytest

rclpy = pytest.importorskip("rclpy")

from navigation_interfaces.action import Hover  # noqa: E402
from rclpy.action import ActionServer  # noqa: E402
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup, ReentrantCallbackGroup  # noqa: E402
from rclpy.context import Context  # noqa: E402
from rclpy.exceptions import InvalidHandle  # noqa: E402
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor  # noqa: E402
from rclpy.impl.implementation_singleton import rclpy_implementation  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.qos import QoSProfile  # noqa: E402
from rclpy.waitable import NumberOfEntities  # noqa: E402
from std_msgs.msg import String  # noqa: E402
from std_srvs.srv import Trigger  # noqa: E402

from alula.common.fast_dds import leave  # noqa: E402
from alula_testing.waits import until  # noqa: E402
from skillset_ros2 import ActionClient  # noqa: E402
from skillset_ros2.executor import LastingWaitable, RclpyExecutor, SparingExecutor  # noqa: E402

SOON_S = 20.0
TURN_S = 0.05
QUIET_S = 0.3
"""So long nothing is expected to happen, wall clock."""
DEEP = QoSProfile(depth=100)
KINDS = ["timer", "subscription", "guard", "client", "service", "action server", "action client"]


@pytest.fixture(params=[SparingExecutor, RclpyExecutor], ids=["ours", "rclpy"])
def kind(request):
    return request.param


@pytest.fixture
def context(ros2_domain):
    context = Context()
    rclpy.init(context=context)
    first = make_node(context, "first")
    yield context
    leave(first)


def make_node(context, name):
    return Node(name, context=context, enable_rosout=False)


@pytest.fixture
def node(context):
    node = make_node(context, "served")
    yield node
    node.destroy_node()


@pytest.fixture
def other(context):
    node = make_node(context, "other")
    yield node
    node.destroy_node()


@pytest.fixture
def executor(kind, context, node):
    executor = kind(context=context)
    executor.add_node(node)
    yield executor
    executor.shutdown(timeout_sec=0)


@pytest.fixture
def spun(executor):
    """Return the executor, spun by a thread of its own, and what it has raised."""
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
    yield SimpleNamespace(executor=executor, raised=raised, thread=thread)
    executor.shutdown(timeout_sec=0)
    thread.join(SOON_S)
    assert not thread.is_alive()


@pytest.fixture
def partner(context, other):
    """Return a node that rclpy's own executor spins, for the other ends of what is attacked."""
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(other)

    def spin():
        with contextlib.suppress(ExternalShutdownException):
            executor.spin()

    thread = threading.Thread(target=spin)
    thread.start()
    yield other
    executor.shutdown(timeout_sec=0)
    thread.join(SOON_S)


class First(LastingWaitable):
    """Is dealt with before all other kinds of entities: what it does, it does in the turn that has found them ready."""

    def __init__(self, node, act) -> None:
        super().__init__(ReentrantCallbackGroup())
        self.act = act
        self.armed = False
        node.add_waitable(self)

    def get_num_entities(self):
        return NumberOfEntities()

    def add_to_wait_set(self, wait_set):
        pass

    def is_ready(self, wait_set):
        return self.armed

    def take_data(self):
        self.armed = False

    async def execute(self, _taken):
        self.act()


class Counting(First):
    """Counts the waits of the node's executor."""

    def __init__(self, node) -> None:
        super().__init__(node, lambda: None)
        self.waits = 0

    def add_to_wait_set(self, wait_set):
        self.waits += 1


class Victim:
    """An entity of a kind on a node, in a callback group of its own; ``ready`` tells whether it has something to be dealt with."""

    def __init__(self, kind, node, partner) -> None:
        self.heard: list[object] = []
        self._node, self._partner, self._kind = node, partner, kind
        self._ends: list[object] = []
        getattr(self, f"_make_{kind.replace(' ', '_')}")(MutuallyExclusiveCallbackGroup())

    def hear(self, thing: object = None) -> None:
        self.heard.append(thing)

    def _serve(self, _request, response):
        self.hear()
        return response

    def _make_timer(self, group):
        self.entity = self._node.create_timer(0.001, self.hear, callback_group=group, autostart=False)
        self.call, self.destroy = self.entity.reset, lambda: self._node.destroy_timer(self.entity)

    def _make_subscription(self, group):
        self.entity = self._node.create_subscription(String, "words", self.hear, DEEP, callback_group=group)
        words = self._partner.create_publisher(String, "words", DEEP)
        until(lambda: words.get_subscription_count() == 1, "the subscription is known", SOON_S)
        self.call, self.destroy = lambda: words.publish(String()), lambda: self._node.destroy_subscription(self.entity)

    def _make_guard(self, group):
        self.entity = self._node.create_guard_condition(self.hear, callback_group=group)
        self.call, self.destroy = self.entity.trigger, lambda: self._node.destroy_guard_condition(self.entity)

    def _make_client(self, group):
        self._partner.create_service(Trigger, "answer", lambda _, response: response)
        self.entity = self._node.create_client(Trigger, "answer", callback_group=group)
        assert self.entity.wait_for_service(SOON_S)
        self.call = lambda: self.entity.call_async(Trigger.Request()).add_done_callback(self.hear)
        self.destroy = lambda: self._node.destroy_client(self.entity)

    def _make_service(self, group):
        self.entity = self._node.create_service(Trigger, "ask", self._serve, callback_group=group)
        client = self._partner.create_client(Trigger, "ask")
        assert client.wait_for_service(SOON_S)
        self.call, self.destroy = lambda: client.call_async(Trigger.Request()), lambda: self._node.destroy_service(self.entity)

    def _make_action_server(self, group):
        def execute(goal):
            self.hear()
            goal.succeed()
            return Hover.Result()

        self.entity = ActionServer(self._node, Hover, "hover", execute, callback_group=group)
        client = ActionClient(self._partner, Hover, "hover")
        self._ends.append(client)
        assert client.wait_for_server(SOON_S)
        self.call, self.destroy = lambda: client.send_goal_async(Hover.Goal()), self.entity.destroy

    def _make_action_client(self, group):
        def execute(goal):
            goal.succeed()
            return Hover.Result()

        self._ends.append(ActionServer(self._partner, Hover, "hover", execute))
        self.entity = ActionClient(self._node, Hover, "hover", callback_group=group)
        assert self.entity.wait_for_server(SOON_S)
        self.call = lambda: self.entity.send_goal_async(Hover.Goal()).add_done_callback(self.hear)
        self.destroy = self.entity.destroy

    @property
    def ready(self) -> bool:
        """Whether a wait for it would find it ready; a guard is, once it was triggered, and looking would take that away."""
        if self._kind == "guard":
            return True
        if self._kind == "timer":
            return self.entity.is_ready()
        inside = self.entity.get_num_entities() if self._kind.startswith("action") else NumberOfEntities(1, 0, 0, 1, 1)
        wait_set = rclpy_implementation.WaitSet(
            inside.num_subscriptions, 0, inside.num_timers, inside.num_clients, inside.num_services, 0, self._node.context.handle
        )
        wait_set.clear_entities()
        if self._kind.startswith("action"):
            self.entity.add_to_wait_set(wait_set)
            wait_set.wait(0)
            return self.entity.is_ready(wait_set)
        getattr(wait_set, f"add_{self._kind}")(self.entity.handle)
        wait_set.wait(0)
        return bool(wait_set.get_ready_entities(self._kind))

    def close(self) -> None:
        with contextlib.suppress(InvalidHandle, ValueError):
            self.destroy()
        for end in self._ends:
            end.destroy()


@pytest.fixture(params=KINDS)
def victim(request, node, partner):
    victim = Victim(request.param, node, partner)
    yield victim
    victim.close()


def turn(executor, times: int = 5) -> None:
    for _ in range(times):
        executor.spin_once(timeout_sec=TURN_S)


def quiet(spun) -> None:
    """Have an executor deal with all that is there, and go to sleep."""
    asleep = threading.Event()
    spun.executor.create_task(asleep.set)
    assert asleep.wait(SOON_S)
    time.sleep(QUIET_S)  # what is tested is a sleep that nothing but the attack ends


def connected(publisher, subscribers: int = 1) -> None:
    until(lambda: publisher.get_subscription_count() == subscribers, "the subscribers are known", SOON_S)


def all_arrived(context, node, server) -> bool:
    """Return whether the last two subscriptions, the service "ask" and the action server of a node each have something to take."""
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
