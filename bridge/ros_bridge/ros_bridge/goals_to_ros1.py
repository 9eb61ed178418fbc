"""Goals of ROS 2 clients at an actionlib server in ROS 1: the state of each, and the transitions at each event. No ROS in here.

A goal is answered (accepted or rejected) at the server's first status of it: ACTIVE accepts, REJECTED rejects; without a status until
its time-out it is rejected. A goal that the server only lists as PENDING (SimpleActionServer queues one behind the running one)
is accepted after ``QUEUED_S``: a ROS 2 client can't cancel what it has no answer for.
"""

from __future__ import annotations

import logging
import math
import threading
import uuid
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, Protocol

from ros_bridge.action_states import ROS1_TERMINAL, ROS2_TERMINAL, TO_ROS2, CancelCode, Ros1Status, Ros2Status
from ros_bridge.actionlib_wire import GoalStatus

logger = logging.getLogger("ros_bridge")

QUEUED_S = 0.5
SEND_AGAIN_S = 1.0  # a goal that the server does not list: it was lost on the way; actionlib takes an id only once
RESULT_WITHIN_S = 2.0  # a terminal status without its result: the result message was lost
LATE_RESULT_WITHIN_S = 125.0  # a server that has been away sends what it had sent meanwhile again after two minutes at the latest (TCP)
KEEP_RESULT_S = 60.0
KEEP_RESULTS = 1000
KEEP_RESULT_BYTES = 64_000_000  # of all results that are kept; the newest is kept whatever its size
MOST_GOALS = 1000  # open at a time; more are rejected
ANY_GOAL = bytes(16)
EVERY_GOAL = ""
"""In a cancel request of ROS 1: all goals of the server, whoever has sent them."""
AFTER_CANCEL_S = 0.1
"""So long after such a request no goal is sent: it goes over another connection, and may arrive first."""
NOT_TAKEN = frozenset({Ros1Status.REJECTED, Ros1Status.RECALLED})


class ActionlibServer(Protocol):
    """The server in ROS 1, as far as the goals need it."""

    def present(self) -> bool:
        """Return whether all five topics have a peer that listens or speaks."""

    def gone(self) -> bool:
        """Return whether the server's status has no publisher any more."""

    def late(self) -> bool:
        """Return whether a result may come late that the server has sent while it was away."""

    def send_goal(self, name: str, payload: bytes) -> None:
        """Publish a goal under this id; ``payload`` is the serialized ROS 1 goal."""

    def send_cancel(self, name: str) -> None:
        """Ask for one goal's end, or that of all."""


class Ros2Clients(Protocol):
    """The clients in ROS 2. A ``caller`` is what the reply to a request is addressed to."""

    def reply_goal(self, caller: Any, *, accepted: bool, stamp_ns: int) -> None:
        """Accept or reject a goal."""

    def reply_cancel(self, caller: Any, code: CancelCode, goals: list[tuple[bytes, int]]) -> None:
        """Answer a cancel request with the ids and stamps of the goals that are being cancelled."""

    def reply_result(self, caller: Any, status: Ros2Status, payload: bytes | None, reason: str) -> None:
        """Hand over a result; without a payload an empty one, with the reason where the type has a field for it."""

    def publish_feedback(self, goal: bytes, payload: bytes) -> None:
        """Publish a goal's feedback; ``payload`` is the serialized ROS 1 feedback."""

    def publish_status(self, goals: list[tuple[bytes, int, Ros2Status]]) -> None:
        """Publish ids, stamps and states of all goals that were accepted."""


@dataclass
class GoalToRos1:
    """One goal. ``status`` is UNKNOWN until it is accepted."""

    uuid: bytes
    payload: bytes
    caller: Any
    answer_by_s: float
    status: Ros2Status = Ros2Status.UNKNOWN
    stamp_ns: int = 0
    sent_s: float | None = None
    cancel_seen: bool = False
    listed_s: float | None = None
    ended_in_ros1: tuple[Ros1Status, float] | None = None
    payload_of_result: bytes | None = None
    reason: str = ""
    ended_s: float | None = None
    waiting: list[Any] = field(default_factory=list)

    @property
    def name(self) -> str:
        """The goal's id in ROS 1: ROS 2's as text."""
        return str(uuid.UUID(bytes=self.uuid))

    @property
    def open(self) -> bool:
        """Return whether the goal has been neither rejected nor ended."""
        return self.ended_s is None


class GoalsToRos1:
    """All goals of one action. Every method may be called from any thread; ``now_s`` is a steady clock's."""

    def __init__(self, label: str, timeout_s: float) -> None:
        self._label = label
        self._timeout_s = timeout_s
        self.lock = threading.RLock()
        self._goals: dict[bytes, GoalToRos1] = {}
        self._owes_cancel = False
        """Whether all goals of the server are to be cancelled as soon as it is there: a bridge before this one may have sent some."""
        self._cancelled_s = -math.inf

    def connect(self, server: ActionlibServer, clients: Ros2Clients) -> None:
        """Take both ends; the caller that opens them holds the lock meanwhile, so that what they bring waits."""
        self._server = server
        self._clients = clients

    @property
    def busy(self) -> bool:
        """Return whether a goal is open."""
        with self.lock:
            return any(goal.open for goal in self._goals.values())

    def request_goal(self, caller: Any, goal_uuid: bytes, payload: bytes, now_s: float) -> None:
        """Take a client's goal; it is answered here or later."""
        with self.lock:
            if goal_uuid in self._goals or sum(goal.open for goal in self._goals.values()) >= MOST_GOALS:
                self._clients.reply_goal(caller, accepted=False, stamp_ns=0)
                return
            goal = self._goals[goal_uuid] = GoalToRos1(goal_uuid, payload, caller, now_s + self._timeout_s)
            self._send_if_possible(goal, now_s)

    def _send_if_possible(self, goal: GoalToRos1, now_s: float) -> None:
        if self._server.present() and not self._owes_cancel and now_s - self._cancelled_s >= AFTER_CANCEL_S:
            goal.sent_s = now_s
            self._server.send_goal(goal.name, goal.payload)

    def request_cancel(self, caller: Any, goal_uuid: bytes, stamp_ns: int, now_s: float) -> None:
        """Cancel one goal, those accepted at or before a stamp, or all: the rules of action_msgs/CancelGoal."""
        with self.lock:
            known = self._goals.get(goal_uuid)
            if goal_uuid != ANY_GOAL and not stamp_ns and (known is None or not known.open):
                code = CancelCode.UNKNOWN_GOAL_ID if known is None else CancelCode.GOAL_TERMINATED
                self._clients.reply_cancel(caller, code, [])
                return
            chosen = [goal for goal in self._goals.values() if goal.open and _is_meant(goal, goal_uuid, stamp_ns)]
            code = CancelCode.NONE if chosen or goal_uuid == ANY_GOAL else CancelCode.REJECTED
            self._clients.reply_cancel(caller, code, [(goal.uuid, goal.stamp_ns) for goal in chosen])
            for goal in chosen:
                self._cancel(goal, now_s)
            if goal_uuid == ANY_GOAL and not stamp_ns:
                self._owes_cancel = True
                self._cancel_all_if_possible(now_s)
            self._publish_status()

    def _cancel_all_if_possible(self, now_s: float) -> None:
        """Cancel what the server does for clients that are not known here, too."""
        if self._owes_cancel and self._server.present():
            self._owes_cancel, self._cancelled_s = False, now_s
            self._server.send_cancel(EVERY_GOAL)

    def _cancel(self, goal: GoalToRos1, now_s: float) -> None:
        goal.cancel_seen = True
        if goal.sent_s is None:
            self._reject(goal, "cancelled before a server was there", now_s)
            return
        self._server.send_cancel(goal.name)
        if goal.status is not Ros2Status.UNKNOWN:
            goal.status = Ros2Status.CANCELING

    def request_result(self, caller: Any, goal_uuid: bytes) -> None:
        """Answer with the goal's result as soon as there is one."""
        with self.lock:
            goal = self._goals.get(goal_uuid)
            if goal is None or goal.status is Ros2Status.UNKNOWN:
                self._clients.reply_result(caller, Ros2Status.UNKNOWN, None, "no such goal")
            elif goal.open:
                goal.waiting.append(caller)
            else:
                self._clients.reply_result(caller, goal.status, goal.payload_of_result, goal.reason)

    def on_status(self, statuses: Iterable[GoalStatus], now_s: float) -> None:
        """Take the server's list of its goals; a goal that was in it and no longer is has been lost with a server's restart."""
        with self.lock:
            by_name = {status.goal_id.name: status for status in statuses}
            for goal in [goal for goal in self._goals.values() if goal.open and goal.sent_s is not None]:
                status = by_name.get(goal.name)
                if status is not None:
                    self._on_goal_status(goal, status, now_s)
                elif goal.listed_s is not None and goal.ended_in_ros1 is None:
                    self._give_up(goal, "the server in ROS 1 has forgotten the goal: it was restarted", now_s)

    def _on_goal_status(self, goal: GoalToRos1, status: GoalStatus, now_s: float) -> None:
        if goal.listed_s is None:
            goal.listed_s, goal.payload = now_s, b""
        goal.stamp_ns = goal.stamp_ns or status.goal_id.stamp_ns
        goal.cancel_seen |= status.status in (Ros1Status.PREEMPTING, Ros1Status.RECALLING)
        if status.status in ROS1_TERMINAL:
            goal.ended_in_ros1 = goal.ended_in_ros1 or (status.status, now_s)
        elif status.status in (Ros1Status.ACTIVE, Ros1Status.PREEMPTING):
            self._accept(goal)
            self._move(goal, TO_ROS2[status.status])
        elif goal.status is not Ros2Status.UNKNOWN:
            self._move(goal, TO_ROS2[status.status])

    def knows(self, status: GoalStatus) -> bool:
        """Return whether a status is about a goal of this bridge."""
        with self.lock:
            return self._find(status) is not None

    def on_feedback(self, status: GoalStatus, payload: bytes, now_s: float) -> None:
        """Pass on feedback; the last one may come after the result, over another connection."""
        with self.lock:
            goal = self._find(status)
            if goal is None:
                return
            if goal.open:
                self._on_goal_status(goal, status, now_s)
            if goal.status is not Ros2Status.UNKNOWN:
                self._clients.publish_feedback(goal.uuid, payload)

    def on_result(self, status: GoalStatus, payload: bytes, now_s: float) -> None:
        """End a goal with the server's result."""
        with self.lock:
            goal = self._find(status)
            if goal is None or not goal.open:
                return
            goal.stamp_ns = goal.stamp_ns or status.goal_id.stamp_ns
            self._end_as_in_ros1(goal, status.status, payload, status.text, now_s)

    def _end_as_in_ros1(self, goal: GoalToRos1, status: Ros1Status, payload: bytes | None, reason: str, now_s: float) -> None:
        if goal.status is Ros2Status.UNKNOWN and status in NOT_TAKEN:
            self._reject(goal, reason, now_s)
            return
        final = TO_ROS2[status]
        if status is Ros1Status.PREEMPTED and not goal.cancel_seen:
            final = Ros2Status.ABORTED  # ended without a request to cancel; ROS 2 has CANCELED for those only
        self._accept(goal)
        self._end(goal, final if final in ROS2_TERMINAL else Ros2Status.ABORTED, payload, reason, now_s)

    def tick(self, now_s: float) -> None:
        """Do what is due: send to a server that came, give up on one that went, drop old results."""
        with self.lock:
            self._cancel_all_if_possible(now_s)
            gone, late = self._server.gone(), self._server.late()
            for goal in list(self._goals.values()):
                if goal.open:
                    self._tick_open(goal, now_s, gone=gone, late=late)
            self._forget_results(now_s)

    def _forget_results(self, now_s: float) -> None:
        """Drop the results that are old, and the oldest of those that are too many or too large."""
        ended = sorted((goal for goal in self._goals.values() if not goal.open), key=lambda goal: goal.ended_s or 0.0, reverse=True)
        kept_bytes = 0
        for number, goal in enumerate(ended):
            kept_bytes += len(goal.payload_of_result or b"")
            too_old = now_s - (goal.ended_s or 0.0) > KEEP_RESULT_S
            if too_old or number >= KEEP_RESULTS or (number and kept_bytes > KEEP_RESULT_BYTES):
                del self._goals[goal.uuid]

    def _tick_open(self, goal: GoalToRos1, now_s: float, *, gone: bool, late: bool) -> None:
        unanswered = goal.status is Ros2Status.UNKNOWN
        refused = goal.ended_in_ros1 is not None and goal.ended_in_ros1[0] in NOT_TAKEN
        result_within_s = LATE_RESULT_WITHIN_S if late else RESULT_WITHIN_S
        if goal.ended_in_ros1 is not None and now_s - goal.ended_in_ros1[1] > result_within_s:
            self._end_as_in_ros1(goal, goal.ended_in_ros1[0], None, "the server in ROS 1 has sent no result", now_s)
        elif goal.sent_s is not None and gone and (goal.listed_s is not None or goal.cancel_seen):
            self._give_up(goal, "the server in ROS 1 is gone", now_s)
        elif unanswered and goal.listed_s is not None and now_s - goal.listed_s > QUEUED_S and not refused:
            self._accept(goal)
        elif unanswered and now_s > goal.answer_by_s and goal.listed_s is None:
            if goal.sent_s is not None:
                self._server.send_cancel(goal.name)  # it must not begin after the client was told that it doesn't
            asked = goal.sent_s is not None and not gone
            reason = "the server in ROS 1 has not taken the goal in time" if asked else "no server in ROS 1"
            self._reject(goal, reason, now_s)
        elif goal.sent_s is None or (goal.listed_s is None and now_s - goal.sent_s > SEND_AGAIN_S):
            self._send_if_possible(goal, now_s)

    def give_up_all(self, reason: str, now_s: float) -> None:
        """End all goals for the clients, and ask the server to end them too."""
        with self.lock:
            for goal in [goal for goal in self._goals.values() if goal.open]:
                if goal.sent_s is not None:
                    self._server.send_cancel(goal.name)
                self._give_up(goal, reason, now_s)

    def _find(self, status: GoalStatus) -> GoalToRos1 | None:
        try:
            goal = self._goals.get(uuid.UUID(status.goal_id.name).bytes)
        except ValueError:
            return None  # a goal of a client in ROS 1
        return None if goal is None or (goal.open and goal.sent_s is None) else goal

    def _accept(self, goal: GoalToRos1) -> None:
        if goal.status is Ros2Status.UNKNOWN:
            goal.status = Ros2Status.CANCELING if goal.cancel_seen else Ros2Status.ACCEPTED
            self._clients.reply_goal(goal.caller, accepted=True, stamp_ns=goal.stamp_ns)
            goal.caller = None
            self._publish_status()

    def _move(self, goal: GoalToRos1, status: Ros2Status) -> None:
        """Go on to a state, never back."""
        if status > goal.status:
            goal.status = status
            self._publish_status()

    def _give_up(self, goal: GoalToRos1, reason: str, now_s: float) -> None:
        if goal.status is Ros2Status.UNKNOWN:
            self._reject(goal, reason, now_s)
        else:
            logger.warning("%s: goal %s aborted: %s", self._label, goal.name, reason)
            self._end(goal, Ros2Status.ABORTED, None, reason, now_s)

    def _reject(self, goal: GoalToRos1, reason: str, now_s: float) -> None:
        logger.warning("%s: goal %s rejected: %s", self._label, goal.name, reason or "by the server in ROS 1")
        goal.ended_s = now_s
        self._clients.reply_goal(goal.caller, accepted=False, stamp_ns=0)
        goal.caller = None

    def _end(self, goal: GoalToRos1, status: Ros2Status, payload: bytes | None, reason: str, now_s: float) -> None:
        goal.status, goal.payload_of_result, goal.reason, goal.ended_s = status, payload, reason, now_s
        for caller in goal.waiting:
            self._clients.reply_result(caller, status, payload, reason)
        goal.waiting.clear()
        self._publish_status()

    def _publish_status(self) -> None:
        accepted = [goal for goal in self._goals.values() if goal.status is not Ros2Status.UNKNOWN]
        self._clients.publish_status([(goal.uuid, goal.stamp_ns, goal.status) for goal in accepted])


def _is_meant(goal: GoalToRos1, goal_uuid: bytes, stamp_ns: int) -> bool:
    if goal.uuid == goal_uuid or (goal_uuid == ANY_GOAL and not stamp_ns):
        return True
    return bool(stamp_ns) and 0 < goal.stamp_ns <= stamp_ns
