"""Localisation's core: from odometry and scans to T_map_odom, the pose, and how well it fits; a search of the whole map on demand."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable

import numpy as np
import rospy
from geometry_msgs.msg import PoseWithCovarianceStamped, Twist
from nav_msgs.msg import Odometry
from node_core import Host, Input, Output
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Float32, Header
from tf2_msgs.msg import TFMessage

from rover_navigation.geometry import Points, Pose, compose, inverse, wrapped
from rover_navigation.grid_map import GridMap
from rover_navigation.health import LaserMonitor
from rover_navigation.matching import locate, match
from rover_navigation.ros import points_of_scan, pose_message, pose_of, transform

BELIEVED = 0.5  # a match of a smaller quality corrects nothing
TURN_RAD_S = 0.8
EVERY_RAD = math.radians(40.0)  # a scan is kept for the search
REMEMBERED = 100  # odometries, for scans that arrive after the one of their moment
STD_M, STD_RAD = 0.03, 0.01  # of a pose that fits

NAME = "localization"
POSE, QUALITY = Output("/localization/pose", PoseWithCovarianceStamped, 5), Output("/localization/quality", Float32, 5)
COMMAND, TF = Output("/cmd_vel", Twist, 5, shared=True), Output("/tf", TFMessage, 20, shared=True)
SCANS = Output("~scans", Header, 20, tcp_nodelay=True)  # up to which scan it has come: a simulator may wait for it
OUTPUTS = (POSE, QUALITY, COMMAND, TF, SCANS)
SearchEnd = Callable[[bool, str], None]
"""Told whether a search has found the pose, and in words how well it fits."""


class Localization:
    """Matches each scan at the odometry of its moment, whichever of both arrives first.

    Args:
        grid: the map.
        initial: the pose at which it starts.
        host: what runs it.
    """

    timers = ()

    def __init__(self, grid: GridMap, initial: Pose, host: Host) -> None:
        self._grid, self._initial, self._host = grid, initial, host
        self._T_map_odom: Pose | None = None
        self._odom: Pose = (0.0, 0.0, 0.0)
        self._odoms: dict[int, Pose] = {}  # by stamp, nanoseconds
        self._waiting: dict[int, Points] = {}  # scans whose odometry has not come
        self._laser = LaserMonitor()
        self._lock = threading.Lock()
        self._turned_rad = 0.0  # since a search began
        self._search_ends: SearchEnd | None = None  # None: none runs
        self._kept: list[tuple[Pose, Points]] = []

    @property
    def inputs(self) -> list[Input]:
        """Scans and odometry."""
        return [Input("/scan", LaserScan, self._on_scan, queue_size=5), Input("/odom", Odometry, self._on_odometry, queue_size=20)]

    # --- the search ---------------------------------------------------------------------------------------------------

    def begin_search(self, ends: SearchEnd) -> None:
        """Turn round once, about 8 s, and search the whole map."""
        with self._lock:
            self._kept, self._turned_rad, self._search_ends = [], 0.0, ends

    def stop_search(self) -> None:
        """End a search: the rover stands, and stays where it believed to be."""
        with self._lock:
            self._search_ends = None
            self._host.publish(COMMAND.topic, Twist())

    def _search_on(self, turned_rad: float) -> None:
        self._turned_rad += turned_rad
        command = Twist()
        if self._turned_rad < math.tau:
            command.angular.z = TURN_RAD_S
        else:
            assert self._search_ends is not None
            ends, self._search_ends = self._search_ends, None
            found, text = locate(self._grid, self._kept)
            if found is not None:
                self._T_map_odom = compose(found, inverse(self._kept[-1][0]))
            ends(found is not None, text)
        self._host.publish(COMMAND.topic, command)

    # --- measurements -------------------------------------------------------------------------------------------------

    @property
    def _pose(self) -> Pose:
        assert self._T_map_odom is not None
        return compose(self._T_map_odom, self._odom)

    def _on_scan(self, scan: LaserScan) -> None:
        with self._lock:
            self._laser.scan(np.asarray(scan.ranges, dtype=np.float64), scan.header.stamp.to_sec())
            if not self._laser.repeats:
                self._waiting[scan.header.stamp.to_nsec()] = points_of_scan(scan)
                self._match()
        self._host.publish(SCANS.topic, Header(stamp=scan.header.stamp))

    def _on_odometry(self, message: Odometry) -> None:
        stamp = message.header.stamp
        with self._lock:
            before, self._odom = self._odom, pose_of(message.pose.pose)
            if self._T_map_odom is None:
                self._T_map_odom = compose(self._initial, inverse(self._odom))
            self._odoms[stamp.to_nsec()] = self._odom
            if len(self._odoms) > REMEMBERED:
                del self._odoms[next(iter(self._odoms))]
            self._match()
            if self._search_ends is not None:
                self._search_on(abs(wrapped(self._odom[2] - before[2])))
            self._tell(stamp)
        self._host.done(stamp.to_nsec())

    def _match(self) -> None:
        """Match the scans whose odometry is there; those of a moment that this node has not seen are forgotten."""
        for stamp_ns in sorted(self._waiting):
            if not self._odoms or stamp_ns > max(self._odoms):
                return
            points, odom = self._waiting.pop(stamp_ns), self._odoms.get(stamp_ns)
            if odom is not None:
                self._take(points, odom)

    def _take(self, points: Points, odom: Pose) -> None:
        assert self._T_map_odom is not None
        found = match(self._grid, compose(self._T_map_odom, odom), points)
        if found.quality >= BELIEVED:
            self._T_map_odom = compose(found.pose, inverse(odom))
        self._host.publish(QUALITY.topic, Float32(found.quality))
        if self._search_ends is not None and len(self._kept) * EVERY_RAD <= self._turned_rad:
            self._kept.append((odom, points))

    def _tell(self, stamp: rospy.Time) -> None:
        assert self._T_map_odom is not None
        self._host.publish(TF.topic, TFMessage([transform(stamp, "map", "odom", self._T_map_odom)]))
        message = PoseWithCovarianceStamped()
        message.header.stamp, message.header.frame_id = stamp, "map"
        message.pose.pose = pose_message(self._pose)
        message.pose.covariance[0] = message.pose.covariance[7] = STD_M**2
        message.pose.covariance[35] = STD_RAD**2
        self._host.publish(POSE.topic, message)
