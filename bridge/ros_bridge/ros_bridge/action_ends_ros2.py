"""Both sides of a ROS 2 action over its services and topics (design.ros2.org, "Actions"): towards clients and towards a server.

rclpy's own ActionServer answers a goal as soon as its callback returns and ActionClient makes an object of everything; here answers
wait for the other world, and feedback stays bytes.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from action_msgs.msg import GoalInfo, GoalStatus, GoalStatusArray
from action_msgs.srv import CancelGoal
from builtin_interfaces.msg import Time
from rclpy.qos import QoSProfile, qos_profile_action_status_default
from rclpy.serialization import deserialize_message, serialize_message
from unique_identifier_msgs.msg import UUID

from ros_bridge.action_states import CancelCode, Ros2Status
from ros_bridge.actionlib_wire import SECOND_NS
from ros_bridge.deferred_service import DeferredService, Header, Take
from ros_bridge.services import TEXTS

if TYPE_CHECKING:
    from rclpy.node import Node
    from rclpy.task import Future

logger = logging.getLogger("ros_bridge")

FEEDBACK_DEPTH = 10  # rclpy's
ENCAPSULATION = 4  # bytes before any CDR
FEEDBACK_AT = ENCAPSULATION + 16  # a FeedbackMessage is the goal's id and the feedback; 16 keeps the alignment of what follows


def ros2_time(stamp_ns: int) -> Time:
    """Return nanoseconds as ROS 2's message."""
    return Time(sec=stamp_ns // SECOND_NS, nanosec=stamp_ns % SECOND_NS)


def stamp_ns(time: Time) -> int:
    """Return ROS 2's message as nanoseconds."""
    return int(time.sec * SECOND_NS + time.nanosec)


def _goal_info(goal: bytes, goal_stamp_ns: int) -> GoalInfo:
    return GoalInfo(goal_id=UUID(uuid=list(goal)), stamp=ros2_time(goal_stamp_ns))


def empty_result(action_class: Any, reason: str) -> Any:
    """Return a result of the action's type with default values, and the reason where the type has a field for it."""
    result = action_class.Result()
    kinds = result.get_fields_and_field_types()
    text = next((name for name in TEXTS if kinds.get(name) == "string"), None)
    if text is not None and reason:
        setattr(result, text, reason)
    return result


class Ros2ClientsEnd:
    """The clients of an action in ROS 2, as the server sees them."""

    def __init__(self, node: Node, action_class: Any, name: str, *, on_goal: Take, on_cancel: Take, on_result: Take) -> None:
        """Offer the action; requests come as soon as the node is spun."""
        self._node = node
        self._class = action_class
        kinds = action_class.Impl
        self._feedback = node.create_publisher(kinds.FeedbackMessage, f"{name}/_action/feedback", QoSProfile(depth=FEEDBACK_DEPTH))
        self._status = node.create_publisher(GoalStatusArray, f"{name}/_action/status", qos_profile_action_status_default)
        self._results = DeferredService(node, kinds.GetResultService, f"{name}/_action/get_result", on_result)
        self._cancels = DeferredService(node, CancelGoal, f"{name}/_action/cancel_goal", on_cancel)
        self._goals = DeferredService(node, kinds.SendGoalService, f"{name}/_action/send_goal", on_goal)

    def reply_goal(self, caller: Header, *, accepted: bool, stamp_ns: int) -> None:
        """Accept or reject a goal."""
        self._goals.reply(self._class.Impl.SendGoalService.Response(accepted=accepted, stamp=ros2_time(stamp_ns)), caller)

    def reply_cancel(self, caller: Header, code: CancelCode, goals: list[tuple[bytes, int]]) -> None:
        """Send the response to a cancel request: its code, and the goals (UUID, stamp in ns) that are being canceled."""
        canceling = [_goal_info(goal, goal_stamp_ns) for goal, goal_stamp_ns in goals]
        self._cancels.reply(CancelGoal.Response(return_code=int(code), goals_canceling=canceling), caller)

    def reply_result(self, caller: Header, status: Ros2Status, payload: bytes | None, reason: str) -> None:
        """Hand over a result, which is CDR."""
        result = empty_result(self._class, reason) if payload is None else deserialize_message(payload, self._class.Result)
        self._results.reply(self._class.Impl.GetResultService.Response(status=int(status), result=result), caller)

    def publish_feedback(self, goal: bytes, payload: bytes) -> None:
        """Publish feedback, which is CDR."""
        self._feedback.publish(payload[:ENCAPSULATION] + goal + payload[ENCAPSULATION:])

    def publish_status(self, goals: list[tuple[bytes, int, Ros2Status]]) -> None:
        """Publish the states of goals."""
        statuses = [GoalStatus(goal_info=_goal_info(goal, at_ns), status=int(status)) for goal, at_ns, status in goals]
        self._status.publish(GoalStatusArray(status_list=statuses))

    def close(self) -> None:
        """Destroy the services and publishers of the action."""
        for service in (self._goals, self._cancels, self._results):
            service.close()
        for publisher in (self._feedback, self._status):
            self._node.destroy_publisher(publisher)


Answer = Callable[[bytes, Any, str], None]  # goal, response or None, why there is none


class Ros2ServerEnd:
    """The server of an action in ROS 2, as a client sees it. Payloads are CDR."""

    def __init__(
        self,
        node: Node,
        action_class: Any,
        name: str,
        *,
        on_answer: Answer,
        on_result: Answer,
        on_feedback: Callable[[bytes, bytes], None],
        on_status: Callable[[list[tuple[bytes, Ros2Status]]], None],
    ) -> None:
        """Connect to the server when it is there."""
        self._node = node
        self._class = action_class
        self._on_answer, self._on_result = on_answer, on_result
        self._on_feedback, self._on_status = on_feedback, on_status
        kinds = action_class.Impl
        self._goals = node.create_client(kinds.SendGoalService, f"{name}/_action/send_goal")
        self._results = node.create_client(kinds.GetResultService, f"{name}/_action/get_result")
        self._cancels = node.create_client(CancelGoal, f"{name}/_action/cancel_goal")
        self._status_name = f"{name}/_action/status"
        self._seen: frozenset[bytes] = frozenset()
        self._pending: dict[bytes, list[tuple[Any, Future]]] = {}
        self._feedback = node.create_subscription(
            kinds.FeedbackMessage, f"{name}/_action/feedback", self._take_feedback, QoSProfile(depth=FEEDBACK_DEPTH), raw=True
        )
        self._status = node.create_subscription(GoalStatusArray, self._status_name, self._take_status, qos_profile_action_status_default)

    def present(self) -> bool:
        """Return whether all services are there."""
        return all(client.service_is_ready() for client in (self._goals, self._results, self._cancels))

    def has_come(self) -> bool:
        """Return whether a server has come since this was last asked: its publisher is a new one."""
        before = self._seen
        self._seen = frozenset(bytes(info.endpoint_gid) for info in self._node.get_publishers_info_by_topic(self._status_name))
        return bool(self._seen - before)

    def send_goal(self, goal: bytes, payload: bytes) -> None:
        """Ask the server to accept a goal."""
        content = deserialize_message(payload, self._class.Goal)
        request = self._class.Impl.SendGoalService.Request(goal_id=UUID(uuid=list(goal)), goal=content)
        self._call(self._goals, request, goal, self._on_answer)

    def ask_result(self, goal: bytes) -> None:
        """Request the result of a goal; it comes when the goal has ended."""
        self._call(self._results, self._class.Impl.GetResultService.Request(goal_id=UUID(uuid=list(goal))), goal, self._on_result)

    def send_cancel(self, goal: bytes) -> None:
        """Ask for one goal's end; that the server agrees shows in its status."""
        self._call(self._cancels, CancelGoal.Request(goal_info=_goal_info(goal, 0)), goal, lambda *_: None)

    def _call(self, client: Any, request: Any, goal: bytes, answer: Answer) -> None:
        future = client.call_async(request)
        self._pending.setdefault(goal, []).append((client, future))

        def done(future: Future) -> None:
            if future.cancelled():
                return
            error = future.exception()
            answer(goal, None if error else future.result(), str(error or ""))

        future.add_done_callback(done)

    def forget(self, goal: bytes) -> None:
        """Wait no longer for any answer about a goal."""
        for client, future in self._pending.pop(goal, ()):
            client.remove_pending_request(future)

    def _take_feedback(self, cdr: bytes) -> None:
        self._on_feedback(cdr[ENCAPSULATION:FEEDBACK_AT], cdr[:ENCAPSULATION] + cdr[FEEDBACK_AT:])

    def _take_status(self, message: GoalStatusArray) -> None:
        known = [status for status in message.status_list if status.status in tuple(Ros2Status)]
        self._on_status([(bytes(status.goal_info.goal_id.uuid), Ros2Status(status.status)) for status in known])

    def close(self) -> None:
        """Forget all requests, and destroy the clients and subscriptions of the action."""
        for goal in list(self._pending):
            self.forget(goal)
        for subscription in (self._feedback, self._status):
            self._node.destroy_subscription(subscription)
        for client in (self._goals, self._results, self._cancels):
            self._node.destroy_client(client)


def result_cdr(response: Any) -> bytes:
    """Return the result in a GetResult response as CDR."""
    return bytes(serialize_message(response.result))
