"""The resource manager's interface (paper, section 4.2) in ROS 1: states latched, services for extern transitions and events."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import rospy
from skillset_interfaces.msg import ResourceState, ResourceStates
from skillset_interfaces.srv import Transition, TransitionResponse, TriggerEvent, TriggerEventResponse

from skill_runtime.core.engine import SkillsetEngine
from skill_runtime.core.events import EngineEvent, TransitionEvent
from skillset_ros1.names import QUEUE, now_ns, stamp_of


class ResourceManager:
    """Publishes ``resource_states`` once a step, and serves ``transition`` and ``trigger``.

    ``header.frame_id`` says which managers' states these are, and after which of their events: topics of ROS 1 come in no order.
    """

    def __init__(self, place: str, engine: SkillsetEngine, life: str) -> None:
        self._engine = engine
        self._life = life
        self._publisher = rospy.Publisher(f"{place}/resource_states", ResourceStates, latch=True, queue_size=QUEUE)
        # Kept apart from the engine's, so that each message is the state after the step that it is sent for.
        self._latest = {
            name: ResourceState(name=name, state=status.state, previous_state="", stamp_ns=status.stamp_ns)
            for name, status in engine.resources.items()
        }
        self._publish(now_ns(), 0)
        self._services = [
            rospy.Service(f"{place}/transition", Transition, self._answer),
            rospy.Service(f"{place}/trigger", TriggerEvent, self._answer_trigger),
        ]

    def on_events(self, events: Sequence[EngineEvent]) -> None:
        """Follow the transitions of one step."""
        transitions = [event for event in events if isinstance(event, TransitionEvent)]
        for event in transitions:
            self._latest[event.resource] = ResourceState(
                name=event.resource, state=event.to_state, previous_state=event.from_state, stamp_ns=event.stamp_ns
            )
        if transitions:
            self._publish(transitions[-1].stamp_ns, transitions[-1].sequence)

    def close(self) -> None:
        """Take topic and service away."""
        for service in self._services:
            service.shutdown()
        self._publisher.unregister()

    def _publish(self, stamp_ns: int, sequence: int) -> None:
        message = ResourceStates(skillset=self._engine.skillset.name, resources=list(self._latest.values()))
        message.header.stamp = stamp_of(stamp_ns)
        message.header.frame_id = f"{self._life} {sequence}"
        self._publisher.publish(message)

    def _answer(self, request: Any) -> Any:
        reply = self._engine.transition(request.resource, request.to)
        return TransitionResponse(accepted=reply.accepted, reason=reply.reason, state=reply.state)

    def _answer_trigger(self, request: Any) -> Any:
        reply = self._engine.trigger(request.event)
        return TriggerEventResponse(accepted=reply.accepted, reason=reply.reason)
