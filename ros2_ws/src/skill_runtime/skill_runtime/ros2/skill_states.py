"""``skill_states``: every skill's open executions and its last result, latched, so that who joins late learns them."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from skillset_interfaces.msg import SkillState, SkillStates

from skill_model.model import Skillset
from skill_runtime.core.events import EngineEvent, ExecutionEvent
from skill_runtime.core.records import Records
from skill_runtime.messages import skill_message
from skill_runtime.ros2.names import LATCHED

TOGETHER_S = 0.02
"""Changes within this time (wall clock) are published together: with many skills the message is long."""


class SkillStatesPublisher:
    """Follows the events and publishes what is known of all skills."""

    def __init__(self, node: Node, skillset: Skillset) -> None:
        self._node = node
        self._skillset = skillset.name
        self._lock = threading.Lock()
        self._records = Records(skillset)
        self._messages = {name: SkillState(name=name) for name in self._records.skills}
        self._changed: set[str] = set()
        self._publisher = node.create_publisher(SkillStates, f"{skillset.name}/skill_states", LATCHED)
        self._timer: Any = node.create_timer(TOGETHER_S, self.publish, clock=Clock(clock_type=ClockType.STEADY_TIME), autostart=False)
        # A timer that is set from another thread does not wake the executor; a guard condition does.
        self._wake = node.create_guard_condition(self._timer.reset)
        self.publish()

    def on_events(self, events: Sequence[EngineEvent]) -> None:
        """Follow the events of one step."""
        skills = {event.skill for event in events if isinstance(event, ExecutionEvent)}
        if not skills:
            return
        with self._lock:
            self._records.on_events(events)
            first = not self._changed
            self._changed |= skills
        if first:
            self._wake.trigger()

    def publish(self) -> None:
        """Publish what is known now."""
        self._timer.cancel()
        with self._lock:
            for name in self._changed:
                self._messages[name] = skill_message(name, self._records.skills[name])
            self._changed.clear()
            message = SkillStates(skillset=self._skillset, skills=list(self._messages.values()))
            message.header.stamp = self._node.get_clock().now().to_msg()
            self._publisher.publish(message)
