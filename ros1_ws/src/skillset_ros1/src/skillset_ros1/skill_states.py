"""``skill_states`` in ROS 1: every skill's open executions and its last result, latched, so that who joins late learns them."""

from __future__ import annotations

import threading
from collections.abc import Sequence

import rospy
from skillset_interfaces.msg import SkillState, SkillStates

from skill_model.model import Skillset
from skill_runtime.core.events import EngineEvent, ExecutionEvent
from skill_runtime.core.records import Records
from skill_runtime.messages import skill_message
from skillset_ros1.names import now_ns, stamp_of

TOGETHER_S = 0.02
"""Changes within this time (wall clock) are published together: with many skills the message is long."""


class SkillStatesPublisher:
    """Follows the events and publishes what is known of all skills."""

    def __init__(self, place: str, skillset: Skillset, life: str) -> None:
        self._skillset = skillset.name
        self._life = life
        self._records = Records(skillset)
        self._messages = {name: SkillState(name=name) for name in self._records.skills}
        self._changed: set[str] = set()
        self._news = threading.Condition()
        self._over = False
        self._publisher = rospy.Publisher(f"{place}/skill_states", SkillStates, latch=True, queue_size=1)
        self.publish()
        self._thread = threading.Thread(target=self._run, name=f"{place}_skill_states", daemon=True)
        self._thread.start()

    def on_events(self, events: Sequence[EngineEvent]) -> None:
        """Follow the events of one step."""
        skills = {event.skill for event in events if isinstance(event, ExecutionEvent)}
        with self._news:
            self._records.on_events(events)
            self._changed |= skills
            if skills:
                self._news.notify()

    def publish(self) -> None:
        """Publish what is known now."""
        with self._news:
            for name in self._changed:
                self._messages[name] = skill_message(name, self._records.skills[name])
            self._changed.clear()
            message = SkillStates(skillset=self._skillset, skills=list(self._messages.values()))
            message.header.stamp, message.header.frame_id = stamp_of(now_ns()), self._life
            self._publisher.publish(message)

    def close(self) -> None:
        """Take the topic away."""
        with self._news:
            self._over = True
            self._news.notify()
        self._thread.join()
        self._publisher.unregister()

    def _run(self) -> None:
        while True:
            with self._news:
                self._news.wait_for(lambda: bool(self._changed) or self._over)
                if self._over:
                    return
                self._news.wait_for(lambda: self._over, TOGETHER_S)
            self.publish()
