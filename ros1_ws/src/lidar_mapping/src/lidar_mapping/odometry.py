"""LiDAR-inertial odometry: propagate by the IMU, straighten the sweep, register it against the keyframes around, keep a keyframe."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from lidar_mapping.inertial import (
    ATTITUDE,
    AUTOPILOT,
    DRIFT,
    GRAVITY,
    HEADING,
    POSITION,
    TERMS,
    VELOCITY,
    ImuReading,
    InertialFilter,
    InertialNoise,
    InertialState,
    rotation_matrix,
    rotation_vector,
)
from lidar_mapping.keyframes import Keyframes
from lidar_mapping.registration import Registration, RegistrationSettings, refused, register
from lidar_mapping.voxel_map import downsample
from perception_core import NS, Poses, straighten

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from lidar_mapping.keyframes import Keyframe
    from lidar_mapping.surface import Surface
    from perception_core import Sweep

    Floats = NDArray[np.float64]
    Floats32 = NDArray[np.float32]

IMU_GAP_NS = 100_000_000
KNOT_NS = 10_000_000
VELOCITY_BASE_NS = 100_000_000
FIRST_SWEEPS = 3
DENSE_SWEEPS = 3  # in a keyframe at least, where sweeps are dense: a fast vehicle would make one of each, which takes too long
WHOLE_KEYFRAMES = 4  # after so many keyframes one tree of the whole surface is built; those between share a small one
FIRST_HEADING_RAD = 0.001  # a new map's heading is what the start says, by definition
ANY_M_S = 10.0
CLEARLY = 0.05  # of fitness
KNOWN_MAP_M = 0.3  # how well a known map's place is known at the start: the autopilot has drifted since it was seen last
AUTOPILOT_RAD = 0.003  # what its attitude is off without the slow error, which is a part of the state
JUMP_SIGMAS = 3.0  # what is off by more counts less: a position that jumps by 0.1 m looks like 1 m/s for one sweep


@dataclass(frozen=True)
class OdometrySettings:
    """Metres, radians. Scans are thinned to ``scan_voxel_m`` and ``scan_points``; the surface is what keyframes within ``reach_m`` saw.

    A sweep of more than ``most_points``, as of a sensor of 64 beams, is thinned to ``dense_voxel_m`` first: then it costs by what it sees.
    A keyframe is taken after ``keyframe_m`` or ``keyframe_rad``; it holds the sweeps since the last one, ``keyframe_sweeps`` at most. The
    autopilot's velocity is believed to ``autopilot_m_s``, but for its drift: how that and its attitude are believed stands in ``noise``.
    A fitness below ``good_fitness`` makes other starts be tried.
    """

    most_points: int = 30_000
    dense_voxel_m: float = 0.12
    scan_voxel_m: float = 0.2
    scan_points: int = 2000
    map_voxel_m: float = 0.08
    reach_m: float = 15.0
    keyframe_m: float = 0.6
    keyframe_rad: float = 0.2
    keyframe_sweeps: int = 8
    max_keyframes: int = 1500
    autopilot_m_s: float = 0.05
    good_fitness: float = 0.85
    noise: InertialNoise = field(default_factory=InertialNoise)
    registration: RegistrationSettings = field(default_factory=RegistrationSettings)


@dataclass(frozen=True)
class AutopilotMotion:
    """The autopilot's motion: R_enu_base (3, 3), with its slow error, and velocity m/s ENU, which a wrong heading does not turn.

    The velocity is the mean over the last `VELOCITY_BASE_NS`.
    """

    rotation: Floats
    velocity: Floats


@dataclass(frozen=True)
class Step:
    """One sweep: its registration, its points (N, 3) in the map, thinned where there are many, and the keyframe that it made, if any."""

    registration: Registration
    points: Floats
    keyframe: Keyframe | None


class LidarInertialOdometry:
    """Follows the vehicle from a start; not thread-safe."""

    def __init__(self, settings: OdometrySettings, keyframes: Keyframes, stamp_ns: int, start: InertialState) -> None:
        self._settings = settings
        self.keyframes = keyframes
        self.filter = InertialFilter(settings.noise, stamp_ns, start)
        if not keyframes.all:
            self.filter.covariance[HEADING, HEADING] = FIRST_HEADING_RAD**2
        else:
            self.filter.covariance[POSITION, POSITION] = np.eye(3) * KNOWN_MAP_M**2
        self._surface: Surface | None = keyframes.surface(start.position, settings.reach_m)
        self._since: list[Floats] = []
        self._last_pose: Floats | None = None

    def add(self, sweep: Sweep, readings: Iterable[ImuReading], T_base_lidar: Floats, autopilot: AutopilotMotion | None = None) -> Step:  # noqa: N803
        """Follow the vehicle to the end of a sweep; ``readings`` are those since the sweep before, in order."""
        self._propagate(readings, sweep.end_ns)
        straight = self._straighten(sweep, T_base_lidar)
        dense = len(straight) > self._settings.most_points
        points = self._thinned(straight, dense=dense)
        registration = self._locate(points, autopilot)
        state = self.filter.state
        placed = points @ state.rotation.T + state.position
        self.filter.history = type(self.filter.history)([self.filter.history[-1]], maxlen=self.filter.history.maxlen)
        return Step(registration, placed, self._keep(placed, dense=dense) if registration.believed else None)

    @property
    def state(self) -> InertialState:
        """The filter's present pose, velocity and biases."""
        return self.filter.state

    def move(self, correction: Floats) -> None:
        """Follow the map when it is corrected; ``correction`` (4, 4) is T_corrected_before at the vehicle.

        A map that was tilted has passed a part of the weight for the accelerometer's bias: what it measures stays the same.
        """
        state, turn = self.filter.state, correction[:3, :3]
        position = turn @ state.position + correction[:3, 3]
        error = rotation_vector(rotation_matrix(state.autopilot_error) @ turn.T)
        rotation = turn @ state.rotation
        moved = replace(
            state,
            rotation=rotation,
            velocity=turn @ state.velocity,
            position=position,
            accel_bias=state.accel_bias - (state.rotation - rotation).T @ GRAVITY,
            autopilot_error=error,
            autopilot_drift=turn @ state.autopilot_drift,
        )
        self.filter.state = moved
        self.filter.history[-1] = (self.filter.stamp_ns, moved)
        self._last_pose = None if self._last_pose is None else correction @ self._last_pose
        self._since = [points @ turn.T + correction[:3, 3] for points in self._since]
        self._surface = self.keyframes.surface(position, self._settings.reach_m)

    def _propagate(self, readings: Iterable[ImuReading], end_ns: int) -> None:
        for reading in readings:
            if reading.stamp_ns <= end_ns:
                self._coast(reading.stamp_ns - IMU_GAP_NS)  # over a gap the last reading says nothing
                self.filter.propagate(reading)
        if end_ns - self.filter.stamp_ns > IMU_GAP_NS // 2:
            self._coast(end_ns)

    def _coast(self, stamp_ns: int) -> None:
        while self.filter.stamp_ns < stamp_ns:
            self.filter.coast(min(stamp_ns, self.filter.stamp_ns + KNOT_NS))

    def _straighten(self, sweep: Sweep, T_base_lidar: Floats) -> Floats32:  # noqa: N803
        """Return the points (N, 3) in the body frame of the filter's moment, each moved from the pose of its own."""
        mount, now = T_base_lidar.astype(np.float32), self.filter.state
        stamps, states = zip(*self.filter.history, strict=True)
        knots_s = (np.array(stamps, dtype=np.int64) - stamps[0]) / NS
        times_s = sweep.times_s + np.float32((sweep.stamp_ns - stamps[0]) / NS)
        # In the body frame of the end numbers are small: 32 bits are enough, and twice as fast.
        rotation = now.rotation.T @ np.array([state.rotation for state in states])
        at_knots = Poses(rotation, np.array([state.position - now.position for state in states]) @ now.rotation)
        return straighten(sweep.points @ mount[:3, :3].T + mount[:3, 3], times_s, knots_s, at_knots)

    def _thinned(self, points: Floats32, *, dense: bool) -> Floats:
        """Return the mean of the points in each voxel where there are more than are needed: a sensor of 64 beams sees a wall many times."""
        exact = points.astype(np.float64)
        return downsample(exact, self._settings.dense_voxel_m) if dense else exact

    def _locate(self, points: Floats, autopilot: AutopilotMotion | None) -> Registration:
        """Register from where the autopilot's motion leads; where that fits badly, from other starts too, and take the best.

        The others are one's own motion, none at all since the last sweep (what the autopilot said before may have misled that, too), and
        any motion, without the autopilot's attitude either. Each has to fit clearly better: along a bare wall anything fits about as well.
        """
        if autopilot is None:
            return self._register(points)
        predicted, take_back = self.filter.state, self.filter.keep()
        autopilot = self._at_the_end(autopilot)
        last = self.filter.history[0][1]
        best, back_to_best = refused("not tried"), take_back
        for velocity_m_s, start in (
            (self._settings.autopilot_m_s, predicted),
            (np.inf, predicted),
            (np.inf, replace(predicted, position=last.position)),
        ):
            take_back()
            self.filter.state = start
            self._listen_to(autopilot, velocity_m_s)
            found = self._register(points)
            if found.fitness >= best.fitness + CLEARLY * best.believed:
                best, back_to_best = found, self.filter.keep()
            if best.believed and best.fitness > self._settings.good_fitness:
                back_to_best()
                return best
        take_back()
        self._forget_motion()
        found = self._register(points)
        if found.believed and found.fitness > best.fitness + CLEARLY:
            self._learn_anew(autopilot)
            return found
        back_to_best()
        return best

    def _forget_motion(self) -> None:
        """Take the velocity since the last sweep for one of up to `ANY_M_S`, and the attitude for what the readings say."""
        moves = np.zeros((TERMS, 3))
        moves[VELOCITY], moves[POSITION] = np.eye(3), np.eye(3) * (self.filter.stamp_ns - self.filter.history[0][0]) / NS
        self.filter.covariance = self.filter.covariance + ANY_M_S**2 * moves @ moves.T

    def _at_the_end(self, autopilot: AutopilotMotion) -> AutopilotMotion:
        """Return the motion with the velocity of the sweep's end: as it has changed since the mean, by the IMU."""
        (since_ns, since), now = self.filter.history[0], self.filter.state
        passed_ns = self.filter.stamp_ns - since_ns
        if not passed_ns:
            return autopilot
        change = now.velocity - (now.position - since.position) / (passed_ns / NS)
        return replace(autopilot, velocity=autopilot.velocity + min(1.0, VELOCITY_BASE_NS / passed_ns) * change)

    def _listen_to(self, autopilot: AutopilotMotion, velocity_m_s: float) -> None:
        moves = np.zeros((3, TERMS))
        moves[:, VELOCITY], moves[:, DRIFT] = np.eye(3), np.linalg.norm(autopilot.velocity) * np.eye(3)

        def off_m_s(state: InertialState) -> Floats:
            return state.velocity + moves[:, DRIFT] @ state.autopilot_drift - autopilot.velocity

        def off_rad(state: InertialState) -> tuple[Floats, Floats]:
            said = rotation_matrix(state.autopilot_error) @ state.rotation
            rows = np.zeros((3, TERMS))
            rows[:, ATTITUDE], rows[:, AUTOPILOT] = np.eye(3), said.T
            return rotation_vector(autopilot.rotation.T @ said), rows

        covariance = self.filter.covariance
        off, turns = off_rad(self.filter.state)
        attitude_weight = _weight(off, turns @ covariance @ turns.T, AUTOPILOT_RAD)
        weight = _weight(off_m_s(self.filter.state), moves @ covariance @ moves.T, velocity_m_s)

        def linearise(state: InertialState) -> tuple[Floats, Floats]:
            off, rows = off_rad(state)
            gradient: Floats = attitude_weight * rows.T @ off + weight * moves.T @ off_m_s(state)
            return attitude_weight * rows.T @ rows + weight * moves.T @ moves, gradient

        self.filter.correct(linearise)

    def _learn_anew(self, autopilot: AutopilotMotion) -> None:
        """Set the error of the autopilot's attitude by the scan: the earlier estimate is discarded."""
        state, covariance = self.filter.state, self.filter.covariance.copy()
        covariance[AUTOPILOT, :], covariance[:, AUTOPILOT] = 0.0, 0.0
        covariance[AUTOPILOT, AUTOPILOT] = np.diag(self._settings.noise.autopilot_rad**2)
        error = rotation_vector(autopilot.rotation @ state.rotation.T)
        self.filter.state, self.filter.covariance = replace(state, autopilot_error=error), covariance
        self.filter.history[-1] = (self.filter.stamp_ns, self.filter.state)

    def _register(self, points: Floats) -> Registration:
        if self._surface is None:
            return Registration(1.0, 0.0, np.zeros(3), np.eye(3), "")  # the first sweep is where the start says
        thinned = downsample(points, self._settings.scan_voxel_m)
        if len(thinned) > self._settings.scan_points:
            thinned = thinned[:: -(-len(thinned) // self._settings.scan_points)]
        return register(thinned, self._surface, self.filter, self._settings.registration)

    def _keep(self, placed: Floats, *, dense: bool) -> Keyframe | None:
        """Gather the sweep, and make a keyframe of what was gathered when the vehicle has moved on.

        The first sweep makes one alone, and the next few another, wherever they are: a single sweep is too sparse to tell normals well.
        """
        settings, pose = self._settings, self.filter.state.matrix
        if len(self._since) < settings.keyframe_sweeps:
            self._since.append(placed)
        if self._last_pose is not None and dense and len(self._since) < DENSE_SWEEPS:
            return None
        early = len(self.keyframes.all) == 1 and len(self._since) >= FIRST_SWEEPS
        if self._last_pose is not None and not early:
            moved = np.linalg.inv(self._last_pose) @ pose
            turned = np.linalg.norm(rotation_vector(moved[:3, :3]))
            if (np.linalg.norm(moved[:3, 3]) < settings.keyframe_m and turned < settings.keyframe_rad) or self.keyframes.full:
                return None
        frame = self.keyframes.add(self.filter.stamp_ns, pose, np.vstack(self._since))
        self._since, self._last_pose = [], pose
        if self._surface is None or len(self.keyframes.all) % WHOLE_KEYFRAMES == 0:
            self._surface = self.keyframes.surface(pose[:3, 3], settings.reach_m)
        else:
            self._surface = self._surface.joined(frame.patches_in_map())
        return frame


def _weight(off: Floats, covariance: Floats, sigma: float) -> float:
    """Return the information of each axis of what is off its prediction (3,) with that covariance (3, 3); 0 for no sigma."""
    if not np.isfinite(sigma):
        return 0.0
    squared = float(off @ np.linalg.solve(covariance + sigma**2 * np.eye(3), off))
    return min(1.0, JUMP_SIGMAS**2 / max(squared, 1e-9)) / sigma**2
