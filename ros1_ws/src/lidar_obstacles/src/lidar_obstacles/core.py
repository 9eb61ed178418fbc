"""What /lidar_obstacles does with its messages: the LiDAR's health always, the obstacle ahead while enabled. No rospy."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from sensor_msgs.msg import PointCloud2
from uav_msgs.msg import Obstacle

from lidar_obstacles.ahead import LidarAhead
from lidar_obstacles.cloud_health import CloudJudge
from lidar_obstacles.mounting import MountCheck
from node_core.core import Input, Output
from perception_core import FINE, Ahead, FaultKind, Finding, Sweep, SweepStamps, TurnJoiner, first_trouble, unsure
from perception_core.clouds import sweep_of_cloud, time_fields
from perception_core.conversions import obstacle_message
from perception_core.sensor_watch import HEALTH, TICK_S, SensorWatch
from perception_core.vehicle import KnownVehicle

if TYPE_CHECKING:
    from collections.abc import Callable

    from lidar_obstacles.settings import LidarSettings
    from node_core.core import Host

CLOUD = "/lidar/points"
CLOUD_BYTES = 1 << 23
POSE_LATE_S = 0.05  # behind a sweep, at which a pose still tells where it was made: 0.1 m at 2 m/s
NO_MOUNT = "the driver has another frame_id than /tf_static", "nobody publishes /tf_static"
OBSTACLE = Output("~obstacle", Obstacle, tcp_nodelay=True, taken="/uav_guidance/taken")
OUTPUTS = (OBSTACLE, HEALTH)


@dataclass(frozen=True)
class Judged:
    """A sweep, the finding of it, and the sectors that have just lost their returns."""

    sweep: Sweep
    finding: Finding
    gone: NDArray[np.bool_]


class LidarObstacles:
    """Judges each sweep; while enabled it looks for what is in the way, on the host's worker."""

    def __init__(self, settings: LidarSettings, host: Host) -> None:
        self.enabled = settings.enabled
        self.vehicle = KnownVehicle()
        self._settings = settings
        self._host = host
        self._judge = CloudJudge(settings.cloud)
        self._ahead = LidarAhead(settings.ahead)
        self._stamps, self._turns = SweepStamps(), TurnJoiner()
        self._mounting = MountCheck()
        self._R_map_lidar: NDArray[np.float64] | None = None
        self._health = SensorWatch(host, "lidar", resource="perception.lidar_status", limits=settings.health, stamps=settings.stamps)

    @property
    def inputs(self) -> list[Input]:
        """The guidance's topics, and the clouds."""
        cloud = Input(CLOUD, PointCloud2, self._on_cloud, self._on_garbage, CLOUD_BYTES)
        return [*self.vehicle.inputs(self._left_out), cloud]

    @property
    def timers(self) -> list[tuple[float, Callable[[], None]]]:
        """The judgement of the LiDAR's health."""
        return [(TICK_S, lambda: self._health.tick(self._missing()))]

    def switch(self, enabled: bool) -> None:  # noqa: FBT001 -- a callback's signature
        """Begin or end to look for obstacles."""
        self.enabled = enabled

    def tune(self, settings: LidarSettings) -> None:
        """Go on with other settings."""
        self._health.tune(settings.health, settings.stamps)
        self._settings, self._judge, self._ahead = settings, CloudJudge(settings.cloud), LidarAhead(settings.ahead)

    def _missing(self) -> str:
        return "" if self._host.published(CLOUD) else f"no points on {CLOUD}: no driver publishes there"

    def _left_out(self, reason: str) -> None:
        self._host.warn("garbage", f"left out: {reason}")

    def _on_garbage(self, reason: str) -> None:
        self._health.garbage(reason)
        self._tell(self._host.now_ns(), Ahead(None, reason))

    def _on_cloud(self, message: PointCloud2) -> None:
        stamp_ns, frame = message.header.stamp.to_nsec(), message.header.frame_id
        try:
            judged = self.judged(sweep_of_cloud(message), frame)
        except ValueError as error:
            self._on_garbage(str(error))
            self._host.done(stamp_ns)
            return
        if not time_fields(message.fields):
            self._host.warn("times", "the LiDAR's points have no times: sweeps can't be straightened", every_s=math.inf)
        self._health.take(judged.finding)
        if judged.finding.ok and self.enabled:
            self._host.offer(partial(self._process, judged, frame, stamp_ns))
            return
        if not judged.finding.ok:
            self._tell(stamp_ns, Ahead(None, judged.finding.reason))
        self._host.done(stamp_ns)

    def judged(self, sweep: Sweep, frame: str) -> Judged:
        """Judge a sweep that has just arrived; call it once for each, in order. Raises ValueError where its times can't be."""
        sweep = self._turns.joined(self._stamps.begun(sweep, self._host.now_ns()))
        # The moment of the last return: a sweep stamped at its beginning is not a tenth of a second old when it comes.
        stamp = self._health.stamp(sweep.end_ns)
        pose, self_m = self._pose(sweep.end_ns), self._settings.body_radius_m
        turned_rad, tilted_rad = self._turned_rad(pose, frame)
        position_m = None if pose is None else pose[:3, 3]
        content = self._judge.finding(sweep, self_m=self_m, position_m=position_m, turned_rad=turned_rad, tilted_rad=tilted_rad)
        self._mounting.hold(changed=not self._judge.changed.ok)
        mounted = self._mounted(sweep, frame, self_m) if stamp.ok and content.ok else FINE
        self._judge.after_change(back=self._mounting.back, apart=self._mounting.apart)
        return Judged(sweep, first_trouble(stamp, content, mounted, self._judge.changed), self._judge.gone)

    def ahead(self, judged: Judged, frame: str) -> Ahead:
        """Return what a good sweep shows ahead of the vehicle; raise LookupError where its pose or the mount is not known."""
        poses, mount = self.vehicle.poses_at(judged.sweep.end_ns), self.vehicle.mount(frame)
        return self._ahead.look(judged.sweep, T_base_lidar=mount, poses=poses, motion=self.vehicle.motion, gone=judged.gone)

    def _mounted(self, sweep: Sweep, frame: str, self_m: float) -> Finding:
        try:
            mount = self.vehicle.mount(frame)
        except LookupError as error:
            return unsure(FaultKind.CALIBRATION, f"it is not known how the LiDAR is mounted: {error}", *NO_MOUNT)
        return self._mounting.finding(sweep, mount, self.vehicle.poses, self_m=self_m)

    def _turned_rad(self, pose: NDArray[np.float64] | None, frame: str) -> tuple[float, float]:
        """Return by how much the LiDAR has turned about its z axis since the sweep before, and that axis; 0 where it is not known."""
        before, self._R_map_lidar = self._R_map_lidar, None
        try:
            self._R_map_lidar = None if pose is None else pose[:3, :3] @ self.vehicle.mount(frame)[:3, :3]
        except LookupError:
            return 0.0, 0.0
        if before is None or self._R_map_lidar is None:
            return 0.0, 0.0
        turn = before.T @ self._R_map_lidar
        return math.atan2(turn[1, 0], turn[0, 0]), math.acos(min(1.0, max(-1.0, turn[2, 2])))

    def _pose(self, stamp_ns: int) -> NDArray[np.float64] | None:
        try:
            # An older one would say that the vehicle stands, and the ranges that its motion changes would be the sensor's error.
            poses = self.vehicle.poses.at([stamp_ns], tolerance_s=POSE_LATE_S)
        except LookupError:
            return None
        return poses.matrix()

    def _process(self, judged: Judged, frame: str, stamp_ns: int) -> None:
        try:
            self._tell(stamp_ns, self.ahead(judged, frame))
        except LookupError as error:
            self._tell(stamp_ns, Ahead(None, str(error)))
            raise
        finally:
            self._host.done(stamp_ns)

    def _tell(self, stamp_ns: int, ahead: Ahead) -> None:
        if self.enabled:
            unknown = ahead.unknown if self._health.ok else ahead.unknown or f"the LiDAR is not believed: {self._health.reason}"
            self._host.publish(OBSTACLE.topic, obstacle_message(stamp_ns, "lidar", ahead.nearest, unknown))
