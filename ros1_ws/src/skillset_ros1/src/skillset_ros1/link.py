"""The topics of one skill's action, on the client's side."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import rospy
from actionlib_msgs.msg import GoalID

from skillset_ros1.names import QUEUE, ActionTypes


class SkillLink:
    """Sends goals and cancellations; passes on feedback and results.

    Not actionlib's client: that invents the goals' ids, and logs an error for every status that overtakes another.
    """

    def __init__(self, place: str, types: ActionTypes, on_feedback: Callable[[Any], None], on_result: Callable[[Any], None]) -> None:
        self.types = types
        self._goals = rospy.Publisher(f"{place}/goal", types.action_goal, queue_size=QUEUE)
        self._cancels = rospy.Publisher(f"{place}/cancel", GoalID, queue_size=QUEUE)
        self._listening = [
            rospy.Subscriber(f"{place}/feedback", types.action_feedback, on_feedback, tcp_nodelay=True),
            rospy.Subscriber(f"{place}/result", types.action_result, on_result, tcp_nodelay=True),
        ]

    def connected(self, server: str) -> bool:
        """Tell whether nothing sent now would be lost on its way to or from this node."""
        sending = all(publisher.impl.has_connection(server) for publisher in (self._goals, self._cancels))
        return sending and all(is_connected(subscriber, server) for subscriber in self._listening)

    def send(self, identifier: str, goal: Any) -> None:
        """Send a goal."""
        message = self.types.action_goal(goal=goal, goal_id=GoalID(id=identifier, stamp=rospy.get_rostime()))
        message.header.stamp = message.goal_id.stamp
        self._goals.publish(message)

    def cancel(self, identifier: str) -> None:
        """Cancel one goal."""
        self._cancels.publish(GoalID(id=identifier))

    def cancel_all(self) -> None:
        """Cancel all goals: that is what an id and a stamp of nothing mean."""
        self._cancels.publish(GoalID())

    def unregister(self) -> None:
        """Take the topics away."""
        for topic in (self._goals, self._cancels, *self._listening):
            topic.unregister()


def is_connected(subscriber: Any, server: str = "") -> bool:
    """Tell whether a subscriber has a live connection from this node, or from any; rospy keeps broken ones to mend them later."""
    if subscriber.impl is None:
        return False
    connections = list(subscriber.impl.connections)
    return any(c.socket is not None and server in {"", c.callerid_pub} for c in connections)
