"""The resource manager's interface (paper, section 4.2): states latched, services for extern transitions and events."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from alula.runtime.core.engine import SkillsetEngine
from alula.runtime.core.events import EngineEvent, TransitionEvent
from alula.runtime.core.records import ResourceStatus
from alula.runtime.middleware import RESOURCE_STATES, Middleware, Reply, ResourceStates


class ResourceManager:
    """Publishes ``resource_states`` once a step, and serves ``transition`` and ``trigger``."""

    def __init__(self, middleware: Middleware, engine: SkillsetEngine, instance_id: str) -> None:
        self._middleware = middleware
        self._engine = engine
        self._instance_id = instance_id
        self._publisher = middleware.advertise(RESOURCE_STATES)
        # Kept apart from the engine's, so that each message is the state after the step that it is sent for.
        self._latest = dict(engine.resources)
        self._publish(0, middleware.now_ns())

    def serve(self) -> None:
        """Serve ``transition`` (extern transitions) and ``trigger`` (events of the model)."""
        self._middleware.serve("transition", self._transition)
        self._middleware.serve("trigger", self._trigger)

    def on_events(self, events: Sequence[EngineEvent]) -> None:
        """Follow the transitions of one step."""
        transitions = [event for event in events if isinstance(event, TransitionEvent)]
        for event in transitions:
            self._latest[event.resource] = ResourceStatus(event.to_state, event.from_state, event.stamp_ns)
        if transitions:
            self._publish(transitions[-1].sequence, transitions[-1].stamp_ns)

    def _publish(self, after: int, stamp_ns: int) -> None:
        self._publisher.publish(ResourceStates(self._instance_id, after, stamp_ns, dict(self._latest)))

    def _transition(self, request: Mapping[str, Any], reply: Reply) -> None:
        reply(self._engine.transition(request["resource"], request["to"]))

    def _trigger(self, request: Mapping[str, Any], reply: Reply) -> None:
        reply(self._engine.trigger(request["event"]))
