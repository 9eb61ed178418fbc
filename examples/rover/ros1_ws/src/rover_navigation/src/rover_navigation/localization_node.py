"""Localisation's node: from odometry and scans to T_map_odom, the pose, and how well it fits. The action `/localize` searches the whole map."""

from __future__ import annotations

import math
import threading

import actionlib
import numpy as np
import rospy
import tf2_ros
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped, Twist
from move_base_msgs.msg import MoveBaseAction, MoveBaseFeedback, MoveBaseGoal
from nav_msgs.msg import Odometry
from resource_reporter import DoneReporter
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Float32

from rover_navigation.geometry import Points, Pose, compose, inverse, wrapped
from rover_navigation.health import LaserMonitor
from rover_navigation.matching import Match, match, search
from rover_navigation.ros import points_of_scan, pose_message, pose_of, transform, wait_for_map

BELIEVED = 0.5  # a match of a smaller quality corrects nothing
FOUND = 0.75  # a search that finds less has found nothing
TURN_RAD_S = 0.8
EVERY_RAD = math.radians(40.0)  # a scan is kept for the search
LOOK_S = 0.05  # wall clock: how often a search looks for its preemption
FEEDBACK_STEPS = 4  # odometries
STD_M, STD_RAD = 0.03, 0.01  # of a pose that fits


class LocalizationNode:
    """Matches each scan, starting from where odometry has come to. Parameter ~dock: the pose (x, y, yaw) at which it starts."""

    def __init__(self) -> None:
        self._grid = wait_for_map()
        self._initial: Pose = tuple(rospy.get_param("~dock"))
        self._T_map_odom: Pose | None = None
        self._odom: Pose = (0.0, 0.0, 0.0)
        self._points: Points | None = None  # of a scan that is not dealt with yet
        self._searched = 0.0  # the quality of the pose that the last search found
        self._laser = LaserMonitor()
        self._lock = threading.Lock()
        self._turned_rad: float | None = None  # since a search began; None: none runs
        self._steps = 0
        self._kept: list[tuple[Pose, Points]] = []
        self._tf = tf2_ros.TransformBroadcaster()
        self._pose = rospy.Publisher("/localization/pose", PoseWithCovarianceStamped, queue_size=5)
        self._quality_topic = rospy.Publisher("/localization/quality", Float32, queue_size=5)
        self._commands = rospy.Publisher("/cmd_vel", Twist, queue_size=5)
        self._localize = actionlib.SimpleActionServer("localize", MoveBaseAction, self._search, auto_start=False)
        rospy.Subscriber("/scan", LaserScan, self._on_scan, queue_size=2, tcp_nodelay=True)
        self._done = DoneReporter()
        rospy.Subscriber("/odom", Odometry, self._on_odometry, queue_size=20, tcp_nodelay=True)
        self._localize.start()

    def _on_scan(self, scan: LaserScan) -> None:
        self._laser.scan(np.asarray(scan.ranges, dtype=np.float64), scan.header.stamp.to_sec())
        if not self._laser.repeats:
            self._points = points_of_scan(scan)

    def _on_odometry(self, message: Odometry) -> None:
        before, self._odom = self._odom, pose_of(message.pose.pose)
        if self._T_map_odom is None:
            self._T_map_odom = compose(self._initial, inverse(self._odom))
        points, self._points = self._points, None
        if points is not None:
            self._match(points)
        with self._lock:
            if self._turned_rad is not None:
                self._search_on(points, abs(wrapped(self._odom[2] - before[2])))
        self._tell(message.header.stamp)

    def _match(self, points: Points) -> None:
        assert self._T_map_odom is not None
        found = match(self._grid, compose(self._T_map_odom, self._odom), points)
        if found.quality >= BELIEVED:
            self._T_map_odom = compose(found.pose, inverse(self._odom))
        self._quality_topic.publish(Float32(found.quality))

    def _search_on(self, points: Points | None, turned_rad: float) -> None:
        """Turn on and keep scans; after a whole turn look for the pose."""
        assert self._turned_rad is not None
        assert self._T_map_odom is not None
        self._turned_rad += turned_rad
        command = Twist()
        if points is not None and len(self._kept) * EVERY_RAD <= self._turned_rad:
            self._kept.append((self._odom, points))
        if self._turned_rad < math.tau:
            command.angular.z = TURN_RAD_S
        else:
            self._turned_rad = None
            found = search(self._grid, self._kept) if self._kept else Match(compose(self._T_map_odom, self._odom), 0.0)
            self._searched = found.quality
            if found.quality >= FOUND:
                self._T_map_odom = compose(found.pose, inverse(self._kept[-1][0]))
        self._commands.publish(command)

    def _search(self, _goal: MoveBaseGoal) -> None:
        """Turn round once, about 8 s, and search; the goal is any. Preempted, it stands, and stays where it believed to be."""
        with self._lock:
            self._kept, self._searched, self._turned_rad = [], 0.0, 0.0
        while not rospy.is_shutdown():
            with self._lock:
                if self._turned_rad is None:
                    break
                if self._localize.is_preempt_requested():
                    self._turned_rad = None
                    self._commands.publish(Twist())
                    self._localize.set_preempted(text="preempted")
                    return
            threading.Event().wait(LOOK_S)
        told = f"{100.0 * self._searched:.0f} % of the beams match"
        (self._localize.set_succeeded if self._searched >= FOUND else self._localize.set_aborted)(text=told)

    def _tell(self, stamp: rospy.Time) -> None:
        assert self._T_map_odom is not None
        self._tf.sendTransform(transform(stamp, "map", "odom", self._T_map_odom))
        message = PoseWithCovarianceStamped()
        message.header.stamp, message.header.frame_id = stamp, "map"
        message.pose.pose = pose_message(compose(self._T_map_odom, self._odom))
        message.pose.covariance[0] = message.pose.covariance[7] = STD_M**2
        message.pose.covariance[35] = STD_RAD**2
        self._pose.publish(message)
        self._steps += 1
        if self._localize.is_active() and self._steps % FEEDBACK_STEPS == 0:
            self._localize.publish_feedback(MoveBaseFeedback(base_position=PoseStamped(message.header, message.pose.pose)))
        self._done.done(stamp.to_nsec())


def main() -> None:
    """Run the node until ROS shuts down."""
    rospy.init_node("localization")
    _node = LocalizationNode()
    rospy.spin()
