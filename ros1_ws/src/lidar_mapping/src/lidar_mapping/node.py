"""The node /lidar_mapping: a registered voxel map while enabled, saved as it grows."""

from __future__ import annotations

from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING

import rospy
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Header
from std_srvs.srv import Trigger, TriggerResponse
from uav_msgs.msg import MappingState

from lidar_mapping.mapper import Mapper
from lidar_mapping.ply import read_ply, write_ply
from lidar_mapping.settings import MappingSettings
from perception_core import NS, Sweep
from perception_core.ros import DoneReporter, EnableSwitch, NewestWorker, Vehicle, cloud_message, read_settings, sweep_of_cloud

if TYPE_CHECKING:
    from std_srvs.srv import TriggerRequest

    from lidar_mapping.registration import Registration

CLOUD_BYTES = 1 << 23


class LidarMappingNode:
    """Convert in, call the core, publish and save out."""

    def __init__(self, settings: MappingSettings) -> None:
        self._settings = settings
        self._path = Path(settings.map_path)
        self._mapper = Mapper(settings.mapper)
        self._lock = Lock()
        self._saving = Lock()
        self._received = 0
        self._saved_scans = 0
        self._resume()
        self._state = rospy.Publisher("~state", MappingState, queue_size=5, latch=True)
        self._map = rospy.Publisher("~map", PointCloud2, queue_size=1, latch=True)
        self._done = DoneReporter()
        self._vehicle = Vehicle()
        self._worker = NewestWorker[tuple[str, Sweep]](self._process)
        self._switch = EnableSwitch(enabled=settings.enabled, on_change=self._on_switch)
        self._save_service = rospy.Service("~save", Trigger, self._on_save)
        self._timers = [
            rospy.Timer(rospy.Duration.from_sec(settings.save_period_s), self._save_if_new, reset=True),
            rospy.Timer(rospy.Duration.from_sec(settings.publish_period_s), self._publish_map, reset=True),
        ]
        self._subscriber = rospy.Subscriber("/lidar/points", PointCloud2, self._on_cloud, queue_size=1, buff_size=CLOUD_BYTES)
        rospy.on_shutdown(lambda: self._save_if_new(None))

    def _resume(self) -> None:
        """Go on with the map that a run before left in the file: this node is started again after a crash."""
        if not (self._settings.resume and self._path.exists()):
            return
        try:
            self._mapper.map.insert(read_ply(self._path))
        except (OSError, ValueError) as error:
            rospy.logwarn(f"starting with an empty map: {error}")

    def _on_cloud(self, message: PointCloud2) -> None:
        self._received += self._switch.enabled
        if self._switch.enabled and self._received % self._settings.every_scan == 0:
            self._worker.offer((message.header.frame_id, sweep_of_cloud(message)))
        else:
            self._done.done(message.header.stamp.to_nsec())

    def _process(self, item: tuple[str, Sweep]) -> None:
        try:
            self._register(*item)
        finally:
            self._done.done(item[1].stamp_ns)

    def _register(self, frame: str, sweep: Sweep) -> None:
        poses = self._vehicle.poses_at(sweep.end_ns)
        with self._lock:
            if not self._switch.enabled:
                return
            registration = self._mapper.add(sweep, poses, self._vehicle.mount(frame))
            self._publish_state(sweep.stamp_ns, registration)
        if self._mapper.map.full:
            rospy.logwarn_throttle(10.0, f"the map is full ({self._settings.max_voxels} voxels): new surfaces are left out")

    def _publish_state(self, stamp_ns: int, registration: Registration | None) -> None:
        count = self._mapper.count
        message = MappingState(header=Header(stamp=rospy.Time(stamp_ns // NS, stamp_ns % NS), frame_id="map"), running=self._switch.enabled)
        message.scans, message.rejected, message.points = count.scans, count.rejected, len(self._mapper.map)
        if registration is not None:
            message.fitness, message.correction_m = registration.fitness, registration.correction_m
        self._state.publish(message)

    def _on_switch(self, _enabled: bool) -> None:  # noqa: FBT001 -- a callback's signature
        with self._lock:  # after the scan in work: nothing contradicts this state until the next change
            self._publish_state(rospy.Time.now().to_nsec(), None)

    def _publish_map(self, _event: object) -> None:
        if not self._map.get_num_connections():
            return
        with self._lock:
            points = self._mapper.map.points
        self._map.publish(cloud_message(Header(stamp=rospy.Time.now(), frame_id="map"), points.astype("float32")))

    def _on_save(self, _request: TriggerRequest) -> TriggerResponse:
        try:
            count = self._save()
        except OSError as error:
            return TriggerResponse(success=False, message=str(error))
        return TriggerResponse(success=True, message=f"{count} points in {self._path}")

    def _save_if_new(self, _event: object) -> None:
        if self._mapper.count.scans == self._saved_scans:
            return
        try:
            self._save()
        except OSError as error:
            rospy.logerr_throttle(10.0, f"the map could not be saved: {error}")

    def _save(self) -> int:
        with self._saving:
            with self._lock:
                points, scans = self._mapper.map.points, self._mapper.count.scans
            write_ply(self._path, points)
            self._saved_scans = scans
        return len(points)


def main() -> None:
    """Run the node until ROS shuts down."""
    rospy.init_node("lidar_mapping")
    _node = LidarMappingNode(read_settings(MappingSettings()))
    rospy.spin()
