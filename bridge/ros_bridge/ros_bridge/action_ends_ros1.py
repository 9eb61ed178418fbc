"""Both sides of actionlib as bytes: towards a server, with the topics of a client; towards clients, with those of a server."""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

from ros_bridge import actionlib_wire
from ros_bridge.actionlib_wire import GoalId, GoalStatus
from ros_bridge.endpoints import Ros1Publisher, Ros1Subscriber

if TYPE_CHECKING:
    from ros_bridge.action_types import ActionType
    from ros_bridge.routes import Context

Take = Callable[[bytes], None]


def _stamp_ns() -> int:
    """Return wall time, as stamps of ROS 1 have it."""
    return time.time_ns()  # noqa: TID251 - a stamp


class ActionlibServerEnd:
    """The server of an action in ROS 1, as a client sees it."""

    def __init__(self, name: str, action: ActionType, context: Context, *, on_status: Take, on_feedback: Take, on_result: Take) -> None:
        """Connect to the server when it is there."""
        self._seq = itertools.count(1)
        plane, types = context.plane, context.types
        self._goals = Ros1Publisher(plane, f"{name}/goal", action.goal.envelope)
        self._cancels = Ros1Publisher(plane, f"{name}/cancel", types.message("actionlib_msgs/GoalID"))
        self._status = Ros1Subscriber(plane, f"{name}/status", types.message("actionlib_msgs/GoalStatusArray"), on_status)
        self._feedback = Ros1Subscriber(plane, f"{name}/feedback", action.feedback.envelope, on_feedback)
        self._result = Ros1Subscriber(plane, f"{name}/result", action.result.envelope, on_result)
        self._ends = (self._goals, self._cancels, self._status, self._feedback, self._result)

    def present(self) -> bool:
        """Return whether all five topics have a peer."""
        return all(end.peers() > 0 for end in self._ends)

    def gone(self) -> bool:
        """Return whether the server's status has no publisher any more."""
        return self._status.peers() == 0

    def late(self) -> bool:
        """Return whether a result may come late that the server has sent while it was away."""
        return self._result.late()

    def send_goal(self, name: str, payload: bytes) -> None:
        """Publish a goal without a stamp: the server fills in its own clock's."""
        self._goals.publish(actionlib_wire.encode_goal(GoalId(name, 0), payload, seq=next(self._seq), stamp_ns=_stamp_ns()))

    def send_cancel(self, name: str) -> None:
        """Ask for one goal's end."""
        self._cancels.publish(actionlib_wire.encode_goal_id(GoalId(name, 0)))

    def close(self) -> None:
        """Unregister the five topics of the action."""
        for end in self._ends:
            end.close()


class ActionlibClientsEnd:
    """The clients of an action in ROS 1, as the server sees them."""

    def __init__(self, name: str, action: ActionType, context: Context, *, on_goal: Take, on_cancel: Take, empty_result: bytes) -> None:
        self._seq = itertools.count(1)
        self._empty_result = empty_result
        plane, types = context.plane, context.types
        self._status = Ros1Publisher(plane, f"{name}/status", types.message("actionlib_msgs/GoalStatusArray"), latched=True)
        self._feedback = Ros1Publisher(plane, f"{name}/feedback", action.feedback.envelope)
        self._result = Ros1Publisher(plane, f"{name}/result", action.result.envelope)
        self._goals = Ros1Subscriber(plane, f"{name}/goal", action.goal.envelope, on_goal)
        self._cancels = Ros1Subscriber(plane, f"{name}/cancel", types.message("actionlib_msgs/GoalID"), on_cancel)
        self._ends = (self._goals, self._cancels, self._status, self._feedback, self._result)

    def publish_status(self, statuses: list[GoalStatus]) -> None:
        """Publish the list of all goals."""
        self._status.publish(actionlib_wire.encode_status_array(statuses, seq=next(self._seq), stamp_ns=_stamp_ns()))

    def publish_feedback(self, status: GoalStatus, payload: bytes) -> None:
        """Publish a goal's feedback; ``payload`` is the serialized ROS 1 feedback."""
        self._feedback.publish(actionlib_wire.encode_outcome(status, payload, seq=next(self._seq), stamp_ns=_stamp_ns()))

    def publish_result(self, status: GoalStatus, payload: bytes | None) -> None:
        """Publish a goal's result; ``payload`` is the serialized ROS 1 result, None for an empty one."""
        content = self._empty_result if payload is None else payload
        self._result.publish(actionlib_wire.encode_outcome(status, content, seq=next(self._seq), stamp_ns=_stamp_ns()))

    def close(self) -> None:
        """Unregister the five topics of the action."""
        for end in self._ends:
            end.close()
