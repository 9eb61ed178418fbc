"""What /lidar_mapping does with its messages: pose and map by LiDAR and IMU while enabled, saved as the map grows. No rospy."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING

import numpy as np
from genpy import Time
from geometry_msgs.msg import Point, PoseWithCovarianceStamped, Quaternion, TransformStamped, Vector3
from sensor_msgs.msg import Imu, PointCloud2
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage
from uav_msgs.msg import MappingState

from lidar_mapping.imu_watch import ImuWatch
from lidar_mapping.inertial import ImuReading, quaternion_xyzw
from lidar_mapping.ply import read_ply, write_ply
from lidar_mapping.readings import ReadingQueue
from lidar_mapping.slam import Slam
from lidar_mapping.standing import StandingGyro
from node_core.core import Input, Output
from perception_core import NS, Sweep, SweepStamps
from perception_core.clouds import sweep_of_cloud
from perception_core.conversions import cloud_message
from perception_core.vehicle import KnownVehicle

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from lidar_mapping.registration import Registration
    from lidar_mapping.settings import MappingSettings
    from node_core.core import Host

    Floats = NDArray[np.float64]

CLOUD, CLOUD_BYTES = "/lidar/points", 1 << 23
IMU, IMU_BYTES, IMU_QUEUE = "/imu/data", 1 << 16, 100
BASE_LINK = "base_link"
READING_WAIT_S = 0.3  # wall clock; the readings of a sweep may arrive after it, over a connection of their own
MAP_WAIT_S = 1.0  # wall clock; a guidance that runs tells of its map at 20 Hz
TF_PERIOD_S = 0.1
HEIGHT_DRIFT_M = 0.2  # from which on it is told: more than a height is noisy, and than a tilt of the map explains before the next turn
HEIGHT_AGREES_M = 0.15  # below which it is not told any more
HEIGHT_WRONG_M = 2.0  # no barometer drifts so far in a flight: the map may, or both
STATE, MAP = Output("~state", MappingState, queue_size=5, latch=True), Output("~map", PointCloud2, latch=True)
POSE, TF = Output("~pose", PoseWithCovarianceStamped, queue_size=5), Output("/tf", TFMessage, queue_size=5, shared=True)
OUTPUTS = (STATE, MAP, POSE, TF)


class LidarMapping:
    """Takes sweeps and readings of the IMU; the map grows on the host's worker."""

    def __init__(self, settings: MappingSettings, host: Host) -> None:
        self.enabled = settings.enabled
        self._settings = settings
        self._host = host
        self._path = Path(settings.map_path)
        self._slam = Slam(settings.slam, self._path.parent)
        self._readings = ReadingQueue()
        self._imu = ImuWatch()
        self._standing = StandingGyro()
        self._vehicle = KnownVehicle()
        self._stamps = SweepStamps()
        self._lock = Lock()
        self._saving = Lock()
        self._height = "AGREED"
        self._storage = ""
        self._received = 0
        self._saved_scans = 0
        self._resume()

    @property
    def inputs(self) -> list[Input]:
        """The guidance's topics, the IMU and the clouds."""
        return [
            *self._vehicle.inputs(self._on_garbage),
            Input(IMU, Imu, self._on_imu, self._on_garbage, IMU_BYTES, queue_size=IMU_QUEUE),
            Input(CLOUD, PointCloud2, self._on_cloud, self._on_garbage, CLOUD_BYTES),
        ]

    @property
    def timers(self) -> list[tuple[float, Callable[[], None]]]:
        """The periodic work: saving and publishing."""
        settings = self._settings
        return [
            (settings.save_period_s, self.save_if_new),
            (settings.publish_period_s, self._publish_map),
            (TF_PERIOD_S, self._publish_tf),
        ]

    def switch(self, enabled: bool) -> None:  # noqa: FBT001 -- a callback's signature
        """Begin or end the mapping."""
        self.enabled = enabled
        with self._lock:  # after the scan in work: nothing contradicts this state until the next change
            self._slam.stop()
            self._readings.clear()
            self._publish_state(self._host.now_ns(), None)
            if enabled:
                self._height = "AGREED"
                self._imu = ImuWatch()
        self._host.report("mapping.slam_status", "UNKNOWN", "the mapping does not run")
        if enabled:
            self._host.report("mapping.height_status", self._height)
            self._host.report("mapping.imu_status", "OK")

    def save(self) -> str:
        """Write the map; return in words what was written where; raise OSError."""
        with self._saving:
            with self._lock:
                points, scans = self._slam.map.points, self._slam.count.scans
            write_ply(self._path, points)
            self._saved_scans = scans
        return f"{len(points)} points in {self._path}"

    def save_if_new(self) -> None:
        """Write the map if it has grown."""
        if self._slam.count.scans == self._saved_scans:
            return
        try:
            self.save()
        except OSError as error:
            self._host.warn("saving", f"the map could not be saved: {error}", every_s=10.0)

    def _resume(self) -> None:
        """Go on with the map that a run before left in the file: this node is started again after a crash."""
        if not (self._settings.resume and self._path.exists()):
            return
        try:
            self._slam.resume(read_ply(self._path))
        except (OSError, ValueError) as error:
            self._host.warn("resuming", f"starting with an empty map: {error}")

    def _on_cloud(self, message: PointCloud2) -> None:
        self._received += self.enabled
        wanted = self.enabled and self._received % self._settings.every_scan == 0
        if not (wanted and self._offered(message)):
            self._host.done(message.header.stamp.to_nsec())

    def _offered(self, message: PointCloud2) -> bool:
        try:
            sweep = self._stamps.begun(sweep_of_cloud(message), self._host.now_ns())
            self._host.offer(partial(self._process, message.header.frame_id, message.header.stamp.to_nsec(), sweep))
        except ValueError as error:
            self._on_garbage(str(error))
            return False
        return True

    def _on_garbage(self, reason: str) -> None:
        self._host.warn("garbage", f"left out: {reason}")

    def _process(self, frame: str, stamp_ns: int, sweep: Sweep) -> None:
        try:
            self._register(frame, sweep)
        finally:
            self._host.done(stamp_ns)

    def _on_imu(self, message: Imu) -> None:
        rates, force = message.angular_velocity, message.linear_acceleration
        turn = self._imu_turn(message.header.frame_id.lstrip("/"))
        measured = (turn @ [rates.x, rates.y, rates.z], turn @ [force.x, force.y, force.z])
        reading = ImuReading(message.header.stamp.to_nsec(), *measured)
        if not self._readings.add(reading, self._host.now_ns()):
            what = f"stamp {reading.stamp_ns}, {reading.rates} rad/s, {reading.specific_force} m/s2"
            self._imu.refuse(what)
            self._on_garbage(f"a reading of {IMU} can't be one: {what}")
            return
        self._standing.add(reading, self._vehicle.poses)

    def _imu_turn(self, frame: str) -> Floats:
        """Return R_base_imu (3, 3); an IMU that is not in ``/tf_static`` is taken to lie in the body's axes."""
        if frame in {"", BASE_LINK}:
            return np.eye(3)
        try:
            return self._vehicle.mount(frame)[:3, :3]
        except LookupError as error:
            self._host.warn("axes", f"{IMU} is taken to be in the axes of {BASE_LINK}: {error}", every_s=10.0)
            return np.eye(3)

    def _register(self, frame: str, sweep: Sweep) -> None:
        poses = self._vehicle.poses_at(sweep.end_ns)
        self._readings.wait_for(sweep.end_ns, READING_WAIT_S)
        if not self._slam.begun:
            self._vehicle.T_odom_map(wait_s=MAP_WAIT_S)
        with self._lock:
            if not self.enabled:
                return
            self._begin_as_flown()
            self._slam.gyro_bias, self._slam.gyro_bias_rad_s = self._standing.bias, self._standing.sigma_rad_s(sweep.end_ns)
            readings = self._usable(self._readings.take_until(sweep.end_ns), sweep.end_ns)
            registration = self._slam.add(sweep, readings, poses, self._vehicle.mount(frame))
            self._publish_state(sweep.stamp_ns, registration)
            self._publish_pose(sweep.end_ns)
        self._report()
        self._tell_what_lacks()

    def _tell_what_lacks(self) -> None:
        """Warn where the map is full, or where what lies behind can't be stored or read."""
        if self._slam.full:
            self._host.warn("full", f"the map is full ({len(self._slam.map)} voxels): new surfaces are left out", every_s=10.0)
        if self._slam.keyframes.problem != self._storage:
            self._storage = self._slam.keyframes.problem
            self._host.warn("storage", self._storage)

    def _usable(self, readings: Sequence[ImuReading], end_ns: int) -> Sequence[ImuReading]:
        """Return the readings, or none of an IMU that has failed or stands still: the filter then says itself how much less it knows.

        A second of zeros would be a free fall of 5 m to it: the map were lost before the IMU is told to be broken.
        """
        if self._imu.fails(end_ns, readings):
            self._host.warn("imu", f"the IMU is not used any more in this mapping: {self._imu.problem}")
            self._host.report("mapping.imu_status", "BROKEN", self._imu.problem)
        return () if self._imu.problem or self._imu.still else readings

    def _begin_as_flown(self) -> None:
        """Let a mapping that has not begun take the place of `map` from the guidance, which flew on by it if this node has crashed."""
        flown = self._vehicle.T_odom_map()
        if flown is not None and not self._slam.begun:
            self._slam.T_map_odom = np.asarray(np.linalg.inv(flown), float)

    def _report(self) -> None:
        """Report to the skillset whether pose and map can be trusted."""
        problem = self._slam.problem
        if problem:
            self._host.warn("lost", f"the map is lost: {problem}")
        else:
            self._report_height(self._slam.height_drift_m)
        self._host.report("mapping.slam_status", "LOST" if problem else "OK", problem)

    def _report_height(self, drifted_m: float) -> None:
        """Tell the skillset how the autopilot's height fares beside the map's, as long as that is to be trusted."""
        found = height_status(drifted_m, self._height)
        where = "higher" if drifted_m > 0.0 else "lower"
        words = f"the autopilot takes the vehicle to be {abs(drifted_m):.2f} m {where} than it is in the map"
        if found == "DRIFTING":
            self._host.warn("height", f"the barometer drifts: {words}", every_s=10.0)
        if found != self._height:
            self._height = found
            self._host.report("mapping.height_status", found, "" if found == "AGREED" else words)

    def _publish_state(self, stamp_ns: int, registration: Registration | None) -> None:
        count = self._slam.count
        message = MappingState(header=Header(stamp=_time(stamp_ns), frame_id="map"), running=self.enabled)
        message.scans, message.rejected, message.points = count.scans, count.rejected, len(self._slam.map)
        message.loops, message.problem, message.uncertainty_m = self._slam.loops, self._slam.problem, self._slam.uncertainty_m
        if registration is not None:
            message.fitness, message.correction_m = registration.fitness, registration.correction_m
            message.refusal, message.degenerate = registration.refusal, registration.degenerate
        self._host.publish(STATE.topic, message)

    def _publish_pose(self, stamp_ns: int) -> None:
        known = self._slam.pose()
        if known is None:
            return
        message = PoseWithCovarianceStamped(header=Header(stamp=_time(stamp_ns), frame_id="map"))
        message.pose.pose.position = Point(*known[0][:3, 3])
        message.pose.pose.orientation = Quaternion(*quaternion_xyzw(known[0][:3, :3]))
        message.pose.covariance = known[1].ravel().tolist()
        self._host.publish(POSE.topic, message)

    def _publish_tf(self) -> None:
        """Publish map -> odom; odom -> base_link is the guidance's, from the autopilot."""
        with self._lock:
            self._begin_as_flown()
            place, known = self._slam.T_map_odom, self._slam.begun or self._vehicle.T_odom_map() is not None
        if not known:
            return  # the identity would be a jump of the pose in flight
        transform = TransformStamped(header=Header(stamp=_time(self._host.now_ns()), frame_id="map"), child_frame_id="odom")
        transform.transform.translation = Vector3(*place[:3, 3])
        transform.transform.rotation = Quaternion(*quaternion_xyzw(place[:3, :3]))
        self._host.publish(TF.topic, TFMessage(transforms=[transform]))

    def _publish_map(self) -> None:
        if not self._host.wanted(MAP.topic):
            return
        with self._lock:
            points = self._slam.map.points
        self._host.publish(MAP.topic, cloud_message(Header(stamp=_time(self._host.now_ns()), frame_id="map"), points.astype("float32")))


def _time(stamp_ns: int) -> Time:
    return Time(stamp_ns // NS, stamp_ns % NS)


def height_status(drifted_m: float, before: str) -> str:
    """Return the state of `mapping.height_status`: WRONG stays until a mapping begins again."""
    off_m = abs(drifted_m)
    if off_m > HEIGHT_WRONG_M or before == "WRONG":
        return "WRONG"
    return "DRIFTING" if off_m > (HEIGHT_AGREES_M if before == "DRIFTING" else HEIGHT_DRIFT_M) else "AGREED"
