"""The node /lidar_mapping: pose and map by LiDAR and IMU while enabled, saved as the map grows."""

from __future__ import annotations

from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING

import numpy as np
import rospy
from geometry_msgs.msg import Point, PoseWithCovarianceStamped, Quaternion, TransformStamped, Vector3
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import Imu, PointCloud2
from std_msgs.msg import Header
from std_srvs.srv import Trigger, TriggerResponse
from tf2_msgs.msg import TFMessage
from uav_msgs.msg import MappingState

from lidar_mapping.inertial import ImuReading
from lidar_mapping.ply import read_ply, write_ply
from lidar_mapping.readings import ReadingQueue
from lidar_mapping.settings import MappingSettings
from lidar_mapping.slam import Slam
from lidar_mapping.standing import StandingGyro
from perception_core import NS, Sweep, SweepStamps
from perception_core.ros import (
    DoneReporter,
    EnableSwitch,
    NewestWorker,
    RawSubscriber,
    Vehicle,
    cloud_message,
    read_settings,
    sweep_of_cloud,
)
from resource_reporter import ResourceReporter, ToldService

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from std_srvs.srv import TriggerRequest

    from lidar_mapping.registration import Registration

    Floats = NDArray[np.float64]

CLOUD, CLOUD_BYTES = "/lidar/points", 1 << 23
IMU, IMU_BYTES, IMU_QUEUE = "/imu/data", 1 << 16, 100
BASE_LINK = "base_link"
READING_WAIT_S = 0.3  # wall clock; the readings of a sweep may arrive after it, over a connection of their own
MAP_WAIT_S = 1.0  # wall clock; a guidance that runs tells of its map at 20 Hz
TF_PERIOD_S = 0.1


class LidarMappingNode:
    """Convert in, call the core, publish and save out."""

    def __init__(self, settings: MappingSettings) -> None:
        self._settings = settings
        self._path = Path(settings.map_path)
        self._slam = Slam(settings.slam)
        self._readings = ReadingQueue()
        self._standing = StandingGyro()
        self._lock = Lock()
        self._saving = Lock()
        self._received = 0
        self._saved_scans = 0
        self._resume()
        self._state = rospy.Publisher("~state", MappingState, queue_size=5, latch=True)
        self._map = rospy.Publisher("~map", PointCloud2, queue_size=1, latch=True)
        self._pose = rospy.Publisher("~pose", PoseWithCovarianceStamped, queue_size=5)
        self._tf = rospy.Publisher("/tf", TFMessage, queue_size=5)
        self._reporter = ResourceReporter("mapping")
        self._done = DoneReporter()
        self._vehicle = Vehicle()
        self._stamps = SweepStamps()
        self._worker = NewestWorker[tuple[str, int, Sweep]](self._process)
        self._switch = EnableSwitch(enabled=settings.enabled, on_change=self._on_switch)
        self._save_service = ToldService("~save", Trigger, self._on_save)
        self._timers = [
            rospy.Timer(rospy.Duration.from_sec(settings.save_period_s), self._save_if_new, reset=True),
            rospy.Timer(rospy.Duration.from_sec(settings.publish_period_s), self._publish_map, reset=True),
            rospy.Timer(rospy.Duration.from_sec(TF_PERIOD_S), self._publish_tf, reset=True),
        ]
        self._imu = RawSubscriber(IMU, Imu, self._on_imu, self._on_garbage, buffer_bytes=IMU_BYTES, queue_size=IMU_QUEUE)
        self._clouds = RawSubscriber(CLOUD, PointCloud2, self._on_cloud, self._on_garbage, buffer_bytes=CLOUD_BYTES)
        rospy.on_shutdown(lambda: self._save_if_new(None))

    def _resume(self) -> None:
        """Go on with the map that a run before left in the file: this node is started again after a crash."""
        if not (self._settings.resume and self._path.exists()):
            return
        try:
            self._slam.resume(read_ply(self._path))
        except (OSError, ValueError) as error:
            rospy.logwarn(f"starting with an empty map: {error}")

    def _on_cloud(self, message: PointCloud2) -> None:
        self._received += self._switch.enabled
        wanted = self._switch.enabled and self._received % self._settings.every_scan == 0
        if not (wanted and self._offered(message)):
            self._done.done(message.header.stamp.to_nsec())

    def _offered(self, message: PointCloud2) -> bool:
        try:
            sweep = self._stamps.begun(sweep_of_cloud(message), rospy.Time.now().to_nsec())
            self._worker.offer((message.header.frame_id, message.header.stamp.to_nsec(), sweep))
        except ValueError as error:
            self._on_garbage(str(error))
            return False
        return True

    @staticmethod
    def _on_garbage(reason: str) -> None:
        rospy.logwarn_throttle(2.0, f"left out: {reason}")

    def _process(self, item: tuple[str, int, Sweep]) -> None:
        frame, stamp_ns, sweep = item
        try:
            self._register(frame, sweep)
        finally:
            self._done.done(stamp_ns)

    def _on_imu(self, message: Imu) -> None:
        rates, force = message.angular_velocity, message.linear_acceleration
        turn = self._imu_turn(message.header.frame_id.lstrip("/"))
        measured = (turn @ [rates.x, rates.y, rates.z], turn @ [force.x, force.y, force.z])
        reading = ImuReading(message.header.stamp.to_nsec(), *measured)
        if not self._readings.add(reading, rospy.Time.now().to_nsec()):
            self._on_garbage(
                f"a reading of {IMU} can't be one: stamp {reading.stamp_ns}, {reading.rates} rad/s, {reading.specific_force} m/s2"
            )
            return
        self._standing.add(reading, self._vehicle.poses)

    def _imu_turn(self, frame: str) -> Floats:
        """Return R_base_imu (3, 3); an IMU of which ``/tf_static`` says nothing is taken to lie in the body's axes."""
        if frame in {"", BASE_LINK}:
            return np.eye(3)
        try:
            return self._vehicle.mount(frame)[:3, :3]
        except LookupError as error:
            rospy.logwarn_throttle(10.0, f"{IMU} is taken to be in the axes of {BASE_LINK}: {error}")
            return np.eye(3)

    def _register(self, frame: str, sweep: Sweep) -> None:
        poses = self._vehicle.poses_at(sweep.end_ns)
        self._readings.wait_for(sweep.end_ns, READING_WAIT_S)
        if not self._slam.begun:
            self._vehicle.T_odom_map(wait_s=MAP_WAIT_S)
        with self._lock:
            if not self._switch.enabled:
                return
            self._begin_as_flown()
            self._slam.gyro_bias = self._standing.bias
            registration = self._slam.add(sweep, self._readings.take_until(sweep.end_ns), poses, self._vehicle.mount(frame))
            self._publish_state(sweep.stamp_ns, registration)
            self._publish_pose(sweep.end_ns)
        self._report()
        if self._slam.full:
            rospy.logwarn_throttle(10.0, f"the map is full ({len(self._slam.map)} voxels): new surfaces are left out")

    def _begin_as_flown(self) -> None:
        """Let a mapping that has not begun take the place of `map` from the guidance, which flew on by it if this node has crashed."""
        flown = self._vehicle.T_odom_map()
        if flown is not None and not self._slam.begun:
            self._slam.T_map_odom = np.asarray(np.linalg.inv(flown), float)

    def _report(self) -> None:
        """Tell the skillset whether pose and map are to be trusted."""
        problem = self._slam.problem
        if problem:
            rospy.logwarn_throttle(2.0, f"the map is lost: {problem}")
        self._reporter.report("slam_status", "LOST" if problem else "OK", problem)

    def _publish_state(self, stamp_ns: int, registration: Registration | None) -> None:
        count = self._slam.count
        message = MappingState(header=Header(stamp=_time(stamp_ns), frame_id="map"), running=self._switch.enabled)
        message.scans, message.rejected, message.points = count.scans, count.rejected, len(self._slam.map)
        message.loops, message.problem, message.uncertainty_m = self._slam.loops, self._slam.problem, self._slam.uncertainty_m
        if registration is not None:
            message.fitness, message.correction_m = registration.fitness, registration.correction_m
            message.refusal, message.degenerate = registration.refusal, registration.degenerate
        self._state.publish(message)

    def _publish_pose(self, stamp_ns: int) -> None:
        known = self._slam.pose()
        if known is None:
            return
        message = PoseWithCovarianceStamped(header=Header(stamp=_time(stamp_ns), frame_id="map"))
        message.pose.pose.position = Point(*known[0][:3, 3])
        message.pose.pose.orientation = Quaternion(*Rotation.from_matrix(known[0][:3, :3]).as_quat())
        message.pose.covariance = known[1].ravel().tolist()
        self._pose.publish(message)

    def _publish_tf(self, _event: object) -> None:
        """Publish map -> odom; odom -> base_link is the guidance's, from the autopilot."""
        with self._lock:
            self._begin_as_flown()
            place, known = self._slam.T_map_odom, self._slam.begun or self._vehicle.T_odom_map() is not None
        if not known:
            return  # the identity would be a jump of the pose in flight
        transform = TransformStamped(header=Header(stamp=rospy.Time.now(), frame_id="map"), child_frame_id="odom")
        transform.transform.translation = Vector3(*place[:3, 3])
        transform.transform.rotation = Quaternion(*Rotation.from_matrix(place[:3, :3]).as_quat())
        self._tf.publish(TFMessage(transforms=[transform]))

    def _on_switch(self, _enabled: bool) -> None:  # noqa: FBT001 -- a callback's signature
        with self._lock:  # after the scan in work: nothing contradicts this state until the next change
            self._slam.stop()
            self._readings.clear()
            self._publish_state(rospy.Time.now().to_nsec(), None)
        self._reporter.report("slam_status", "UNKNOWN", "the mapping does not run")

    def _publish_map(self, _event: object) -> None:
        if not self._map.get_num_connections():
            return
        with self._lock:
            points = self._slam.map.points
        self._map.publish(cloud_message(Header(stamp=rospy.Time.now(), frame_id="map"), points.astype("float32")))

    def _on_save(self, _request: TriggerRequest) -> TriggerResponse:
        try:
            count = self._save()
        except OSError as error:
            return TriggerResponse(success=False, message=str(error))
        return TriggerResponse(success=True, message=f"{count} points in {self._path}")

    def _save_if_new(self, _event: object) -> None:
        if self._slam.count.scans == self._saved_scans:
            return
        try:
            self._save()
        except OSError as error:
            rospy.logerr_throttle(10.0, f"the map could not be saved: {error}")

    def _save(self) -> int:
        with self._saving:
            with self._lock:
                points, scans = self._slam.map.points, self._slam.count.scans
            write_ply(self._path, points)
            self._saved_scans = scans
        return len(points)


def _time(stamp_ns: int) -> rospy.Time:
    return rospy.Time(stamp_ns // NS, stamp_ns % NS)


def main() -> None:
    """Run the node until ROS shuts down."""
    rospy.init_node("lidar_mapping")
    _node = LidarMappingNode(read_settings(MappingSettings()))
    rospy.spin()
