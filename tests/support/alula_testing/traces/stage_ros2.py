"""Managers and clients over rclpy, in a DDS domain of this process's own."""

from __future__ import annotations

import itertools
import threading
from collections.abc import Callable
from typing import Any

import navigation_interfaces.action
from navigation_managers.model import SKILLSET
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from skillset_interfaces.msg import Event
from skillset_interfaces.srv import Transition

from alula_testing.traces import live
from alula_testing.traces.stage import Client, HooksFactory
from skill_runtime.ros2 import SkillsetClient, SkillsetNode
from skill_runtime.ros2.names import EVENTS

NUMBERS = itertools.count()
CALL_S = 1.0


class Ros2Stage:
    """One namespace; each node is spun by a thread of its own."""

    def __init__(self, make_hooks: HooksFactory) -> None:
        self._namespace = f"/play{next(NUMBERS)}"
        self._listener = live.Listener()
        self._spun: list[tuple[Node, SingleThreadedExecutor, threading.Thread]] = []
        self._managers = SkillsetNode(SKILLSET, navigation_interfaces.action, lambda _: make_hooks(live.after), namespace=self._namespace)
        self.engine = self._managers.engine
        self._spin(self._managers)
        self._node = self._new_node()
        self._node.create_subscription(Event, f"{SKILLSET.name}/events", self._listener.hear, EVENTS)
        self._service = self._node.create_client(Transition, f"{SKILLSET.name}/transition")
        self._spin(self._node)

    def client(self) -> Client:
        """Return a new client that is ready."""
        node = self._new_node()
        client: Client = SkillsetClient(node, SKILLSET.name)
        assert client.wait_ready(live.PATIENCE_S)
        self._spin(node)
        return client

    def transition(self, resource: str, state: str) -> tuple[bool, str, str]:
        """Call the service. DDS loses answers to clients that it has not discovered; what was taken is then refused as taken."""
        assert self._service.wait_for_service(live.PATIENCE_S)
        reply = self._service.call(Transition.Request(resource=resource, to=state), timeout_sec=live.PATIENCE_S)
        assert reply is not None
        return reply.accepted, reply.reason, reply.state

    def until(self, condition: Callable[[], bool], what: str) -> None:
        """Wait."""
        live.until(condition, what)

    def events(self) -> list[dict[str, Any]]:
        """Return what was heard."""
        return self._listener.events()

    def close(self) -> None:
        """End the managers."""
        self._managers.close("the play is over")
        for node, executor, thread in reversed(self._spun):
            executor.shutdown(timeout_sec=live.PATIENCE_S)
            thread.join(live.PATIENCE_S)
            node.destroy_node()

    def _new_node(self) -> Node:
        return Node(f"player_{next(NUMBERS)}", namespace=self._namespace)

    def _spin(self, node: Node) -> None:
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        thread = threading.Thread(target=executor.spin, daemon=True)
        thread.start()
        self._spun.append((node, executor, thread))
