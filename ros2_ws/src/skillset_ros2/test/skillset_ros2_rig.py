"""A live skillset for this package's tests: the drone's generated navigation with recorders for hooks, a client, a listener."""

from __future__ import annotations

import itertools
import os
import threading

import navigation_interfaces.action as navigation_actions
from navigation_managers.hooks import ABSTRACT_HOOKS
from navigation_managers.model import SKILLSET
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.time import Time
from rosgraph_msgs.msg import Clock
from skillset_interfaces.msg import Event
from skillset_interfaces.srv import Transition

from alula.model.execution_state import ExecutionState
from alula.runtime.hook_processes import HookServer, RemoteHooks, pipe_address
from alula_testing import waits
from alula_testing.recorder import Recorder
from alula_testing.ros2 import end_spinning, spin
from skillset_ros2 import SkillsetClient, SkillsetNode
from skillset_ros2.names import EVENTS

S = ExecutionState
SOON_S = 10.0
READY_S = 30.0
NUMBERS = itertools.count()


def until(condition, what: str, timeout_s: float = SOON_S) -> None:
    waits.until(condition, what, timeout_s)


def ask(node, kind, service: str, **request: object):
    """Call a service, again when the answer does not come: DDS loses those to clients that it has not discovered yet."""
    client = node.create_client(kind, service)
    assert client.wait_for_service(SOON_S)
    answers: list = []
    until(lambda: answers.append(client.call(kind.Request(**request), timeout_sec=1.0)) or answers[-1] is not None, f"{service} answers")
    node.destroy_client(client)
    return answers[-1]


def take(node, resource: str, state: str) -> None:
    """Take an extern transition, as the functional layer does."""
    answer = ask(node, Transition, "navigation/transition", resource=resource, to=state)
    assert answer.accepted or answer.state == state, answer.reason


class NavigationRecorder(Recorder):
    inputs_type = None


class Spinning:
    """Nodes, each spun by a thread of its own."""

    def __init__(self) -> None:
        self.running: list = []
        self.pipes: list = []

    def spin(self, node):
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        thread = threading.Thread(target=spin, args=(executor,), daemon=True)
        thread.start()
        self.running.append((node, executor, thread))
        return node

    def elsewhere(self, skillset, hooks) -> RemoteHooks:
        """Have hooks called over the pipe, as if they were in processes of their own."""
        address = pipe_address("test", str(next(NUMBERS)), str(os.getpid()))
        remote = RemoteHooks(skillset, address, print)
        self.pipes += [HookServer(skillset.name, skill, one, address, print) for skill, one in hooks.items()]
        assert remote.wait(READY_S) == []
        self.pipes.append(remote)
        return remote

    def close(self) -> None:
        for node, executor, thread in reversed(self.running):
            if hasattr(node, "close"):
                node.close("the test is over")
            end_spinning(executor, thread)
            node.destroy_node()
        for pipe in self.pipes:
            pipe.close(*() if isinstance(pipe, RemoteHooks) else ("the test is over", 5.0))


class Navigation:
    """The managers with recorders, a client, and the events as another subscriber hears them."""

    def __init__(self, spinning: Spinning, *, separate: bool = False, **node_options: object) -> None:
        self.hooks = {skill.name: NavigationRecorder() for skill in SKILLSET.skills}
        for name, hooks in self.hooks.items():
            hooks.make_inputs = lambda values, name=name: ABSTRACT_HOOKS[name].inputs_type(**values)
        namespace = str(node_options.get("namespace", ""))
        if separate:
            self.managers = spinning.spin(
                SkillsetNode(SKILLSET, navigation_actions, spinning.elsewhere(SKILLSET, self.hooks), **node_options)
            )
        else:
            self.managers = spinning.spin(SkillsetNode(SKILLSET, navigation_actions, lambda _: self.hooks, **node_options))
        self.node = Node(f"skill_runtime_tester_{next(NUMBERS)}", namespace=namespace)
        self.client = SkillsetClient(self.node, "navigation")
        assert self.client.wait_ready(READY_S)
        self.events: list = []
        self.node.create_subscription(Event, "navigation/events", self.events.append, EVENTS)
        spinning.spin(self.node)

    def service(self, kind, name: str, /, **request: object):
        return ask(self.node, kind, f"navigation/{name}", **request)

    def mission_clock(self):
        """Return a function that sets the mission clock, s, and waits until the managers, made with ``use_sim_time``, follow it."""
        publisher = self.node.create_publisher(Clock, "/clock", 10)

        def set_time(seconds: float) -> None:
            def there() -> bool:
                publisher.publish(Clock(clock=Time(seconds=seconds).to_msg()))
                return self.managers.get_clock().now().nanoseconds == int(seconds * 1e9)

            until(there, "the managers follow the clock")

        return set_time

    def bring(self, states: dict[str, str]) -> None:
        """Take extern transitions, as the functional layer does."""
        for resource, state in states.items():
            take(self.node, resource, state)

    def fly(self):
        dispatched = self.hooks["goto_straight"].dispatched
        dispatched.clear()  # of an execution before
        handle = self.client.start("goto_straight", target=(1, 2.5, 3), speed=1)
        until(lambda: handle.state is S.RUNNING, f"goto_straight runs, it is {handle}")
        assert dispatched.wait(SOON_S)
        return handle
