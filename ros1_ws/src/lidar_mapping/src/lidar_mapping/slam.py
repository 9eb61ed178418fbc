"""The procedure: follow the vehicle through a sweep, put the sweep into the map, close loops, and judge the quality."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from lidar_mapping.graph import GraphSettings, PoseGraph
from lidar_mapping.inertial import POSITION, UP, InertialState, rotation_vector
from lidar_mapping.keyframes import Keyframes
from lidar_mapping.odometry import VELOCITY_BASE_NS, AutopilotMotion, LidarInertialOdometry, OdometrySettings, Step
from lidar_mapping.readings import KEPT, SET_BACK_NS
from lidar_mapping.registration import refused
from lidar_mapping.surface import flat_patches
from lidar_mapping.voxel_map import VoxelMap, downsample
from perception_core import NS

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from lidar_mapping.inertial import ImuReading
    from lidar_mapping.registration import Registration
    from perception_core import PoseBuffer, Sweep

    Floats = NDArray[np.float64]


@dataclass(frozen=True)
class SlamSettings:
    """Metres, seconds.

    The map is lost after ``lost_s`` without a believed scan, or when the position is not known to ``lost_m``.
    """

    voxel_m: float = 0.1
    max_voxels: int = 1_000_000
    self_m: float = 1.2
    max_range_m: float = 25.0
    lost_s: float = 2.0
    lost_m: float = 0.75
    odometry: OdometrySettings = field(default_factory=OdometrySettings)
    graph: GraphSettings = field(default_factory=GraphSettings)


@dataclass
class SlamCount:
    """Counts of what was done so far."""

    scans: int = 0
    rejected: int = 0


class Slam:
    """One map and the vehicle's place in it; not thread-safe.

    What lies behind is stored in ``folder``, or the system's folder for temporary files.
    """

    def __init__(self, settings: SlamSettings, folder: Path | None = None) -> None:
        self._settings = settings
        self.map = VoxelMap(voxel_m=settings.voxel_m, max_voxels=settings.max_voxels)
        self.keyframes = Keyframes(voxel_m=settings.odometry.map_voxel_m, limit=settings.odometry.max_keyframes, folder=folder)
        self.count = SlamCount()
        self.T_map_odom: Floats = np.eye(4)
        self.gyro_bias: Floats = np.zeros(3)
        """The gyro's rates at rest, (3,) rad/s about the body's axes, as far as it is known when track is taken up."""
        self.gyro_bias_rad_s = math.inf
        """How well that is known: a standard deviation; what the settings say of any gyro holds where it is less."""
        self._graph = PoseGraph(settings.graph, settings.odometry.registration)
        self._odometry: LidarInertialOdometry | None = None
        self._lost_since_ns: int | None = None
        self._readings: deque[ImuReading] = deque(maxlen=KEPT)

    @property
    def loops(self) -> int:
        """How many loops were closed."""
        return self._graph.loops

    @property
    def begun(self) -> bool:
        """Whether a sweep was followed: from then on ``T_map_odom`` is by the scans, before it may be set."""
        return self.count.scans > 0

    @property
    def full(self) -> bool:
        """Whether new places are left out."""
        return self.map.full or self.keyframes.full

    def pose(self) -> tuple[Floats, Floats] | None:
        """Return T_map_base (4, 4) and its covariance (6, 6; position, then rotation about the body's axes); None before the start.

        The covariance is that of the pose relative to the keyframes around, and theirs in the map.
        """
        if self._odometry is None:
            return None
        place, order = self._odometry.state.matrix, np.r_[6:9, 0:3]
        of_keyframes = self._graph.covariance[np.ix_([3, 4, 5, 0, 1, 2], [3, 4, 5, 0, 1, 2])]
        into_body = np.eye(6)
        into_body[3:, 3:] = place[:3, :3].T
        return place, self._odometry.filter.covariance[np.ix_(order, order)] + into_body @ of_keyframes @ into_body.T

    @property
    def problem(self) -> str:
        """Why pose and map are not to be trusted now; empty when they are."""
        if self._odometry is None:
            return ""
        silent_s = 0.0 if self._lost_since_ns is None else (self._odometry.filter.stamp_ns - self._lost_since_ns) / NS
        if silent_s > self._settings.lost_s:
            return f"no scan fitted the map for {silent_s:.1f} s"
        if self.uncertainty_m > self._settings.lost_m:
            return f"the position is known to {self.uncertainty_m:.2f} m only: no surface holds the scans"
        return ""

    @property
    def height_drift_m(self) -> float:
        """How much higher than the map the autopilot takes the vehicle to be since the start, but for jumps: its barometer's drift."""
        return self._graph.barometer.drifted_m

    @property
    def uncertainty_m(self) -> float:
        """The standard deviation of the position relative to the keyframes around, in its worst direction."""
        if self._odometry is None:
            return 0.0
        return float(np.sqrt(np.linalg.eigvalsh(self._odometry.filter.covariance[POSITION, POSITION])[-1]))

    def resume(self, points: Floats) -> None:
        """Go on with a map (N, 3) that was saved before; scans are laid onto it."""
        self.map.insert(points)
        thinned = downsample(points, self._settings.odometry.scan_voxel_m)
        if len(thinned):
            self.keyframes.adopt(thinned, flat_patches(thinned, thinned))
            self._graph.add(self.keyframes, None)

    def stop(self) -> None:
        """Lose track: the next sweep starts at the autopilot's pose, corrected as the map was last."""
        self._odometry = None
        self._readings.clear()
        self._lost_since_ns = None

    def add(self, sweep: Sweep, readings: Sequence[ImuReading], poses: PoseBuffer, T_base_lidar: Floats) -> Registration:  # noqa: N803
        """Follow the vehicle through one sweep; a scan that is not believed, or not later than the one before, is not inserted.

        A sweep that is earlier by more than a second tells of a clock that was set back: track is lost and found as at the start.
        ``readings`` are those since the call before; ``poses`` are the autopilot's. Raises PoseUnavailableError when it says nothing of the
        sweep's end: then nothing was changed, and the readings are kept for the next sweep, for the vehicle has turned all the same.
        """
        self._readings.extend(readings)
        ends = poses.at([sweep.end_ns - VELOCITY_BASE_NS, sweep.end_ns])
        velocity = (ends.position[1] - ends.position[0]) / (VELOCITY_BASE_NS / NS)
        early_ns = 0 if self._odometry is None else self._odometry.filter.stamp_ns - sweep.end_ns
        if early_ns > SET_BACK_NS:
            self.stop()
            self._readings.extend(readings)
        elif self._odometry is not None and early_ns >= 0:
            self.count.scans += 1
            self.count.rejected += 1
            return refused("the sweep is not later than the one before")
        if self._odometry is None:
            self._start(sweep, poses, velocity)
        assert self._odometry is not None  # noqa: S101 -- just started
        near = sweep.within(self._settings.self_m, self._settings.max_range_m)
        step = self._odometry.add(near, self._readings, T_base_lidar, AutopilotMotion(ends.rotation[1], velocity))
        self._readings.clear()
        self._take(step, ends.matrix(1))
        return step.registration

    def _start(self, sweep: Sweep, poses: PoseBuffer, velocity: Floats) -> None:
        place = self.T_map_odom @ poses.at([sweep.stamp_ns]).matrix()
        error = rotation_vector(self.T_map_odom[:3, :3].T)
        start = InertialState(place[:3, :3], velocity, place[:3, 3], gyro_bias=self.gyro_bias, autopilot_error=error)
        noise = self._settings.odometry.noise
        noise = replace(noise, start_gyro_bias=min(noise.start_gyro_bias, self.gyro_bias_rad_s))
        settings = replace(self._settings.odometry, noise=noise)
        self._odometry = LidarInertialOdometry(settings, self.keyframes, sweep.stamp_ns, start)

    def _take(self, step: Step, T_odom_base: Floats) -> None:  # noqa: N803 -- T_target_source
        assert self._odometry is not None  # noqa: S101 -- called by add only
        self.count.scans += 1
        if step.registration.believed:
            self._lost_since_ns = None
            self.map.insert(step.points)
            self._graph.barometer.hear(self._odometry.filter.stamp_ns, float(T_odom_base[2, 3]), float(self._odometry.state.position[2]))
            if step.keyframe is not None:
                self._settle(T_odom_base)
            else:
                self._graph.stay(self.keyframes, self._odometry.filter.stamp_ns)
        else:
            self._graph.barometer.forget()
            self.count.rejected += 1
            self._lost_since_ns = self._lost_since_ns or self._odometry.filter.stamp_ns
        self.T_map_odom = self._odometry.state.matrix @ np.linalg.inv(T_odom_base)

    def _settle(self, T_odom_base: Floats) -> None:  # noqa: N803
        """Let the graph settle and look for loops; what it corrects is carried on to the map and the vehicle."""
        assert self._odometry is not None  # noqa: S101 -- called by add only
        before = self.keyframes.all[-1].pose
        if not self._graph.add(self.keyframes, T_odom_base, float(np.sqrt(self._odometry.filter.covariance[UP, UP]))):
            return
        self._graph.barometer.forget()
        self._odometry.move(self.keyframes.all[-1].pose @ np.linalg.inv(before))
        self.map = VoxelMap(voxel_m=self._settings.voxel_m, max_voxels=self._settings.max_voxels)
        for frame in self.keyframes.all:
            self.map.insert(frame.points_in_map())
