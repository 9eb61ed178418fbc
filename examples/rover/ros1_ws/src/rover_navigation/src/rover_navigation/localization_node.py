"""Localisation's node: its core on ROS, and the action `/localize`, which searches the whole map."""

from __future__ import annotations

import threading

import actionlib
import rospy
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
from move_base_msgs.msg import MoveBaseAction, MoveBaseFeedback, MoveBaseGoal
from node_core.ros import RosHost

from rover_navigation.localization import NAME, OUTPUTS, POSE, Localization
from rover_navigation.ros import wait_for_map

LOOK_S = 0.05  # wall clock: how often a search looks for its preemption
FEEDBACK_STEPS = 4  # poses


class Localize:
    """Serves the action; the goal is any."""

    def __init__(self, core: Localization) -> None:
        self._core = core
        self._poses = 0
        self._server = actionlib.SimpleActionServer("localize", MoveBaseAction, self._search, auto_start=False)
        rospy.Subscriber(POSE.topic, PoseWithCovarianceStamped, self._on_pose, queue_size=5)
        self._server.start()

    def _search(self, _goal: MoveBaseGoal) -> None:
        ended = threading.Event()
        told: list[tuple[bool, str]] = []

        def ends(found: bool, text: str) -> None:
            told.append((found, text))
            ended.set()

        self._core.begin_search(ends)
        while not ended.wait(LOOK_S) and not rospy.is_shutdown():
            if self._server.is_preempt_requested():
                self._core.stop_search()
                self._server.set_preempted(text="preempted")
                return
        for found, text in told:
            (self._server.set_succeeded if found else self._server.set_aborted)(text=text)

    def _on_pose(self, message: PoseWithCovarianceStamped) -> None:
        self._poses += 1
        if self._server.is_active() and self._poses % FEEDBACK_STEPS == 0:
            self._server.publish_feedback(MoveBaseFeedback(base_position=PoseStamped(message.header, message.pose.pose)))


def main() -> None:
    """Run the node until ROS shuts down. Parameter ~dock: the pose (x, y, yaw) at which it starts."""
    rospy.init_node(NAME)
    host = RosHost(OUTPUTS)
    core = Localization(wait_for_map(), tuple(rospy.get_param("~dock")), host)
    _action = Localize(core)
    host.run(core)
    rospy.spin()
