"""The node /lidar_obstacles: the LiDAR's health always, the obstacle ahead while enabled."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import rospy
from numpy.typing import NDArray
from sensor_msgs.msg import PointCloud2
from uav_msgs.msg import Obstacle

from lidar_obstacles.ahead import LidarAhead
from lidar_obstacles.cloud_health import CloudJudge
from lidar_obstacles.mounting import MountCheck
from lidar_obstacles.settings import LidarSettings
from perception_core import FINE, Ahead, Finding, Sweep, SweepStamps, TurnJoiner, first_trouble
from perception_core.clouds import sweep_of_cloud, time_fields
from perception_core.ros import (
    DoneReporter,
    EnableSwitch,
    HealthReporter,
    NewestWorker,
    RawSubscriber,
    TunableSettings,
    Vehicle,
    obstacle_message,
    read_settings,
)

CLOUD = "/lidar/points"
CLOUD_BYTES = 1 << 23


@dataclass(frozen=True)
class _Item:
    """A good sweep, its message's frame and stamp, and the sectors that have just lost their returns."""

    frame: str
    stamp_ns: int
    sweep: Sweep
    gone: NDArray[np.bool_]


class LidarObstaclesNode:
    """Convert in, call the core, publish out."""

    def __init__(self, settings: LidarSettings) -> None:
        self._settings = settings
        self._judge = CloudJudge(settings.cloud)
        self._ahead = LidarAhead(settings.ahead)
        self._stamps, self._turns = SweepStamps(), TurnJoiner()
        self._mounting = MountCheck()
        self._obstacle = rospy.Publisher("~obstacle", Obstacle, queue_size=1, tcp_nodelay=True)
        self._done = DoneReporter()
        self._vehicle = Vehicle()
        self._health = HealthReporter("lidar", resource="lidar_status", limits=settings.health, stamps=settings.stamps)
        self._worker = NewestWorker[_Item](self._process)
        self._switch = EnableSwitch(enabled=settings.enabled)
        self._tuning = TunableSettings(settings, self._tune)
        self._subscriber = RawSubscriber(CLOUD, PointCloud2, self._on_cloud, self._on_garbage, buffer_bytes=CLOUD_BYTES)
        self._health.missing = self._missing

    def _missing(self) -> str:
        return "" if self._subscriber.published else f"no points on {CLOUD}: no driver publishes there"

    def _tune(self, settings: LidarSettings) -> None:
        self._health.tune(settings.health, settings.stamps)
        self._settings, self._judge, self._ahead = settings, CloudJudge(settings.cloud), LidarAhead(settings.ahead)

    def _on_garbage(self, reason: str) -> None:
        self._health.garbage(reason)
        self._tell(rospy.Time.now().to_nsec(), Ahead(None, reason))

    def _on_cloud(self, message: PointCloud2) -> None:
        stamp_ns = message.header.stamp.to_nsec()
        try:
            sweep = self._turns.joined(self._stamps.begun(sweep_of_cloud(message), rospy.Time.now().to_nsec()))
        except ValueError as error:
            self._on_garbage(str(error))
            self._done.done(stamp_ns)
            return
        if not time_fields(message.fields):
            rospy.logwarn_once("the LiDAR's points have no times: sweeps can't be straightened")
        finding = self._judged(sweep, message.header.frame_id)
        self._health.take(finding)
        if finding.ok and self._switch.enabled:
            self._worker.offer(_Item(message.header.frame_id, stamp_ns, sweep, self._judge.gone))
            return
        if not finding.ok:
            self._tell(stamp_ns, Ahead(None, finding.reason))
        self._done.done(stamp_ns)

    def _judged(self, sweep: Sweep, frame: str) -> Finding:
        # The moment of the last return: a sweep stamped at its beginning is not a tenth of a second old when it comes.
        stamp = self._health.stamp(sweep.end_ns)
        position_m, self_m = self._position_m(sweep.end_ns), self._settings.body_radius_m
        content = self._judge.finding(sweep, self_m=self_m, position_m=position_m)
        return first_trouble(stamp, content, self._mounted(sweep, frame, self_m) if stamp.ok and content.ok else FINE)

    def _mounted(self, sweep: Sweep, frame: str, self_m: float) -> Finding:
        try:
            mount = self._vehicle.mount(frame)
        except LookupError:
            return FINE
        return self._mounting.finding(sweep, mount, self._vehicle.poses, self_m=self_m)

    def _position_m(self, stamp_ns: int) -> NDArray[np.float64] | None:
        try:
            poses = self._vehicle.poses.at([stamp_ns])
        except LookupError:
            return None
        return poses.matrix()[:3, 3]

    def _process(self, item: _Item) -> None:
        sweep = item.sweep
        try:
            poses, mount = self._vehicle.poses_at(sweep.end_ns), self._vehicle.mount(item.frame)
            ahead = self._ahead.look(sweep, T_base_lidar=mount, poses=poses, motion=self._vehicle.motion, gone=item.gone)
            self._tell(item.stamp_ns, ahead)
        except LookupError as error:
            self._tell(item.stamp_ns, Ahead(None, str(error)))
            raise
        finally:
            self._done.done(item.stamp_ns)

    def _tell(self, stamp_ns: int, ahead: Ahead) -> None:
        if self._switch.enabled:
            unknown = ahead.unknown if self._health.ok else ahead.unknown or f"the LiDAR is not believed: {self._health.reason}"
            self._obstacle.publish(obstacle_message(stamp_ns, "lidar", ahead.nearest, unknown))


def main() -> None:
    """Run the node until ROS shuts down."""
    rospy.init_node("lidar_obstacles")
    _node = LidarObstaclesNode(read_settings(LidarSettings()))
    rospy.spin()
