"""Has the rover stand when no mission decides any more: cancels what the navigation drives to. In the ROS 1 world."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING, Any

import rospy
from actionlib_msgs.msg import GoalID
from nav_msgs.msg import Odometry

if TYPE_CHECKING:
    from alula import parts

SERVERS = ("move_base", "follow_corridor", "creep", "dock", "localize")
STANDS_M_S, STANDS_RAD_S = 0.01, 0.02
STANDING_S, LONGEST_S = 1.0, 20.0  # mission clock: how long it has to have stood, and how long that is waited for


class Standing:
    """Hears from the odometry since when the rover stands."""

    def __init__(self) -> None:
        self.now_s = 0.0
        self._since_s: float | None = None
        self.news = threading.Event()

    def hear(self, message: Any) -> None:
        """Take an odometry."""
        speed, self.now_s = message.twist.twist, message.header.stamp.to_sec()
        moves = abs(speed.linear.x) > STANDS_M_S or abs(speed.angular.z) > STANDS_RAD_S
        self._since_s = None if moves else self._since_s if self._since_s is not None else self.now_s
        self.news.set()

    @property
    def stands(self) -> bool:
        """Return whether it has stood for long enough."""
        return self._since_s is not None and self.now_s - self._since_s >= STANDING_S


def stand(clock: parts.Clock) -> None:
    """Return when the rover stands, or when that takes too long."""
    cancels = [rospy.Publisher(f"/{server}/cancel", GoalID, queue_size=1) for server in SERVERS]
    standing, begin_s = Standing(), clock.now_s or 0.0
    rospy.Subscriber("/odom", Odometry, standing.hear, queue_size=1)
    while not standing.stands and not clock.stands_still and (clock.now_s or 0.0) - begin_s < LONGEST_S:
        for cancel in cancels:
            cancel.publish(GoalID())  # of all goals; again and again, for a server may just be connecting
        standing.news.wait(1.0)
        standing.news.clear()
