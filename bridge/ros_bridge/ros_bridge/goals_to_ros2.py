"""Goals of actionlib clients in ROS 1 at an action server in ROS 2: the state of each, and the transitions at each event. No ROS here.

Towards ROS 1 it behaves as actionlib's own server does: the status list goes out at each change and at 5 Hz, an ended goal stays in it for
5 s, a cancel request that overtakes its goal is remembered, one with a stamp also meets goals that come later with an earlier stamp.
A goal is PENDING until the server in ROS 2 executes it, and PREEMPTING when that server agrees to cancel, not before.

A request to a server that is starting or stopping may get lost, and so may its answer. For a goal that has no answer, or whose server was
restarted, the bridge therefore requests the result: a server that does not know the goal refuses at once. Then the goal is sent again under
the same id, which no server accepts twice; a goal that had been accepted before has ended.
"""

from __future__ import annotations

import logging
import threading
import uuid
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Protocol

from ros_bridge.action_states import ROS1_TERMINAL, ROS2_TERMINAL, TO_ROS1, Ros1Status, Ros2Status
from ros_bridge.actionlib_wire import GoalId, GoalStatus

logger = logging.getLogger("ros_bridge")

KEEP_S = 5.0  # actionlib's status_list_timeout
KEEP_MOST = 1000
MOST_GOALS = 1000  # open at a time; more are rejected
ASK_AFTER_S = 1.0
STATUS_PERIOD_S = 0.2  # actionlib's status frequency of 5 Hz


class Ros2Server(Protocol):
    """The server in ROS 2, as far as the goals need it; what it says comes back in ``on_answer``, ``on_status`` and so on."""

    def present(self) -> bool:
        """Return whether all its services are there."""

    def has_come(self) -> bool:
        """Return whether a server has come since this was last asked."""

    def send_goal(self, goal: bytes, payload: bytes) -> None:
        """Ask the server to accept a goal."""

    def ask_result(self, goal: bytes) -> None:
        """Ask for the result, which comes when there is one."""

    def send_cancel(self, goal: bytes) -> None:
        """Ask for one goal's end."""

    def forget(self, goal: bytes) -> None:
        """Wait no longer for any answer about a goal."""


class Ros1Clients(Protocol):
    """The clients in ROS 1."""

    def publish_status(self, statuses: list[GoalStatus]) -> None:
        """Publish the list of all goals."""

    def publish_feedback(self, status: GoalStatus, payload: bytes) -> None:
        """Publish a goal's feedback; ``payload`` is the serialized feedback."""

    def publish_result(self, status: GoalStatus, payload: bytes | None) -> None:
        """Publish a result; without a payload an empty one."""


@dataclass
class GoalToRos2:
    """A goal of a ROS 1 client, on its way to the ROS 2 server."""

    name: str
    stamp_ns: int
    payload: bytes
    answer_by_s: float
    uuid: bytes
    status: Ros1Status = Ros1Status.PENDING
    text: str = ""
    sent_s: float | None = None
    asked: bool = False
    ended_in_ros2_s: float | None = None
    accepted: bool = False
    cancel_asked: bool = False
    ended_s: float | None = None

    @property
    def open(self) -> bool:
        """Return whether the goal has not ended."""
        return self.ended_s is None

    @property
    def goal_status(self) -> GoalStatus:
        """Return what the list says about the goal."""
        return GoalStatus(GoalId(self.name, self.stamp_ns), self.status, self.text)


class GoalsToRos2:
    """All goals of one action. Every method may be called from any thread; ``now_s`` is a steady clock's."""

    def __init__(self, label: str, timeout_s: float) -> None:
        self._label = label
        self._timeout_s = timeout_s
        self.lock = threading.RLock()
        self._goals: dict[str, GoalToRos2] = {}
        self._by_uuid: dict[bytes, GoalToRos2] = {}
        self._last_cancel_ns = 0
        self._next_status_s = 0.0

    def connect(self, server: Ros2Server, clients: Ros1Clients) -> None:
        """Take both ends; the caller that opens them holds the lock meanwhile, so that what they bring waits."""
        self._server = server
        self._clients = clients

    @property
    def busy(self) -> bool:
        """Return whether a goal is open."""
        with self.lock:
            return any(goal.open for goal in self._goals.values())

    def on_goal(self, goal_id: GoalId, payload: bytes, now_s: float) -> None:
        """Take a client's goal; a second one of the same id is none, as in actionlib."""
        with self.lock:
            goal = self._goals.get(goal_id.name)
            if goal is not None:
                if goal.status is Ros1Status.RECALLING:
                    self._end(goal, Ros1Status.RECALLED, None, "cancelled before it came", now_s)
                return
            goal = self._new(goal_id, payload, now_s)
            if 0 < goal_id.stamp_ns <= self._last_cancel_ns:
                self._end(goal, Ros1Status.RECALLED, None, "a cancel request with a later stamp came before it", now_s)
            elif sum(other.open for other in self._goals.values()) > MOST_GOALS:
                self._end(goal, Ros1Status.REJECTED, None, f"the bridge has {MOST_GOALS} open goals of this action", now_s)
            else:
                self._send_if_possible(goal, now_s)

    def _new(self, goal_id: GoalId, payload: bytes, now_s: float) -> GoalToRos2:
        goal_uuid = uuid.uuid4()
        name = goal_id.name or f"ros_bridge-{goal_uuid}"
        goal = GoalToRos2(name, goal_id.stamp_ns, payload, now_s + self._timeout_s, goal_uuid.bytes)
        self._goals[name] = self._by_uuid[goal.uuid] = goal
        return goal

    def _send_if_possible(self, goal: GoalToRos2, now_s: float) -> None:
        if self._server.present():
            goal.sent_s = now_s
            goal.asked = False
            self._server.send_goal(goal.uuid, goal.payload)

    def on_cancel(self, request: GoalId, now_s: float) -> None:
        """Cancel one goal, those stamped at or before a time, or all: the rules of actionlib's server."""
        with self.lock:
            self._last_cancel_ns = max(self._last_cancel_ns, request.stamp_ns)
            for goal in [goal for goal in self._goals.values() if goal.open and _is_meant(goal, request)]:
                self._cancel(goal, now_s)
            if request.name and request.name not in self._goals:
                early = self._new(GoalId(request.name, request.stamp_ns), b"", now_s)
                early.status, early.ended_s = Ros1Status.RECALLING, now_s

    def _cancel(self, goal: GoalToRos2, now_s: float) -> None:
        goal.cancel_asked = True
        if goal.sent_s is None:
            self._end(goal, Ros1Status.RECALLED, None, "cancelled before a server was there", now_s)
        elif goal.accepted:
            self._server.send_cancel(goal.uuid)

    def on_answer(self, goal_uuid: bytes, *, accepted: bool, stamp_ns: int, reason: str, now_s: float) -> None:
        """Take the server's answer to a goal; one that the client was told is over is cancelled again."""
        with self.lock:
            goal = self._by_uuid.get(goal_uuid)
            if goal is None or not goal.open:
                if accepted:
                    self._server.send_cancel(goal_uuid)
            elif goal.sent_s is None:
                return  # the goal was never sent
            elif accepted:
                goal.stamp_ns = goal.stamp_ns or stamp_ns
                self._accept(goal)
            elif not goal.accepted:
                self._end(goal, Ros1Status.REJECTED, None, reason, now_s)

    def _accept(self, goal: GoalToRos2) -> None:
        if goal.accepted:
            return
        goal.accepted, goal.payload = True, b""
        self._server.ask_result(goal.uuid)
        if goal.cancel_asked:
            self._server.send_cancel(goal.uuid)

    def on_status(self, statuses: Iterable[tuple[bytes, Ros2Status]], now_s: float) -> None:
        """Take the server's states; how a goal ends is for its result to say, which is asked for again when it does not come."""
        with self.lock:
            for goal_uuid, status in statuses:
                goal = self._by_uuid.get(goal_uuid)
                if goal is None or not goal.open or goal.sent_s is None:
                    continue
                self._accept(goal)  # if the answer was lost
                if status in (Ros2Status.EXECUTING, Ros2Status.CANCELING):
                    self._move(goal, TO_ROS1[status])
                elif status in ROS2_TERMINAL and goal.ended_in_ros2_s is None:
                    goal.ended_in_ros2_s = now_s

    def knows(self, goal_uuid: bytes) -> bool:
        """Return whether an id is that of a goal of this bridge."""
        with self.lock:
            return goal_uuid in self._by_uuid

    def on_feedback(self, goal_uuid: bytes, payload: bytes) -> None:
        """Pass feedback of the server on to the client of its goal."""
        with self.lock:
            goal = self._by_uuid.get(goal_uuid)
            if goal is not None and goal.open:
                self._move(goal, Ros1Status.ACTIVE)
                self._clients.publish_feedback(goal.goal_status, payload)

    def on_result(self, goal_uuid: bytes, status: Ros2Status, payload: bytes | None, reason: str, now_s: float) -> None:
        """End a goal with the server's result; UNKNOWN comes from a server that has not seen the goal."""
        with self.lock:
            goal = self._by_uuid.get(goal_uuid)
            if goal is None or not goal.open:
                return
            if status is Ros2Status.UNKNOWN and not goal.accepted:
                self._send_if_possible(goal, now_s)
                return
            final = TO_ROS1[status]
            if status is Ros2Status.UNKNOWN:
                payload, reason = None, "the server in ROS 2 does not know the goal: it was restarted"
            self._end(goal, final if final in ROS1_TERMINAL else Ros1Status.ABORTED, payload, reason, now_s)

    def tick(self, now_s: float) -> None:
        """Do what is due: send to a server that came, give up on one that went, publish the list, drop ended goals."""
        with self.lock:
            present, come = self._server.present(), self._server.has_come()
            for goal in list(self._goals.values()):
                if goal.open:
                    self._tick_open(goal, now_s, present=present, come=come)
            self._forget(now_s)
            if now_s >= self._next_status_s:
                self._publish_status()
                self._next_status_s = now_s + STATUS_PERIOD_S

    def _tick_open(self, goal: GoalToRos2, now_s: float, *, present: bool, come: bool) -> None:
        if goal.sent_s is not None and not present and (goal.accepted or goal.cancel_asked):
            self._give_up(goal, "the server in ROS 2 is gone", now_s)
        elif not goal.accepted and now_s > goal.answer_by_s:
            asked = goal.sent_s is not None and present
            reason = "the server in ROS 2 has not answered in time" if asked else "no server in ROS 2"
            self._give_up(goal, reason, now_s)
        elif goal.sent_s is None:
            self._send_if_possible(goal, now_s)
        elif come or (not goal.asked and now_s - goal.sent_s > ASK_AFTER_S):
            goal.asked = True
            self._server.ask_result(goal.uuid)
        elif goal.ended_in_ros2_s is not None and now_s - goal.ended_in_ros2_s > ASK_AFTER_S:
            goal.ended_in_ros2_s = now_s
            self._server.ask_result(goal.uuid)

    def _forget(self, now_s: float) -> None:
        ended = [goal for goal in self._goals.values() if goal.ended_s is not None]
        late = [goal for goal in ended if now_s - (goal.ended_s or 0.0) > KEEP_S]
        for goal in late or ended[: max(0, len(ended) - KEEP_MOST)]:
            del self._goals[goal.name], self._by_uuid[goal.uuid]
            self._server.forget(goal.uuid)

    def give_up_all(self, reason: str, now_s: float) -> None:
        """End all goals for the clients, and ask the server to end them too."""
        with self.lock:
            for goal in [goal for goal in self._goals.values() if goal.open]:
                if goal.accepted:
                    self._server.send_cancel(goal.uuid)
                self._give_up(goal, reason, now_s)

    def _give_up(self, goal: GoalToRos2, reason: str, now_s: float) -> None:
        final = Ros1Status.ABORTED if goal.accepted else Ros1Status.REJECTED
        logger.warning("%s: goal %s %s: %s", self._label, goal.name, final.name.lower(), reason)
        self._end(goal, final, None, reason, now_s)

    def _move(self, goal: GoalToRos2, status: Ros1Status) -> None:
        """Go on from PENDING to ACTIVE to PREEMPTING, never back."""
        if status is not goal.status and goal.status is not Ros1Status.PREEMPTING:
            goal.status = status
            self._publish_status()

    def _end(self, goal: GoalToRos2, status: Ros1Status, payload: bytes | None, text: str, now_s: float) -> None:
        goal.status, goal.text, goal.ended_s, goal.payload = status, text, now_s, b""
        self._clients.publish_result(goal.goal_status, payload)
        self._publish_status()

    def _publish_status(self) -> None:
        self._clients.publish_status([goal.goal_status for goal in self._goals.values()])


def _is_meant(goal: GoalToRos2, request: GoalId) -> bool:
    if not request.name and not request.stamp_ns:
        return True
    return goal.name == request.name or 0 < goal.stamp_ns <= request.stamp_ns
