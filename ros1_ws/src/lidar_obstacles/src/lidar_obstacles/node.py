"""The node /lidar_obstacles: the LiDAR's health always, the obstacle ahead while enabled."""

from __future__ import annotations

import rospy
from sensor_msgs.msg import PointCloud2
from uav_msgs.msg import Obstacle

from lidar_obstacles.ahead import CloudJudge, obstacle_ahead
from lidar_obstacles.settings import LidarSettings
from perception_core import Sweep
from perception_core.ros import (
    DoneReporter,
    EnableSwitch,
    HealthReporter,
    NewestWorker,
    Vehicle,
    obstacle_message,
    read_settings,
    sweep_of_cloud,
)

CLOUD_BYTES = 1 << 23


class LidarObstaclesNode:
    """Convert in, call the core, publish out."""

    def __init__(self, settings: LidarSettings) -> None:
        self._settings = settings
        self._judge = CloudJudge(min_returns=settings.min_returns, self_m=settings.self_m)
        self._obstacle = rospy.Publisher("~obstacle", Obstacle, queue_size=1, tcp_nodelay=True)
        self._done = DoneReporter()
        self._vehicle = Vehicle()
        self._health = HealthReporter("lidar", resource="lidar_status", limits=settings.health)
        self._worker = NewestWorker[tuple[str, Sweep]](self._process)
        self._switch = EnableSwitch(enabled=settings.enabled)
        self._subscriber = rospy.Subscriber(
            "/lidar/points", PointCloud2, self._on_cloud, queue_size=1, buff_size=CLOUD_BYTES, tcp_nodelay=True
        )

    def _on_cloud(self, message: PointCloud2) -> None:
        if not self._judged_good(message):
            self._done.done(message.header.stamp.to_nsec())

    def _judged_good(self, message: PointCloud2) -> bool:
        """Judge the cloud; return whether the worker has it now."""
        try:
            sweep = sweep_of_cloud(message)
        except ValueError as error:
            self._health.bad(str(error))
            return False
        complaint = self._judge.complaint(message.data, sweep)
        if complaint:
            self._health.bad(complaint)
            return False
        # The moment of the last return: a sweep stamped at its beginning is not a tenth of a second old when it comes.
        self._health.good(sweep.end_ns)
        if self._switch.enabled:
            self._worker.offer((message.header.frame_id, sweep))
            return True
        return False

    def _process(self, item: tuple[str, Sweep]) -> None:
        try:
            self._look_ahead(*item)
        finally:
            self._done.done(item[1].stamp_ns)

    def _look_ahead(self, frame: str, sweep: Sweep) -> None:
        nearest = obstacle_ahead(
            sweep,
            T_base_lidar=self._vehicle.mount(frame),
            poses=self._vehicle.poses_at(sweep.end_ns),
            motion=self._vehicle.motion,
            settings=self._settings.ahead,
        )
        if self._switch.enabled:
            self._obstacle.publish(obstacle_message(sweep.stamp_ns, "lidar", nearest))


def main() -> None:
    """Run the node until ROS shuts down."""
    rospy.init_node("lidar_obstacles")
    _node = LidarObstaclesNode(read_settings(LidarSettings()))
    rospy.spin()
