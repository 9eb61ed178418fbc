"""Both sides of actionlib as bytes over rospy: towards a server, with the topics of a client; towards clients, with those of a server."""

from __future__ import annotations

import itertools
import logging
import select
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from ros_bridge import actionlib_wire, raw
from ros_bridge.actionlib_wire import GoalId, GoalStatus
from ros_bridge.errors import BridgeError

import rospy  # isort: skip - after ros_bridge.raw, which fetches it

if TYPE_CHECKING:
    from ros_bridge.action_types import ActionType
    from ros_bridge.conversion import Types
    from ros_bridge.raw import RawMessage

logger = logging.getLogger("ros_bridge")

QUEUE = 100  # messages towards each peer; the oldest gives way
Take = Callable[[bytes], None]


def _subscribe(topic: str, message_class: type[RawMessage], take: Take) -> rospy.Subscriber:
    """Subscribe so that whatever garbage a peer sends is told and does not end its connection's thread."""

    def receive(message: RawMessage) -> None:
        try:
            take(bytes(message.data))
        except BridgeError as error:
            logger.error("%s: a message is ignored: %s", topic, error)
        except Exception:
            logger.exception("%s: a message is ignored", topic)

    return rospy.Subscriber(topic, message_class, receive, tcp_nodelay=True)


def _publisher(topic: str, message_class: type[RawMessage], *, latch: bool = False) -> rospy.Publisher:
    return rospy.Publisher(topic, message_class, queue_size=QUEUE, latch=latch, tcp_nodelay=True)


def _hears(subscriber: rospy.Subscriber) -> bool:
    """Tell whether a publisher is connected; rospy keeps broken connections, without a socket, to mend them."""
    return any(connection.socket is not None and not connection.done for connection in subscriber.impl.connections)


def _is_heard(publisher: rospy.Publisher) -> bool:
    """Tell whether a subscriber is connected; rospy sees one's end when it next writes, we see that there is an end to be read."""
    return any(_is_open(connection.socket) for connection in publisher.impl.connections)


def _is_open(socket: Any) -> bool:
    try:
        return socket is not None and not select.select([socket], [], [], 0)[0]
    except (OSError, ValueError):  # it is being closed
        return False


class ActionlibServerEnd:
    """The server of an action in ROS 1, as a client sees it."""

    def __init__(self, name: str, action: ActionType, types: Types, *, on_status: Take, on_feedback: Take, on_result: Take) -> None:
        """Connect to the server when it is there."""
        self._seq = itertools.count(1)
        self._goal_class = raw.message_class(action.goal.envelope)
        self._cancel_class = raw.message_class(types.message("actionlib_msgs/GoalID"))
        self._goals = _publisher(f"{name}/goal", self._goal_class)
        self._cancels = _publisher(f"{name}/cancel", self._cancel_class)
        self._status = _subscribe(f"{name}/status", raw.message_class(types.message("actionlib_msgs/GoalStatusArray")), on_status)
        self._feedback = _subscribe(f"{name}/feedback", raw.message_class(action.feedback.envelope), on_feedback)
        self._result = _subscribe(f"{name}/result", raw.message_class(action.result.envelope), on_result)

    def present(self) -> bool:
        """Tell whether all five topics have a peer."""
        return all(map(_hears, (self._status, self._feedback, self._result))) and all(map(_is_heard, (self._goals, self._cancels)))

    def gone(self) -> bool:
        """Tell whether nobody publishes the server's status any more."""
        return not _hears(self._status)

    def send_goal(self, name: str, payload: bytes) -> None:
        """Publish a goal without a stamp: the server fills in its own clock's."""
        message = actionlib_wire.encode_goal(GoalId(name, 0), payload, seq=next(self._seq), stamp_ns=time.time_ns())
        self._goals.publish(self._goal_class(message))

    def send_cancel(self, name: str) -> None:
        """Ask for one goal's end."""
        self._cancels.publish(self._cancel_class(actionlib_wire.encode_goal_id(GoalId(name, 0))))

    def close(self) -> None:
        """Leave all topics."""
        for end in (self._goals, self._cancels, self._status, self._feedback, self._result):
            end.unregister()


class ActionlibClientsEnd:
    """The clients of an action in ROS 1, as the server sees them."""

    def __init__(self, name: str, action: ActionType, types: Types, *, on_goal: Take, on_cancel: Take, empty_result: bytes) -> None:
        """Offer the action."""
        self._seq = itertools.count(1)
        self._empty_result = empty_result
        self._status_class = raw.message_class(types.message("actionlib_msgs/GoalStatusArray"))
        self._feedback_class = raw.message_class(action.feedback.envelope)
        self._result_class = raw.message_class(action.result.envelope)
        self._status = _publisher(f"{name}/status", self._status_class, latch=True)
        self._feedback = _publisher(f"{name}/feedback", self._feedback_class)
        self._result = _publisher(f"{name}/result", self._result_class)
        self._goals = _subscribe(f"{name}/goal", raw.message_class(action.goal.envelope), on_goal)
        self._cancels = _subscribe(f"{name}/cancel", raw.message_class(types.message("actionlib_msgs/GoalID")), on_cancel)

    def publish_status(self, statuses: list[GoalStatus]) -> None:
        """Publish the list of all goals."""
        message = actionlib_wire.encode_status_array(statuses, seq=next(self._seq), stamp_ns=time.time_ns())
        self._status.publish(self._status_class(message))

    def publish_feedback(self, status: GoalStatus, payload: bytes) -> None:
        """Publish feedback."""
        message = actionlib_wire.encode_outcome(status, payload, seq=next(self._seq), stamp_ns=time.time_ns())
        self._feedback.publish(self._feedback_class(message))

    def publish_result(self, status: GoalStatus, payload: bytes | None) -> None:
        """Publish a result."""
        content = self._empty_result if payload is None else payload
        message = actionlib_wire.encode_outcome(status, content, seq=next(self._seq), stamp_ns=time.time_ns())
        self._result.publish(self._result_class(message))

    def close(self) -> None:
        """Leave all topics."""
        for end in (self._goals, self._cancels, self._status, self._feedback, self._result):
            end.unregister()
