"""A mock robot on ROS 2: real skillset nodes, the node's clock, and the functional layer's topics."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from rclpy.node import Node
from skillset_interfaces.msg import Event

from alula.runtime.managers import DataBindings
from alula.runtime.timers import Job, Timer
from skillset_ros2.convert import fields_of, fill, message_class
from skillset_ros2.mission_clock import NodeClock
from skillset_ros2.names import EVENTS, in_namespace
from skillset_ros2.node import SkillsetNode
from skillset_ros2.timers import MissionTimers


class RosMockHost:
    """A node as the host of a mock robot; ``nodes`` (the mocked skillsets) are added once they are made."""

    def __init__(self, node: Node, bindings: Mapping[str, DataBindings]) -> None:
        self.nodes: dict[str, SkillsetNode] = {}
        self.notes: list[str] = []
        self._node = node
        self._bindings = bindings
        self._publishers: dict[tuple[str, str], Any] = {}
        self._clock = NodeClock(node)
        self._timers = MissionTimers(node, self._clock, node.default_callback_group, lambda: False)

    def watch(self, skillsets: Sequence[str], on_state: Callable[[str, str, str], None]) -> None:
        """Call ``on_state(skillset, resource, state)`` for every transition."""

        def follow(event: Any) -> None:
            if event.kind == Event.TRANSITION:
                on_state(event.skillset, event.resource, event.to_state)

        for name in skillsets:
            self._node.create_subscription(Event, f"{name}/events", follow, EVENTS)

    @property
    def now_s(self) -> float:
        """Mission clock, seconds."""
        return self._clock.now_ns() / 1e9

    def after(self, delay_s: float, job: Job) -> Timer:
        """Run a job after a delay of mission clock; one that raises is told and ends nothing but itself."""

        def attempt() -> None:
            try:
                job()
            except Exception as error:  # noqa: BLE001 - the robot goes on
                self.note(f"{type(error).__name__}: {error}")

        return self._timers.at(self._clock.now_ns() + round(delay_s * 1e9), attempt)

    def transition(self, skillset: str, resource: str, to: str, reason: str) -> str:
        """Take an extern transition; return why it was refused, empty where it was taken."""
        node = self.nodes.get(skillset)
        return f"{skillset} is not mocked here" if node is None else node.engine.transition(resource, to, reason).reason

    def state(self, skillset: str, resource: str) -> str:
        """Return the state of a resource."""
        node = self.nodes.get(skillset)
        return "" if node is None else node.engine.resources[resource].state

    def publish(self, skillset: str, data: str, value: object) -> None:
        """Publish a value where the functional layer would; a header gets the present stamp."""
        topic, type_name = self._bindings[skillset][data]
        message = message_class(type_name)()
        values = value if isinstance(value, Mapping) else {"data": value}
        try:
            fill(message, values, f"the mock's {skillset}.{data}")
        except ValueError as error:
            self.note(str(error))
            return
        if "header" in fields_of(message) and "header" not in values:
            message.header.stamp = self._node.get_clock().now().to_msg()
        if (skillset, data) not in self._publishers:
            self._publishers[skillset, data] = self._node.create_publisher(type(message), in_namespace(topic), 10)
        self._publishers[skillset, data].publish(message)

    def note(self, error: str) -> None:
        """Add an error to ``notes`` and log it, once."""
        if error not in self.notes:
            self.notes.append(error)
            self._node.get_logger().error(error)
