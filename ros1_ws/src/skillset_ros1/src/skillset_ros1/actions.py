"""Skills as actionlib actions that take any number of goals at a time.

A goal's id is the execution's. It is PENDING until the skill runs, so a refusal is a REJECTED goal and an interruption before the start
a RECALLED one; every end carries a result that says why.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from typing import Any

import rospy
from actionlib import ActionServer, ServerGoalHandle
from actionlib_msgs.msg import GoalID, GoalStatus
from std_msgs.msg import Header

from alula.model.execution_state import ExecutionState
from alula.runtime.action_messages import ActionMessages
from alula.runtime.core.events import ExecutionEvent
from alula.runtime.middleware import Goal, GoalListener, OnError, OnValue
from skillset_ros1.base import RospyBase
from skillset_ros1.convert import TYPES, fields_of
from skillset_ros1.names import QUEUE, ActionTypes

OnGoal = Callable[[ServerGoalHandle], None]
RECALLED_EARLY = "interrupted before it arrived"
RESULTS_KEPT = 10
"""So many of a skill, until others take their place, however long ago they came."""
_WAITING = {GoalStatus.PENDING, GoalStatus.RECALLING}


def action_messages(base: RospyBase, types: ActionTypes, skill: str) -> ActionMessages:
    """Return what makes and reads the messages of an action."""
    return ActionMessages(skill, TYPES, goal=types.goal, feedback=types.feedback, result=types.result, on_error=base.log)


class _Server(ActionServer, rospy.SubscribeListener):  # type: ignore[misc]  # neither actionlib nor rospy has types
    """An action server whose results reach every client and are never empty.

    A subscriber of ROS 1 takes itself for connected a moment before the publisher knows of it, so an action client can lose the
    result of its first goal: a new subscriber is sent the last results. And actionlib itself recalls a goal whose cancellation came
    first, without a word.
    """

    def __init__(self, name: str, spec: Any, on_goal: OnGoal, on_cancel: OnGoal) -> None:
        self._results: deque[Any] = deque(maxlen=RESULTS_KEPT)
        super().__init__(name, spec, on_goal, on_cancel, auto_start=False)

    def initialize(self) -> None:
        super().initialize()
        self.result_pub.impl.add_subscriber_listener(self)

    def publish_result(self, status: Any, result: Any) -> None:
        """Publish a result, and keep it for subscribers that come later; one that actionlib left empty is made INTERRUPTED."""
        if not result.outcome:
            result.outcome, result.message = ExecutionState.INTERRUPTED.value, RECALLED_EARLY
        with self.lock:
            self._results.append(self.ActionResult(Header(stamp=rospy.get_rostime()), status, result))
            super().publish_result(status, result)

    def peer_subscribe(self, topic_name: str, topic_publish: OnValue, peer_publish: OnValue) -> None:  # noqa: ARG002
        """Send the last results to a new subscriber."""
        with self.lock:
            for result in self._results:
                peer_publish(result)


class RospyGoal:
    """A goal at its server."""

    def __init__(self, server: RospyServer, handle: ServerGoalHandle) -> None:
        self.id: str = handle.get_goal_id().id
        self.inputs: Mapping[str, object] = server.messages.read_goal(handle.get_goal())
        self._server = server
        self._handle = handle

    def report(self, progress: float, state: ExecutionState, outputs: Mapping[str, object]) -> None:
        """Send feedback; the goal is active from the first on."""
        if self._handle.get_goal_status().status in _WAITING:
            self._handle.set_accepted()
        self._handle.publish_feedback(self._server.messages.make_feedback(progress, state, outputs))

    def finish(self, event: ExecutionEvent) -> None:
        """Set the goal's terminal state and send its result."""
        result = self._server.messages.make_result(event)
        waiting = self._handle.get_goal_status().status in _WAITING
        if event.state is ExecutionState.TERMINATED:
            self._handle.set_succeeded(result, event.message)
        elif event.state is ExecutionState.INTERRUPTED:
            self._handle.set_canceled(result, event.message)
        elif waiting:
            self._handle.set_rejected(result, event.message)
        else:
            self._handle.set_aborted(result, event.message)


class RospyServer:
    """A skill's action at its manager."""

    def __init__(
        self, base: RospyBase, types: ActionTypes, skill: str, on_goal: Callable[[Goal], None], on_cancel: Callable[[str], None]
    ) -> None:
        self.messages = action_messages(base, types, skill)
        self.inputs_of = self.messages.inputs_of
        # On the loop: actionlib's threads hold its lock, and a cancellation comes after its goal.
        took: OnGoal = lambda handle: base.submit(lambda: on_goal(RospyGoal(self, handle)))  # noqa: E731
        cancelled: OnGoal = lambda handle: base.submit(lambda: on_cancel(handle.get_goal_id().id))  # noqa: E731
        self.server = _Server(base.name(f"skill/{skill}"), types.spec, took, cancelled)
        self.server.start()

    def unregister(self) -> None:
        """Accept no more goals, and unregister the topics."""
        self.server.stop()


class RospyLink:
    """A skill's action at a client.

    Not actionlib's client: that invents the goals' ids, and logs an error for every status that overtakes another.
    """

    def __init__(self, base: RospyBase, types: ActionTypes, skill: str, listener: GoalListener) -> None:
        self._types = types
        self._base = base
        self._messages = action_messages(base, types, skill)
        self.fit, self.outputs_of = self._messages.fit, self._messages.outputs_of
        self._listener = listener
        place = base.name(f"skill/{skill}")
        self._goals = rospy.Publisher(f"{place}/goal", types.action_goal, queue_size=QUEUE)
        self._cancels = rospy.Publisher(f"{place}/cancel", GoalID, queue_size=QUEUE)
        self._listening = [
            base.listen(f"{place}/feedback", types.action_feedback, self._on_feedback),
            base.listen(f"{place}/result", types.action_result, self._on_result),
        ]

    @property
    def connected(self) -> bool:
        """Return whether there are connections in both directions to the managers' node."""
        server = self._base.server
        sending = all(publisher.impl.has_connection(server) for publisher in (self._goals, self._cancels) if publisher.impl)
        return sending and all(is_connected(subscriber, server) for subscriber in self._listening)

    @property
    def input_types(self) -> dict[str, str]:
        """The inputs with their types."""
        return fields_of(self._types.goal)

    def send(self, goal_id: str, goal: Any, on_answer: Callable[[bool], None]) -> None:  # noqa: ARG002 - events answer it
        """Publish a goal; events of the managers show whether it was accepted."""
        message = self._types.action_goal(goal=goal, goal_id=GoalID(id=goal_id, stamp=rospy.get_rostime()))
        message.header.stamp = message.goal_id.stamp
        self._goals.publish(message)

    def cancel(self, goal_id: str) -> None:
        """Request the interruption of one goal."""
        self._cancels.publish(GoalID(id=goal_id))

    def cancel_all(self, on_count: OnValue, on_error: OnError) -> None:  # noqa: ARG002 - nothing is answered
        """Cancel all goals: an empty id and stamp mean that. ROS 1 does not report how many there were."""
        self._cancels.publish(GoalID())
        self._base.submit(lambda: on_count(None))

    def request_result(self, goal_id: str) -> None:
        """Do nothing: results are sent to every subscriber, and arrive over their connections."""

    def release(self, goal_id: str) -> None:
        """Stop following a goal."""

    def unregister(self) -> None:
        """Unregister publishers and subscribers at the master."""
        for topic in (self._goals, self._cancels, *self._listening):
            topic.unregister()

    def _on_feedback(self, message: Any) -> None:
        self._listener.on_feedback(message.status.goal_id.id, *self._messages.read_feedback(message.feedback))

    def _on_result(self, message: Any) -> None:
        self._listener.on_result(message.status.goal_id.id, self._messages.read_result(message.result))


def is_connected(subscriber: Any, server: str = "") -> bool:
    """Return whether a subscriber has a live connection from this node, or from any; rospy keeps broken ones to mend them later."""
    if subscriber.impl is None:
        return False
    connections = list(subscriber.impl.connections)
    return any(c.socket is not None and server in {"", c.callerid_pub} for c in connections)
