"""Managers and clients over rclpy, in a DDS domain of this process's own."""

from __future__ import annotations

import itertools
import json
import threading
from typing import Any

import navigation_interfaces.action
from navigation_managers.model import SKILLSET
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from skillset_interfaces.msg import Event
from skillset_interfaces.srv import SetPaused, Transition, Why

from alula_testing.ros2 import end_spinning, spin
from alula_testing.traces import live
from alula_testing.traces.stage import Client, HooksFactory
from skillset_ros2 import SkillsetClient, SkillsetNode
from skillset_ros2.names import EVENTS

NUMBERS = itertools.count()


class Ros2Stage(live.LiveStage):
    """One namespace; each node is spun by a thread of its own."""

    def __init__(self, make_hooks: HooksFactory) -> None:
        super().__init__()
        self._namespace = f"/play{next(NUMBERS)}"
        self._spun: list[tuple[Node, SingleThreadedExecutor, threading.Thread]] = []
        self._managers = SkillsetNode(SKILLSET, navigation_interfaces.action, lambda _: make_hooks(live.after), namespace=self._namespace)
        self.engine = self._managers.engine
        self._spin(self._managers)
        self._node = self._new_node()
        self._node.create_subscription(Event, f"{SKILLSET.name}/events", self.listener.hear, EVENTS)
        kinds = {"transition": Transition, "pause": SetPaused, "why": Why}
        self._services = {name: self._node.create_client(kind, f"{SKILLSET.name}/{name}") for name, kind in kinds.items()}
        self._spin(self._node)

    def client(self) -> Client:
        """Return a new client that is ready."""
        node = self._new_node()
        client: Client = SkillsetClient(node, SKILLSET.name)
        assert client.wait_ready(live.TIMEOUT_S)
        self._spin(node)
        return client

    def transition(self, resource: str, state: str) -> tuple[bool, str, str]:
        """Call the service."""
        reply = self._call("transition", Transition.Request(resource=resource, to=state))
        return reply.accepted, reply.reason, reply.state

    def set_paused(self, identifier: str, *, paused: bool) -> tuple[bool, str]:
        """Call the service."""
        reply = self._call("pause", SetPaused.Request(id=identifier, paused=paused))
        return reply.accepted, reply.reason

    def why(self, skill: str, inputs: dict[str, Any]) -> tuple[bool, str, list[str]]:
        """Call the service."""
        reply = self._call("why", Why.Request(skill=skill, inputs_json=json.dumps(inputs) if inputs else ""))
        return reply.ready, reply.reason, [transition.cause for transition in reply.history]

    def close(self) -> None:
        """End the managers."""
        self._managers.close("the play is over")
        for node, executor, thread in reversed(self._spun):
            end_spinning(executor, thread, live.TIMEOUT_S)
            node.destroy_node()

    def _call(self, service: str, request: Any) -> Any:
        client = self._services[service]
        # Both ends must know one another, or DDS loses the answer: the managers, too, that this client is there.
        assert client.wait_for_service(live.TIMEOUT_S)
        live.until(lambda: self._managers.count_clients(client.srv_name) > 0, f"the managers know the client of {service}")
        reply = client.call(request, timeout_sec=live.TIMEOUT_S)
        assert reply is not None, f"{service} does not answer"
        return reply

    def _new_node(self) -> Node:
        return Node(f"player_{next(NUMBERS)}", namespace=self._namespace)

    def _spin(self, node: Node) -> None:
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        thread = threading.Thread(target=spin, args=(executor,), daemon=True)
        thread.start()
        self._spun.append((node, executor, thread))
