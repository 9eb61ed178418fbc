"""Localisation's node: from odometry and scans to T_map_odom, the pose, and how well it fits. `/localize` searches the whole map."""

from __future__ import annotations

import math
import threading

import numpy as np
import rospy
import tf2_ros
from geometry_msgs.msg import PoseWithCovarianceStamped, Twist
from nav_msgs.msg import Odometry
from resource_reporter import ToldService
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Float32
from std_srvs.srv import Trigger, TriggerRequest, TriggerResponse

from rover_navigation.geometry import Points, Pose, compose, inverse, wrapped
from rover_navigation.health import LaserMonitor
from rover_navigation.matching import match, search
from rover_navigation.ros import Done, points_of_scan, pose_message, pose_of, transform, wait_for_map

BELIEVED = 0.5  # a match of a smaller quality corrects nothing
FOUND = 0.75  # a search that finds less has found nothing
TURN_RAD_S = 0.8
EVERY_RAD = math.radians(40.0)  # a scan is kept for the search
SEARCH_LIMIT_S = 25.0  # wall clock
STD_M, STD_RAD = 0.03, 0.01  # of a pose that fits


class LocalizationNode:
    """Matches each scan, starting from where odometry has come to. Parameter ~dock: the pose (x, y, yaw) at which it starts."""

    def __init__(self) -> None:
        self._grid = wait_for_map()
        self._initial: Pose = tuple(rospy.get_param("~dock"))
        self._T_map_odom: Pose | None = None
        self._odom: Pose = (0.0, 0.0, 0.0)
        self._points: Points | None = None  # of a scan that is not dealt with yet
        self._quality = 0.0
        self._laser = LaserMonitor()
        self._turned_rad: float | None = None  # since a search began; None: none runs
        self._kept: list[tuple[Pose, Points]] = []
        self._found = threading.Event()
        self._tf = tf2_ros.TransformBroadcaster()
        self._pose = rospy.Publisher("/localization/pose", PoseWithCovarianceStamped, queue_size=5)
        self._quality_topic = rospy.Publisher("/localization/quality", Float32, queue_size=5)
        self._commands = rospy.Publisher("/cmd_vel", Twist, queue_size=5)
        self._done = Done()
        ToldService("/localize", Trigger, self._on_localize)
        rospy.Subscriber("/scan", LaserScan, self._on_scan, queue_size=2, tcp_nodelay=True)
        rospy.Subscriber("/odom", Odometry, self._on_odometry, queue_size=20, tcp_nodelay=True)

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
        if self._turned_rad is not None:
            self._search_on(points, abs(wrapped(self._odom[2] - before[2])))
        self._tell(message.header.stamp)

    def _match(self, points: Points) -> None:
        assert self._T_map_odom is not None
        found = match(self._grid, compose(self._T_map_odom, self._odom), points)
        self._quality = found.quality
        if found.quality >= BELIEVED:
            self._T_map_odom = compose(found.pose, inverse(self._odom))
        self._quality_topic.publish(Float32(found.quality))

    def _search_on(self, points: Points | None, turned_rad: float) -> None:
        """Turn on and keep scans; after a whole turn look for the pose."""
        assert self._turned_rad is not None
        self._turned_rad += turned_rad
        command = Twist()
        if points is not None and len(self._kept) * EVERY_RAD <= self._turned_rad:
            self._kept.append((self._odom, points))
        if self._turned_rad < math.tau:
            command.angular.z = TURN_RAD_S
        elif self._kept:
            found = search(self._grid, self._kept)
            self._quality = found.quality
            if found.quality >= FOUND:
                self._T_map_odom = compose(found.pose, inverse(self._kept[-1][0]))
            self._turned_rad = None
            self._found.set()
        else:
            self._turned_rad = None
            self._found.set()
        self._commands.publish(command)

    def _on_localize(self, _request: TriggerRequest) -> TriggerResponse:
        """Answer when the search has ended: on a turn of about 8 s of simulated time."""
        self._found.clear()
        self._kept, self._quality, self._turned_rad = [], 0.0, 0.0
        if not self._found.wait(SEARCH_LIMIT_S):
            self._turned_rad = None
            return TriggerResponse(success=False, message=f"not turned round within {SEARCH_LIMIT_S:g} s")
        share = f"{100.0 * self._quality:.0f} % of the beams match"
        return TriggerResponse(success=self._quality >= FOUND, message=share)

    def _tell(self, stamp: rospy.Time) -> None:
        assert self._T_map_odom is not None
        self._tf.sendTransform(transform(stamp, "map", "odom", self._T_map_odom))
        message = PoseWithCovarianceStamped()
        message.header.stamp, message.header.frame_id = stamp, "map"
        message.pose.pose = pose_message(compose(self._T_map_odom, self._odom))
        message.pose.covariance[0] = message.pose.covariance[7] = STD_M**2
        message.pose.covariance[35] = STD_RAD**2
        self._pose.publish(message)
        self._done.tell(stamp)


def main() -> None:
    """Run the node until ROS shuts down."""
    rospy.init_node("localization")
    _node = LocalizationNode()
    rospy.spin()
