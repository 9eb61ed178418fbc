"""The pose graph of the keyframes: odometry, loops, and what the autopilot says of place, height and the vertical (gtsam).

The odometry alone keeps the tilt with which the map began: 0.3 degrees are 0.1 m of height after 20 m. The autopilot's height comes from
a barometer, which drifts with time and not with the way (`BarometerZero`), so its differences along the way say what is level. The
autopilot's vertical leans by a constant about the body's axes: when the vehicle turns, the lean turns in the map and is told from a tilt.

The graph also says how well the last keyframe is known in the map. The odometry lays each scan onto keyframes that it has placed itself,
so its own covariance is that of the pose relative to them, and says nothing of the error that they hand on from one to the next.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import gtsam
import numpy as np

from lidar_mapping.barometer import BarometerZero, HeightSettings
from lidar_mapping.inertial import POSITION, InertialFilter, InertialNoise, InertialState, cross_matrix
from lidar_mapping.registration import RegistrationSettings, register

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from lidar_mapping.keyframes import Keyframe, Keyframes

    Floats = NDArray[np.float64]


LEAN = int(gtsam.symbol("l", 0))
ANY_TILT_RAD = 0.1  # of a new map: the autopilot's vertical tells


@dataclass(frozen=True)
class GraphSettings:
    """When a place is taken for a known one, and what is believed of what; metres, radians.

    A keyframe is held against one that lies at least ``path_m`` of flight back and within ``reach_m``. The drift of the odometry is
    ``drift`` of the way and ``turn_rad`` a keyframe; upwards, where the ground holds the scan, it is ``up_m`` a keyframe. The autopilot's
    position is believed to ``autopilot_m``: loosely, for its error is the same for minutes, so that many keyframes know no more of it than
    one. What is known of its height stands in ``height``. Its vertical leans by a constant of ``tilt_rad``, and by ``upright_rad`` more at
    one keyframe, loosely, as its position; a new map begins upright by it to ``begin_rad``. With every ``every``th keyframe loops are
    looked for and all is optimised; keyframes are moved where one is off by ``moved_m``.
    """

    path_m: float = 25.0
    reach_m: float = 6.0
    every: int = 3
    drift: float = 0.01
    least_m: float = 0.005
    turn_rad: float = 0.0005
    up_m: float = 0.001
    loop_m: float = 0.03
    loop_rad: float = 0.005
    loop_fitness: float = 0.7
    autopilot_m: float = 30.0
    tilt_rad: float = 0.012
    upright_rad: float = 0.005
    begin_rad: float = 0.002
    moved_m: float = 0.02
    submap: int = 6
    height: HeightSettings = field(default_factory=HeightSettings)


class PoseGraph:
    """Adds keyframes one after the other, finds loops, and corrects the poses."""

    def __init__(self, settings: GraphSettings, registration: RegistrationSettings) -> None:
        self._settings, self._registration = settings, registration
        self._factors = gtsam.NonlinearFactorGraph()
        self._path_m: list[float] = []
        self.barometer = BarometerZero(settings.height, self._factors)
        self._lean_rad: Floats = np.zeros(3)
        leaning = gtsam.noiseModel.Diagonal.Sigmas(np.array([settings.tilt_rad, settings.tilt_rad, 1e-3]))
        self._factors.add(gtsam.PriorFactorVector(LEAN, np.zeros(3), leaning))
        self.loops = 0
        self.covariance: Floats = np.zeros((6, 6))
        """Of the last keyframe's pose: rotation vector and position, map frame (6, 6)."""

    @property
    def lean_rad(self) -> Floats:
        """How the autopilot's vertical leans about the body's x and y, (2,)."""
        return self._lean_rad[:2]

    def stay(self, keyframes: Keyframes, stamp_ns: int) -> None:
        """Add the barometer's last height, where the vehicle stays near the last keyframe."""
        if self.barometer.due(stamp_ns, keyframes.all[-1]):
            self.barometer.tie(stamp_ns, len(keyframes.all) - 1, float(keyframes.all[-1].pose[2, 3]))

    def add(self, keyframes: Keyframes, T_odom_base: Floats | None, up_m: float = 0.0) -> bool:  # noqa: N803 -- T_target_source
        """Add the last keyframe and the autopilot's pose at its moment; return whether keyframes' poses were moved.

        ``up_m`` is how well the height of that keyframe is known relative to those around: a standard deviation.
        """
        index = len(keyframes.all) - 1
        frame = keyframes.all[index]
        if index == 0:
            self._begin(frame)
        else:
            self._lead_on(keyframes, up_m)
        if T_odom_base is not None:
            self._listen_to(T_odom_base, frame, index)
        if index % self._settings.every:
            return False
        known = self._known_place(keyframes)
        if known is not None:
            self._close(keyframes, known)
        return self._optimise(keyframes)

    def _begin(self, frame: Keyframe) -> None:
        """Place the first keyframe: a new map is level as the autopilot's vertical leans, one that is known already was levelled before."""
        tilt_rad = 1e-3 if frame.everywhere else ANY_TILT_RAD
        start = gtsam.noiseModel.Diagonal.Sigmas(np.array([tilt_rad, tilt_rad, 1e-3, 1e-3, 1e-3, 1e-3]))
        self._factors.add(gtsam.PriorFactorPose3(0, gtsam.Pose3(frame.pose), start))
        self._path_m.append(0.0)

    def _lead_on(self, keyframes: Keyframes, up_m: float) -> None:
        """Add the odometry's way from the keyframe before."""
        settings, index = self._settings, len(keyframes.all) - 1
        before, pose = keyframes.all[index - 1].pose, keyframes.all[index].pose
        step = np.linalg.inv(before) @ pose
        length_m = float(np.linalg.norm(step[:3, 3]))
        shift_m = settings.least_m + settings.drift * length_m
        odometry = gtsam.noiseModel.Diagonal.Sigmas(
            np.array([*[settings.turn_rad] * 3, shift_m, shift_m, min(shift_m, float(np.hypot(settings.up_m, up_m)))])
        )
        self._factors.add(gtsam.BetweenFactorPose3(index - 1, index, gtsam.Pose3(step), odometry))
        self._path_m.append(self._path_m[-1] + length_m)
        self._go_on(pose[:3, 3] - before[:3, 3], odometry)

    def _listen_to(self, T_odom_base: Floats, frame: Keyframe, index: int) -> None:  # noqa: N803
        """Take the autopilot's place, vertical and height."""
        settings, isotropic = self._settings, gtsam.noiseModel.Isotropic.Sigma
        self._factors.add(gtsam.GPSFactor(index, np.asarray(T_odom_base[:3, 3], dtype=np.float64), isotropic(3, settings.autopilot_m)))
        upright = isotropic(2, settings.upright_rad if index else settings.begin_rad)
        self._factors.add(_leaning(index, frame.pose, T_odom_base[2, :3], upright))
        self.barometer.tie(frame.stamp_ns, index, float(frame.pose[2, 3]))

    def _go_on(self, moved_m: Floats, odometry: gtsam.noiseModel.Diagonal) -> None:
        """Carry the covariance on by one keyframe: an error of attitude displaces what lies farther on."""
        carried = np.eye(6)
        carried[3:, :3] = -cross_matrix(moved_m)
        self.covariance = carried @ self.covariance @ carried.T + odometry.covariance()

    def _known_place(self, keyframes: Keyframes) -> int | None:
        """Return the nearest keyframe that lies long enough back; None when there is none."""
        settings, here = self._settings, keyframes.all[-1].pose[:3, 3]
        long_ago = [i for i, path_m in enumerate(self._path_m) if self._path_m[-1] - path_m > settings.path_m]
        if not long_ago:
            return None
        away_m = [float(np.linalg.norm(keyframes.all[i].pose[:3, 3] - here)) for i in long_ago]
        nearest = int(np.argmin(away_m))
        return long_ago[nearest] if away_m[nearest] < settings.reach_m else None

    def _close(self, keyframes: Keyframes, known: int) -> None:
        """Register the last keyframe against what was seen around a known one; a loop that is believed is kept."""
        settings, index = self._settings, len(keyframes.all) - 1
        frame = keyframes.all[index]
        around = slice(max(0, known - settings.submap), known + settings.submap + 1)
        surface = keyframes.surface(frame.pose[:3, 3], 4.0 * settings.reach_m, among=around)
        if surface is None:
            return
        rotation, position = frame.pose[:3, :3], frame.pose[:3, 3]
        place = InertialFilter(_loose(), frame.stamp_ns, InertialState(rotation, np.zeros(3), position))
        place.covariance[POSITION, POSITION] = np.eye(3) * 0.3**2
        points = frame.seen.patches.points
        found = register(points[:: max(1, len(points) // 2000)], surface, place, self._registration)
        if not found.believed or found.fitness < settings.loop_fitness or found.degenerate:
            return
        relative = np.linalg.inv(keyframes.all[known].pose) @ place.state.matrix
        robust = gtsam.noiseModel.Robust.Create(gtsam.noiseModel.mEstimator.Huber.Create(1.0), _noise(settings.loop_rad, settings.loop_m))
        self._factors.add(gtsam.BetweenFactorPose3(known, index, gtsam.Pose3(relative), robust))
        self.loops += 1

    def _optimise(self, keyframes: Keyframes) -> bool:
        """Find the poses that agree best with all; move the keyframes there where that is worth it, and return whether."""
        values = gtsam.Values()
        for i, frame in enumerate(keyframes.all):
            values.insert(i, gtsam.Pose3(frame.pose))
        values.insert(LEAN, self._lean_rad)
        self.barometer.insert_into(values)
        best = gtsam.LevenbergMarquardtOptimizer(self._factors, values).optimize()
        while self.barometer.allow_change(best):
            best = gtsam.LevenbergMarquardtOptimizer(self._factors, best).optimize()
        poses = [best.atPose3(i).matrix() for i in range(len(keyframes.all))]
        self.barometer.take_from(best)
        self._lean_rad = best.atVector(LEAN)
        turn = np.kron(np.eye(2), poses[-1][:3, :3])  # gtsam tells of the body's axes
        self.covariance = turn @ gtsam.Marginals(self._factors, best).marginalCovariance(len(poses) - 1) @ turn.T
        off_m = max(float(np.linalg.norm(pose[:3, 3] - frame.pose[:3, 3])) for pose, frame in zip(poses, keyframes.all, strict=True))
        if off_m < self._settings.moved_m:
            return False
        for pose, frame in zip(poses, keyframes.all, strict=True):
            frame.pose = pose
        return True


def _leaning(index: int, pose: Floats, up: Floats, noise: gtsam.noiseModel.Isotropic) -> gtsam.LinearContainerFactor:
    """Return the factor by which the autopilot's vertical ``up`` (3,), body frame, is that of a keyframe's pose, and the lean.

    A turn d of the pose about the body's axes, and a lean l, both small, take the vertical v to v - (d + l) x v.
    """
    at = gtsam.Values()
    at.insert(index, gtsam.Pose3(pose))
    at.insert(LEAN, np.zeros(3))
    vertical = pose[2, :3]
    turned = cross_matrix(vertical)[:2]
    of_pose = np.hstack([turned, np.zeros((2, 3))])
    linear = gtsam.JacobianFactor(index, of_pose, LEAN, turned, np.asarray(up - vertical, dtype=np.float64)[:2], noise)
    return gtsam.LinearContainerFactor(linear, at)


def _noise(turn_rad: float, shift_m: float) -> gtsam.noiseModel.Diagonal:
    return gtsam.noiseModel.Diagonal.Sigmas(np.repeat([turn_rad, shift_m], 3))


def _loose() -> InertialNoise:
    return InertialNoise(start_attitude_rad=0.05)
