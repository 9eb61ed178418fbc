"""The resource manager's interface (paper, section 4.2): states latched, services for extern transitions and events, and what happens."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.time import Time
from skillset_interfaces.msg import Event, ResourceState, ResourceStates
from skillset_interfaces.srv import Transition, TriggerEvent

from skill_runtime.core.engine import SkillsetEngine
from skill_runtime.core.events import EngineEvent, TransitionEvent
from skill_runtime.messages import event_message
from skill_runtime.ros2.names import ALIVE, EVENTS


class EventPublisher:
    """Publishes the events of each step on ``events``."""

    def __init__(self, node: Node, skillset: str) -> None:
        self._skillset = skillset
        self._publisher = node.create_publisher(Event, f"{skillset}/events", EVENTS)

    def publish(self, events: Sequence[EngineEvent]) -> None:
        """Publish in order."""
        for event in events:
            message = event_message(self._skillset, event)
            message.header.stamp = Time(nanoseconds=event.stamp_ns).to_msg()
            self._publisher.publish(message)

    def flush(self, timeout_s: float) -> None:
        """Wait (wall clock) until all who listen have all events: those of a process that ends would be lost."""
        self._publisher.wait_for_all_acked(Duration(seconds=timeout_s))


class ResourceManager:
    """Publishes ``resource_states`` once a step, and serves ``transition`` and ``trigger``."""

    def __init__(self, node: Node, engine: SkillsetEngine) -> None:
        self._name = engine.skillset.name
        self._engine = engine
        self._publisher = node.create_publisher(ResourceStates, f"{self._name}/resource_states", ALIVE)
        # Kept apart from the engine's, so that each message is the state after the step that it is sent for.
        self._latest = {
            name: ResourceState(name=name, state=status.state, previous_state="", stamp_ns=status.stamp_ns)
            for name, status in engine.resources.items()
        }
        self._publish(node.get_clock().now().nanoseconds)
        node.create_service(Transition, f"{self._name}/transition", self._answer)
        node.create_service(TriggerEvent, f"{self._name}/trigger", self._answer_trigger)

    def on_events(self, events: Sequence[EngineEvent]) -> None:
        """Follow the transitions of one step."""
        transitions = [event for event in events if isinstance(event, TransitionEvent)]
        for event in transitions:
            self._latest[event.resource] = ResourceState(
                name=event.resource, state=event.to_state, previous_state=event.from_state, stamp_ns=event.stamp_ns
            )
        if transitions:
            self._publish(transitions[-1].stamp_ns)

    def _publish(self, stamp_ns: int) -> None:
        message = ResourceStates(skillset=self._name, resources=list(self._latest.values()))
        message.header.stamp = Time(nanoseconds=stamp_ns).to_msg()
        self._publisher.publish(message)

    def _answer(self, request: Any, response: Any) -> Any:
        reply = self._engine.transition(request.resource, request.to)
        response.accepted, response.reason, response.state = reply.accepted, reply.reason, reply.state
        return response

    def _answer_trigger(self, request: Any, response: Any) -> Any:
        reply = self._engine.trigger(request.event)
        response.accepted, response.reason = reply.accepted, reply.reason
        return response
