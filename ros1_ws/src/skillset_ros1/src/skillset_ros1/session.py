"""What a client hears of the managers of one skillset, dealt with in one order by one thread.

Each topic of ROS 1 comes over a connection of its own, in no order with the others. The managers number their events and tell
with their states after which event these are; so whoever is told of an execution's end can see the resources as they are after it.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

import rospy
from skillset_interfaces.msg import Event, ResourceStates, SkillStates
from std_msgs.msg import Header

from skill_model.execution_state import ExecutionState
from skill_runtime.callbacks import Callbacks
from skill_runtime.handle import SkillHandle
from skillset_ros1.news_thread import Job, NewsThread
from skillset_ros1.pursuit import Pursuit
from skillset_ros1.questions import Questions
from skillset_ros1.reach import Reach


class Session:
    """The client's thread and all that it knows; ``do`` runs a job on it.

    ``last`` has the end of each skill's last execution, as ``SkillExecution`` or ``Event`` tells it, with its stamp.
    """

    def __init__(self, place: str, skillset: str) -> None:
        self.skillset = skillset
        self._thread = NewsThread(skillset, self)
        self.reach = Reach(place, skillset, self._thread.handing_over, self._on_feedback, self._on_result)
        self.lock = threading.Lock()
        self.resources: dict[str, str] = {}
        self.last: dict[str, tuple[int, Any]] = {}
        self.skills: dict[str, Any] = {}
        self.on_changes: Callbacks[Callable[[dict[str, str]], None]] = Callbacks()
        self.on_skills: Callbacks[Callable[[dict[str, Any]], None]] = Callbacks()
        self.on_events: Callbacks[Callable[[Any], None]] = Callbacks()
        self.questions = Questions(place, self)
        self._open: dict[str, Pursuit] = {}
        self._last_event = self._last_transition = 0
        self._states_after = -1
        heard = (
            ("resource_states", ResourceStates, self._on_resources),
            ("skill_states", SkillStates, self._on_skills),
            ("events", Event, self._on_event),
            ("alive", Header, self._on_alive),
        )
        self._subscribers = [
            rospy.Subscriber(f"{place}/{topic}", kind, self._thread.handing_over(handler), tcp_nodelay=True)
            for topic, kind, handler in heard
        ]
        self._thread.start()

    # --- for the client, from any thread -----------------------------------------------------------------------------

    def do(self, job: Job) -> None:
        """Run a job on the client's thread, soon."""
        self._thread.do(job)

    def pursue(self, pursuit: Pursuit, goal: Any) -> bool:
        """Send a goal and follow it to its end; False when the session is over."""

        def send() -> None:
            self._open[pursuit.handle.id] = pursuit
            pursuit.handle.add_done_callback(self._forget)
            pursuit.send(goal)

        return self._thread.do_unless_over(send)

    def wait(self, event: threading.Event, timeout_s: float | None) -> bool:
        """Wait for an event that the client's thread brings; None: until it comes or can't come any more.

        Raises:
            CannotWaitError: this is that thread, or it has ended.
        """
        return self._thread.wait(event, timeout_s)

    def close(self, reason: str) -> None:
        """End every wait for this reason, the thread and its connections."""
        self._thread.close(reason)
        for topic in (*self._subscribers, *self.reach.links.values()):
            topic.unregister()

    # --- for the thread ----------------------------------------------------------------------------------------------

    @property
    def restless(self) -> bool:
        """Tell whether something has to be looked at soon."""
        return not self.reach.ready.is_set() or any(pursuit.restless for pursuit in self._open.values())

    def look(self) -> None:
        """See who can be called, and end what can be ended."""
        if self.reach.gone(self._subscribers[-1]):
            self._abandon(f"the managers of {self.skillset} have gone: they ended, or gave no sign of life")
        if self._states_after >= 0:
            self.reach.look(self._subscribers)
        for pursuit in list(self._open.values()):
            pursuit.settle(self._states_after)

    def ending(self) -> None:
        """Start nothing more."""
        self.reach.ready.clear()

    def ended(self, reason: str) -> None:
        """End every wait."""
        self._abandon(reason)

    # --- what is heard -----------------------------------------------------------------------------------------------

    def _on_alive(self, message: Any) -> None:
        if self._heard(message.frame_id):
            self.reach.on_alive(message)

    def _on_resources(self, message: Any) -> None:
        life, _, after = message.header.frame_id.partition(" ")
        if not self._heard(life) or int(after) <= self._states_after:
            return
        self._states_after = int(after)
        states = {resource.name: resource.state for resource in message.resources}
        with self.lock:
            self.resources = states
        for callback in self.on_changes:
            callback(dict(states))

    def _on_skills(self, message: Any) -> None:
        if not self._heard(message.header.frame_id):
            return
        for skill in message.skills:
            for execution in skill.last:
                self._keep_last(skill.name, execution.ended_ns, execution)
        self.skills = {skill.name: skill for skill in message.skills}
        for callback in self.on_skills:
            callback(dict(self.skills))

    def _on_event(self, event: Any) -> None:
        life = event.header.frame_id
        # Twice comes what was published while the history of earlier events was on its way.
        if not self._heard(life) or event.sequence <= self._last_event:
            return
        self._last_event = event.sequence
        if event.kind == Event.TRANSITION:
            self._last_transition = event.sequence
        else:
            if ExecutionState(event.state).terminal:
                self._keep_last(event.skill, event.header.stamp.to_nsec(), event)
            if event.id in self._open:
                self._open[event.id].on_event(event, life, self._last_transition)
        for callback in self.on_events:
            callback(event)

    def _keep_last(self, skill: str, stamp_ns: int, said: Any) -> None:
        if skill not in self.last or self.last[skill][0] <= stamp_ns:
            self.last[skill] = (stamp_ns, said)

    def _on_feedback(self, message: Any) -> None:
        pursuit = self._open.get(message.status.goal_id.id)
        if pursuit is not None:
            pursuit.on_feedback(message.feedback, self.reach.presence.life)

    def _on_result(self, message: Any) -> None:
        pursuit = self._open.get(message.status.goal_id.id)
        if pursuit is not None:
            pursuit.on_result(message.result, self.reach.presence.life)

    def _heard(self, life: str) -> bool:
        """Note a sign of life; forget what was known of earlier managers when these are others."""
        before = self.reach.presence.life
        if not self.reach.presence.heard(life, time.monotonic()):
            return False
        if life != before:
            self._last_event, self._last_transition, self._states_after = 0, 0, -1
            self.last.clear()
            self.reach.ready.clear()
            for pursuit in list(self._open.values()):
                pursuit.outlived(life)
        return True

    def _forget(self, handle: SkillHandle) -> None:
        self._open.pop(handle.id, None)

    def _abandon(self, reason: str) -> None:
        for pursuit in list(self._open.values()):
            pursuit.abandon(reason)
        self.questions.give_up(reason)
