"""``skill_states``: every skill's open executions and its last result, latched for late subscribers."""

from __future__ import annotations

import threading
from collections.abc import Sequence

from alula.model.model import Skillset
from alula.runtime.core.events import EngineEvent, ExecutionEvent
from alula.runtime.core.records import Records
from alula.runtime.middleware import SKILL_STATES, Middleware, SkillStates

TOGETHER_S = 0.02
"""Changes within this time are published together: with many skills the message is long."""


class SkillStatesPublisher:
    """Follows the events and publishes what is known of all skills."""

    def __init__(self, middleware: Middleware, skillset: Skillset, instance_id: str) -> None:
        self._middleware = middleware
        self._instance_id = instance_id
        self._lock = threading.Lock()
        self._records = Records(skillset)
        self._changed = False
        self._publisher = middleware.advertise(SKILL_STATES)
        self.publish()

    def on_events(self, events: Sequence[EngineEvent]) -> None:
        """Follow the events of one step."""
        if not any(isinstance(event, ExecutionEvent) for event in events):
            return
        with self._lock:
            self._records.on_events(events)
            first, self._changed = not self._changed, True
        if first:
            self._middleware.later(TOGETHER_S, self.publish)

    def publish(self) -> None:
        """Publish what is known now."""
        with self._lock:
            self._changed = False
            skills = dict(self._records.skills)
        self._publisher.publish(SkillStates(self._instance_id, self._middleware.now_ns(), skills))
